"""Handles in, pose out: what is fixed, in which steps it is reached, and how each part follows."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import wraps
from threading import RLock
from typing import Any, TypeVar, cast

import numpy as np
from scipy.sparse import csr_array

from ..base.arrays import F64, I32, Sparse, frozen, frozen_rows
from ..base.kernel_files import numba
from ..base.rotations import matrix_from_vector
from ..base.threads import FAST
from ..document.model import LiftedObject
from ..document.pose import UNHELD, Base, Handle, Pose, turn_at
from ..document.rig import Rig
from ..document.settings import DeformSettings
from .anderson import Anderson
from .arap import TOLERANCE, ArapSolver, Minimum, iterate, minimise
from .binding import Binding, bind
from .graph import ControlGraph, build_graph
from .hold import Frozen, Grasp, HandleRows, Start, other_sides, stiffened
from .skinning import Motion, Skin, Skinned, skin, skin_faithful
from .surface_links import SolidSurface

FAITHFUL_ITERATIONS = 3  # paper 3.2.2
ITERATIONS = 400  # at most; the solve ends earlier when nothing moves
STEP_ITERATIONS = 4  # in the sub-steps of a large move
LARGE_MOVE = 0.1  # x diameter: a handle's move beyond this is made in sub-steps
LARGE_TURN = 0.3  # rad: likewise for a turn
MOST_STEPS = 30
LIMIT_STEPS = 7  # halvings of the way to the stretch limit: to 1 % of it
TURNED_RADIUS = 0.1  # x diameter along the surface: what turns with a turned handle
TURNED_APART = 0.3  # x distance to the next handle, likewise
SAME = 1e-9  # x diameter, and rad: handles that are moved as one body
LINE = 1e-6  # x the handles' spread along it: what they spread beside a line
USUAL = Base()  # from rest, with anchors of their own
ANCHORED_SHARE = 0.25  # of the control points, the farthest along the surface


Method = TypeVar("Method", bound=Callable[..., Any])


def _alone(method: Method) -> Method:
    """Lets one thread at a time use the solver: a drag's may be prepared in another one."""

    @wraps(method)
    def wrapped(self: Deformer, *arguments: Any, **keywords: Any) -> Any:
        with self._lock:
            return method(self, *arguments, **keywords)

    return cast(Method, wrapped)


@dataclass(frozen=True, eq=False)
class Solution:
    """A pose and what it cost."""

    pose: Pose
    energies: tuple[float, ...]  # paper Eq. 2 after each iteration of the last sub-step
    share: float = 1.0  # of the handles' ways that was gone; less where a limit stopped them


class Deformer:
    """Deforms one lifted object. The constructor builds its graph and binds its Gaussians."""

    def __init__(
        self, lifted: LiftedObject, settings: DeformSettings, rig: Rig | None = None
    ) -> None:
        if settings.mode not in ("arap", "laplacian"):
            raise ValueError(f"deform must be arap or laplacian, not {settings.mode!r}")
        self.lifted = lifted
        self.settings = settings
        self.rig = rig or Rig()
        self.points = lifted.control_points.astype(np.float64)
        self.diameter = lifted.diameter
        self._solid = SolidSurface(lifted.body.means, lifted.body.normals)
        self.graph: ControlGraph = build_graph(self.points, settings, self._solid, self.rig.seams)
        self._means = frozen(lifted.gaussians.means, np.float64)
        self.binding = bind(self._means, self.points, self.graph, lifted.gaussians.normals)
        self._last_anchors: tuple[int, I32] | None = None  # those of a single handle
        self._last_chosen: tuple[I32, F64, Binding] | None = None
        self._prepare_solver()

    def with_rig(self, rig: Rig) -> Deformer:
        """Return the same object with another rig. Only other seams need a new graph."""
        if rig.seams != self.rig.seams:
            return Deformer(self.lifted, self.settings, rig)
        other = copy.copy(self)
        other.rig = rig
        other._prepare_solver()
        return other

    def _prepare_solver(self) -> None:
        self._frozen = Frozen.of(self.rig)
        weights = _weighed(self.graph.weights, self.rig.stiffness)
        self._solver = ArapSolver(self.points, weights, self.rig.bodies)
        self._lock = RLock()  # see `_alone`
        self._constrained: tuple[object, ...] = ()  # what the solver is prepared for
        self._history = Anderson(self.points.size)  # what a drag's frames have learnt of it

    def rest(self) -> Pose:
        """The pose of the photo."""
        return Pose(self.points, np.broadcast_to(np.eye(3), (len(self.points), 3, 3)))

    def nearest_control_point(self, point: np.ndarray) -> int:
        """Index of the control point nearest to a rest surface point (3,), object frame."""
        return int(((self.points - point) ** 2).sum(1).argmin())

    def anchors(self, handles: tuple[Handle, ...], base: Base = USUAL) -> I32:
        """Control points that stay where they are although nobody pinned them.

        One handle alone is only a translation for ARAP, so the quarter of its part that is
        farthest along the surface is held; with a second handle, a pin or frozen control points
        the artist has said what holds. Unless the base says it.
        """
        if base.anchors is not None:
            return base.anchors
        if len(handles) != 1 or handles[0].is_pin or self.rig.held is not None:
            return np.empty(0, np.int32)
        return self.farthest_from(handles[0].control_point)

    def farthest_from(self, h: int) -> I32:
        """The quarter of its part that is farthest from a control point along the surface."""
        if self._last_anchors is None or self._last_anchors[0] != h:
            self._last_anchors = (h, self._find_farthest(h))
        return self._last_anchors[1]

    def _find_farthest(self, h: int) -> I32:
        distances = self.graph.distances_from(h)
        own = np.flatnonzero(np.isfinite(distances))
        count = max(1, round(ANCHORED_SHARE * len(own)))
        farthest = own[np.argsort(-distances[own], kind="stable")[:count]]
        return frozen(np.sort(farthest[farthest != h]), np.int32)

    @_alone
    def solve(
        self,
        handles: tuple[Handle, ...],
        base: Base = USUAL,
        start: Pose | None = None,
        seconds: float = np.inf,
        tolerance: float = TOLERANCE,
    ) -> Solution:
        """The pose in which every handle is at its target, but for those on frozen control points.

        With `start` the solve continues from there (a drag), for about so many `seconds` or until
        `tolerance` is met, see `minimise`; without, large moves are made in sub-steps from the
        base, so the result is a function of the handles and their base alone. Raises ValueError
        for handles that are not finite.
        """
        numbers = [v for h in handles for v in (h.point, h.target, h.turn) if v is not None]
        if not np.isfinite(np.concatenate([*numbers, np.zeros(1)])).all():
            raise ValueError("a handle's point, target or turn is not finite")
        handles = self._effective(handles)
        if not handles and (self._pose_of(base) is not None or not self._frozen.shifts.any()):
            return Solution(self._pose_of(base) or self.rest(), (0.0,))
        if base.is_usual and (rigid := self._rigid(handles)) is not None:
            return Solution(rigid, (0.0,))
        solution = self._solved(handles, base, start, seconds, tolerance)
        if self.settings.stretch_limit is None or self._is_allowed(solution.pose):
            return solution
        return self._limited(handles, base, seconds)

    def held(
        self, handles: tuple[Handle, ...], pose: Pose | None, anchors: I32
    ) -> tuple[tuple[Handle, ...], Base]:
        """The handles with their points where `pose` has them, and the base that it is then.

        What they move the object from is that pose, whatever it is; the anchors stay as in it.
        """
        if pose is not None and handles:
            places = self.skin_points(np.array([h.point for h in handles]), pose).points
            handles = tuple(
                replace(h, target=place) for h, place in zip(handles, places, strict=True)
            )
        return handles, Base(pose, handles, anchors)

    def _pose_of(self, base: Base) -> Pose | None:
        """What handles begin from. The ablations know only the rest."""
        is_usual = self.settings.mode == "arap" and not self.settings.is_faithful
        return base.pose if is_usual else None

    def _start(self, handles: tuple[Handle, ...], base: Base) -> Start:
        """Where the handles, in their order, begin."""
        pose = self._pose_of(base)
        known = {h.control_point: h for h in base.handles}
        begun = []
        for h in handles:
            start = known.get(h.control_point)
            if pose is None or start is None:
                begun.append(_on_the_way(h, 0.0))
                continue
            turn = turn_at(pose, h.control_point) if start.turn is None else start.turn
            begun.append(replace(start, turn=None if h.turn is None else turn))
        return Start(pose, tuple(begun), self.anchors(handles, base), self._frozen)

    def _effective(self, handles: tuple[Handle, ...]) -> tuple[Handle, ...]:
        """Those that move anything: what is frozen stays, and they with it.

        The paper's pins hold a place, not a turn.
        """
        free = (h for h in handles if not self.rig.is_held(h.control_point))
        if self.settings.is_faithful:
            return tuple(replace(h, turn=None) if h.is_pin else h for h in free)
        return tuple(free)

    def _rigid(self, handles: tuple[Handle, ...]) -> Pose | None:
        """The pose of handles that are all moved as one body: that motion, with no energy."""
        is_usual = self.settings.mode == "arap" and not self.settings.is_faithful
        if len(handles) < 3 or not is_usual or self.rig.held is not None:
            return None
        rest, goal = (np.array([getattr(h, name) for h in handles]) for name in ("point", "target"))
        centre, to = rest.mean(0), goal.mean(0)
        u, spread, vt = np.linalg.svd((goal - to).T @ (rest - centre))
        if spread[1] <= LINE * spread[0]:  # all in a line: turned about it by any angle
            return None
        r = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
        gaps = [np.abs((rest - centre) @ r.T + to - goal).max() / self.diameter]
        gaps += [
            np.abs(matrix_from_vector(h.turn) - r).max() for h in handles if h.turn is not None
        ]
        if max(gaps) > SAME:
            return None
        turned = np.broadcast_to(r, (len(self.points), 3, 3))
        return Pose((self.points - centre) @ r.T + to, turned)

    def _limited(self, handles: tuple[Handle, ...], base: Base, seconds: float) -> Solution:
        """The farthest that all handles together can go before the stretch limit, by halving."""
        starts, low, high = self._start(handles, base).handles, 0.0, 1.0
        best = Solution(self._pose_of(base) or self.rest(), (0.0,), 0.0)
        if self._pose_of(base) is None and self._frozen.shifts.any():
            # They stay: the handles' ways begin where those hold them.
            best = replace(self._solved((), UNHELD, None, seconds / LIMIT_STEPS), share=0.0)
            starts = tuple(
                replace(h, target=self.skin_points(h.point, best.pose).points[0]) for h in starts
            )
        for _ in range(LIMIT_STEPS):
            share = 0.5 * (low + high)
            partly = tuple(
                _on_the_way(h, share, start) for h, start in zip(handles, starts, strict=True)
            )
            solution = self._solved(partly, base, best.pose, seconds / LIMIT_STEPS)
            if self._is_allowed(solution.pose):
                best, low = replace(solution, share=share), share
            else:
                high = share
        return best

    def _is_allowed(self, pose: Pose) -> bool:
        limit = self.settings.stretch_limit
        return limit is None or float(self.strain(pose).most.max()) <= limit

    def _solved(
        self,
        handles: tuple[Handle, ...],
        base: Base,
        start: Pose | None,
        seconds: float,
        tolerance: float = TOLERANCE,
    ) -> Solution:
        begun = self._constrain(handles, base)
        rotations = (start or begun.pose or self.rest()).rotations
        if self.settings.mode == "laplacian":
            minimum = self._laplacian()
        elif self.settings.is_faithful:
            minimum = iterate(self._solver, rotations, FAITHFUL_ITERATIONS)
        else:
            if start is None:
                rotations = self._approach(handles, begun, rotations)
            is_hurried = start is not None and np.isfinite(seconds)
            history = self._history if is_hurried else None
            minimum = minimise(
                self._solver, rotations, ITERATIONS, tolerance, seconds, history
            )  # fmt: skip
        positions, rotations = self._follow(
            minimum.positions, minimum.rotations, begun.pose or self.rest()
        )
        return Solution(Pose(positions, rotations), minimum.energies)

    @_alone
    def prepare(self, handles: tuple[Handle, ...], base: Base = USUAL) -> None:
        """Does now what the first solve with these handles would do: their factorisation."""
        if handles := self._effective(handles):
            self._constrain(handles, base)

    def skin_points(
        self, points: np.ndarray, pose: Pose, normals: np.ndarray | None = None
    ) -> Skinned:
        """Skin rest surface points (N, 3) by `pose`, and return the motion's Jacobian too.

        `normals` (N, 3), where they are known, tell the sides of a contact apart.
        """
        return self._skin(points, bind(points, self.points, self.graph, normals), pose)

    def skin_gaussians(self, pose: Pose) -> Skinned:
        """The object's Gaussians under `pose`."""
        return self._skin(self._means, self.binding, pose)

    def gaussians_motion(self, pose: Pose, chosen: I32 | None = None) -> Skin | Skinned:
        """Skin the Gaussians, or leave it to a renderer that projects only those within reach.

        `chosen` (n,): of these Gaussians only.
        """
        means, binding = self._means, self.binding
        if chosen is not None:
            means, binding = self._chosen(chosen)
        if self.settings.is_faithful:
            return self._skin(means, binding, pose)
        return Skin(means, binding, Motion(self.points, pose.points, pose.rotations))

    def _chosen(self, chosen: I32) -> tuple[F64, Binding]:
        """Means and binding of these Gaussians; the last ones asked for are kept."""
        if self._last_chosen is None or self._last_chosen[0] is not chosen:
            means, binding = frozen(self._means[chosen]), self.binding.select(chosen)
            self._last_chosen = (chosen, means, binding)
        return self._last_chosen[1:]

    def _skin(self, points: np.ndarray, binding: Binding, pose: Pose) -> Skinned:
        motion = Motion(self.points, pose.points, pose.rotations)
        if self.settings.is_faithful:
            return skin_faithful(points, binding, motion, self.graph)
        return skin(points, binding, motion)

    def strain(self, pose: Pose) -> Strain:
        """Return how much `pose` bends and stretches the object at each control point."""
        return measure_strain(self.points, self._solver.weights, pose)

    @_alone
    def influence(self, handles: tuple[Handle, ...], h: int, base: Base, pose: Pose | None) -> F64:
        """(M,) how much each control point goes along with handle `h`: 1 = as far as it does.

        For a small move from `pose`. With the rotations as they are, all follow linearly, and by
        the same share in every direction.
        """
        if self.rig.is_held(handles[h].control_point):
            return np.zeros(len(self.points))
        handles, h = self._effective(handles), len(self._effective(handles[:h]))
        self._constrain(handles, base)
        rotations = (pose or self.rest()).rotations
        step = np.array([self.diameter, 0.0, 0.0])
        there = replace(handles[h], target=handles[h].target + step)
        before = self._solver.positions(rotations)
        self._solver.aim(self._hold.targets((*handles[:h], there, *handles[h + 1 :])))
        after = self._solver.positions(rotations)
        self._solver.aim(self._hold.targets(handles))
        return np.linalg.norm(after - before, axis=1) / self.diameter

    def _constrain(self, handles: tuple[Handle, ...], base: Base) -> Start:
        """Aims the solver at the handles; it is prepared anew only when their set changed.

        Returns where they begin.
        """
        start = self._start(handles, base)
        key = (
            start.pose,
            start.anchors.tobytes(),
            *((h.point.tobytes(), h.control_point, h.softness, h.turn is None) for h in handles),
        )
        if key != self._constrained:
            points, hands = np.array([h.point for h in handles]).reshape(-1, 3), None
            if len(handles) and not self.settings.is_faithful:
                ends = other_sides(points, self._solid, self.graph.mean_spacing, self.diameter)
                hands = stiffened(self.points, self._solver.weights, points, ends, self.diameter)
            grasp = self._grasp(handles, points)
            self._hold = HandleRows.of(handles, grasp, self.points, start)
            self._solver.constrain(self._hold.constraints, hands)
            if start.pose is not None:
                self._solver.aim(self._hold.targets(start.handles))
                self._solver.rest_in(start.pose.points, start.pose.rotations)
            self._constrained, self._history = key, Anderson(self.points.size)
        self._solver.aim(self._hold.targets(handles))
        return start

    def _grasp(self, handles: tuple[Handle, ...], points: F64) -> Grasp:
        """The surface point itself, and what turns with it; in the paper its control point."""
        if self.settings.is_faithful:
            nodes = np.array([h.control_point for h in handles], np.int32).reshape(-1, 1)
            binding = Binding(nodes, np.ones(nodes.shape), np.zeros((*nodes.shape, 3)))
            return Grasp(binding, tuple(nodes), is_on_nodes=True)
        around = []
        for h in handles:
            if h.turn is None:
                around.append(np.empty(0, np.int32))
                continue
            distances = self.graph.distances_from(h.control_point)
            others = [distances[o.control_point] for o in handles if o is not h]
            reach = min([TURNED_RADIUS * self.diameter, *(TURNED_APART * d for d in others)])
            around.append(np.flatnonzero(distances <= reach).astype(np.int32))
        return Grasp(bind(points, self.points, self.graph), tuple(around))

    def _approach(self, handles: tuple[Handle, ...], begun: Start, rotations: F64) -> F64:
        """Walks targets and frozen points from where they begin; returns the rotations there.

        From a cold start a large turn ends in a false minimum; in steps of a tenth of the
        diameter each solve begins near its own.
        """
        pairs = list(zip(handles, begun.handles, strict=True))
        shifts = self._frozen.shifts if begun.pose is None else np.zeros((1, 3))
        moves = np.array([*(h.target - s.target for h, s in pairs), *shifts]).reshape(-1, 3)
        turns = [h.turned - s.turned for h, s in pairs]
        turns = np.array([np.zeros(3), *turns])
        farthest = np.linalg.norm(moves, axis=1).max() / (LARGE_MOVE * self.diameter)
        largest = np.linalg.norm(turns, axis=1).max() / LARGE_TURN
        steps = int(np.clip(np.ceil(max(farthest, largest)), 1, MOST_STEPS))
        for step in range(1, steps):
            partly = tuple(_on_the_way(h, step / steps, s) for h, s in pairs)
            self._solver.aim(self._hold.targets(partly, step / steps))
            rotations = minimise(self._solver, rotations, STEP_ITERATIONS).rotations
        self._solver.aim(self._hold.targets(handles))
        return rotations

    def _laplacian(self) -> Minimum:
        """The ablation: Eq. 2 with R_i = identity."""
        rotations = self.rest().rotations
        positions = self._solver.positions(rotations)
        return Minimum(positions, rotations, (self._solver.energy(positions, rotations),))

    def _follow(self, positions: F64, rotations: F64, begun: Pose) -> tuple[F64, F64]:
        """Parts without a handle move rigidly from `begun` with the nearest part that has one."""
        is_free, components = self._solver.is_free, self._solver.components
        if is_free.all():
            return positions, rotations
        positions, rotations = positions.copy(), rotations.copy()
        leaders = np.flatnonzero(is_free)
        for component in np.unique(components[~is_free]):
            own = np.flatnonzero(components == component)
            gaps = ((self.points[own, None] - self.points[None, leaders]) ** 2).sum(-1)
            leader = leaders[np.unravel_index(gaps.argmin(), gaps.shape)[1]]
            r = rotations[leader] @ begun.rotations[leader].T
            positions[own] = positions[leader] + (begun.points[own] - begun.points[leader]) @ r.T
            rotations[own] = r @ begun.rotations[own]
        return positions, rotations


def _on_the_way(handle: Handle, share: float, start: Handle | None = None) -> Handle:
    """The handle when it has gone a `share` of its way from where it begins, or from rest."""
    begun = handle.point if start is None else start.target
    target = begun + share * (handle.target - begun)
    if handle.turn is None:
        return replace(handle, target=target)
    turned = np.zeros(3) if start is None else start.turned
    return replace(handle, target=target, turn=turned + share * (handle.turn - turned))


def _weighed(weights: csr_array, stiffness: F64 | None) -> csr_array:
    """Links (M, M) as stiff as the control points at their ends, (M,) 1 = usual."""
    if stiffness is None:
        return weights
    root, own = np.sqrt(stiffness), np.repeat(np.arange(len(stiffness)), np.diff(weights.indptr))
    both = root[own] * root[weights.indices]  # the product first: rounded alike from both ends
    return csr_array((weights.data * both, weights.indices, weights.indptr), weights.shape)


# How much a pose bends and stretches the object, control point by control point.


@dataclass(frozen=True, eq=False)
class Strain:
    """Dimensionless; all 0 or 1 for a rigid motion."""

    energy: F64  # (M,) share of Eq. 2 over the weighted squares of the links at rest
    most: F64  # (M,) largest stretch along the surface, 1 = none
    least: F64  # (M,) smallest


def measure_strain(points: F64, weights: Sparse, pose: Pose) -> Strain:
    """Strain of `pose` on the links `weights` (M, M) between rest control points (M, 3).

    The surroundings of a control point are mapped by F_i = (sum w e' e^T)(sum w e e^T)^-1, the
    least-squares fit to its links. Its links lie along a surface, so F_i is taken in the plane
    of their two widest directions, and its singular values are the stretches.
    """
    own = frozen(points, np.float64), frozen(pose.points), frozen(pose.rotations)
    before, after, energy = _sums(*frozen_rows(weights), *own)
    squares = np.trace(before, axis1=1, axis2=2)
    spread, axes = np.linalg.eigh(before)  # rising
    widest = np.maximum(spread[:, 2], 1e-300)
    is_line = spread[:, 1] < 1e-9 * widest  # of links all in one line: no second direction
    scale = np.where(np.stack([is_line, np.zeros_like(is_line)], 1), 1.0, spread[:, 1:])
    plane = after @ axes[:, :, 1:] / np.maximum(scale, 1e-300)[:, None, :]  # F V, (M, 3, 2)
    stretches = np.linalg.svd(plane, compute_uv=False)
    stretches[is_line] = stretches[is_line, :1]
    stretches[squares <= 0] = 1.0
    most, least = np.asarray(stretches.T, np.float64)
    return Strain(energy / np.maximum(squares, 1e-300), most, least)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _sums(starts, others, weights, points, moved, rotations):
    """Over the links of each control point: w e e^T and w e' e^T (M, 3, 3), w |e' - R e|^2 (M,)."""
    count = len(points)
    before, after = np.zeros((count, 3, 3)), np.zeros((count, 3, 3))
    energy = np.zeros(count)
    for i in range(count):
        for k in range(starts[i], starts[i + 1]):
            j, w = others[k], weights[k]
            x, y = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
            z = points[j, 2] - points[i, 2]
            for a in range(3):
                old = points[j, a] - points[i, a]
                new = moved[j, a] - moved[i, a]
                turned = rotations[i, a, 0] * x + rotations[i, a, 1] * y + rotations[i, a, 2] * z
                energy[i] += w * (new - turned) ** 2
                before[i, a, 0] += w * old * x
                before[i, a, 1] += w * old * y
                before[i, a, 2] += w * old * z
                after[i, a, 0] += w * new * x
                after[i, a, 1] += w * new * y
                after[i, a, 2] += w * new * z
    return before, after, energy
