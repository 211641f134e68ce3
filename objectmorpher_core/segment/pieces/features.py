"""Features of a photo's pieces, and of their borders."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...base.arrays import F32, F64, frozen
from ...base.kernel_files import numba
from ...base.threads import in_threads

KEPT = 64  # dimensions of the tokens; the others of 384 hardly matter within one photo
REACH = 0.7  # cells, standard deviation of how far a token counts
LIKE_COLOR = 15.0  # CIELAB units within which a cell's token is trusted for a piece
DISTRUST = 0.02  # weight of a cell of another colour
LEAST_PLACES = 500  # for which a second thread is woken


@dataclass(frozen=True, eq=False)
class BorderLine:
    """Borders between neighbouring pieces."""

    left: np.ndarray  # (m,) the lower piece
    right: np.ndarray  # (m,) the higher one
    length: F64  # (m,) px
    slope: F64  # (m,) mean step of CIELAB across it


@dataclass(frozen=True, eq=False)
class Likeness:
    """Colours, CIELAB, by which a place trusts the cells around it."""

    colors: F64  # (n, 3) of the places
    cells: F32  # (h, w, 3) of the cells


def border_lines(labels: np.ndarray, lab: F32) -> BorderLine:
    """Return the border lines of labels (h, w) from 0, over a picture (h, w, 3)."""
    count = int(labels.max()) + 1
    keys, steps = [], []
    for a, b in ((np.s_[:, 1:], np.s_[:, :-1]), (np.s_[1:], np.s_[:-1])):
        is_border = labels[a] != labels[b]
        low = np.minimum(labels[a], labels[b])[is_border].astype(np.int64)
        keys.append(low * count + np.maximum(labels[a], labels[b])[is_border])
        steps.append(np.linalg.norm((lab[a] - lab[b])[is_border], axis=-1))
    unique, index, lengths = np.unique(
        np.concatenate(keys), return_inverse=True, return_counts=True
    )
    slope = np.bincount(index, np.concatenate(steps), len(unique)) / np.maximum(lengths, 1)
    return BorderLine(unique // count, unique % count, lengths.astype(np.float64), slope)


def main_directions(tokens: F32) -> F32:
    """(h, w, d) unit tokens: what sets a photo's tokens apart, in their KEPT main directions."""
    height, width, depth = tokens.shape
    flat = tokens.reshape(-1, depth).astype(np.float64)
    flat = _unit(flat - flat.mean(0))
    flat = flat - flat.mean(0)
    _, axes = np.linalg.eigh(flat.T @ flat)
    return _unit((flat @ axes[:, -KEPT:]).astype(np.float32)).reshape(height, width, -1)


def cell_size(tokens: F32, shape: tuple[int, int]) -> float:
    """px of the picture (h, w) that a token stands for, across."""
    return (shape[0] / tokens.shape[0] + shape[1] / tokens.shape[1]) / 2


def sample_tokens(
    tokens: F32, shape: tuple[int, int], places: tuple[F64, F64], like: Likeness | None = None
) -> F32:
    """(n, d) unit tokens at x, y px of the picture of (h, w) px.

    With `like`, cells of the place's own colour count most: the coarse tokens' outlines
    then follow the picture's (joint bilateral upsampling, Kopf et al. 2007).
    """
    rows, columns, _ = tokens.shape
    height, width = shape
    x = np.clip(places[0] * columns / width - 0.5, 0, columns - 1)
    y = np.clip(places[1] * rows / height - 0.5, 0, rows - 1)
    colors, cells = np.zeros((0, 3)), np.zeros((rows, columns, 3))
    if like is not None:
        colors, cells = like.colors, like.cells.astype(np.float64)
    mixed = np.zeros((len(x), tokens.shape[2]), np.float32)
    own, places = frozen(tokens), (frozen(x), frozen(y))
    trust = frozen(colors), frozen(cells)

    def run(first: int, last: int) -> None:
        _mix(own, *places, *trust, mixed, first, last)

    in_threads(run, len(x), least=LEAST_PLACES)
    return _unit(mixed)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _mix(
    tokens: F32, x: F64, y: F64, colors: F64, cells: F64, mixed: F32, first: int, last: int
) -> None:
    """Adds up the 4 x 4 cells around each place, `mixed` (n, d); no `colors`: all are trusted."""
    rows, columns, depth = tokens.shape
    for n in range(first, last):
        top, left = int(np.floor(y[n])) - 1, int(np.floor(x[n])) - 1
        for i in range(max(top, 0), min(top + 4, rows)):
            for j in range(max(left, 0), min(left + 4, columns)):
                far = (i - y[n]) ** 2 + (j - x[n]) ** 2
                weight = np.exp(-far / (2 * REACH**2))
                if len(colors):
                    apart = 0.0
                    for c in range(3):
                        apart += (colors[n, c] - cells[i, j, c]) ** 2
                    weight *= np.exp(-apart / (2 * LIKE_COLOR**2)) + DISTRUST
                single = np.float32(weight)
                for d in range(depth):
                    mixed[n, d] += single * tokens[i, j, d]


def crop_tokens(tokens: F32, photo: tuple[int, int], box: tuple[int, int, int, int]) -> F32:
    """(h, w, d) the tokens of a box (left, top, right, bottom px) of a photo of (H, W) px."""
    rows, columns, depth = tokens.shape
    down = max(1, round((box[3] - box[1]) * rows / photo[0] * 2))  # twice as dense: no new border
    across = max(1, round((box[2] - box[0]) * columns / photo[1] * 2))
    y = box[1] + (np.arange(down) + 0.5) * (box[3] - box[1]) / down
    x = box[0] + (np.arange(across) + 0.5) * (box[2] - box[0]) / across
    grid = np.meshgrid(x, y)
    flat = sample_tokens(tokens, photo, (grid[0].ravel(), grid[1].ravel()))
    return flat.reshape(down, across, depth)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-6)
