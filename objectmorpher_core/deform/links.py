"""The sums of Eq. 2-4 over the links of each control point.

Both steps need W x for twelve columns x: the right-hand side of Eq. 3 from [R_j, R_j p_j], the
S_i of Eq. 4 from [p'_j p_j^T, p'_j]. Control points are put into groups of neighbours; the rows
of a group share most of their columns, so W is kept as one small dense block a group (a third to
a half of it zeros), which is read in order and multiplied in registers.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from ..base.arrays import F32, F64, Sparse, frozen, frozen_rows
from ..base.kernel_files import numba
from ..base.threads import FAST
from .rotation_fit import fit_rotations

GROUP = 16  # control points whose rows are multiplied together; 8 and 32 are slower
Packed = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]
LANES = 4  # columns are filled up to a multiple of this
NO_CHANGES = frozen(np.empty((0, 3)))


@dataclass(frozen=True, eq=False)
class Links:
    """Symmetric link weights, packed for the sums of the two steps.

    The weights are float32 numbers (`in_single`), so that the blocks need half the memory to be
    read from and are still exact; all sums are in float64.
    """

    points: F64  # (M, 3) rest, about their centroid
    weights: Sparse  # (M, M)
    totals: F64  # (5, M) sums over the links of w, of w e, of w |e|^2; e_ij = p_j - p_i
    order: np.ndarray  # (M,) u32 control points, group by group
    columns: np.ndarray  # (C,) u32 control points that a group's rows are linked to
    column_starts: np.ndarray  # (groups + 1,) u32
    blocks: F32  # (B,) the groups' blocks, row by row
    block_starts: np.ndarray  # (groups + 1,) u32
    slots: np.ndarray  # (E,) u32 where each link of `weights` is in `blocks`
    # (E, 3) by how much the links differ from the rest's, which is then e_ij + d_ij, and those of
    # the same links seen from their other ends; (0, 3) where they do not (`prestress.py`).
    changes: F64 = field(default_factory=lambda: NO_CHANGES)
    returning: F64 = field(default_factory=lambda: NO_CHANGES)

    @classmethod
    def of(cls, points: F64, weights: Sparse) -> Links:
        """`points` (M, 3) rest control points, `weights` (M, M) symmetric."""
        centred = frozen(points - points.mean(0))
        order = _neighbours_together(centred)
        packed = _pack(order, weights)
        return cls(centred, weights, _totals_of(centred, weights), *packed)

    def reweighted(self, data: F64) -> Links:
        """Return the same links with other weights (E,), in the order of `weights.data`."""
        weights = csr_array((data, self.weights.indices, self.weights.indptr), self.weights.shape)
        blocks = np.zeros(len(self.blocks), np.float32)
        blocks[self.slots] = data
        totals = _totals_of(self.points, weights)
        return replace(self, weights=weights, totals=totals, blocks=frozen(blocks))

    def prestressed(self, changes: F64) -> Links:
        """Return the same links with rest lengths changed by `changes` (E, 3)."""
        w, ends = self.weights.data, self.weights.indices
        starts = np.repeat(np.arange(len(self.points)), np.diff(self.weights.indptr))
        edges = self.points[ends] - self.points[starts]
        totals = self.totals.copy()
        for a in range(3):
            totals[1 + a] += np.bincount(starts, w * changes[:, a], len(self.points))
        longer = ((2 * edges + changes) * changes).sum(1)
        totals[4] += np.bincount(starts, w * longer, len(self.points))
        numbers = csr_array((np.arange(1, len(w) + 1), ends, self.weights.indptr))
        back = np.asarray(numbers.T.tocsr().data) - 1
        return replace(
            self, totals=frozen(totals), changes=frozen(changes), returning=frozen(changes[back])
        )

    def right_side(self, rotations: F64) -> F64:
        """(M, 3) right-hand side of Eq. 3: sum_j w_ij / 2 (R_i + R_j) (p_i - p_j)."""
        out = np.empty((len(self.points), 3))
        _right_side(*self._packed, self.totals, self._rest, frozen(rotations), out)
        if len(self.returning):
            _return(*frozen_rows(self.weights), self.returning, frozen(rotations), out)
        return out

    def fit(self, positions: F64, warm: F64, is_given: np.ndarray) -> tuple[F64, float]:
        """Local step: rotations (M, 3, 3), det = +1, that minimise Eq. 2; and its energy.

        Where `is_given` (M,) the rotation stays as in `warm` (M, 3, 3).
        """
        rotations = np.empty(warm.shape)
        state = frozen(positions), frozen(warm), frozen(is_given), rotations
        more = np.zeros((9, len(self.points) if len(self.changes) else 0))
        if len(self.changes):
            _stretch(*frozen_rows(self.weights), self.changes, frozen(positions), more)
        energy = _fit(*self._packed, self.totals, self._rest, more, *state)
        return rotations, max(float(energy), 0.0)

    def energies(self, positions: F64, rotations: F64) -> F64:
        """(M,) each control point's share of Eq. 2, object units squared."""
        out = np.empty(len(positions))
        pose = frozen(positions), frozen(rotations)
        _energies(*frozen_rows(self.weights), self.points, self.changes, *pose, out)
        return out

    @cached_property
    def _rest(self) -> F64:
        """(3, M) rest."""
        return frozen(self.points.T)

    @cached_property
    def _packed(self) -> Packed:
        return self.order, self.columns, self.column_starts, self.blocks, self.block_starts


def in_single(weights: np.ndarray) -> F64:
    """The nearest numbers that float32 can hold."""
    return weights.astype(np.float32).astype(np.float64)


def _neighbours_together(points: F64) -> np.ndarray:
    """(M,) u32 control points in groups of `GROUP` near ones, by halving the longest side."""
    groups: list[np.ndarray] = []
    waiting = [np.arange(len(points))]
    while waiting:
        own = waiting.pop()
        if len(own) <= GROUP:
            groups.append(own)
            continue
        longest = int(np.ptp(points[own], axis=0).argmax())
        own = own[np.argsort(points[own, longest], kind="stable")]
        half = -(-len(own) // (2 * GROUP)) * GROUP  # whole groups on one side
        waiting += [own[half:], own[:half]]
    return frozen(np.concatenate(groups), np.uint32)


def _pack(order: np.ndarray, weights: Sparse) -> tuple[np.ndarray, ...]:
    """Columns, their starts, blocks, their starts, slots: see `Links`."""
    columns, blocks = [], []
    slots = np.empty(weights.nnz, np.uint32)
    first = 0
    for start in range(0, len(order), GROUP):
        rows = order[start : start + GROUP].astype(np.int64)
        entries = [np.arange(weights.indptr[r], weights.indptr[r + 1]) for r in rows]
        links = np.concatenate(entries)
        own, at = np.unique(weights.indices[links], return_inverse=True)
        width = max(-(-len(own) // LANES) * LANES, LANES)
        row = np.repeat(np.arange(len(rows)), [len(e) for e in entries])
        slots[links] = first + row * width + at
        block = np.zeros((len(rows), width), np.float32)
        block[row, at] = weights.data[links]
        columns.append(np.pad(own, (0, width - len(own))))
        blocks.append(block.ravel())
        first += block.size
    starts = [np.cumsum([0, *map(len, parts)]) for parts in (columns, blocks)]
    return (
        order, frozen(np.concatenate(columns), np.uint32), frozen(starts[0], np.uint32),
        frozen(np.concatenate(blocks)), frozen(starts[1], np.uint32), frozen(slots),
    )  # fmt: skip


def _totals_of(points: F64, weights: Sparse) -> F64:
    out = np.empty((5, len(points)))
    _totals(*frozen_rows(weights), points, out)
    return frozen(out)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _totals(starts, ends, weights, p, out):
    for i in range(len(p)):
        d = x = y = z = squares = 0.0
        for e in range(starts[i], starts[i + 1]):
            j, w = ends[e], weights[e]
            e0, e1, e2 = p[j, 0] - p[i, 0], p[j, 1] - p[i, 1], p[j, 2] - p[i, 2]
            d += w
            x += w * e0
            y += w * e1
            z += w * e2
            squares += w * (e0 * e0 + e1 * e1 + e2 * e2)
        out[0, i], out[1, i], out[2, i], out[3, i], out[4, i] = d, x, y, z, squares


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _times(order, columns, column_starts, blocks, block_starts, x, out):
    """out (12, M) := W x for the twelve columns of x (M, 12).

    Four rows of W and two columns of x at a time: eight sums and six factors stay in registers.
    """
    widest = np.int64(0)
    for g in range(len(column_starts) - 1):
        widest = max(widest, np.int64(column_starts[g + 1] - column_starts[g]))
    gathered = np.empty(12 * widest)
    row = np.uint32(0)
    for g in range(len(column_starts) - 1):
        first, width = column_starts[g], column_starts[g + 1] - column_starts[g]
        y = gathered[: 12 * width].reshape(12, width)
        for c in range(width):
            j = columns[first + c]
            for h in range(12):
                y[h, c] = x[j, h]
        rows = (block_starts[g + 1] - block_starts[g]) // width
        block = blocks[block_starts[g] : block_starts[g + 1]].reshape(rows, width)
        for a in range(0, rows, 4):
            b, d, e = min(a + 1, rows - 1), min(a + 2, rows - 1), min(a + 3, rows - 1)
            i, j, k, m = order[row + a], order[row + b], order[row + d], order[row + e]
            for h in range(0, 12, 2):
                s0 = s1 = s2 = s3 = t0 = t1 = t2 = t3 = 0.0
                for c in range(width):
                    y0, y1 = y[h, c], y[h + 1, c]
                    w = np.float64(block[a, c])
                    s0 += w * y0
                    t0 += w * y1
                    w = np.float64(block[b, c])
                    s1 += w * y0
                    t1 += w * y1
                    w = np.float64(block[d, c])
                    s2 += w * y0
                    t2 += w * y1
                    w = np.float64(block[e, c])
                    s3 += w * y0
                    t3 += w * y1
                out[h, i], out[h, j], out[h, k], out[h, m] = s0, s1, s2, s3
                out[h + 1, i], out[h + 1, j], out[h + 1, k], out[h + 1, m] = t0, t1, t2, t3
        row += np.uint32(rows)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _right_side(order, columns, column_starts, blocks, block_starts, totals, p, r, out):
    """2 b_i = (sum_j w R_j) p_i - sum_j w R_j p_j - R_i sum_j w e_ij."""
    count = p.shape[1]
    x, wx = np.empty((count, 12)), np.empty((12, count))
    for j in range(count):
        for a in range(3):
            u, v, w = r[j, a, 0], r[j, a, 1], r[j, a, 2]
            x[j, 3 * a], x[j, 3 * a + 1], x[j, 3 * a + 2] = u, v, w
            x[j, 9 + a] = u * p[0, j] + v * p[1, j] + w * p[2, j]
    _times(order, columns, column_starts, blocks, block_starts, x, wx)
    for i in range(count):
        for a in range(3):
            others = -wx[9 + a, i]
            for b in range(3):
                others += wx[3 * a + b, i] * p[b, i] - r[i, a, b] * totals[1 + b, i]
            out[i, a] = 0.5 * others


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _fit(
    order, columns, column_starts, blocks, block_starts, totals, p, more, positions, warm,
    is_given, out,
):  # fmt: skip
    """Rotations into `out`, from `warm`; the energy. `more` (9, M) of the sums, or (9, 0).

    sum_j w p'_j e_ij^T = sum_j w p'_j p_j^T - (sum_j w p'_j) p_i^T, and
    sum_ij w |e'|^2 = 2 sum_i p'_i . (sum_j w (p'_i - p'_j)): no link's squares are summed. The
    positions are taken about their centroid: far from it these differences would lose digits.
    """
    count = p.shape[1]
    q, r = np.empty((3, count)), np.empty((9, count))
    for a in range(3):
        mean = 0.0
        for j in range(count):
            mean += positions[j, a]
        mean /= count
        for j in range(count):
            q[a, j] = positions[j, a] - mean
    x, s = np.empty((count, 12)), np.empty((12, count))
    for j in range(count):
        for a in range(3):
            x[j, 9 + a] = q[a, j]
            for b in range(3):
                x[j, 3 * a + b] = q[a, j] * p[b, j]
                r[3 * a + b, j] = warm[j, a, b]
    _times(order, columns, column_starts, blocks, block_starts, x, s)
    energy = 0.0
    for a in range(3):
        for i in range(count):
            energy += 2.0 * q[a, i] * (totals[0, i] * q[a, i] - s[9 + a, i])
        for b in range(3):
            for i in range(count):
                s[3 * a + b, i] -= s[9 + a, i] * p[b, i] + q[a, i] * totals[1 + b, i]
    if more.shape[1] == count:
        for k in range(9):
            for i in range(count):
                s[k, i] += more[k, i]
    fit_rotations(s[:9], r)
    for i in range(count):
        for a in range(3):
            for b in range(3):
                k = 3 * a + b
                out[i, a, b] = warm[i, a, b] if is_given[i] else r[k, i]
                energy -= 2.0 * out[i, a, b] * s[k, i]
        energy += totals[4, i]
    return energy


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _return(starts, ends, weights, returning, r, out):
    """out_i += sum_j w R_j d_ji / 2."""
    for i in range(len(starts) - 1):
        for a in range(3):
            total = 0.0
            for e in range(starts[i], starts[i + 1]):
                s, d = r[ends[e], a], returning[e]
                total += weights[e] * (s[0] * d[0] + s[1] * d[1] + s[2] * d[2])
            out[i, a] += 0.5 * total


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _stretch(starts, ends, weights, changes, q, out):
    """out (9, M) := sum_j w (q_j - c) d_ij^T, about the positions' centroid c."""
    count = len(q)
    mean = np.zeros(3)
    for j in range(count):
        for a in range(3):
            mean[a] += q[j, a] / count
    for i in range(count):
        for e in range(starts[i], starts[i + 1]):
            for a in range(3):
                pull = weights[e] * (q[ends[e], a] - mean[a])
                for b in range(3):
                    out[3 * a + b, i] += pull * changes[e, b]


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _energies(starts, ends, weights, p, changes, q, r, out):
    for i in range(len(starts) - 1):
        total = 0.0
        for e in range(starts[i], starts[i + 1]):
            j = ends[e]
            x, y, z = p[j, 0] - p[i, 0], p[j, 1] - p[i, 1], p[j, 2] - p[i, 2]
            if len(changes):
                x, y, z = x + changes[e, 0], y + changes[e, 1], z + changes[e, 2]
            square = 0.0
            for a in range(3):
                gap = q[j, a] - q[i, a] - (r[i, a, 0] * x + r[i, a, 1] * y + r[i, a, 2] * z)
                square += gap * gap
            total += weights[e] * square
        out[i] = total
