"""The constraints of a set of handles: which rows they are, and their targets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arrays import F64, I32, Sparse, frozen, frozen_rows
from ..base.kernel_files import numba
from ..base.rotations import matrix_from_vector
from ..document.model import Handle, Pose
from ..document.rig import Rig
from .binding import Binding
from .constraints import Constraints, Targets
from .surface_links import SolidSurface, thickness


@dataclass(frozen=True, eq=False)
class Grasp:
    """The grip of a set of handles."""

    binding: Binding  # of the handles' points
    around: tuple[I32, ...]  # control points that turn with each, if it is turned
    is_on_nodes: bool = False  # the paper: the nearest control points themselves are held


@dataclass(frozen=True, eq=False)
class Frozen:
    """Control points that stay, whatever the handles want."""

    nodes: I32  # (P,) sorted
    shifts: F64  # (P, 3) from where they are at rest

    @classmethod
    def of(cls, rig: Rig) -> Frozen:
        nodes = np.empty(0, np.int32) if rig.held is None else rig.held
        return cls(nodes, np.zeros((len(nodes), 3)) if rig.shifts is None else rig.shifts)


@dataclass(frozen=True, eq=False)
class Start:
    """The start of a set of handles, and the parts that stay there."""

    pose: Pose | None  # None: the object at rest
    handles: tuple[Handle, ...]  # the same ones, as they are in that pose
    anchors: I32  # control points
    frozen: Frozen


@dataclass(frozen=True, eq=False)
class HandleRows:
    """The rows of a set of handles. They depend on where the handles begin only."""

    constraints: Constraints
    owners: I32  # (H,) the handle of each row
    places: F64  # (H, 3) the row's surface point from its handle's, at the start
    turners: I32  # (T,) the handle of each turned control point
    held: F64  # (P, 3) held control points, at the start
    shifts: F64  # (P, 3) how far from there they are held
    turns: F64  # (handles, 3, 3) of the handles at the start
    turned: F64  # (T, 3, 3) rotations of the turned control points at the start

    @classmethod
    def of(cls, handles: tuple[Handle, ...], grasp: Grasp, points: F64, start: Start) -> HandleRows:
        """`points` (M, 3) control points at rest; anchors stay, if no handle is on them.

        A handle is the surface point that the artist clicked. One that is turned too takes the
        control points around it along as one rigid body, all that are not frozen: a row each.
        """
        frozen = start.frozen
        owners, nodes, weights, turned = [], [], [], []
        binding = grasp.binding
        width = binding.control_points.shape[1]
        for h, handle in enumerate(handles):
            shares = binding.weights[h]
            own = np.where(shares > 0, binding.control_points[h], binding.control_points[h, 0])
            if handle.turn is None:
                nodes.append(own)
                weights.append(shares)
                owners.append(h)
                continue
            for node in np.setdiff1d(np.union1d(own, grasp.around[h]), frozen.nodes):
                nodes.append(np.full(width, node))
                weights.append(np.eye(1, width)[0])
                owners.append(h)
                turned.append((node, h))
        index, owner = np.array(nodes, np.int32).reshape(-1, width), np.array(owners, np.int32)
        clicked = np.array([h.point for h in handles]).reshape(-1, 3)
        is_node = [grasp.is_on_nodes or handles[h].turn is not None for h in owners]
        is_node = np.array(is_node, bool)
        surface = np.where(is_node[:, None], points[index[:, 0]], clicked[owner])
        constraints = Constraints(
            index, np.array(weights).reshape(-1, width), surface[:, None] - points[index],
            np.array([handles[h].softness for h in owners]),
            np.concatenate([np.setdiff1d(start.anchors, index), frozen.nodes]).astype(np.int32),
            np.array([node for node, _ in turned], np.int32),
        )  # fmt: skip
        turners = np.array([h for _, h in turned], np.int32)
        shifts = np.zeros((len(constraints.held), 3))
        shifts[len(shifts) - len(frozen.nodes) :] = frozen.shifts
        held, begun = points[constraints.held], clicked
        rotations = np.broadcast_to(np.eye(3), (len(turned), 3, 3))
        if start.pose is not None:
            surface = constraints.placed(start.pose.points, start.pose.rotations)
            held, shifts = start.pose.points[constraints.held], np.zeros(shifts.shape)
            rotations = start.pose.rotations[constraints.turned]
            begun = np.array([h.target for h in start.handles]).reshape(-1, 3)
        return cls(
            constraints, owner, surface - begun[owner], turners, held, shifts,
            _turns(start.handles), rotations,
        )  # fmt: skip

    def targets(self, handles: tuple[Handle, ...], share: float = 1.0) -> Targets:
        """Return the targets of handles that begin where these do.

        What is frozen has gone a `share` of its way.
        """
        goals, held = np.array([h.target for h in handles]), self.held + share * self.shifts
        goals = goals.reshape(-1, 3)
        if len(self.turners) == 0:
            return Targets(goals[self.owners] + self.places, held, np.empty((0, 3, 3)))
        turns = _turns(handles) @ self.turns.transpose(0, 2, 1)  # since the start
        turned = (turns[self.owners] @ self.places[..., None])[..., 0]
        return Targets(goals[self.owners] + turned, held, turns[self.turners] @ self.turned)


def _turns(handles: tuple[Handle, ...]) -> F64:
    """(handles, 3, 3) how each is turned; one that turns as it comes is not."""
    turns = [np.eye(3) if h.turn is None else matrix_from_vector(h.turn) for h in handles]
    return np.array(turns).reshape(-1, 3, 3)


# The hand of a handle: links around it are stiffer.

GRIP = 20.0  # x a link's weight, in the middle of the hand
SMALLEST, LARGEST = 0.1, 0.15  # x diameter: a hand's radius, between them as thick as the body is
DEEPEST = 0.6  # x diameter, that a hand reaches through
SHARED = 0.5  # x distance to the next handle: over this much two hands let go towards the middle


def other_sides(handles: F64, surface: SolidSurface, spacing: float, diameter: float) -> F64:
    """(H, 3) where the body ends behind surface points (H, 3); themselves where none is met.

    `spacing` is the control points' mean one; all in the object frame.
    """
    if len(surface.means) == 0:
        return handles
    normals = surface.normals_near(handles)[:, 0]
    depths = thickness(handles, normals, spacing, DEEPEST * diameter, surface)
    return handles - depths[:, None] * normals


def stiffened(points: F64, weights: Sparse, handles: F64, ends: F64, diameter: float) -> F64:
    """Weights (E,) of the links, up to `GRIP` times larger around `handles` (H, 3).

    A hand is what is near the way from its handle to `ends` (H, 3), the other side of the body,
    but for the last bit, which the smallest hand covers. `points` (M, 3) control points;
    `weights` (M, M) symmetric, and so is the result.
    """
    depths = np.linalg.norm(ends - handles, axis=1)
    radii = np.clip(depths, SMALLEST * diameter, LARGEST * diameter)
    shares = 1.0 - np.minimum(SMALLEST * diameter / np.maximum(depths, 1e-300), 1.0)
    distances = _from_segments(points, handles, handles + shares[:, None] * (ends - handles))
    grip = np.maximum(1.0 - (distances / radii[:, None]) ** 2, 0.0) ** 2
    apart = np.linalg.norm(handles[:, None] - handles[None], axis=2)
    meeting = (apart > 1e-6 * diameter) & (apart < radii[:, None] + radii[None])
    for h, other in np.argwhere(meeting):
        nearer = (distances[other] - distances[h]) / (SHARED * apart[h, other])
        grip[h] *= np.clip(nearer, 0.0, 1.0)
    data = weights.data.copy()
    _stiffen(*frozen_rows(weights), frozen(grip), data)
    return data


def _from_segments(points: F64, starts: F64, ends: F64) -> F64:
    """Distances (H, M) of `points` (M, 3) from segments (H, 3) to (H, 3)."""
    ways = ends - starts
    squares = np.maximum((ways * ways).sum(1), 1e-300)
    gaps = points[None] - starts[:, None]  # (H, M, 3)
    shares = np.einsum("hma,ha->hm", gaps, ways) / squares[:, None]
    gaps -= shares.clip(0.0, 1.0)[..., None] * ways[:, None]
    return np.linalg.norm(gaps, axis=2)


@numba.njit(cache=True)
def _stiffen(starts, ends, weights, grip, data):
    for h in range(len(grip)):
        for i in range(len(starts) - 1):
            own = grip[h, i]
            if own == 0.0:
                continue
            for e in range(starts[i], starts[i + 1]):
                data[e] = max(data[e], weights[e] * (1.0 + (GRIP - 1.0) * own * grip[h, ends[e]]))
