"""Surfaces of revolution and ellipsoids that look like the photo.

The outline of an ellipsoid is an ellipse; that of a surface of revolution gives its profile, once
the axis is known: see `lathe`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial

import cv2
import numpy as np

from ...base.arrays import F64, Mask
from ...base.masks import largest_piece
from .evidence import HOPELESS, STRIDE, Evidence, Misfit, all_least, least
from .lathe import FINER, PLACES, Lathe, Profile, ways_of
from .solids import AROUND, FINE, Mesh, drawn, ellipsoid, tube

# A ring that looks like the photo: a round tube about an axis, as a doughnut, a tyre, a bracelet.
#
# What is seen of one is between two outlines, both nearly ellipses: the outer one's half axes are
# the sums of the ring's radius, foreshortened along one, and of the tube's; the hole's are the
# differences.

LEAST_HOLE = 0.01  # x the filled outline's area
CENTRAL = 0.35  # x the outline's half axis, that a hole's middle may be off
STEPS = np.array([0.03, 0.03, 0.1, 0.1, 0.05, 0.1, 0.2])  # of the numbers of a ring
NOTHING = np.zeros(len(STEPS))  # that it is off
TUBES = (0.2, 0.35, 0.5, 0.7)  # x a ring's radius, half of a tube's that are tried
FARTHEST = 250.0  # misfit, from which an outline is no ring's
HALF_MOMENT = 2.0  # standard deviations that an ellipse's half axis is


def fit_ring(evidence: Evidence) -> tuple[Mesh, Misfit] | None:
    """The best ring; None where nothing has a hole amid it."""
    found = _ellipses(evidence)
    if found is None:
        return None
    outer, hole = found
    half = outer[2]
    radius, thick = 0.5 * (half[0] + hole[0]), 0.5 * (half[0] - hole[0])
    sine = 0.5 * (half[1] + hole[1]) / radius
    starts = [_RingStart(evidence, outer, radius, thick, sine, sign) for sign in (1.0, -1.0)]
    return min((start.fit() for start in starts), key=lambda fit: fit[1].total)


def fit_closed_ring(evidence: Evidence, normal: F64) -> tuple[Mesh, Misfit] | None:
    """The best ring whose nearer side hides its hole; None where its outline is none's.

    `normal` (3,) roughly its axis, which an outline alone leaves two ways.
    """
    outer = _ellipse(_filled(evidence.fine) > 0, evidence)
    trials = []
    for share in TUBES:
        radius = outer[2][0] / (1 + share)
        sine = outer[2][1] / radius - share
        sides = [
            _RingStart(evidence, outer, radius, share * radius, sine, sign) for sign in (1.0, -1.0)
        ]
        start = max(sides, key=lambda side: abs(float(side.mesh().axes[0] @ normal)))
        trials.append((evidence.misfit(start.mesh()).total, start))
    cost, start = min(trials, key=lambda trial: trial[0])
    # It starts farther off than one whose hole is seen.
    return start.fit(4, HOPELESS) if cost < FARTHEST else None


@dataclass(frozen=True, eq=False)
class _RingStart:
    """A first guess at a ring, in tangents, from which it is fitted."""

    evidence: Evidence
    outer: Ellipse
    radius: float
    thick: float  # half of the tube's
    sine: float  # of its lean
    sign: float  # to which of the two sides it leans

    @cached_property
    def lean(self) -> float:
        """Radians between the ring's plane and the rays."""
        return float(np.arcsin(np.clip(self.sine, 0.1, 0.99)))

    @cached_property
    def depth(self) -> float:
        """Crop units from the camera, of its middle."""
        return float(np.median(self.evidence.depth[self.evidence.sure]))

    def mesh(self, numbers: F64 = NOTHING, around: int = AROUND) -> Mesh:
        """The ring that is off from it by `numbers`, as many as STEPS."""
        x, y, turn, more, wide, width, height = numbers
        middle, way, _ = self.outer
        centre = np.append(middle + self.radius * np.array([x, y]), 1.0)
        cosine, sine = np.cos(turn), np.sin(turn)
        along = np.array([[cosine, -sine], [sine, cosine]]) @ [-way[1], way[0]]
        forward = centre / np.linalg.norm(centre)
        flat = np.append(along, 0.0) - forward * (forward[:2] @ along)
        flat /= np.linalg.norm(flat)
        own = self.sign * (self.lean + more)
        axis = np.cos(own) * flat + np.sin(own) * forward
        sizes = self.depth * np.array([self.radius * np.exp(wide), self.thick * np.exp(width), 0.0])
        sizes[2] = sizes[1] * np.exp(height)
        return tube(self.depth * centre, axis, sizes, around)

    def fit(self, rounds: int = 2, hopeless: float = np.inf) -> tuple[Mesh, Misfit]:
        """The best ring near it; a misfit that stays `hopeless` is not made smaller."""

        def misfit(own: F64) -> Misfit:
            return self.evidence.misfit(self.mesh(own))

        best = NOTHING
        for _ in range(rounds):  # seven numbers take longer than the others' do
            best = least(lambda own: misfit(own).total, best, STEPS)
            if misfit(best).total > hopeless:
                break
        return self.mesh(best, FINE), misfit(best)


Ellipse = tuple[F64, F64, F64]  # middle (2,) tangents, unit long axis (2,), half axes (2,)


def _ellipses(evidence: Evidence) -> tuple[Ellipse, F64] | None:
    """Of the filled outline, and the half axes (2,) of its hole likewise; None without a hole."""
    filled = _filled(evidence.fine)
    _, pieces, stats, _ = cv2.connectedComponentsWithStats(filled - evidence.fine, connectivity=4)
    areas = np.asarray(stats)[1:, cv2.CC_STAT_AREA]
    if not len(areas) or areas.max() < LEAST_HOLE * filled.sum():
        return None
    outer, inner = (
        _ellipse(part, evidence)
        for part in (filled > 0, np.asarray(pieces) == 1 + int(np.argmax(areas)))
    )
    if np.linalg.norm(outer[0] - inner[0]) > CENTRAL * outer[2][1]:
        return None
    return outer, inner[2]


def _filled(fine: Mask) -> np.ndarray:
    """(s, s) u8 a mask (s, s) without its holes."""
    own = fine.astype(np.uint8)
    rings, _ = cv2.findContours(own, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return np.asarray(cv2.drawContours(np.zeros_like(own), rings, -1, 1, cv2.FILLED))


def _ellipse(part: Mask, evidence: Evidence) -> Ellipse:
    """The ellipse with the moments of a part (s, s) of the crop."""
    cells = np.argwhere(part)[:, ::-1].astype(np.float64)
    values, axes = np.linalg.eigh(np.cov((cells - cells.mean(0)).T))
    half = HALF_MOMENT * np.sqrt(np.maximum(values[::-1], 1e-9))
    step = evidence.grid.step / STRIDE
    middle = np.array(evidence.grid.start) + step * (cells.mean(0) - STRIDE // 2)
    return middle, axes[:, 1], step * half


LEANS = np.radians([4.0, 15.0, 28.0, 42.0, 58.0, 74.0])  # of the axis from the picture's plane
STEEPEST = 1.5  # radians, likewise
STEPPED = 0.3  # misfit that more places on the axis explain, where the profile has steps
SIMPLER = 1.0  # misfit that a radian of a profile's bend outweighs
ROUNDER = 0.5  # misfit that an ellipsoid outweighs, odd in depth by one of its steps
KEPT = 2  # leanings that are refined
CHANGES = np.array([0.15, 0.04, 0.03])  # how far off an axis may well be, as in `_changed`
LEAST_SHARE = 0.6  # of the mask, that is alike on both sides
CAPS = (-0.8, 0.0, 0.35, 1.0)  # height of the end that is seen, x its radius


def fit_ellipsoid(evidence: Evidence) -> tuple[Mesh, Misfit]:
    """Its outline is the ellipse of the mask; how deep it is the network says."""
    middle, axes, half, away = _moments(evidence)
    forward = middle / np.linalg.norm(middle)
    right = np.cross([0.0, 1.0, 0.0], forward)
    right /= np.linalg.norm(right)
    frame = np.column_stack([right, np.cross(forward, right), forward])
    spread = frame[:, :2] @ (axes * half)
    start = np.array([0.0, 0.0, 0.0, 0.0, 0.0, np.log(half.min()), 0.0, 0.0])
    steps = np.array([0.02, 0.02, 0.06, 0.06, 0.06, 0.3, 0.15 * half[0], 0.15 * half[1]])

    def build(numbers: F64, around: int = AROUND) -> Mesh:
        x, y, grow_a, grow_b, skew, deep, lean_a, lean_b = numbers
        flat = spread @ np.array([[np.exp(grow_a), skew], [skew, np.exp(grow_b)]])
        columns = np.column_stack(
            [flat + np.outer(forward, [lean_a, lean_b]), np.exp(deep) * forward]
        )
        return ellipsoid(middle + away * (frame[:, 0] * x + frame[:, 1] * y), columns, around)

    for _ in range(2):
        start[:4] += _wider(drawn(build(start), evidence.grid).near > 0, evidence, frame, axes)

    def cost(numbers: F64) -> float:
        odd = (((numbers - start) / steps)[5:] ** 2).sum()  # no ball, nor an egg that lies across
        return evidence.misfit(build(numbers)).total + ROUNDER * float(odd)

    best = all_least([cost], [start], steps)[0]
    return build(best, FINE), evidence.misfit(build(best))


def _wider(met: Mask, evidence: Evidence, frame: F64, axes: F64) -> F64:
    """(4,) how far an ellipse that is `met` (h, w) is to be moved and stretched onto the mask.

    Of what is near the circle that looks the largest is not the one in the middle.
    """
    if not met.any():
        return np.zeros(4)
    own, wanted = (_spread_of(evidence.grid.tangents[mask]) for mask in (met, evidence.mask))
    wide = [np.diag(axes.T @ spread @ axes) for spread in (wanted[1], own[1])]
    moved = frame[:2, :2].T @ (wanted[0] - own[0])
    return np.concatenate([moved, 0.5 * np.log(wide[0] / np.maximum(wide[1], 1e-12))])


def _spread_of(at: F64) -> tuple[F64, F64]:
    """Mean (2,) and covariance (2, 2) of places (n, 2)."""
    return at.mean(0), np.cov((at - at.mean(0)).T)


def _moments(evidence: Evidence) -> tuple[F64, F64, F64, float]:
    """Middle (3,), axes (2, 2) columns, half lengths (2,) and distance of the mask's ellipse."""
    mean, spread = _spread_of(evidence.grid.tangents[evidence.mask])
    values, axes = np.linalg.eigh(spread)
    depth = float(np.median(evidence.depth[evidence.sure])) + 0.0
    half = 2 * np.sqrt(np.maximum(values, 1e-12))
    away = depth * (1 + 0.5 * half.min())
    half, middle = away * half, away * np.append(mean, 1.0)
    return middle, axes, half, float(np.linalg.norm(middle))


def fit_revolution(
    evidence: Evidence, hopeless: float = np.inf
) -> tuple[Mesh, Misfit, float] | None:
    """The best of several axes and leanings, and the bend of its profile, radians.

    None where nothing is alike on both sides, or all cost more than is `hopeless` at first.
    """
    trials: list[tuple[float, Lathe, float]] = []
    for lathe in _lathes(evidence):
        for lean in np.concatenate([LEANS, -LEANS]):
            if (cost := _cost(lathe, lean, evidence, np.zeros(3))) < np.inf:
                trials.append((cost, lathe, lean))
    trials.sort(key=lambda trial: trial[0])
    kept = [trial for trial in trials[:KEPT] if trial[0] <= hopeless]
    if not kept:
        return None
    costs = [partial(_cost, lathe, lean, evidence) for _, lathe, lean in kept]
    numbers = all_least(costs, [np.zeros(3)] * len(costs), CHANGES)
    fits = [
        _ended(lathe, lean, own, evidence)
        for (_, lathe, lean), own in zip(kept, numbers, strict=True)
    ]
    return min(fits, key=lambda fit: fit[1].total + SIMPLER * fit[2])


def _changed(lathe: Lathe, lean: float, numbers: F64, places: int = PLACES) -> Profile | None:
    """With an axis that is off by `numbers` (3,): its leaning, angle, and place over its length."""
    own = float(np.clip(lean + numbers[0], -STEEPEST, STEEPEST))
    return lathe.profile(own, numbers[1:] * [1.0, lathe.high - lathe.low], places)


def _cost(lathe: Lathe, lean: float, evidence: Evidence, numbers: F64) -> float:
    profile = _changed(lathe, lean, numbers)
    if profile is None:
        return np.inf
    return evidence.misfit(profile.mesh()).total + SIMPLER * profile.bend


def _ended(
    lathe: Lathe, lean: float, numbers: F64, evidence: Evidence
) -> tuple[Mesh, Misfit, float]:
    """The profile with the end that fits best, of more places where these explain more."""
    profile, stepped = (_changed(lathe, lean, numbers, places) for places in FINER)
    assert profile is not None and stepped is not None, "its start was one"
    shapes = [profile.capped(cap) for cap in CAPS]
    fits = [evidence.misfit(shape.mesh()) for shape in shapes]
    best = int(np.argmin([fit.total for fit in fits]))
    shape, fit = shapes[best], fits[best]
    stepped = stepped.capped(CAPS[best])
    other = evidence.misfit(stepped.mesh())
    if other.total < fit.total - STEPPED:
        shape, fit = stepped, other
    return shape.mesh(FINE), fit, profile.bend


def _lathes(evidence: Evidence) -> list[Lathe]:
    """About the axes of the mask; what sticks out on one side only is left out."""
    at = evidence.grid.tangents
    mean = at[evidence.mask].mean(0)
    found: list[Lathe] = []
    for way in ways_of(evidence):
        middle = _axis_of(evidence.mask, at, mean, way)
        mirrored = largest_piece(_both_sides(evidence, middle, way))
        if mirrored.sum() < LEAST_SHARE * evidence.mask.sum():
            continue
        found.append(Lathe.of(evidence, middle, way))
    return found


def _axis_of(mask: Mask, at: F64, mean: F64, way: F64) -> F64:
    """(2,) a place on the line along `way` that halves most chords across it."""
    normal = np.array([-way[1], way[0]])
    along, across = (at[mask] - mean) @ way, (at[mask] - mean) @ normal
    bins = np.clip(((along - along.min()) / max(np.ptp(along), 1e-9) * 24).astype(int), 0, 23)
    middles, weights = [], []
    for k in range(24):
        own = across[bins == k]
        if len(own) > 2:
            middles.append(0.5 * (own.min() + own.max()))
            weights.append(np.ptp(own))
    order = np.argsort(middles)
    share = np.cumsum(np.array(weights)[order])
    return mean + normal * np.array(middles)[order][np.searchsorted(share, 0.5 * share[-1])]


def _both_sides(evidence: Evidence, middle: F64, way: F64) -> Mask:
    """(h, w) of the mask, whose mirror image about the axis is in it, too."""
    at = evidence.grid.tangents
    normal = np.array([-way[1], way[0]])
    image = at - 2 * ((at - middle) @ normal)[..., None] * normal
    cells = (image - evidence.grid.start) / evidence.grid.step
    j, i = np.moveaxis(np.rint(cells).astype(int), -1, 0)
    h, w = evidence.mask.shape
    inside = (i >= 0) & (i < h) & (j >= 0) & (j < w)
    return evidence.mask & inside & evidence.mask[i.clip(0, h - 1), j.clip(0, w - 1)]
