"""A .ply of points becomes small splats that cover what they were taken from."""

from __future__ import annotations

import numpy as np
import pytest

from objectmorpher_core.splat_files import read

PLANE = np.stack(np.meshgrid(np.arange(20), np.arange(20)), axis=-1).reshape(-1, 2) * 0.1


def points_file(columns: dict[str, tuple[str, np.ndarray]]) -> bytes:
    """A binary .ply file: name -> (type, values)."""
    codes = {"float": "<f4", "uchar": "u1", "ushort": "<u2"}
    count = len(next(iter(columns.values()))[1])
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n"
    head += "".join(f"property {kind} {name}\n" for name, (kind, _) in columns.items())
    table = np.empty(count, [(name, codes[kind]) for name, (kind, _) in columns.items()])
    for name, (_, values) in columns.items():
        table[name] = values
    return head.encode() + b"end_header\n" + table.tobytes()


def plane(**more: tuple[str, np.ndarray]) -> dict[str, tuple[str, np.ndarray]]:
    xyz = (PLANE[:, 0], PLANE[:, 1], np.zeros(len(PLANE)))
    return {name: ("float", values) for name, values in zip("xyz", xyz, strict=True)} | more


def test_each_point_is_as_large_as_the_gap_to_its_neighbours(tmp_path):
    (tmp_path / "a.ply").write_bytes(points_file(plane()))
    cloud = read(tmp_path / "a.ply")
    np.testing.assert_allclose(cloud.means[:, :2], PLANE, atol=1e-6)
    assert (cloud.scales > 0.05).all() and (cloud.scales < 0.09).all()
    np.testing.assert_array_equal(cloud.scales[:, 0], cloud.scales[:, 2])
    assert (cloud.opacities == 1).all()


def test_normals_make_the_splats_flat(tmp_path):
    normals = {f"n{axis}": ("float", np.full(400, value)) for axis, value in
               zip("xyz", (0, 3.0, 4.0), strict=True)}  # fmt: skip
    (tmp_path / "a.ply").write_bytes(points_file(plane(**normals)))
    cloud = read(tmp_path / "a.ply")
    np.testing.assert_allclose(cloud.normals, np.tile([0, 0.6, 0.8], (400, 1)), atol=1e-6)
    assert (cloud.scales[:, 2] < 0.5 * cloud.scales[:, 0]).all()


def test_normals_that_are_zero_mean_nothing(tmp_path):
    """COLMAP writes them so."""
    normals = {f"n{axis}": ("float", np.zeros(400)) for axis in "xyz"}
    (tmp_path / "a.ply").write_bytes(points_file(plane(**normals)))
    np.testing.assert_array_equal(*(read(tmp_path / "a.ply").scales[:, k] for k in (0, 2)))


@pytest.mark.parametrize(
    ("kind", "most", "prefix"), [("uchar", 255, ""), ("ushort", 65535, ""), ("float", 1.0, ""),
                                 ("uchar", 255, "diffuse_")]
)  # fmt: skip
def test_colours_of_every_type(kind, most, prefix, tmp_path):
    shades = {f"{prefix}{name}": (kind, np.full(400, value * most)) for name, value in
              (("red", 1.0), ("green", 0.5), ("blue", 0.0))}  # fmt: skip
    (tmp_path / "a.ply").write_bytes(points_file(plane(**shades)))
    np.testing.assert_allclose(read(tmp_path / "a.ply").colors,
                               np.tile([1, 0.5, 0], (400, 1)), atol=0.005)  # fmt: skip


def test_a_stray_point_is_no_balloon(tmp_path):
    columns = plane()
    columns["x"][1][0] = 1e6
    (tmp_path / "a.ply").write_bytes(points_file(columns))
    assert read(tmp_path / "a.ply").scales.max() < 1


def test_points_without_a_place_are_left_out(tmp_path):
    columns = plane()
    columns["y"][1][[3, 9]] = np.nan, np.inf
    (tmp_path / "a.ply").write_bytes(points_file(columns))
    assert len(read(tmp_path / "a.ply")) == 398


def test_one_point_and_points_in_one_place(tmp_path):
    for count in (1, 50):
        columns = {axis: ("float", np.full(count, 2.0)) for axis in "xyz"}
        (tmp_path / "a.ply").write_bytes(points_file(columns))
        assert len(read(tmp_path / "a.ply")) == count
