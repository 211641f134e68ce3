"""As-rigid-as-possible solve on the control points (paper Eq. 2-4; Sorkine & Alexa 2007).

All sums over neighbours are dense matrix products: at the paper's link radius a control point
has some eighty neighbours, and M = 512.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cached_property

import numba
import numpy as np
from scipy.linalg import cho_factor, cho_solve, pinvh

from ..arrays import F64, I32, frozen

ANDERSON_WINDOW = 5  # previous steps that the acceleration combines
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

    def targets(self, rotations: F64) -> F64:
        """(H, 3) right-hand sides for rotations (M, 3, 3)."""
        if self._turning.size == 0:
            return self.fixed
        targets = self.fixed.copy()
        turned = rotations[self._nodes] @ self._arms[..., None]  # (T, N, 3, 1)
        targets[self._turning] -= turned[..., 0].sum(1)
        return targets

    @cached_property
    def _turning(self) -> I32:
        """(T,) the rows whose targets depend on rotations."""
        return np.flatnonzero((self.offsets != 0).any((1, 2))).astype(np.int32)

    @cached_property
    def _nodes(self) -> I32:
        """(T, N) the control points that they depend on, the most heavily first."""
        weights = np.abs(self.rows[self._turning])
        count = int((weights > 0).sum(1).max())
        return np.argsort(-weights, axis=1, kind="stable")[:, :count].astype(np.int32)

    @cached_property
    def _arms(self) -> F64:
        """(T, N, 3) w_j (x0 - p_j) of those."""
        weights = np.take_along_axis(self.rows[self._turning], self._nodes, 1)
        arms = np.take_along_axis(self.offsets[self._turning], self._nodes[..., None], 1)
        return weights[..., None] * arms

    def moved(self, fixed: F64) -> Constraints:
        """The same conditions with other targets (H, 3)."""
        other = Constraints(self.rows, fixed, self.offsets)
        other.__dict__.update({k: v for k, v in self.__dict__.items() if k[0] == "_"})
        return other


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
        self._centre = self.points.mean(0)
        self._centred = self.points - self._centre  # sums of squares lose no digits
        self._weighted_points = weights @ self._centred  # W P
        self._rest_energy = self._square_sum(self._centred, self._weighted_points)
        self.scale = float(np.abs(self.points - self.points.mean(0)).max()) or 1.0

    def constrain(self, constraints: Constraints, is_free: np.ndarray) -> None:
        """Factors for these rows. `is_free` (M,): control points that the system may move.

        The others keep an identity row and take no part. With C the rows, the minimiser of
        Eq. 2 under C p' = t does not change when a multiple of C^T C is added to L; that makes
        the matrix positive definite as soon as each component has one constraint.
        """
        self.constraints = constraints
        self.is_free = is_free
        c = constraints.rows
        self._stiffness = float(self.degree.max()) or 1.0
        matrix = self._laplacian + self._stiffness * c.T @ c
        matrix[~is_free] = 0.0
        matrix[:, ~is_free] = 0.0
        matrix[~is_free, ~is_free] = 1.0
        try:
            self._factor = cho_factor(matrix, lower=True, check_finite=False)
        except np.linalg.LinAlgError:  # coincident points: the smallest push off singular
            jitter = 1e-10 * self._stiffness * np.eye(len(matrix))
            self._factor = cho_factor(matrix + jitter, lower=True, check_finite=False)
        self._response = cho_solve(self._factor, c.T, check_finite=False)  # K^-1 C^T
        self._inverse_schur = pinvh(c @ self._response, rtol=1e-10, check_finite=False)

    def positions(self, rotations: F64) -> F64:
        """Global step: control points (M, 3) that minimise Eq. 2 for fixed rotations."""
        p, m = self._centred, len(self.points)
        r = rotations.reshape(m, 9)
        turned = (rotations @ p[:, :, None])[:, :, 0]  # R_j p_j
        sums = self.weights @ np.concatenate([r, turned], axis=1)  # sum_j w_ij (R_j, R_j p_j)
        arms = self.degree[:, None] * p - self._weighted_points
        own = (rotations @ arms[:, :, None])[:, :, 0]
        blended = (sums[:, :9].reshape(m, 3, 3) @ p[:, :, None])[:, :, 0]
        right = 0.5 * (own + blended - sums[:, 9:])  # Eq. 3
        c = self.constraints.rows
        targets = self.constraints.targets(rotations)
        right += self._stiffness * (c.T @ targets)
        right[~self.is_free] = self.points[~self.is_free]
        loose = cho_solve(self._factor, right, check_finite=False)
        multipliers = self._inverse_schur @ (targets - c @ loose)
        return loose + self._response @ multipliers

    def rotations(self, positions: F64, warm: F64) -> F64:
        """Local step: rotations (M, 3, 3), det = +1, that minimise Eq. 2 for fixed positions."""
        return _fit_rotations(frozen(self._covariances(positions)[0]), frozen(warm))

    def energy(self, positions: F64, rotations: F64) -> float:
        """Eq. 2, in object units squared."""
        return self._energy(rotations, *self._covariances(positions))

    def fit(self, positions: F64, warm: F64) -> tuple[F64, float]:
        """`rotations`, and the `energy` with them."""
        covariances, posed = self._covariances(positions)
        rotations = _fit_rotations(frozen(covariances), frozen(warm))
        return rotations, self._energy(rotations, covariances, posed)

    def _energy(self, rotations: F64, covariances: F64, posed: float) -> float:
        aligned = float(np.vdot(rotations, covariances))
        return max(posed + self._rest_energy - 2.0 * aligned, 0.0)

    def _covariances(self, positions: F64) -> tuple[F64, float]:
        """sum_j w_ij e'_ij e_ij^T (M, 3, 3), the transpose of the paper's S_i; sum of w |e'|^2."""
        p, m = self._centred, len(self.points)
        q = positions - positions.mean(0)
        outer = (q[:, :, None] * p[:, None, :]).reshape(m, 9)
        sums = self.weights @ np.concatenate([outer, q], axis=1)  # sum_j w_ij (p'_j p_j^T, p'_j)
        covariances = (
            (sums[:, :9] + self.degree[:, None] * outer).reshape(m, 3, 3)
            - q[:, :, None] * self._weighted_points[:, None, :]
            - sums[:, 9:, None] * p[:, None, :]
        )
        return covariances, self._square_sum(q, sums[:, 9:])

    def _square_sum(self, points: F64, weighted: F64) -> float:
        """sum_ij w_ij |p_i - p_j|^2 of points (M, 3), `weighted` = W P."""
        return 2.0 * float(np.vdot(points, self.degree[:, None] * points - weighted))


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


@numba.njit(cache=True, nogil=True)
def _fit_rotations(covariances: F64, warm: F64) -> F64:
    """Rotation nearest to each 3x3 matrix, from a warm start (Mueller et al. 2016).

    The turn that aligns the current axes with the matrix's columns is repeated until it is
    nothing; a product of rotations never becomes a mirror image. From more than a right angle
    away the first turns are large but still in the right sense.
    """
    fitted = np.empty(warm.shape)
    for i in range(len(covariances)):
        a, r = covariances[i], fitted[i]
        size = 0.0
        for j in range(3):
            for k in range(3):
                r[j, k] = warm[i, j, k]
                size = max(size, abs(a[j, k]))
        if size <= 1e-300:
            continue
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
            angle = np.sqrt(square)
            if angle > 1e-30:
                _turn(r, ox / angle, oy / angle, oz / angle, angle)
            if square < ROTATION_TOLERANCE:
                break
        _orthonormalise(r)
    return fitted


@numba.njit(cache=True)
def _turn(r, x, y, z, angle):
    """r := (turn by `angle` about the unit axis) r, by Rodrigues' formula."""
    s, c = np.sin(angle), np.cos(angle)
    for k in range(3):
        a, b, d = r[0, k], r[1, k], r[2, k]
        along = (x * a + y * b + z * d) * (1.0 - c)
        r[0, k] = a * c + (y * d - z * b) * s + x * along
        r[1, k] = b * c + (z * a - x * d) * s + y * along
        r[2, k] = d * c + (x * b - y * a) * s + z * along


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
