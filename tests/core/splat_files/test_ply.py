"""3DGS files: our Gaussians come back, and those of other programs are understood."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from objectmorpher_core.document.gaussians import Gaussians
from objectmorpher_core.splat_files import read
from objectmorpher_core.splat_files.limits import LEAST_SCALE
from objectmorpher_core.splat_files.splats.ply import (
    FLATNESS,
    SH0,
    SURFEL,
    SplatFileError,
    decode_ply,
    encode_ply,
)
from tests.core.splat_files.clouds import gaussians
from tests.tree import over

F32 = 2e-6  # relative; a value goes through a float32 logarithm or logit of size up to 14


def assert_close(got: Gaussians, expected: Gaussians) -> None:
    np.testing.assert_array_equal(got.means, expected.means)
    np.testing.assert_allclose(got.quats, expected.quats, atol=2e-7)
    np.testing.assert_allclose(got.scales, expected.scales, rtol=F32)
    np.testing.assert_allclose(got.opacities, expected.opacities, atol=F32)
    np.testing.assert_allclose(got.colors, expected.colors, atol=F32)


def stored(cloud: Gaussians) -> dict[str, np.ndarray]:
    """The columns as a 3DGS trainer would store them."""
    columns = {name: cloud.means[:, k] for k, name in enumerate("xyz")}
    for k in range(3):
        columns[f"f_dc_{k}"] = (cloud.colors[:, k] - 0.5) / SH0
        columns[f"scale_{k}"] = np.log(cloud.scales[:, k])
    columns["opacity"] = np.log(cloud.opacities / (1 - cloud.opacities))
    columns |= {f"rot_{k}": cloud.quats[:, k] for k in range(4)}
    return {name: column.copy() for name, column in columns.items()}


def foreign_file(columns: dict[str, np.ndarray], kind: str, types: dict[str, str]) -> bytes:
    """A .ply of these columns, in this order, with an element before and one after."""
    count = len(columns["x"])
    lines = ["ply", f"format {kind} 1.0", "comment made elsewhere"]
    lines += ["element camera 2", "property uchar lens", f"element vertex {count}"]
    lines += [f"property {types.get(name, 'float')} {name}" for name in columns]
    lines += ["element face 1", "property list uchar int vertex_index", "end_header"]
    head = ("\n".join(lines) + "\n").encode()
    if kind == "ascii":
        rows = zip(*columns.values(), strict=True)
        body = "7\n8\n" + "".join(" ".join(map(repr, map(float, r))) + "\n" for r in rows)
        return head + body.encode() + b"3 0 1 2\n"
    order = "<" if "little" in kind else ">"
    codes = {"float": "f4", "double": "f8", "uchar": "u1", "short": "i2", "int": "i4"}
    codes["uint"] = "u4"
    row = [(name, order + codes[types.get(name, "float")]) for name in columns]
    table = np.empty(count, row)
    for name, column in columns.items():
        table[name] = column
    return head + b"\7\10" + table.tobytes() + b"\3" + bytes(12)


def test_round_trip():
    assert_close(decode_ply(encode_ply(gaussians())), gaussians())


def test_none_and_extremes():
    none = gaussians(1).select(np.zeros(0, int))
    assert len(decode_ply(encode_ply(none))) == 0
    base = gaussians(2)
    extremes = Gaussians(
        base.means, base.quats, base.scales, np.array([0, 1], np.float32), base.colors
    )
    back = decode_ply(encode_ply(extremes))
    np.testing.assert_allclose(back.opacities, [0, 1], atol=F32)


@over("kind", ["ascii", "binary_little_endian", "binary_big_endian"])
@over("degree", [0, 1, 2, 3])
def test_files_of_other_programs(kind, degree):
    """Any order of properties, any degree, doubles, extra properties, elements on both sides."""
    cloud = gaussians()
    columns = stored(cloud)
    for k in range(3 * ((degree + 1) ** 2 - 1)):
        columns[f"f_rest_{k}"] = np.full(20, 0.1)
    columns["label"] = np.arange(20)
    names = list(columns)
    np.random.default_rng(degree).shuffle(names)
    shuffled = {name: columns[name] for name in names}
    data = foreign_file(shuffled, kind, {"label": "uchar", "x": "double"})
    assert_close(decode_ply(data), cloud)


@over("kind", ["uchar", "short", "int", "uint"])
def test_colours_of_points_are_read_from_any_whole_numbers(kind, tmp_path):
    rng = np.random.default_rng(0)
    columns = {name: rng.normal(0, 1, 20) for name in "xyz"}
    columns |= {"red": np.full(20, 102), "green": np.full(20, 51), "blue": np.zeros(20)}
    types = dict.fromkeys(("red", "green", "blue"), kind)
    path = tmp_path / "points.ply"
    data = foreign_file(columns, "binary_little_endian", types)
    path.write_bytes(data.replace(b"element face 1\n", b"element face 0\n"))
    assert np.abs(read(path).colors - [0.4, 0.2, 0.0]).max() < 1e-6


def test_quaternions_are_made_unit():
    columns = stored(gaussians(3))
    for k in range(4):
        columns[f"rot_{k}"] = columns[f"rot_{k}"] * 5
        columns[f"rot_{k}"][0] = 0
    back = decode_ply(foreign_file(columns, "binary_little_endian", {}))
    np.testing.assert_allclose(np.linalg.norm(back.quats, axis=1), 1, atol=1e-6)
    np.testing.assert_array_equal(back.quats[0], [1, 0, 0, 0])


def test_a_line_may_end_as_on_windows():
    columns = stored(gaussians())
    text = foreign_file(columns, "ascii", {}).replace(b"\n", b"\r\n")
    assert_close(decode_ply(text), gaussians())
    head, rows = foreign_file(columns, "binary_little_endian", {}).split(b"end_header\n")
    data = head.replace(b"\n", b"\r\n") + b"end_header\r\n" + rows
    assert_close(decode_ply(data), gaussians())


def test_a_comment_may_be_in_any_script():
    data = encode_ply(gaussians()).replace(b"ply\n", "ply\ncomment 物体 é\n".encode(), 1)
    assert_close(decode_ply(data), gaussians())


def test_surfels_become_flat_along_their_normal():
    """2DGS stores two scales; its normal is the third axis of the rotation, as ours."""
    columns = stored(gaussians())
    del columns["scale_2"]
    back = decode_ply(foreign_file(columns, "binary_little_endian", {}))
    np.testing.assert_allclose(back.scales[:, :2], gaussians().scales[:, :2], rtol=F32)
    np.testing.assert_allclose(back.scales[:, 2], FLATNESS * back.scales[:, :2].min(1), rtol=F32)
    np.testing.assert_allclose(back.normals, gaussians().normals, atol=1e-6)


def test_scales_of_zero_become_tiny():
    columns = stored(gaussians())
    columns["scale_1"][3] = -np.inf
    back = decode_ply(foreign_file(columns, "binary_little_endian", {}))
    assert back.scales[3, 1] == np.float32(LEAST_SCALE)
    assert len(back) == 20


def test_opacities_of_exactly_nothing_and_everything():
    columns = stored(gaussians())
    columns["opacity"][:2] = -np.inf, np.inf
    back = decode_ply(foreign_file(columns, "binary_little_endian", {}))
    np.testing.assert_array_equal(back.opacities[:2], [0, 1])


@pytest.mark.parametrize("name", ["x", "scale_0", "opacity", "rot_2", "f_dc_1"])
def test_what_cannot_be_drawn_is_left_out(name):
    columns = stored(gaussians())
    columns[name][[2, 5]] = np.nan
    if name in ("x", "scale_0"):
        columns[name][7] = np.inf
    back = decode_ply(foreign_file(columns, "binary_little_endian", {}))
    kept = np.isfinite(columns[name])
    assert_close(back, gaussians().select(kept))


def test_harmonics_of_the_third_degree_never_lie_in_memory_together():
    columns = stored(gaussians(200_000))
    columns |= {f"f_rest_{k}": np.zeros(200_000, np.float32) for k in range(45)}
    data = foreign_file(columns, "binary_little_endian", {})
    tracemalloc.start()
    try:
        cloud = decode_ply(data)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    own = sum(getattr(cloud, name).nbytes for name in cloud.__dataclass_fields__)
    assert peak < 2.5 * own + 40e6 < len(data) + 40e6


@over("name", SURFEL)
def test_a_missing_property_is_named(name):
    columns = stored(gaussians())
    if name == "x":
        columns = {"q" if key == "x" else key: value for key, value in columns.items()}
        columns["x_"] = columns.pop("q")
        with pytest.raises(SplatFileError, match="x is missing"):
            decode_ply(foreign_file({"x": columns["x_"]} | columns, "ascii", {}).replace(
                b"property float x\n", b"property float w\n"))  # fmt: skip
        return
    del columns[name]
    with pytest.raises(SplatFileError, match=f"{name} is missing"):
        decode_ply(foreign_file(columns, "ascii", {}))


@over(
    "spoil",
    [
        lambda data: b"",
        lambda data: b"solid\n" + data,
        lambda data: data[:-1],
        lambda data: data[:100],
        lambda data: data.replace(b"float x", b"quad x"),
        lambda data: data.replace(b"vertex 20", b"vertex -1"),
        lambda data: data.replace(b"vertex 20", b"vertex 9999999999999"),
        lambda data: data.replace(b"vertex", b"corner"),
        lambda data: data.replace(b"float y", b"float x"),
        lambda data: data.replace(b"property float x", b"property list uchar int x"),
    ],
)
def test_bad_files_give_one_sentence(spoil):
    with pytest.raises(SplatFileError) as caught:
        decode_ply(spoil(encode_ply(gaussians())))
    assert "\n" not in str(caught.value)
