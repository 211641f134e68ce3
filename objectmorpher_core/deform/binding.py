"""Which control points move a point of the rest shape, and how much (paper 3.2.2)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..base.arrays import F64, I32, frozen
from ..base.kernel_files import numba
from ..base.threads import FAST, LEAST_ROWS, in_threads
from .graph import ControlGraph

LANES = 64  # points that are skinned together
NEIGHBOURS = 4  # control points that move a Gaussian, paper 3.2.2
STEEPEST = 3.0  # weight per mean spacing; one in 300 points would be steeper, twice as much at most
TINY = 1e-150  # object units; its square is still a number


@dataclass(frozen=True, eq=False)
class Binding:
    """Which control points move each point of the rest shape, and how much.

    The first of a point is the nearest and weighs most. Where its part has fewer than K others,
    the rest are that one again, with weight 0.
    """

    control_points: I32  # (N, K)
    weights: F64  # (N, K), rows sum to 1
    weight_gradients: F64  # (N, K, 3) per object unit, rows sum to 0; where too steep, less so

    @cached_property
    def shares(self) -> F64:
        """(blocks, 4 K x LANES): of 64 points each the weights and gradients, one after the other.

        As `skinning` reads them; the rest of the last block is 0.
        """
        count, own = self.weights.shape
        blocks = -(-count // LANES)
        rows = np.zeros((blocks * LANES, own, 4))
        rows[:count, :, 0], rows[:count, :, 1:] = self.weights, self.weight_gradients
        columns = rows.reshape(blocks, LANES, 4 * own).transpose(0, 2, 1)
        return frozen(columns.reshape(blocks, 4 * own * LANES))

    def select(self, index: np.ndarray) -> Binding:
        """Return the binding of the points at `index` only."""
        return Binding(
            self.control_points[index], self.weights[index], self.weight_gradients[index]
        )


def bind(
    points: np.ndarray,
    control_points: np.ndarray,
    graph: ControlGraph,
    normals: np.ndarray | None = None,
) -> Binding:
    """Bind points (N, 3) or (3,) to their K = 4 nearest control points of (M, 3).

    The nearest control point is found by straight distance, the others among its neighbours
    along the surface (paper 3.2.2). Where two surfaces come near each other the first is found
    along the surface, too: by straight distance it could be on the other one. There `normals`
    (N, 3) tell the sides of a contact apart. Weights are (1 - d / d_5)^2, normalised, with d_5 the
    distance of the next control point that is not used: a weight is 0 when its control point
    enters or leaves the set, so the motion has no seams (embedded deformation, Sumner et al.
    2007).
    """
    x = frozen(np.atleast_2d(points), np.float64)
    if not np.isfinite(x.sum()):
        count = int((~np.isfinite(x).all(1)).sum())
        raise ValueError(f"{count} of {len(x)} points to bind are not finite")
    p = frozen(control_points, np.float64)
    columns = np.ascontiguousarray(p.T)
    axis = int((columns.max(1) - columns.min(1)).argmax())
    order = np.argsort(columns[axis]).astype(np.int32)
    nodes = np.empty((len(x), NEIGHBOURS), np.int32)
    weights = np.empty((len(x), NEIGHBOURS))
    gradients = np.empty((len(x), NEIGHBOURS, 3))
    seeds = np.full(len(x), -1, np.int32)
    inputs: tuple[Any, ...] = (
        x, seeds, p, frozen(order), frozen(p.take(order, 0)), axis,
        frozen(graph.neighbours, np.int32), STEEPEST / graph.mean_spacing,
        nodes, weights, gradients,
    )  # fmt: skip
    in_threads(lambda first, last: _bind(first, last, *inputs), len(x), least=LEAST_ROWS)
    if graph.cells is not None:
        asked = np.flatnonzero(graph.cells.has_gap[nodes[:, 0]])
        if len(asked):
            own = None if normals is None else np.atleast_2d(normals)[asked]
            seeds[asked] = graph.cells.owners_of(x[asked], own)
            in_threads(lambda first, last: _bind(first, last, *inputs), len(x), least=LEAST_ROWS)
    return Binding(nodes, weights, gradients)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _bind(
    first, last, x, seeds, p, order, ordered, axis, neighbours, steepest, nodes, weights, gradients
):
    """Rows first..last of a `Binding`."""
    near = np.empty(NEIGHBOURS + 1, np.int32)
    distances = np.empty(NEIGHBOURS + 1)
    for i in range(first, last):
        nearest = seeds[i]
        if nearest < 0:
            nearest = order[_nearest(x[i, 0], x[i, 1], x[i, 2], ordered, axis)]
        at = x[i, 0], x[i, 1], x[i, 2]
        count = _among_neighbours(at, p, neighbours, nearest, near, distances)
        _weigh(at, p, near, distances, count, i, weights, gradients)
        _flatten(i, steepest, gradients)
        for c in range(NEIGHBOURS):
            nodes[i, c] = near[c] if c < count - 1 else near[0]


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _nearest(x, y, z, ordered, axis):
    """Row of `ordered` (M, 3), which ascends along `axis`, that is nearest to x, y, z.

    From the point's own place in that order down and up, until the distance along the axis
    alone is larger than the smallest one: a twentieth of 512 control points on a surface.
    """
    value = x if axis == 0 else y if axis == 1 else z
    low, high = 0, len(ordered)
    while low < high:
        middle = (low + high) // 2
        if ordered[middle, axis] < value:
            low = middle + 1
        else:
            high = middle
    best, smallest = 0, np.inf
    for step, start in ((-1, low - 1), (1, low)):
        k = start
        while 0 <= k < len(ordered):
            a, b, c = x - ordered[k, 0], y - ordered[k, 1], z - ordered[k, 2]
            along = value - ordered[k, axis]
            if along * along > smallest:
                break
            square = a * a + b * b + c * c
            if square < smallest:
                best, smallest = k, square
            k += step
    return best


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _among_neighbours(x, p, neighbours, nearest, near, distances):
    """Those of the `neighbours` of control point `nearest` that are nearest to `x`; -1: no more.

    Into `near`, with their distances, both (K + 1,) and ascending; returns how many there are.
    """
    for k in range(NEIGHBOURS + 1):
        distances[k] = np.inf
    count = 0
    for k in range(neighbours.shape[1]):
        j = neighbours[nearest, k]
        if j < 0:
            break
        count += 1
        a, b, c = x[0] - p[j, 0], x[1] - p[j, 1], x[2] - p[j, 2]
        square = a * a + b * b + c * c
        if square >= distances[NEIGHBOURS]:
            continue
        place = NEIGHBOURS
        while place > 0 and distances[place - 1] > square:
            distances[place], near[place] = distances[place - 1], near[place - 1]
            place -= 1
        distances[place], near[place] = square, j
    for k in range(NEIGHBOURS + 1):
        distances[k] = np.sqrt(distances[k])
    return min(count, NEIGHBOURS + 1)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _weigh(x, p, near, distances, count, i, weights, gradients):
    """Normalised (1 - d_k / d_K+1)^2 into row i of `weights`, and of `gradients`.

    In a part with few control points the farthest of it takes the place of the next one.
    """
    last = count - 1
    used = max(last, 1)
    limit = distances[last]
    total = sum0 = sum1 = sum2 = 0.0
    for c in range(NEIGHBOURS):
        weights[i, c] = gradients[i, c, 0] = gradients[i, c, 1] = gradients[i, c, 2] = 0.0
        if c >= used or limit < TINY:
            continue
        d = distances[c]
        slack = 1.0 - d / limit
        weights[i, c] = slack * slack
        total += weights[i, c]
        # d slack = (d / limit * grad limit - grad d) / limit
        inner = 1.0 / max(d, TINY)
        outer = d / (limit * limit)
        share = 2.0 * slack / limit
        m, n = near[last], near[c]
        gradients[i, c, 0] = share * (outer * (x[0] - p[m, 0]) - inner * (x[0] - p[n, 0]))
        gradients[i, c, 1] = share * (outer * (x[1] - p[m, 1]) - inner * (x[1] - p[n, 1]))
        gradients[i, c, 2] = share * (outer * (x[2] - p[m, 2]) - inner * (x[2] - p[n, 2]))
        sum0 += gradients[i, c, 0]
        sum1 += gradients[i, c, 1]
        sum2 += gradients[i, c, 2]
    for c in range(NEIGHBOURS):
        if total <= 1e-30:  # equally far from all, or alone: equal shares that do not change
            weights[i, c] = 1.0 / used if c < used else 0.0
            gradients[i, c, 0] = gradients[i, c, 1] = gradients[i, c, 2] = 0.0
            continue
        weights[i, c] /= total
        gradients[i, c, 0] = (gradients[i, c, 0] - weights[i, c] * sum0) / total
        gradients[i, c, 1] = (gradients[i, c, 1] - weights[i, c] * sum1) / total
        gradients[i, c, 2] = (gradients[i, c, 2] - weights[i, c] * sum2) / total


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _flatten(i, steepest, gradients):
    """Scales row i of `gradients` so that none is longer than `steepest`.

    Where five control points are about as far away, the weights change by leaps within less than
    a Gaussian's own size: their derivative there would draw it out to a needle.
    """
    longest = 0.0
    for c in range(NEIGHBOURS):
        x, y, z = gradients[i, c, 0], gradients[i, c, 1], gradients[i, c, 2]
        longest = max(longest, x * x + y * y + z * z)
    if longest > steepest * steepest:
        scale = steepest / np.sqrt(longest)
        for c in range(NEIGHBOURS):
            for a in range(3):
                gradients[i, c, a] *= scale
