"""A box that looks like the photo: faces from the network's normals, edges by the outline."""

from __future__ import annotations

import cv2
import numpy as np
from scipy.optimize import least_squares
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from ...base.arrays import F64
from .evidence import NORMAL_ERROR, STRIDE, TAIL, Build, Cost, Evidence, Misfit, all_least
from .solids import Mesh, box

# A flat sheet that looks like the photo: a plane from the network's front and normals.

ROUNDS = 8
STEEPEST = 0.25  # cosine to the ray, below which a sheet is not turned


def fit_flat(evidence: Evidence) -> tuple[F64, Misfit]:
    """The plane (3,), of which inverse depth is the product with (x, y, 1) tangents."""
    own = evidence.sure
    rays = np.concatenate([evidence.grid.tangents[own], np.ones((own.sum(), 1))], 1)
    inverse, error = 1 / evidence.depth[own], evidence.error[own]
    mean = float(np.median(inverse))
    weight = np.ones(len(rays))
    normals, heed = evidence.normal[own], np.ones(len(rays))
    plane = np.array([0.0, 0.0, mean])
    off = apart = np.zeros(len(rays))
    for _ in range(ROUNDS):
        # A plane's normal is that of its inverse depths; a unit one, times its distance.
        scaled = weight / error / mean
        towards = -(normals * heed[:, None]).sum(0) / heed.sum()
        towards /= np.linalg.norm(towards)
        pull = len(rays) * heed.mean() / NORMAL_ERROR**2 / np.linalg.norm(plane) ** 2
        system = (rays * scaled[:, None] ** 2).T @ rays + pull * np.eye(3)
        wanted = (rays * scaled[:, None] ** 2).T @ inverse
        plane = np.linalg.solve(system, wanted + pull * towards * np.linalg.norm(plane))
        off = (rays @ plane - inverse) / error / mean
        weight = 1 / (1 + (off / TAIL) ** 2)
        unit = plane / np.linalg.norm(plane)
        apart = np.linalg.norm(normals + unit, axis=1) / NORMAL_ERROR
        heed = 1 / (1 + (apart / TAIL) ** 2) ** 2
    depth, normal = ((r**2 / (1 + (r / TAIL) ** 2)).mean() for r in (off, apart))
    return plane, Misfit(0.0, float(depth), float(normal), 0.0)


STARTS = 60  # rotations that are tried
PITCHES, YAWS = (-10, 8, 20, 35), (12, 35, 55, 78)  # degrees, of those that stand
KEPT = 2  # of them, that are refined
TRIED = 10  # of them, that are drawn
APART = 0.3  # radians between two that are kept
ENDS = (2, 98)  # percentiles of what is seen along an axis
# A box is fitted once more to places of an outline, in px of the crop: how many, how far they are
# off, how many of them are independent, and from how many times that error on they count less.
PLACES, OFF, INDEPENDENT, USUAL = 400, 0.5, 100, 3.0
FREE = np.array([0.1, 0.1, 0.1, 0.02, 0.02, 0.02, 0.1, 0.1, 0.1])  # as STEPS, then
WORSE = 1.0  # misfit, by which such a box may be farther from what the network sees
NEAREST, FAR_OFF = 1e-3, 1e3  # depth that a box has at least; what is off of one that has less
STEPS = np.array([0.15, 0.15, 0.15, 0.03, 0.03, 0.03, 0.15, 0.15, 0.15])


def fit_box(evidence: Evidence, hopeless: float = np.inf) -> tuple[Mesh, Misfit]:
    """The best of boxes that were refined from different rotations.

    `hopeless`: misfit, from which its outline is not looked at more closely.
    """
    guesses = _guesses(evidence)
    guesses.sort(key=lambda guess: _cost(guess, evidence)(np.zeros(9)))
    costs = [_cost(guess, evidence) for guess in guesses[:KEPT]]
    fits = all_least(costs, [np.zeros(9)] * len(costs), STEPS)
    best = min(range(len(fits)), key=lambda k: costs[k](fits[k]))
    build, numbers = guesses[best], fits[best]
    mesh = build(numbers)
    if (misfit := evidence.misfit(mesh)).total > hopeless:
        return mesh, misfit
    finer = build(_outlined(build, numbers, evidence))
    is_better = (found := evidence.misfit(finer)).total < misfit.total + WORSE
    return (finer, found) if is_better else (mesh, misfit)


def _cost(build: Build, evidence: Evidence) -> Cost:
    return lambda numbers: evidence.misfit(build(numbers)).total


def fit_about(evidence: Evidence) -> tuple[Mesh, Misfit]:
    """The box about what is seen, whatever its outline: a thing that is none has the outline of
    boxes that are nothing like it.
    """
    meshes = [guess(np.zeros(9)) for guess in _guesses(evidence)]
    fits = [(mesh, evidence.misfit(mesh)) for mesh in meshes]
    return min(fits, key=lambda fit: fit[1].depth + fit[1].normal)


def _guesses(evidence: Evidence) -> list[Build]:
    """Boxes about what is seen, of rotations that differ."""
    turns, scores = _turns(evidence)
    kept: list[Rotation] = []
    for k in np.argsort(-scores):
        if all(_between(turns[k], other) > APART for other in kept):
            kept.append(turns[k])
        if len(kept) == TRIED:
            break
    return [_guess(turn, evidence) for turn in [*kept, *_upright(evidence)]]


def _outlined(build: Build, start: F64, evidence: Evidence) -> F64:
    """Numbers (9,) near `start`, of the box whose own outline is nearest to the photo's.

    Six corners of an outline say nearly all of a box; the evidence is looked at on a coarse grid.
    """
    ring = evidence.outline[:: max(1, len(evidence.outline) // PLACES)]
    error = OFF * evidence.grid.step / STRIDE

    def residuals(change: F64) -> F64:
        vertices = build(start + FREE * change).vertices
        if vertices[:, 2].min() <= NEAREST:
            return np.full(len(ring) + len(change), FAR_OFF)
        hull = vertices[:, :2] / vertices[:, 2:]
        hull = hull[ConvexHull(hull).vertices]
        away = _away(ring, hull) / error
        return np.concatenate([away / np.sqrt(len(ring) / INDEPENDENT), change])

    found = least_squares(residuals, np.zeros(len(start)), loss="soft_l1", f_scale=USUAL)
    return start + FREE * found.x


def _away(places: F64, hull: F64) -> F64:
    """(n,) how far places (n, 2) are from a closed line (m, 2)."""
    ways = np.roll(hull, -1, axis=0) - hull
    off = places[:, None] - hull
    share = ((off * ways).sum(2) / (ways**2).sum(1)).clip(0, 1)
    return np.asarray(np.linalg.norm(off - share[..., None] * ways, axis=2).min(1), np.float64)


def _turns(evidence: Evidence) -> tuple[Rotation, F64]:
    """Rotations and how well the normals lie along their axes."""
    normals = evidence.normal[evidence.sure]
    normals = normals[:: max(1, len(normals) // 150)]
    turns = Rotation.random(STARTS, rng=np.random.default_rng(0))
    # The faces pull the axes: a step towards the mean of the normals that are nearest to each.
    for _ in range(5):
        own = turns.as_matrix()  # (n, 3, 3), columns are axes
        along = np.einsum("pk,nka->npa", normals, own)
        which = np.abs(along).argmax(2)
        weight = np.where(np.arange(3) == which[..., None], along**3, 0.0)
        pulled = np.einsum("npa,pk->nka", weight, normals) + 0.05 * len(normals) * own
        u, _, vt = np.linalg.svd(pulled)
        det = np.linalg.det(u @ vt)
        u[:, :, 2] *= det[:, None]
        turns = Rotation.from_matrix(u @ vt)
    along = np.abs(np.einsum("pk,nka->npa", normals, turns.as_matrix())).max(2)
    return turns, (along**8).mean(1)


def _upright(evidence: Evidence) -> list[Rotation]:
    """Of boxes that stand as the box around the outline does, seen from a little above."""
    angle = float(cv2.minAreaRect(evidence.outline.astype(np.float32))[2])
    roll = (angle + 45.0) % 90.0 - 45.0  # degrees, the nearest to upright
    return [
        Rotation.from_euler("yxz", [yaw, pitch, tilt], degrees=True)
        for tilt in {0.0, roll} for pitch in PITCHES for yaw in YAWS
    ]  # fmt: skip


def _between(one: Rotation, other: Rotation) -> float:
    """Radians between two frames of which any axis may be any."""
    apart = np.abs(one.as_matrix().T @ other.as_matrix())
    return float(np.arccos(np.clip(apart.max(0).min(), 0, 1)))


def _guess(turn: Rotation, evidence: Evidence) -> Build:
    """Boxes by how they differ (9,) from one that holds what is seen: turn, place, size."""
    axes = turn.as_matrix().T
    along = evidence.points @ axes.T
    low, high = np.percentile(along, ENDS, axis=0)
    # Of faces that are not seen nothing is known yet: no thinner than what is seen through.
    half = np.maximum(0.5 * (high - low), 0.06 * np.ptp(along, 0).max())
    towards = evidence.points.mean(0) / np.linalg.norm(evidence.points.mean(0))
    middle = 0.5 * (low + high)
    middle += np.where(high - low < 2 * half, np.sign(axes @ towards) * half, 0.0)
    away = float(np.linalg.norm(evidence.points.mean(0)))
    place, size = middle @ axes / away, np.log(half / away)

    def build(change: F64) -> Mesh:
        own = Rotation.from_rotvec(change[:3]).as_matrix() @ axes.T
        return box(away * (place + change[3:6]), own.T, away * np.exp(size + change[6:9]))

    return build
