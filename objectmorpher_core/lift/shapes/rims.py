"""Circles along an outline: the rims of plates, saucers, bowls and cups, and where they lie.

A circle in perspective is an ellipse, and an ellipse is the picture of circles in two planes
(Forsyth et al., "Invariant descriptors for 3D object recognition and pose", 1991). The network
decides which of the two it is, and whether it is any: an egg's outline is an ellipse, too. Circles
about the same axis, as the lip of a cup above its saucer, share the plane's normal.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from ...base.arrays import F32, F64, Mask, Pixels
from ...base.camera import Camera
from ...pictures.image import to_u8
from ..relief.shape_look import SeenShape
from .evidence import OUTLINE_ERROR, STRIDE, Evidence

PLACES = 240  # of an outline, that are looked at
TRIALS = 400  # ellipses through five of them
LEAST_ARC = 0.5  # x the outline, that lies on the first ellipse
LEAST_FURTHER = 0.1  # x the outline, that lies on a further one
HELD = 0.97  # x an ellipse's area, that is within the mask
SEEN_LEAN = 0.35  # x a rim's own slope, that the network sees of it
HANGING = 0.2  # cosine of a rim's normal to the picture's upright, below which it does not lie
LEVEL = 0.25  # slope, below which a rim may as well face the camera
SIZE = 100  # px, a lip's radius in the picture in which it is looked for
# How far off it may be, x its radius, how much wider and how much more tilted.
FREE = 0.3, 0.3, 0.25, 0.12, 0.12
USUAL = 0.05  # x an edge all around: what it has to gain from each of them
EDGES = 0.08, 0.05, 0.03, 0.02, 0.012  # x its radius, how wide an edge is; finer each time
AROUND = 60  # places of a lip that are looked at
TRIED, FINER = 5, 0.6  # values of each number, and how much nearer they lie the next time
EDGE = 20.0  # levels per px, of an edge that counts by half
HEIGHTS, RADII = (0.05, 1.6), (0.2, 1.05)  # x the first radius, of a further circle
STEPS, ROUNDS = 25, 4  # of each, and how often they are made finer
NEAREST = 0.1  # x the first circle's depth, that a further one is from the camera at least
FRAME = 2.0  # px from the photo's frame, where an outline is its cut and no outline


@dataclass(frozen=True, eq=False)
class Rim:
    """A circle in camera axes; its scale is free."""

    centre: F64  # (3,)
    normal: F64  # (3,) unit, towards the camera
    radius: float

    def depth(self, tangents: F64) -> F64:
        """(...) depth of the circle's plane along rays with the tangents (..., 2)."""
        across = tangents @ self.normal[:2] + self.normal[2]
        return float(self.normal @ self.centre) / np.minimum(across, -1e-3)

    def outside(self, tangents: F64) -> F64:
        """(...) how far beyond the circle rays meet its plane, tangents at its own depth."""
        depth = self.depth(tangents)
        places = np.concatenate([tangents, np.ones((*tangents.shape[:-1], 1))], -1)
        away = np.linalg.norm(places * depth[..., None] - self.centre, axis=-1)
        return (away - self.radius) / self.centre[2]

    @property
    def up(self) -> F64 | None:
        """(3,) what is up where it lies; None for one that hangs, or is seen from below."""
        return self.normal if self.normal[1] < -HANGING else None

    @property
    def is_steep(self) -> bool:
        """Whether its plane turns away from the camera's."""
        return float(np.linalg.norm(self.slope)) >= LEVEL

    @property
    def slope(self) -> F64:
        """(2,) what the logarithm of the plane's depth grows by, per tangent."""
        return -self.normal[:2] * self.centre[2] / float(self.normal @ self.centre)


def rims_of(seen: SeenShape, camera: Camera) -> list[Rim]:
    """The circle on which most of an outline lies, and a smaller one before it; none elsewhere."""
    evidence = Evidence.of(seen)
    ring = evidence.outline
    ring = ring[_within(ring, camera)]
    if len(ring) < PLACES:
        return []
    ring = ring[np.linspace(0, len(ring), PLACES, endpoint=False).astype(int)]
    error = OUTLINE_ERROR * evidence.extent * evidence.grid.step / STRIDE
    conic, is_on = _ellipse(ring, error)
    if is_on.mean() < LEAST_ARC:
        return []
    first = max(_circles(conic), key=lambda rim: _seen_lean(rim, evidence), default=None)
    if first is None or _held(first, evidence, camera) < HELD:
        return []
    lean = _seen_lean(first, evidence)
    further = _further(first, ring[~is_on], error)
    if further is not None and lean > 0 and _held(further, evidence, camera) > HELD:
        return [first, further]  # an egg has none
    return [first] if lean >= SEEN_LEAN else []


def _within(tangents: F64, camera: Camera) -> Mask:
    """(...) whether rays with the tangents (..., 2) are seen, apart from the photo's frame."""
    at = tangents * camera.focal + [camera.cx, camera.cy]
    is_in = (at > FRAME) & (at < [camera.width - FRAME, camera.height - FRAME])
    return np.asarray(is_in.all(-1), bool)


def _ellipse(ring: F64, error: float) -> tuple[F64, Mask]:
    """A conic (3, 3) on which most places of a ring (n, 2) lie, and which (n,) do."""
    rng = np.random.default_rng(0)
    middle, size = ring.mean(0), float(np.ptp(ring, 0).max())
    own = (ring - middle) / size
    terms = _terms(own)
    chosen = np.argsort(rng.random((TRIALS, len(ring))), 1)[:, :5]
    conics = np.linalg.svd(terms[chosen])[2][:, -1]
    counts = [_is_on(conic, own, error / size).sum() for conic in conics]
    conic = conics[int(np.argmax(counts))]
    for _ in range(4):
        is_on = _is_on(conic, own, error / size)
        if is_on.sum() < 6:
            break
        conic = np.linalg.svd(terms[is_on], full_matrices=False)[2][-1]
    is_on = _is_on(conic, own, error / size)
    into = np.array([[1 / size, 0, -middle[0] / size], [0, 1 / size, -middle[1] / size], [0, 0, 1]])
    return into.T @ _matrix(conic) @ into, is_on


def _terms(own: F64) -> F64:
    x, y = own.T
    return np.column_stack([x * x, x * y, y * y, x, y, np.ones(len(x))])


def _matrix(conic: F64) -> F64:
    a, b, c, d, e, f = conic
    return np.array([[a, b / 2, d / 2], [b / 2, c, e / 2], [d / 2, e / 2, f]])


def _is_on(conic: F64, own: F64, error: float) -> Mask:
    """(n,) of an ellipse, whose distance is to first order; nothing is on another conic."""
    matrix = _matrix(conic)
    if np.linalg.det(matrix[:2, :2]) <= 0:
        return np.zeros(len(own), bool)
    places = np.column_stack([own, np.ones(len(own))]) @ matrix
    value = (places[:, :2] * own).sum(1) + places[:, 2]
    gradient = 2 * np.linalg.norm(places[:, :2], axis=1)
    return np.abs(value) < error * np.maximum(gradient, 1e-9)


def _circles(conic: F64) -> list[Rim]:
    """The two circles, about one unit away, whose picture is a conic (3, 3)."""
    values, axes = np.linalg.eigh(conic)
    if values[1] < 0:  # two of one sign and one of the other
        values, axes = -values[::-1], axes[:, ::-1]
    low, middle, high = values
    if not low < 0 < middle:
        return []
    sine, cosine = (np.sqrt(part / (high - low)) for part in (high - middle, middle - low))
    found = []
    for sign in (1.0, -1.0):
        normal = sine * axes[:, 2] + sign * cosine * axes[:, 0]
        centre = np.linalg.solve(conic, normal)
        if abs(centre[2]) < 1e-9:
            continue
        centre = centre / centre[2]
        normal = normal * -np.sign(normal @ centre)
        rim = Rim(centre, normal, 0.0)
        # A place of the conic gives the radius: where it is crossed level with the middle.
        a, b, c = conic[0, 0], 2 * (conic[0, 1] * centre[1] + conic[0, 2]), 0.0
        c = conic[1, 1] * centre[1] ** 2 + 2 * conic[1, 2] * centre[1] + conic[2, 2]
        root = np.sqrt(max(b * b - 4 * a * c, 0.0))
        place = np.array([(-b + root) / (2 * a), centre[1]])
        found.append(replace(rim, radius=float(rim.outside(place) * centre[2])))
    return found


def _seen_lean(rim: Rim, evidence: Evidence) -> float:
    """How much of a rim's slope the network sees of what is within it."""
    own = evidence.sure & (rim.outside(evidence.grid.tangents) < 0)
    if own.sum() < 12 or not rim.is_steep:
        return SEEN_LEAN if own.sum() >= 12 else 0.0
    at = np.column_stack([evidence.grid.tangents[own], np.ones(own.sum())])
    slope = np.linalg.lstsq(at, np.log(evidence.depth[own]))[0][:2]
    return float(slope @ rim.slope / (rim.slope @ rim.slope))


def _held(rim: Rim, evidence: Evidence, camera: Camera) -> float:
    """The share of a rim's picture that is the object."""
    tangents = evidence.grid.tangents
    own = (rim.outside(tangents) < 0) & _within(tangents, camera)
    return float(evidence.mask[own].mean()) if own.any() else 0.0


def _further(first: Rim, rest: F64, error: float) -> Rim | None:
    """The circle about the same axis, nearer, on which most of the rest (n, 2) lies."""
    if len(rest) < LEAST_FURTHER * PLACES:
        return None
    spans = [np.array(HEIGHTS), np.array(RADII)]
    best, most = None, 0.0
    for _ in range(ROUNDS):
        heights, radii = (np.linspace(span[0], span[1], STEPS) for span in spans)
        for height in heights:
            centre = first.centre + height * first.radius * first.normal
            if centre[2] - RADII[1] * first.radius < NEAREST:
                continue
            away = Rim(centre, first.normal, 0.0).outside(rest) * centre[2]
            off = (away[:, None] - radii * first.radius) / (error * centre[2])
            scores = (1 / (1 + off**2)).sum(0)
            if scores.max() > most:
                most, k = float(scores.max()), int(scores.argmax())
                best = np.array([height, radii[k]])
        if best is None:
            return None
        spans = [
            value + np.array([-2, 2]) * np.ptp(span) / STEPS
            for value, span in zip(best, spans, strict=True)
        ]
    assert best is not None, "it was found in the first round"
    rim = Rim(
        first.centre + best[0] * first.radius * first.normal, first.normal, best[1] * first.radius
    )
    is_on = np.abs(rim.outside(rest)) < 2 * error
    return rim if is_on.sum() >= LEAST_FURTHER * PLACES else None


def at_edge(first: Rim, lip: Rim, pixels: Pixels, mask: Mask, camera: Camera) -> Rim:
    """`lip` where the photo's edges are, of the object `mask` (H, W), and nearest to the axis.

    Of a lip the outline shows an arc only, and a cup stands hardly ever amid its saucer.
    """
    edges, corner, scale = _edges_around(lip, pixels, mask, camera)
    most = np.array(edges.shape[::-1]) - 1
    flat = np.cross(lip.normal, [0.0, 0.0, 1.0])
    lean = float(np.linalg.norm(flat))
    across = flat / lean if lean > 1e-9 else np.array([1.0, 0.0, 0.0])
    down = np.cross(lip.normal, across)
    turn = 2 * np.pi * np.arange(AROUND) / AROUND
    ring = np.stack([np.cos(turn), np.sin(turn)])
    still = np.array([0.0, 0.0, 1.0, 0.0, 0.0])
    best, spans = still, np.array(FREE)
    for width in EDGES:
        blurred = cv2.GaussianBlur(edges, (0, 0), width * SIZE)
        steps = best[:, None] + spans[:, None] * np.linspace(-1, 1, TRIED)
        trials = np.stack(np.meshgrid(*steps, indexing="ij"), -1).reshape(-1, 5)
        aside, below, wider, *tilt = trials.T
        # A circle that tilts moves along the normal.
        places = np.stack([aside[:, None] + wider[:, None] * ring[0],
                           below[:, None] + wider[:, None] * ring[1],
                           wider[:, None] * -(np.stack(tilt, 1) @ ring)], -1)  # fmt: skip
        places = lip.centre + lip.radius * (places @ np.stack([across, down, lip.normal]))
        at = places[..., :2] / places[..., 2:] * camera.focal + [camera.cx, camera.cy]
        at = np.floor((at - corner) * scale).astype(int).clip(0, most)
        seen = blurred[at[..., 1], at[..., 0]].mean(1)
        likely = seen - USUAL * (((trials - still) / FREE) ** 2).sum(1)
        best = trials[int(np.argmax(likely))]
        spans = FINER * spans
    centre = lip.centre + lip.radius * (best[0] * across + best[1] * down)
    normal = lip.normal + best[3] * across + best[4] * down
    normal /= np.linalg.norm(normal)
    # So it looks from wherever it is along its rays: nearest to the first one's axis.
    off, own = first.centre, centre
    off, own = (part - part @ first.normal * first.normal for part in (off, own))
    away = float(off @ own / max(own @ own, 1e-12))
    return Rim(away * centre, normal, away * lip.radius * float(best[2]))


def _edges_around(lip: Rim, pixels: Pixels, mask: Mask, camera: Camera) -> tuple[F32, F64, float]:
    """Edges of the object in [0, 1] around a lip of at most SIZE px; where, and how large.

    A px (2,) of the photo is at (px - corner (2,)) x scale of that picture.
    """
    size = lip.radius * camera.focal / lip.centre[2]
    scale = min(SIZE / size, 1.0)
    reach, blur = 2.0 * size, 0.5 / scale  # px of the photo
    corner = lip.centre[:2] / lip.centre[2] * camera.focal + [camera.cx, camera.cy] - reach
    # Only what is near is blurred: a photo may have a hundred megapixels.
    margin = 4.0 * blur + 2.0
    low = np.clip(np.floor(corner - margin), 0, [camera.width - 1, camera.height - 1])
    high = np.clip(np.ceil(corner + 2 * reach + margin), low + 1, [camera.width, camera.height])
    (x0, y0), (x1, y1) = low.astype(int), high.astype(int)
    (left, top), wide = scale * (low + 0.5 - corner) - 0.5, (max(int(2 * reach * scale), 1),) * 2
    warp = np.array([[scale, 0, left], [0, scale, top]])
    how = cv2.INTER_AREA if scale == 1 else cv2.INTER_LINEAR
    smooth = cv2.GaussianBlur(to_u8(pixels[y0:y1, x0:x1]), (0, 0), blur)
    shown = cv2.warpAffine(smooth, warp, wide, flags=how, borderMode=cv2.BORDER_REPLICATE)
    own = cv2.warpAffine(mask[y0:y1, x0:x1].astype(np.uint8), warp, wide)
    outline = cv2.morphologyEx(own, cv2.MORPH_GRADIENT, np.ones((3, 3)))
    return np.maximum(_edges(shown) * own, outline.astype(np.float32)), corner, scale


def _edges(picture: np.ndarray) -> F32:
    """(h, w) in [0, 1] how much colours (h, w, 3) u8 change there."""
    levels = picture.astype(np.float32)
    x, y = (cv2.Sobel(levels, cv2.CV_32F, *way) / 8 for way in ((1, 0), (0, 1)))
    strong = np.sqrt((x * x + y * y).sum(-1))
    return np.asarray(strong / (strong + EDGE), np.float32)
