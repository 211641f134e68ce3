"""The way from one pose of an object to another that no set of handles describes.

Each control point turns by the shortest rotation between the two that goes with its neighbours'.
The points follow as in the global step (paper Eq. 3): they minimise, over the links of weights w,
w |p_i - p_j - g_ij|^2, where g_ij is the link in its ends' own frames, from what it is in the one
pose to what it is in the other, turned as these are at that moment. So what turns is carried
around, and does not shrink as it would along straight lines; both poses are met exactly.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.csgraph import breadth_first_order
from scipy.sparse.linalg import splu

from ..base.arrays import F64, I32, Mask
from ..base.rotations import matrix_from_vector, vector_from_matrix
from ..document.pose import Pose
from .deformer import Deformer

STRAIGHT = 20.0  # degrees: where nothing turns by more, a straight way is 1.5 % shorter at most
STILL = 2e-3  # x diameter: by so much may move what is tied to its own straight way by one link
LEAST = 1e-2  # x `STILL`: so that what does not move at all is tied by no more than 1e4 links
RIGID = 1e3  # x the weight of a link inside a rigid body


class PoseInterpolation:
    """Costly to make, cheap to use."""

    def __init__(self, deformer: Deformer, start: Pose, end: Pose) -> None:
        self.start, self.end = start, end
        turns = [a.T @ b for a, b in zip(start.rotations, end.rotations, strict=True)]
        self._own = np.array([vector_from_matrix(turn) for turn in turns])  # (M, 3) own frames
        farthest = float(np.linalg.norm(self._own, axis=1).max(initial=0.0))
        self._is_straight = bool(np.degrees(farthest) <= STRAIGHT)
        if self._is_straight:
            return
        self._vectors = _vectors(deformer.graph.weights, deformer.graph.components, start, end)
        links = deformer.graph.weights.tocoo()
        self._rows, self._columns = (np.asarray(ends, np.int32) for ends in links.coords)
        self._weights = links.data * np.where(self._are_rigid(deformer.rig.bodies), RIGID, 1.0)
        count = len(start.points)
        matrix = csr_array((self._weights, links.coords), shape=(count, count))
        degrees = matrix.sum(1)
        moved = np.linalg.norm(end.points - start.points, axis=1) / deformer.diameter
        ties = (STILL / (moved + LEAST * STILL)) ** 2
        self._ties = ties * np.where(degrees > 0, degrees, 1.0)  # (M,)
        self._factors = splu(csc_array(diags_array(degrees + self._ties) - matrix))

    def _are_rigid(self, bodies: tuple[I32, ...]) -> Mask:
        """(L,) whether both ends of a link are in one body."""
        body = np.full(len(self.start.points), -1)
        for n, group in enumerate(bodies):
            body[group] = n
        return (body[self._rows] == body[self._columns]) & (body[self._rows] >= 0)

    def at(self, share: float) -> Pose:
        """The pose when a `share` of the way is done."""
        start, end = self.start, self.end
        straight = start.points + share * (end.points - start.points)
        if self._is_straight:
            pairs = zip(start.rotations, self._own, strict=True)
            return Pose(straight, np.array([a @ matrix_from_vector(share * v) for a, v in pairs]))
        pairs = zip(start.rotations, self._vectors, strict=True)
        rotations = np.array([matrix_from_vector(share * v) @ a for a, v in pairs])
        links = 0.5 * (
            self._links(rotations, share, self._rows) + self._links(rotations, share, self._columns)
        )
        forces = self._ties[:, None] * straight
        np.add.at(forces, self._rows, self._weights[:, None] * links)
        return Pose(self._factors.solve(forces), rotations)

    def _links(self, rotations: F64, share: float, seen_from: I32) -> F64:
        """(L, 3) from column to row, as one end of each, `seen_from`, has it at that moment."""
        own = []
        for pose in (self.start, self.end):
            link = pose.points[self._rows] - pose.points[self._columns]
            own.append(np.einsum("nji,nj->ni", pose.rotations[seen_from], link))
        between = own[0] + share * (own[1] - own[0])
        return np.einsum("nij,nj->ni", rotations[seen_from], between)


def _vectors(weights: csr_array, components: I32, start: Pose, end: Pose) -> F64:
    """(M, 3) radians, object frame: how each control point is turned from `start` to `end`.

    Of those that do so it is the nearest to that of a neighbour, which is nearer to the one of
    its part that turns least: so two sides of a thing do not part ways at 180 degrees.
    """
    turns = end.rotations @ start.rotations.transpose(0, 2, 1)
    vectors = np.array([vector_from_matrix(turn) for turn in turns])
    angles = np.linalg.norm(vectors, axis=1)
    for part in np.unique(components):
        members = np.flatnonzero(components == part)
        first = members[angles[members].argmin()]
        order, before = breadth_first_order(weights, int(first), directed=False)
        for k in order[1:]:
            vectors[k] = vector_from_matrix(turns[k], vectors[before[k]])
    return vectors
