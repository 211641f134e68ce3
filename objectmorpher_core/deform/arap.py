"""As-rigid-as-possible solve on the control points (paper Eq. 2-4; Sorkine & Alexa 2007).

The sums over neighbours are compiled loops over the links; the global step is two triangular
solves. At the paper's link radius a control point has some eighty neighbours, and M = 512.
"""

from __future__ import annotations

import time
from copy import copy
from dataclasses import dataclass, replace
from typing import NamedTuple

import numba
import numpy as np
from scipy.linalg import cho_factor, cho_solve, pinvh

from ..arrays import F64, I32, frozen

ANDERSON_WINDOW = 5  # previous steps that the acceleration combines
FAST = {"reassoc", "contract", "nsz"}  # sums in any order, a * b + c at once
ROTATION_STEPS = 40  # at most, per rotation fit; two or three from a warm start
ROTATION_TOLERANCE = 1e-12  # rad^2, squared length of the last turn


@dataclass(frozen=True, eq=False)
class Constraints:
    """Linear conditions `rows @ p' = targets`, met exactly.

    A handle is the surface point x0 that the artist clicked: its skinned position
    sum_j w_j (R_j (x0 - p_j) + p'_j) must be the target, so its row holds its skinning weights
    and its target depends on the rotations: targets = fixed - sum_j w_j R_j offset_j.
    """

    rows: F64  # (H, M)
    fixed: F64  # (H, 3)
    offsets: F64  # (H, M, 3), x0 - p_j; 0 for a constraint on a control point itself


class ArapSolver:
    """Local-global minimisation of Eq. 2 under linear constraints.

    The constructor does what depends on the rest shape; `constrain` factors once for a set of
    rows; `step` is two triangular solves and M rotation fits.
    """

    def __init__(self, points: np.ndarray, weights: np.ndarray) -> None:
        """`points` (M, 3) rest control points, `weights` (M, M) symmetric."""
        assert np.array_equal(weights, weights.T), "Eq. 3 needs symmetric weights"
        self.points = points.astype(np.float64)
        self.weights = weights
        self.degree = weights.sum(1)
        self._laplacian = np.diag(self.degree) - weights
        self._pairs = np.nonzero(weights)  # (E,) control points at this end, and at the other
        self._links = _Links.of(self.points, weights, self._pairs)
        self.scale = float(np.abs(self.points - self.points.mean(0)).max()) or 1.0

    def reweighted(self, weights: np.ndarray) -> ArapSolver:
        """A solver of the same points and links with other weights (M, M), symmetric."""
        other = copy(self)
        other.weights, other.degree = weights, weights.sum(1)
        other._laplacian = np.diag(other.degree) - weights
        other._links = self._links._replace(weights=frozen(weights[self._pairs]))
        return other

    def constrain(
        self, constraints: Constraints, is_free: np.ndarray, held: np.ndarray | None = None
    ) -> None:
        """Factors for these rows. `is_free` (M,): control points that the system may move.

        The others keep an identity row and take no part. Those whose indices are `held` stay at
        rest too, and the rest of the object hangs on them. With C the rows, the minimiser of
        Eq. 2 under C p' = t does not change when a multiple of C^T C is added to L; that makes
        the matrix positive definite as soon as each component has one constraint.
        """
        self._constraints = constraints
        self._turning, self._turners, self._arms = _turning_parts(constraints)
        held = np.empty(0, np.int32) if held is None else held
        self._is_still = ~is_free
        self._is_still[held] = True
        self._still = self.points[self._is_still]
        self._pull = self._laplacian[:, held] @ self.points[held]
        self._rows = np.where(self._is_still, 0.0, constraints.rows)
        self._still_part = constraints.rows[:, self._is_still] @ self._still  # of the targets
        self._stiffness = float(self.degree.max()) or 1.0
        matrix = self._laplacian + self._stiffness * (self._rows.T @ self._rows)
        matrix[self._is_still] = 0.0
        matrix[:, self._is_still] = 0.0
        matrix[self._is_still, self._is_still] = 1.0
        try:
            self._factor = cho_factor(matrix, lower=True, check_finite=False)
        except np.linalg.LinAlgError:  # coincident points: the smallest push off singular
            jitter = 1e-10 * self._stiffness * np.eye(len(matrix))
            self._factor = cho_factor(matrix + jitter, lower=True, check_finite=False)
        self._response = cho_solve(self._factor, self._rows.T, check_finite=False)  # K^-1 C^T
        self._inverse_schur = pinvh(self._rows @ self._response, rtol=1e-10, check_finite=False)

    def aim(self, fixed: F64) -> None:
        """Gives the constraints other targets (H, 3); nothing is factored for that."""
        self._constraints = replace(self._constraints, fixed=fixed)

    def positions(self, rotations: F64) -> F64:
        """Global step: control points (M, 3) that minimise Eq. 2 for fixed rotations."""
        right = _right_side(*self._links, frozen(rotations))
        targets = self._constraints.fixed - self._still_part
        turned = rotations[self._turners] @ self._arms[..., None]  # (T, N, 3, 1)
        targets[self._turning] -= turned[..., 0].sum(1)
        right += self._stiffness * (self._rows.T @ targets) - self._pull
        right[self._is_still] = self._still
        loose = cho_solve(self._factor, right, check_finite=False)
        multipliers = self._inverse_schur @ (targets - self._rows @ loose)
        return loose + self._response @ multipliers

    def rotations(self, positions: F64, warm: F64) -> F64:
        """Local step: rotations (M, 3, 3), det = +1, that minimise Eq. 2 for fixed positions."""
        return self.fit(positions, warm)[0]

    def energy(self, positions: F64, rotations: F64) -> float:
        """Eq. 2, in object units squared."""
        return float(_energy(*self._links, frozen(positions), frozen(rotations)))

    def fit(self, positions: F64, warm: F64) -> tuple[F64, float]:
        """`rotations`, and the `energy` with them."""
        rotations = np.empty(warm.shape)
        energy = _fit(*self._links, frozen(positions), frozen(warm), rotations)
        return rotations, max(float(energy), 0.0)


class _Links(NamedTuple):
    """The links from each control point, one after the other: arguments of the kernels."""

    starts: I32  # (M + 1,) into the others
    ends: I32  # (E,) control point at the other end
    weights: F64  # (E,)
    arms: F64  # (E, 3) p_j - p_i

    @classmethod
    def of(cls, points: F64, weights: F64, pairs: tuple[np.ndarray, ...]) -> _Links:
        i, j = pairs
        starts = np.searchsorted(i, np.arange(len(points) + 1)).astype(np.int32)
        arms = frozen(points[j] - points[i])
        return cls(frozen(starts), frozen(j, np.int32), frozen(weights[pairs]), arms)


def _turning_parts(constraints: Constraints) -> tuple[I32, I32, F64]:
    """Rows (T,) whose targets turn, the control points (T, N) they turn with, w_j (x0 - p_j)."""
    turning = np.flatnonzero((constraints.offsets != 0).any((1, 2)))
    weights = constraints.rows[turning]
    count = int((weights != 0).sum(1).max(initial=0))
    turners = np.argsort(-np.abs(weights), axis=1, kind="stable")[:, :count]
    offsets = np.take_along_axis(constraints.offsets[turning], turners[..., None], 1)
    arms = np.take_along_axis(weights, turners, 1)[..., None] * offsets
    return turning.astype(np.int32), turners.astype(np.int32), arms


@dataclass(frozen=True, eq=False)
class Minimum:
    """Where the iteration ended."""

    positions: F64  # (M, 3)
    rotations: F64  # (M, 3, 3)
    energies: tuple[float, ...]  # Eq. 2 after each iteration


def minimise(
    solver: ArapSolver,
    rotations: F64,
    iterations: int,
    tolerance: float = 1e-4,
    seconds: float = np.inf,
) -> Minimum:
    """Local-global iteration with Anderson acceleration from warm `rotations`.

    The fixed-point map is rotations -> positions -> rotations; the acceleration extrapolates
    the positions from the last five steps (Peng et al. 2018) and falls back to the plain step
    whenever the energy would rise, so the energy never rises. Ends after `iterations` or when
    the positions moved by less than `tolerance` x the object's size times 0.01, and begins no
    iteration after `seconds`.
    """
    end = time.perf_counter() + seconds
    limit = tolerance * 0.01 * solver.scale
    positions = solver.positions(rotations)
    rotations, energy = solver.fit(positions, rotations)
    energies = [energy]
    history: list[tuple[F64, F64]] = []  # (map's value, residual)
    for _ in range(iterations - 1):
        plain = solver.positions(rotations)
        residual = (plain - positions).ravel()
        if np.abs(residual).max() < limit or time.perf_counter() > end:
            break
        history = [*history[-ANDERSON_WINDOW:], (plain.ravel(), residual)]
        trial = _extrapolate(history).reshape(plain.shape)
        trial_rotations, energy = solver.fit(trial, rotations)
        if len(history) > 1 and energy > energies[-1] * (1 + 1e-12):
            history = history[-1:]
            trial = plain
            trial_rotations, energy = solver.fit(trial, rotations)
        positions, rotations = trial, trial_rotations
        energies.append(energy)
    # One plain step last: the constraints depend on the rotations and are then met exactly.
    positions = solver.positions(rotations)
    return Minimum(positions, rotations, (*energies, solver.energy(positions, rotations)))


def _extrapolate(history: list[tuple[F64, F64]]) -> F64:
    """Anderson's combination of the last map values, weights least-squares on the residuals."""
    value, residual = history[-1]
    if len(history) == 1:
        return value
    gaps = np.stack([residual - r for _, r in history[:-1]], axis=1)
    weights = np.linalg.lstsq(gaps, residual, rcond=1e-8)[0]
    return value - sum(w * (value - v) for w, (v, _) in zip(weights, history[:-1], strict=True))


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _right_side(starts, ends, weights, arms, r):
    """(M, 3) right-hand side of Eq. 3: sum_j w_ij / 2 (R_i + R_j) (p_i - p_j)."""
    count = len(starts) - 1
    right = np.empty((count, 3))
    for i in range(count):
        b0 = b1 = b2 = m0 = m1 = m2 = 0.0
        for e in range(starts[i], starts[i + 1]):
            j = ends[e]
            x, y, z = weights[e] * arms[e, 0], weights[e] * arms[e, 1], weights[e] * arms[e, 2]
            m0 += x
            m1 += y
            m2 += z
            b0 += r[j, 0, 0] * x + r[j, 0, 1] * y + r[j, 0, 2] * z
            b1 += r[j, 1, 0] * x + r[j, 1, 1] * y + r[j, 1, 2] * z
            b2 += r[j, 2, 0] * x + r[j, 2, 1] * y + r[j, 2, 2] * z
        right[i, 0] = -0.5 * (b0 + r[i, 0, 0] * m0 + r[i, 0, 1] * m1 + r[i, 0, 2] * m2)
        right[i, 1] = -0.5 * (b1 + r[i, 1, 0] * m0 + r[i, 1, 1] * m1 + r[i, 1, 2] * m2)
        right[i, 2] = -0.5 * (b2 + r[i, 2, 0] * m0 + r[i, 2, 1] * m1 + r[i, 2, 2] * m2)
    return right


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _energy(starts, ends, weights, arms, q, r):
    """Eq. 2 of positions `q` (M, 3) and rotations `r`."""
    total = 0.0
    for i in range(len(starts) - 1):
        for e in range(starts[i], starts[i + 1]):
            j = ends[e]
            for a in range(3):
                turned = r[i, a, 0] * arms[e, 0] + r[i, a, 1] * arms[e, 1] + r[i, a, 2] * arms[e, 2]
                gap = q[j, a] - q[i, a] - turned
                total += weights[e] * gap * gap
    return total


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _fit(starts, ends, weights, arms, q, warm, fitted):
    """Local step into `fitted` (M, 3, 3); the energy with it.

    The transpose of the paper's S_i is sum_j w_ij e'_ij e_ij^T.
    """
    total = 0.0
    s = np.empty((3, 3))
    for i in range(len(starts) - 1):
        s00 = s01 = s02 = s10 = s11 = s12 = s20 = s21 = s22 = squares = 0.0
        for e in range(starts[i], starts[i + 1]):
            j, w = ends[e], weights[e]
            x, y, z = arms[e, 0], arms[e, 1], arms[e, 2]
            u, v, t = q[j, 0] - q[i, 0], q[j, 1] - q[i, 1], q[j, 2] - q[i, 2]
            squares += w * (u * u + v * v + t * t + x * x + y * y + z * z)
            u, v, t = w * u, w * v, w * t
            s00 += u * x
            s01 += u * y
            s02 += u * z
            s10 += v * x
            s11 += v * y
            s12 += v * z
            s20 += t * x
            s21 += t * y
            s22 += t * z
        s[0, 0], s[0, 1], s[0, 2] = s00, s01, s02
        s[1, 0], s[1, 1], s[1, 2] = s10, s11, s12
        s[2, 0], s[2, 1], s[2, 2] = s20, s21, s22
        r = fitted[i]
        _fit_rotation(s, warm[i], r)
        aligned = 0.0
        for a in range(3):
            for b in range(3):
                aligned += r[a, b] * s[a, b]
        total += squares - 2.0 * aligned
    return total


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _fit_rotation(a, warm, r):
    """r := the rotation nearest to `a`, from a warm start (Mueller et al. 2016).

    The turn that aligns the current axes with the matrix's columns is repeated until it is
    nothing; a product of rotations never becomes a mirror image. From more than a right angle
    away the first turns are large but still in the right sense.
    """
    size = 0.0
    for j in range(3):
        for k in range(3):
            r[j, k] = warm[j, k]
            size = max(size, abs(a[j, k]))
    if size <= 1e-300:
        return
    for _ in range(ROTATION_STEPS):
        # omega = sum_k r_k x a_k / |sum_k r_k . a_k|, r_k and a_k the columns
        ox = oy = oz = 0.0
        dot = 0.0
        for k in range(3):
            ox += r[1, k] * a[2, k] - r[2, k] * a[1, k]
            oy += r[2, k] * a[0, k] - r[0, k] * a[2, k]
            oz += r[0, k] * a[1, k] - r[1, k] * a[0, k]
            dot += r[0, k] * a[0, k] + r[1, k] * a[1, k] + r[2, k] * a[2, k]
        scale = 1.0 / (abs(dot) + 1e-12 * size)
        ox, oy, oz = ox * scale, oy * scale, oz * scale
        square = ox * ox + oy * oy + oz * oz
        _turn(r, 0.5 * ox, 0.5 * oy, 0.5 * oz)
        if square < ROTATION_TOLERANCE:
            break
    _orthonormalise(r)


@numba.njit(cache=True)
def _turn(r, x, y, z):
    """r := (turn whose Gibbs vector, axis x tan(angle / 2), is x, y, z) r.

    v + 2 / (1 + g.g) (g x v + g x (g x v)) for each column v: no sine, and 0 turns nothing.
    """
    share = 2.0 / (1.0 + x * x + y * y + z * z)
    for k in range(3):
        a, b, d = r[0, k], r[1, k], r[2, k]
        u, v, w = y * d - z * b, z * a - x * d, x * b - y * a
        r[0, k] = a + share * (u + y * w - z * v)
        r[1, k] = b + share * (v + z * u - x * w)
        r[2, k] = d + share * (w + x * v - y * u)


@numba.njit(cache=True)
def _orthonormalise(r):
    """Gram-Schmidt on the columns: takes away the rounding of a long chain of turns."""
    for k in range(2):
        for j in range(k):
            dot = r[0, k] * r[0, j] + r[1, k] * r[1, j] + r[2, k] * r[2, j]
            for a in range(3):
                r[a, k] -= dot * r[a, j]
        norm = np.sqrt(r[0, k] ** 2 + r[1, k] ** 2 + r[2, k] ** 2)
        for a in range(3):
            r[a, k] /= norm
    r[0, 2] = r[1, 0] * r[2, 1] - r[2, 0] * r[1, 1]
    r[1, 2] = r[2, 0] * r[0, 1] - r[0, 0] * r[2, 1]
    r[2, 2] = r[0, 0] * r[1, 1] - r[1, 0] * r[0, 1]
