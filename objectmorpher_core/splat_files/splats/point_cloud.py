"""A .ply of points, with or without colours and normals, as small splats.

The starting point of a 3DGS training (COLMAP's points3D.ply) and a scanner's output are such
files. Each point becomes as large as the gap to its neighbours: round, or flat on its normal
where the file has normals.
"""

from __future__ import annotations

from typing import IO

import numpy as np

from ...base.arrays import F64
from ...base.rotations import quats_along
from ...document.gaussians import Gaussians
from ..limits import GREATEST, SplatFileError, check_count
from .ply_table import PlyHeader, blocks

NEIGHBOURS = 3  # as 3DGS starts its training (Kerbl et al. 2023)
SIZE = 0.6  # x mean distance to them: neighbours overlap without gaps
FLATNESS = 0.2  # x the size, across a surface
WIDEST = 10.0  # x median size: a stray point is no balloon
GREY = 0.5
COLORS = (("red", "green", "blue"), ("diffuse_red", "diffuse_green", "diffuse_blue"))
NORMALS = ("nx", "ny", "nz")


def read_points(stream: IO[bytes], header: PlyHeader, size: int) -> Gaussians:
    """Read one splat per point of an open .ply file of `size` bytes. Raises SplatFileError."""
    vertex = header.element("vertex")
    if vertex is None or not {"x", "y", "z"} <= set(vertex.names):
        raise SplatFileError("the .ply file holds no points: x, y or z is missing")
    check_count(vertex.count, "points")
    if not vertex.count:
        raise SplatFileError("the .ply file holds no points")
    names = next((names for names in COLORS if set(names) <= set(vertex.names)), None)
    scale = _color_scale(dict((name, form) for form, name in vertex.properties), names)
    points, colors, normals = [], [], []
    for table in blocks(stream, header, "vertex", size):
        at = np.stack([table[name].astype(np.float64) for name in "xyz"], axis=1)
        points.append(at)
        if names:
            block = np.stack([table[name].astype(np.float32) for name in names], axis=1)
            colors.append(np.clip(np.nan_to_num(block * scale), 0, 1).astype(np.float32))
        if set(NORMALS) <= set(vertex.names):
            normals.append(np.stack([table[n].astype(np.float64) for n in NORMALS], axis=1))
    cloud = np.concatenate(points)
    kept = (np.abs(cloud) <= GREATEST).all(1)  # NaN compares false
    if not kept.any():
        raise SplatFileError("none of the file's points has a finite position")
    shades = np.concatenate(colors) if colors else np.full((len(cloud), 3), GREY, np.float32)
    across = np.concatenate(normals)[kept] if normals else None
    return _splats(cloud[kept], shades[kept], across)


def _color_scale(forms: dict[str, str], names: tuple[str, ...] | None) -> np.float32:
    """What brings a stored colour to [0, 1]."""
    most = {"u1": 255.0, "u2": 65535.0}
    return np.float32(1 / most.get(forms[names[0]] if names else "", 1.0))


def _splats(points: F64, colors: np.ndarray, normals: F64 | None) -> Gaussians:
    from scipy.spatial import KDTree

    gaps = KDTree(points).query(points, k=min(NEIGHBOURS + 1, len(points)), workers=1)[0]
    gaps = gaps.reshape(len(points), -1)[:, 1:]
    sizes = SIZE * gaps.mean(1) if gaps.shape[1] else np.full(1, SIZE)
    positive = sizes[sizes > 0]
    usual = float(np.median(positive)) if len(positive) else 1.0
    sizes = np.clip(sizes, 0.05 * usual, WIDEST * usual)
    scales = np.repeat(sizes[:, None], 3, axis=1)
    quats = np.tile([1.0, 0.0, 0.0, 0.0], (len(points), 1))
    if normals is not None:
        lengths = np.linalg.norm(normals, axis=1)
        known = np.isfinite(lengths) & (lengths > 1e-12)
        quats[known] = quats_along(normals[known] / lengths[known, None])
        scales[known, 2] *= FLATNESS
    parts = (points, quats, scales, np.ones(len(points)), colors)
    return Gaussians(*(part.astype(np.float32) for part in parts))
