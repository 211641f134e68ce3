"""A photo as some thousand pieces that keep to its edges, and the regions that grow from a click.

Pieces are SLIC superpixels (Achanta et al. 2012). A random walk with restart (Grady 2006) over
their graph visits what belongs together with a click first: the sets of the k most visited pieces,
for every k, are nested outlines around the click, of which one with much contrast is an object.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import scipy.sparse as sparse
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from ...base.arrays import F32, F64, RGB, Mask, Sparse
from .features import BorderLine, Likeness, border_lines, cell_size, sample_tokens

WORK_AREA = 280_000  # px of the reduced photo that is cut into pieces
PIECES = 3000
SMALLEST_STEP = 4  # px of the reduced photo between pieces
RULER = 12.0  # how much SLIC keeps pieces compact
TEMPERATURE = 0.03  # of 1 - cosine between tokens
COLOR_TEMPERATURE = 12.0  # CIELAB units
COLOR_ALONE_TEMPERATURE = 4.0  # the same, where there are no tokens
COLOR_WORTH = 0.25  # gap of two colours far apart, in 1 - cosine of tokens
COLOR_STEP = 25.0  # CIELAB units that make most of that gap
STAMINA = 0.999  # the chance that a walk goes on, in the pieces of a photo
SPAN = 1.15  # x area: a region has the most contrast among those of about its size


@dataclass(frozen=True, eq=False)
class Growth:
    """Nested regions: the first k + 1 of `order`, for each k."""

    order: np.ndarray  # (m,) pieces
    area: F64  # (m,) px of each region
    contrast: F64  # (m,) mean gap across its outline; 0 where it has none
    is_closed: Mask  # (m,) it has no outline: all that can be reached

    def peaks(self) -> list[int]:
        """The k whose regions have more contrast than all of about their size."""
        size = np.log(self.area)
        low = np.searchsorted(size, size - np.log(SPAN))
        high = np.searchsorted(size, size + np.log(SPAN), side="right")
        # `reduceat` takes each window's largest, and what lies between two windows in vain.
        windows = np.column_stack([low, high]).ravel()
        highest = np.maximum.reduceat(np.append(self.contrast, -np.inf), windows)[::2]
        return [int(k) for k in np.flatnonzero(self.contrast >= highest - 1e-12)]


class Pieces:
    """Precomputed for a photo (H, W, 3) and its tokens (h, w, d), if any: about `count` pieces.

    A walk goes as far as among pieces of the side `like` px, where that is given. `photo_shape`
    (H, W) is the photo's own, where `rgb` is a smaller picture of it.
    """

    _stamina = STAMINA

    def __init__(
        self,
        rgb: RGB,
        tokens: F32 | None,
        count: int = PIECES,
        like: float | None = None,
        photo_shape: tuple[int, int] | None = None,
    ) -> None:
        self.photo_shape = photo_shape or rgb.shape[:2]
        image = reduced(rgb)
        self.shape = height, width = image.shape[:2]
        lab = np.asarray(
            cv2.cvtColor(image.astype(np.float32) / 255, cv2.COLOR_RGB2LAB), np.float32
        )
        self.labels = _superpixels(image, count)  # (h, w) int32
        self._sparse = np.ascontiguousarray(self.labels[::2, ::2])
        self.count = int(self.labels.max()) + 1
        self.area = np.bincount(self.labels.ravel(), minlength=self.count).astype(np.float64)
        self.colors = np.stack([self.mean(lab[..., c]) for c in range(3)], 1)  # (n, 3) CIELAB
        rows, columns = np.mgrid[:height, :width]
        self.centres = np.stack([self.mean(columns), self.mean(rows)], 1) + 0.5  # (n, 2) px
        lines = border_lines(self.labels, lab)
        self._measure(lines, lab, tokens)
        frame = np.concatenate([self.labels[[0, -1]].ravel(), self.labels[:, [0, -1]].ravel()])
        self.frame = np.bincount(frame, minlength=self.count) / frame.size  # share of the frame
        self.side = float(self.area.mean() ** 0.5)  # px of the reduced photo, of a piece
        if like is not None:  # the square of how far a walk goes grows with its steps
            self._stamina = 1 - (1 - STAMINA) * (self.side / like) ** 2
        self._solver: Any = None

    def _measure(self, lines: BorderLine, lab: F32, tokens: F32 | None) -> None:
        """What parts neighbours (`gap`), and how easily a walk passes (`_links`)."""
        self.left, self.right, self.length = lines.left, lines.right, lines.length
        apart = np.linalg.norm(self.colors[self.left] - self.colors[self.right], axis=1)
        color = 0.5 * apart + np.minimum(lines.slope, 30.0)
        worth = 1 - np.exp(-color / COLOR_STEP)
        if tokens is None:
            self.features = np.asarray(self.colors / COLOR_STEP, np.float32)
            self.gap = worth
            ease = np.exp(-color / COLOR_ALONE_TEMPERATURE)
        else:
            x, y = self.centres.T
            size = (tokens.shape[1], tokens.shape[0])
            cells = np.asarray(cv2.resize(lab, size, interpolation=cv2.INTER_AREA), np.float32)
            like = Likeness(self.colors, cells)
            self.features = sample_tokens(tokens, self.shape, (x, y), like)
            near = _cosine_gap(self.features[self.left], self.features[self.right])
            step = self.centres[self.right] - self.centres[self.left]
            half_cell = 0.5 * cell_size(tokens, self.shape)
            step *= half_cell / np.linalg.norm(step, axis=1, keepdims=True)
            before, after = self.centres[self.left] - step, self.centres[self.right] + step
            # Tokens are coarse: what a border parts shows better half a cell beyond it.
            far = _cosine_gap(
                sample_tokens(tokens, self.shape, (before[:, 0], before[:, 1])),
                sample_tokens(tokens, self.shape, (after[:, 0], after[:, 1])),
            )
            self.gap = 0.5 * near + 0.5 * np.maximum(near, far) + COLOR_WORTH * worth
            ease = np.exp(-near / TEMPERATURE - color / COLOR_TEMPERATURE)
        weights = ease * np.sqrt(self.length / self.area.mean() ** 0.5) + 1e-9
        half = sparse.coo_matrix((weights, (self.left, self.right)), (self.count, self.count))
        self._links = (half + half.T).tocsr()
        self._links.sort_indices()
        self._degrees = np.asarray(self._links.sum(1)).ravel()

    def __getstate__(self) -> dict[str, object]:
        return {**self.__dict__, "_solver": None}  # a factorisation cannot be pickled

    def rehearse(self) -> None:
        """Gets ready what all clicks need, so that the first one does not wait for it."""
        self.grow(0).peaks()
        everywhere = np.ones(self.count, bool)
        self.reached(everywhere, everywhere)

    # Between photo and pieces

    def at(self, x: float, y: float) -> int:
        """The piece under x, y px of the photo."""
        column, row = self.pixel(x, y)
        return int(self.labels[row, column])

    def pixel(self, x: float, y: float) -> tuple[int, int]:
        """Column and row of the reduced photo under x, y px of the photo."""
        (height, width), (tall, wide) = self.shape, self.photo_shape
        return min(int(x * width / wide), width - 1), min(int(y * height / tall), height - 1)

    def mean(self, image: np.ndarray) -> F64:
        """(n,) means of an image (h, w) of the reduced photo's size."""
        total = np.bincount(self.labels.ravel(), image.ravel().astype(np.float64), self.count)
        return total / self.area

    def paint(self, mask: Mask) -> Mask:
        """(h, w) the pixels of the pieces (n,) in `mask`."""
        return mask[self.labels]

    def paint_sparsely(self, mask: Mask) -> Mask:
        """(h / 2, w / 2), rounded up: every second pixel of every second row of `paint`."""
        return mask[self._sparse]

    def share(self, mask: Mask) -> float:
        """Return the share of the photo, in [0, 1]."""
        return float(self.area[mask].sum() / self.area.sum())

    # Regions

    def contrast(self, mask: Mask) -> float:
        """Mean gap across the outline of the pieces (n,); the photo's frame does not count."""
        cut = mask[self.left] != mask[self.right]
        return float((self.gap * self.length)[cut].sum() / max(self.length[cut].sum(), 1e-9))

    def grow(self, piece: int, allowed: Mask | None = None, walls: tuple[int, ...] = ()) -> Growth:
        """Regions around `piece` within the pieces `allowed` (n,), never on one of `walls`.

        Contrast counts only between allowed pieces.
        """
        start = np.zeros(self.count)
        start[piece] = 1
        if allowed is None and not walls:
            visits, reached = self._open().solve(start), np.ones(self.count, bool)
            allowed = reached
        else:
            allowed = np.ones(self.count, bool) if allowed is None else allowed
            visits, reached = self._visits_within(start, allowed, walls)
        order = np.argsort(-np.where(reached, visits, -1.0), kind="stable")[: reached.sum()]
        return self._growth(order, allowed)

    def settle(self, is_object: Mask, is_ground: Mask) -> F64:
        """(n,) chance that a walk from a piece meets the object before the ground, both (n,)."""
        unsure = np.full(self.count, 0.5e-9)
        to_object, to_ground = (
            np.asarray(1e6 * there + unsure, np.float64)
            for there in (is_object, is_ground & ~is_object)
        )
        return self.walk_home(to_object, to_ground)

    def walk_home(self, to_object: F64, to_ground: F64) -> F64:
        """(n,) chance that a walk ends in the object; how easily it does, and in the ground (n,).

        Both as the ease with which it passes on to a neighbour: at most about 1.
        """
        system = sparse.diags(self._degrees + to_object + to_ground) - self._links
        return _factored(system).solve(to_object)

    def reached(self, allowed: Mask, start: Mask) -> Mask:
        """(n,) the connected sets of pieces in `allowed` (n,) that hold one of `start` (n,)."""
        _, sets = connected_components(self._links[allowed][:, allowed], directed=False)
        found = np.zeros(self.count, bool)
        found[allowed] = np.isin(sets, sets[start[allowed]])
        return found

    def _open(self) -> Any:
        if self._solver is None:
            everywhere = np.ones(self.count, bool)
            self._solver = self._restarting(everywhere, everywhere)
        return self._solver

    def _restarting(self, allowed: Mask, free: Mask) -> Any:
        """The system (f, f) of a walk among `free` pieces that ends on others that are `allowed`.

        Both are (n,), and all that is free is allowed.
        """
        degrees = self._links[free] @ allowed.astype(np.float64)
        return _factored(sparse.diags(degrees + 1e-9) - self._stamina * self._links[free][:, free])

    def _visits_within(self, start: F64, allowed: Mask, walls: tuple[int, ...]) -> tuple[F64, Mask]:
        """(n,) how often each allowed piece is visited by a walk that ends at a wall; reached."""
        is_free = allowed.copy()
        is_free[list(walls)] = False
        visits = np.zeros(self.count)
        visits[is_free] = self._restarting(allowed, is_free).solve(start[is_free])
        return visits, self.reached(is_free, start > 0)

    def _growth(self, order: np.ndarray, allowed: Mask) -> Growth:
        rank = np.full(self.count, len(order))
        rank[order] = np.arange(len(order))
        first = np.minimum(rank[self.left], rank[self.right])
        last = np.maximum(rank[self.left], rank[self.right])
        counts = allowed[self.left] & allowed[self.right] & (first < last)

        def total(values: F64) -> F64:
            """Return the sum over the borders along each region's outline."""
            size = len(order) + 1
            begins = np.bincount(first[counts], values[counts], size)
            ends = np.bincount(last[counts], values[counts], size)
            return np.cumsum(begins - ends, dtype=np.float64)[:-1]

        length = total(self.length)
        is_closed = length < 0.5
        contrast = total(self.length * self.gap) / np.maximum(length, 0.5)
        area = np.cumsum(self.area[order])
        return Growth(order, area, np.where(is_closed, 0.0, contrast), is_closed)

    def region(self, growth: Growth, k: int) -> Mask:
        """(n,) the first k + 1 pieces of a growth."""
        mask = np.zeros(self.count, bool)
        mask[growth.order[: k + 1]] = True
        return mask


def reduced(rgb: RGB) -> RGB:
    """The photo (H, W, 3) at the size at which it is cut into pieces."""
    height, width = rgb.shape[:2]
    scale = min(1.0, (WORK_AREA / (height * width)) ** 0.5)
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    if size == (width, height):
        return rgb
    return np.asarray(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA), np.uint8)


def _superpixels(image: RGB, count: int) -> np.ndarray:
    """(h, w) int32 labels from 0, of about `count` pieces."""
    height, width = image.shape[:2]
    step = max(SMALLEST_STEP, round((height * width / count) ** 0.5))
    if min(height, width) < 2 * step:  # too small for SLIC: squares
        rows, columns = np.mgrid[:height, :width] // SMALLEST_STEP
        return np.asarray(rows * (columns.max() + 1) + columns, np.int32)
    lab = cv2.cvtColor(image, cv2.COLOR_RGB2LAB)
    slic = cv2.ximgproc.createSuperpixelSLIC(lab, cv2.ximgproc.SLIC, step, RULER)
    slic.iterate(5)
    slic.enforceLabelConnectivity(20)
    _, labels = np.unique(slic.getLabels(), return_inverse=True)
    return labels.reshape(height, width).astype(np.int32)


def _factored(system: Sparse) -> Any:
    """A symmetric matrix in which every diagonal outweighs its row: no pivots are looked for.

    1.5 times as fast as SuperLU's general way, with half as many entries to solve with.
    """
    return splu(
        system.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )  # fmt: skip


def _cosine_gap(a: F32, b: F32) -> F64:
    return 0.5 * np.square(a - b).sum(-1, dtype=np.float64)
