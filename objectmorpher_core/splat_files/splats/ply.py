"""The 3DGS .ply format, and the only place that knows how it stores values.

A file holds logarithms of scales, logits of opacities, and colours as coefficients of spherical
harmonics; `Gaussians` holds the values themselves. Degree 0 is written; of any degree the first
coefficient is read, which is the colour averaged over all directions: what the photo shows of an
object wears the photo's own pixels, and the rest is seen from sides that the photo did not see,
so a colour evaluated for the photo's side would be wrong exactly where it is used.

Surfels (2DGS) have two scales: the third becomes FLATNESS of the smaller. A .ply that holds
points and nothing of a Gaussian becomes small splats, see `point_cloud.py`.
"""

from __future__ import annotations

import io
from typing import IO

import numpy as np

from ...base.arrays import F32
from ...document.gaussians import Gaussians
from ..limits import LEAST_SCALE, SplatFileError, check_count, empty_columns, mended
from .ply_table import Element, PlyHeader, Table, blocks, read_header

__all__ = ["SplatFileError", "decode_ply", "encode_ply", "read_ply"]

SH0 = 0.28209479177387814  # the constant spherical harmonic, 1 / (2 sqrt(pi))
LEAST_ALPHA = 1e-6  # a logit is infinite at 0 and 1
FLATNESS = 0.01  # x the smaller of a surfel's two scales

MEANS = ("x", "y", "z")
NORMALS = ("nx", "ny", "nz")  # written as 0: some readers expect them
COLORS = ("f_dc_0", "f_dc_1", "f_dc_2")
SCALES = ("scale_0", "scale_1", "scale_2")
QUATS = ("rot_0", "rot_1", "rot_2", "rot_3")  # wxyz
WRITTEN = (*MEANS, *NORMALS, *COLORS, "opacity", *SCALES, *QUATS)
SURFEL = (*MEANS, *COLORS, "opacity", *SCALES[:2], *QUATS)
READ = (*SURFEL, SCALES[2])


def encode_ply(gaussians: Gaussians) -> bytes:
    """Binary little-endian .ply file of the Gaussians, degree 0, axes as they are."""
    properties = "".join(f"property float {name}\n" for name in WRITTEN)
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(gaussians)}\n{properties}end_header\n"
    )
    alpha = np.clip(gaussians.opacities.astype(np.float64), LEAST_ALPHA, 1 - LEAST_ALPHA)
    columns = (
        gaussians.means,
        np.zeros_like(gaussians.means),
        (gaussians.colors.astype(np.float64) - 0.5) / SH0,
        np.log(alpha / (1 - alpha))[:, None],
        np.log(np.maximum(gaussians.scales.astype(np.float64), LEAST_SCALE)),
        gaussians.quats,
    )
    table = np.concatenate([column.astype("<f4") for column in columns], axis=1)
    return header.encode("ascii") + table.tobytes()


def decode_ply(data: bytes) -> Gaussians:
    """The Gaussians of a .ply file's bytes, binary or text, its properties in any order.

    Properties and elements that are not a Gaussian's are ignored. Raises SplatFileError.
    """
    stream = io.BytesIO(data)
    return read_ply(stream, read_header(stream), len(data))


def read_ply(stream: IO[bytes], header: PlyHeader, size: int) -> Gaussians:
    """The Gaussians of an open .ply file of `size` bytes. Raises SplatFileError."""
    vertex = header.element("vertex")
    if vertex is None:
        raise SplatFileError("the .ply file has no vertices")
    if is_mere_points(vertex):
        raise SplatFileError("the .ply file holds points or a mesh, not 3D Gaussians")
    missing = [name for name in SURFEL if name not in vertex.names]
    if missing:
        raise SplatFileError(f"the .ply file holds no 3D Gaussians: {missing[0]} is missing")
    check_count(vertex.count)
    rows, first = blocks(stream, header, "vertex", size), 0
    table = next(rows, None)  # before anything is allocated: the file is as long as it says
    columns = empty_columns(vertex.count)
    while table is not None:
        last = first + len(table["x"])
        _decode(table, tuple(column[first:last] for column in columns))
        first, table = last, next(rows, None)
    return mended(*columns)


def is_mere_points(vertex: Element) -> bool:
    """True where not one of a vertex's properties is a Gaussian's own."""
    return not set(vertex.names) & (set(READ) - set(MEANS))


def stack(table: Table, names: tuple[str, ...]) -> np.ndarray:
    """Columns (N, len(names)) f64."""
    return np.stack([table[name].astype(np.float64) for name in names], axis=1)


def _decode(table: Table, columns: tuple[F32, ...]) -> None:
    """Fills the rows of `columns` (see `empty_columns`) from the stored values."""
    means, quats, scales, opacities, colors = columns
    with np.errstate(over="ignore", invalid="ignore"):  # `mended` leaves out what overflows
        means[:] = stack(table, MEANS)
        quats[:] = stack(table, QUATS)
        if SCALES[2] in table:
            scales[:] = np.exp(stack(table, SCALES))
        else:
            scales[:, :2] = np.exp(stack(table, SCALES[:2]))
            scales[:, 2] = FLATNESS * scales[:, :2].min(1)
        opacities[:] = 1 / (1 + np.exp(-table["opacity"].astype(np.float64)))
        colors[:] = 0.5 + SH0 * stack(table, COLORS)
