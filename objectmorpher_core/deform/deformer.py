"""Handles in, pose out: what is fixed, in which steps it is reached, and how each part follows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from ..arrays import F64, I32
from ..document import DeformSettings, Handle, LiftedObject, Pose
from .arap import ArapSolver, Constraints, Minimum, minimise
from .graph import Graph, build_graph
from .skinning import Skinned, bind, faithful_linear, skin

FAITHFUL_ITERATIONS = 3  # paper 3.2.2
ITERATIONS = 200  # at most; the solve ends earlier when nothing moves
STEP_ITERATIONS = 4  # in the sub-steps of a large move
LARGE_MOVE = 0.1  # x diameter: a handle's move beyond this is made in sub-steps
GRIP = 20.0  # x a link's weight, in the hand of a handle
LEAST_GRIP = 1e-3  # at less a point is not in the patch
GRIP_RADIUS = 0.06  # x diameter, of the patch that a handle takes hold of
GRIP_APART = 0.4  # x distance to the next handle, no patch is larger
ANCHORED_SHARE = 0.25  # of the control points, the farthest along the surface


@dataclass(frozen=True, eq=False)
class Solution:
    """A pose and what it cost."""

    pose: Pose
    energies: tuple[float, ...]  # paper Eq. 2 after each iteration of the last sub-step


class Deformer:
    """Deforms one lifted object. The constructor builds its graph and binds its Gaussians."""

    def __init__(self, lifted: LiftedObject, settings: DeformSettings) -> None:
        if settings.mode not in ("arap", "laplacian"):
            raise ValueError(f"deform must be arap or laplacian, not {settings.mode!r}")
        self.lifted = lifted
        self.settings = settings
        self.points = lifted.control_points.astype(np.float64)
        self.diameter = lifted.diameter
        self.graph: Graph = build_graph(
            self.points, settings.links, settings.is_faithful, _normals_at(lifted, self.points)
        )
        self.binding = bind(lifted.gaussians.means, self.points, self.graph)
        self._solver = ArapSolver(self.points, self.graph.weights)
        self._constrained: tuple[object, ...] = ()  # what the solver is factored for
        self._is_free = np.ones(len(self.points), bool)

    def rest(self) -> Pose:
        """The pose of the photo."""
        return Pose(self.points, np.broadcast_to(np.eye(3), (len(self.points), 3, 3)))

    def nearest_control_point(self, point: np.ndarray) -> int:
        """Index of the control point nearest to a rest surface point (3,), object frame."""
        return int(((self.points - point) ** 2).sum(1).argmin())

    def anchors(self, handles: tuple[Handle, ...], is_automatic: bool = True) -> I32:
        """Control points that stay where they are although nobody pinned them.

        One handle alone is only a translation for ARAP, so the quarter of its part that is
        farthest along the surface is held; with a second handle or a pin the artist has said
        what holds.
        """
        if len(handles) != 1 or handles[0].is_pin or not is_automatic:
            return np.empty(0, np.int32)
        h = handles[0].control_point
        distances = self.graph.geodesics[h]
        own = np.flatnonzero(self.graph.components == self.graph.components[h])
        count = max(1, round(ANCHORED_SHARE * len(own)))
        farthest = own[np.argsort(-distances[own], kind="stable")[:count]]
        return np.sort(farthest[farthest != h]).astype(np.int32)

    def solve(
        self,
        handles: tuple[Handle, ...],
        has_auto_anchors: bool = True,
        start: Pose | None = None,
        seconds: float = np.inf,
    ) -> Solution:
        """The pose in which every handle is at its target.

        With `start` the solve continues from there (a drag), for about so many `seconds`; without,
        large moves are made in sub-steps from rest, so the result is a function of the handles
        alone.
        """
        if not handles:
            return Solution(self.rest(), (0.0,))
        anchors = self.anchors(handles, has_auto_anchors)
        self._constrain(handles, anchors)
        rotations = (start or self.rest()).rotations
        if self.settings.mode == "laplacian":
            minimum = self._laplacian()
        elif self.settings.is_faithful:
            minimum = minimise(self._solver, rotations, FAITHFUL_ITERATIONS, tolerance=0.0)
        else:
            if start is None:
                rotations = self._approach(handles, rotations)
            minimum = minimise(self._solver, rotations, ITERATIONS, seconds=seconds)
        positions, rotations = self._follow(minimum.positions, minimum.rotations)
        return Solution(Pose(positions, rotations), minimum.energies)

    def prepare(self, handles: tuple[Handle, ...], has_auto_anchors: bool = True) -> None:
        """Does now what the first solve with these handles would do: their factorisation."""
        if handles:
            self._constrain(handles, self.anchors(handles, has_auto_anchors))

    def skin_points(self, points: np.ndarray, pose: Pose) -> Skinned:
        """Rest surface points (N, 3) under `pose`, with the motion's Jacobian."""
        binding = bind(points, self.points, self.graph)
        return skin(points, binding, self.points, pose.points, pose.rotations)

    def skin_gaussians(self, pose: Pose) -> Skinned:
        """The object's Gaussians under `pose`."""
        means = self.lifted.gaussians.means
        skinned = skin(means, self.binding, self.points, pose.points, pose.rotations)
        if not self.settings.is_faithful:
            return skinned
        linear = faithful_linear(self.binding, self.points, pose.points, pose.rotations, self.graph)
        return Skinned(skinned.points, linear)

    def _constrain(self, handles: tuple[Handle, ...], anchors: I32) -> None:
        """Aims the solver at the handles; it is factored again only when their set changed."""
        points = np.array([h.point for h in handles])
        nodes = np.array([h.control_point for h in handles])
        fixed = self._fixed(handles)
        key = (points.tobytes(), nodes.tobytes(), anchors.tobytes())
        if key == self._constrained:
            self._solver.aim(fixed)
            return
        rows, offsets = self._rows(points, nodes)
        anchors = anchors[~rows[:, anchors].any(0)]
        held = np.concatenate([np.flatnonzero(rows.any(0)), anchors])
        touched = np.unique(self.graph.components[held])
        self._is_free = np.isin(self.graph.components, touched)
        if not self.settings.is_faithful:
            self._solver = self._solver.reweighted(self._stiffened(handles))
        self._solver.constrain(Constraints(rows, fixed, offsets), self._is_free, anchors)
        self._constrained = key

    def _fixed(self, handles: tuple[Handle, ...], share: float = 1.0) -> F64:
        """Where the rows must be (H, 3) when the handles have gone a `share` of their way."""
        points = np.array([h.point for h in handles])
        moves = np.array([h.target for h in handles]) - points
        if self.settings.is_faithful:  # the paper constrains the control point itself
            points = self.points[[h.control_point for h in handles]]
        return points + share * moves

    def _rows(self, points: F64, nodes: np.ndarray) -> tuple[F64, F64]:
        """Each handle's row (H, M) and offsets (H, M, 3), see `Constraints`."""
        rows = np.zeros((len(points), len(self.points)))
        offsets = np.zeros((*rows.shape, 3))
        if self.settings.is_faithful:
            rows[np.arange(len(points)), nodes] = 1.0
            return rows, offsets
        binding = bind(points, self.points, self.graph)
        for i, own in enumerate(binding.control_points):
            rows[i, own] = binding.weights[i]
            offsets[i, own] = points[i] - self.points[own]
        return rows, offsets

    def _stiffened(self, handles: tuple[Handle, ...]) -> F64:
        """(M, M) the graph's weights, larger around each handle.

        A load on one point of an elastic sheet makes a spike, however fine the sheet is. A hand
        takes hold of a patch: links inside it weigh up to `GRIP` times more, so the patch moves
        nearly as one body and the strain is spread over what is around it. No patch reaches
        another handle.
        """
        held = np.array([h.point for h in handles])
        apart = np.linalg.norm(held[:, None] - held[None], axis=2)
        apart[apart <= 1e-6 * self.diameter] = np.inf
        radii = np.minimum(GRIP_RADIUS * self.diameter, GRIP_APART * apart.min(1))
        distances = np.linalg.norm(self.points[:, None] - held[None], axis=2)
        grip = np.exp(-((distances / radii) ** 2))  # (M, H)
        factor = np.ones_like(self.graph.weights)
        for column in grip.T:
            near = np.flatnonzero(column > LEAST_GRIP)
            patch = np.ix_(near, near)
            own = 1 + (GRIP - 1) * np.outer(column[near], column[near])
            factor[patch] = np.maximum(factor[patch], own)
        return self.graph.weights * factor

    def _approach(self, handles: tuple[Handle, ...], rotations: F64) -> F64:
        """Walks the targets from rest to where they belong; returns the rotations there.

        From a cold start a large turn ends in a false minimum; in steps of a tenth of the
        diameter each solve begins near its own.
        """
        moves = np.array([h.target - h.point for h in handles])
        farthest = float(np.linalg.norm(moves, axis=1).max())
        steps = int(np.clip(np.ceil(farthest / (LARGE_MOVE * self.diameter)), 1, 20))
        for step in range(1, steps):
            self._solver.aim(self._fixed(handles, step / steps))
            rotations = minimise(self._solver, rotations, STEP_ITERATIONS).rotations
        self._solver.aim(self._fixed(handles))
        return rotations

    def _laplacian(self) -> Minimum:
        """The ablation: Eq. 2 with R_i = identity."""
        rotations = self.rest().rotations
        positions = self._solver.positions(rotations)
        return Minimum(positions, rotations, (self._solver.energy(positions, rotations),))

    def _follow(self, positions: F64, rotations: F64) -> tuple[F64, F64]:
        """Parts without a handle move rigidly with the nearest part that has one."""
        is_free = self._is_free
        if is_free.all():
            return positions, rotations
        positions, rotations = positions.copy(), rotations.copy()
        leaders = np.flatnonzero(is_free)
        for component in np.unique(self.graph.components[~is_free]):
            own = np.flatnonzero(self.graph.components == component)
            gaps = ((self.points[own, None] - self.points[None, leaders]) ** 2).sum(-1)
            leader = leaders[np.unravel_index(gaps.argmin(), gaps.shape)[1]]
            r = rotations[leader]
            positions[own] = positions[leader] + (self.points[own] - self.points[leader]) @ r.T
            rotations[own] = r
        return positions, rotations


def _normals_at(lifted: LiftedObject, points: F64) -> F64:
    """Outward normals (M, 3) of the surface at control points (M, 3), object frame."""
    body = np.flatnonzero(lifted.texture.solidity > 0.5)
    if len(body) == 0:
        body = np.arange(len(lifted.gaussians))
    nearest = body[KDTree(lifted.gaussians.means[body]).query(points)[1]]
    return lifted.gaussians.normals[nearest].astype(np.float64)
