"""What pieces of a photo are like, and what runs along their borders."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse

from ..arrays import F32, F64

KEPT = 64  # dimensions of the tokens; the others of 384 hardly matter within one photo
REACH = 0.7  # cells, standard deviation of how far a token counts
LIKE_COLOR = 15.0  # CIELAB units within which a cell's token is trusted for a piece
DISTRUST = 0.02  # weight of a cell of another colour


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
    """Those of labels (h, w) from 0, over a picture (h, w, 3)."""
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
    rows, columns, depth = tokens.shape
    height, width = shape
    x = np.clip(places[0] * columns / width - 0.5, 0, columns - 1)
    y = np.clip(places[1] * rows / height - 0.5, 0, rows - 1)
    index, weight = [], []
    for dy in (-1, 0, 1, 2):
        for dx in (-1, 0, 1, 2):
            i, j = np.floor(y).astype(int) + dy, np.floor(x).astype(int) + dx
            is_inside = (i >= 0) & (j >= 0) & (i < rows) & (j < columns)
            cell = np.clip(i, 0, rows - 1) * columns + np.clip(j, 0, columns - 1)
            near = np.exp(-((i - y) ** 2 + (j - x) ** 2) / (2 * REACH**2)) * is_inside
            if like is not None:
                apart = np.square(like.colors - like.cells.reshape(-1, 3)[cell]).sum(1)
                near *= np.exp(-apart / (2 * LIKE_COLOR**2)) + DISTRUST
            index.append(cell)
            weight.append(near)
    places_of = np.tile(np.arange(len(x)), len(index))
    entries = (np.concatenate(weight), (places_of, np.concatenate(index)))
    mixing = sparse.csr_matrix(entries, (len(x), rows * columns)).astype(np.float32)
    return _unit(np.asarray(mixing @ tokens.reshape(-1, depth), np.float32))


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
