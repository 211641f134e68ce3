"""The 3DGS .ply format, and the only place that knows how it stores values.

A file holds logarithms of scales, logits of opacities, and colours as coefficients of spherical
harmonics; `Gaussians` holds the values themselves. Degree 0 is written; of any degree the first
coefficient is read, which is the colour without its change with the view.
"""

from __future__ import annotations

import numpy as np

from ..gaussians import Gaussians

SH0 = 0.28209479177387814  # the constant spherical harmonic, 1 / (2 sqrt(pi))
LEAST_ALPHA = 1e-6  # a logit is infinite at 0 and 1
LEAST_SCALE = 1e-12  # a logarithm at 0
MAX_HEADER = 1 << 16  # bytes; the longest real header (degree 3) has 2 KB

TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8",
}  # fmt: skip

MEANS = ("x", "y", "z")
NORMALS = ("nx", "ny", "nz")  # written as 0: some readers expect them
COLORS = ("f_dc_0", "f_dc_1", "f_dc_2")
SCALES = ("scale_0", "scale_1", "scale_2")
QUATS = ("rot_0", "rot_1", "rot_2", "rot_3")  # wxyz
WRITTEN = (*MEANS, *NORMALS, *COLORS, "opacity", *SCALES, *QUATS)
READ = (*MEANS, *COLORS, "opacity", *SCALES, *QUATS)


class SplatFileError(ValueError):
    """The bytes are not a file of 3D Gaussians; one sentence."""


def encode_ply(gaussians: Gaussians) -> bytes:
    """Binary little-endian .ply file of the Gaussians, degree 0."""
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
    """The Gaussians of a .ply file, binary or text, its properties in any order.

    Properties and elements that are not a Gaussian's are ignored. Raises SplatFileError.
    """
    table = _vertices(data)
    missing = [name for name in READ if name not in table]
    if missing:
        raise SplatFileError(f"the .ply file holds no 3D Gaussians: {missing[0]} is missing")
    with np.errstate(over="ignore"):  # what overflows is refused below
        scales = np.exp(_stack(table, SCALES))
        opacities = 1 / (1 + np.exp(-table["opacity"].astype(np.float64)))
    quats = _stack(table, QUATS)
    lengths = np.linalg.norm(quats, axis=1, keepdims=True)
    upright = np.array([1.0, 0.0, 0.0, 0.0])
    quats = np.where(lengths == 0, upright, quats / np.where(lengths == 0, 1, lengths))
    colors = np.clip(0.5 + SH0 * _stack(table, COLORS), 0, 1)
    try:
        return Gaussians(
            *(
                part.astype(np.float32)
                for part in (_stack(table, MEANS), quats, scales, opacities, colors)
            )
        )
    except ValueError as error:
        raise SplatFileError(f"the .ply file is damaged: {error}") from error


def _stack(table: dict[str, np.ndarray], names: tuple[str, ...]) -> np.ndarray:
    """Columns (N, len(names)) f64."""
    return np.stack([table[name].astype(np.float64) for name in names], axis=1)


def _vertices(data: bytes) -> dict[str, np.ndarray]:
    """The columns (N,) of the element "vertex", by name."""
    kind, elements, start = _header(data)
    for name, count, properties in elements:
        has_lists = any(form == "list" for form, _ in properties)
        if has_lists or (name == "vertex" and len({p for _, p in properties}) < len(properties)):
            raise SplatFileError("the .ply file is a mesh or is damaged, not 3D Gaussians")
        if kind == "ascii":
            lines = data[start:].split(b"\n", count)
            if name == "vertex":
                return _text_columns(lines[:count], count, [p for _, p in properties])
            start += sum(len(line) + 1 for line in lines[:count])
            continue
        order = "<" if kind == "binary_little_endian" else ">"
        row = np.dtype([(p, order + form) for form, p in properties])
        if count * row.itemsize > len(data) - start:
            raise SplatFileError("the .ply file ends early")
        if name == "vertex":
            table = np.frombuffer(data, row, count, start)
            return {p: table[p] for _, p in properties}
        start += count * row.itemsize
    raise SplatFileError("the .ply file has no vertices")


def _header(data: bytes) -> tuple[str, list[tuple[str, int, list[tuple[str, str]]]], int]:
    """Format, elements (name, count, properties as (numpy type or "list", name)), data's offset."""
    if not data.startswith((b"ply\n", b"ply\r\n")):
        raise SplatFileError("the file is not a .ply file")
    end = data.find(b"end_header", 0, MAX_HEADER)
    start = data.find(b"\n", end) + 1
    if end < 0 or start == 0:
        raise SplatFileError("the .ply file's header does not end")
    kind, elements = "", []
    try:
        for line in data[:end].decode("ascii").splitlines()[1:]:
            match line.split():
                case ["format", kind, _] if kind in (
                    "ascii", "binary_little_endian", "binary_big_endian",
                ):  # fmt: skip
                    pass
                case ["element", name, count] if count.isdigit():
                    elements.append((name, int(count), []))
                case ["property", "list", _, _, name]:
                    elements[-1][2].append(("list", name))
                case ["property", form, name]:
                    elements[-1][2].append((TYPES[form], name))
                case [] | ["comment", *_] | ["obj_info", *_]:
                    pass
                case _:
                    raise ValueError(line)
    except (ValueError, KeyError, IndexError) as error:
        raise SplatFileError("the .ply file's header is damaged") from error
    return kind, elements, start


def _text_columns(lines: list[bytes], count: int, names: list[str]) -> dict[str, np.ndarray]:
    try:
        table = np.array([line.split() for line in lines], dtype=np.float64)
        table = table.reshape(count, len(names))
    except ValueError as error:
        raise SplatFileError("the .ply file is damaged or ends early") from error
    return {name: table[:, k] for k, name in enumerate(names)}
