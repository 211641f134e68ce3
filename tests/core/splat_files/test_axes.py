"""Files are written right side up and come back so: each format's axes, and ours (y down)."""

from __future__ import annotations

import gzip

import numpy as np
import pytest

from objectmorpher_core.base.rotations import quats_along, turn_matrix
from objectmorpher_core.document.gaussians import Gaussians
from objectmorpher_core.splat_files import FORMATS, encode, read
from objectmorpher_core.splat_files.splats.ply import HALF_TURN, half_turned, turned
from tests.core.splat_files.clouds import gaussians, matched


def figure() -> Gaussians:
    """A red head above (-y), a green foot below, a blue nose towards the viewer (-z)."""
    return Gaussians(
        means=np.array([[0, -1, 0], [0, 1, 0], [0, -0.5, -1]], np.float32),
        quats=quats_along(np.array([[0.0, -1, 0], [0, 1, 0], [0, 0, -1]])).astype(np.float32),
        scales=np.array([[0.2, 0.1, 0.01]] * 3, np.float32),
        opacities=np.ones(3, np.float32),
        colors=np.eye(3, dtype=np.float32),
    )


def raw_positions(data: bytes, ending: str) -> dict[str, np.ndarray]:
    """The three positions as they stand in the file, by the colour that they have there."""
    if ending == ".splat":
        rows = np.frombuffer(data, [("at", "<f4", 3), ("s", "<f4", 3), ("c", "u1", 4), ("q", "u4")])
        at, colors = rows["at"], rows["c"][:, :3]
    elif ending == ".ply":
        rows = np.frombuffer(data.split(b"end_header\n")[1], "<f4").reshape(3, 17)
        at, colors = rows[:, :3], rows[:, 6:9]
    else:
        body = gzip.decompress(data)
        wide = np.zeros((3, 3, 4), np.uint8)
        wide[..., 1:] = np.frombuffer(body, np.uint8, 27, 16).reshape(3, 3, 3)
        at = (wide.view("<i4")[..., 0] >> 8) / 2.0 ** body[13]
        colors = np.frombuffer(body, np.uint8, 9, 16 + 30).reshape(3, 3)
    return dict(zip(np.array(["head", "foot", "nose"])[colors.argmax(1)], at, strict=True))


@pytest.mark.parametrize("ending", [".ply", ".splat"])
def test_a_ply_and_a_splat_have_y_down_as_3dgs_trains_them(ending):
    """SuperSplat shows both turned by 180 degrees about z: then the head is above."""
    at = raw_positions(FORMATS[ending].encode(figure()), ending)
    shown = {name: np.array([-x, -y, z]) for name, (x, y, z) in at.items()}  # there y is up
    assert shown["head"][1] > 0 > shown["foot"][1]


def test_an_spz_has_y_up_and_z_towards_the_viewer():
    at = raw_positions(FORMATS[".spz"].encode(figure()), ".spz")
    assert at["head"][1] > 0 > at["foot"][1]
    assert at["nose"][2] > 0


@pytest.mark.parametrize("ending", FORMATS)
@pytest.mark.parametrize("other", FORMATS)
def test_no_chain_of_formats_turns_the_object(ending, other, tmp_path):
    first, second = tmp_path / f"a{ending}", tmp_path / f"b{other}"
    first.write_bytes(encode(figure(), first))
    second.write_bytes(encode(read(first), second))
    back = matched(read(second), figure())
    np.testing.assert_allclose(back.means, figure().means, atol=2e-3)
    np.testing.assert_allclose(back.normals, figure().normals, atol=0.02)
    np.testing.assert_allclose(back.colors, figure().colors, atol=0.01)


@pytest.mark.parametrize("ending", FORMATS)
def test_a_file_that_does_not_keep_to_its_axes_can_be_flipped(ending, tmp_path):
    path = tmp_path / f"wrong{ending}"
    path.write_bytes(encode(half_turned(figure()), path))
    back = matched(read(path, is_flipped=True), figure())
    np.testing.assert_allclose(back.means, figure().means, atol=2e-3)


def test_half_a_turn_is_the_rotation_it_says_it_is():
    by_matrix, by_signs = turned(gaussians(), HALF_TURN), half_turned(gaussians())
    np.testing.assert_allclose(by_signs.means, by_matrix.means, atol=1e-6)
    np.testing.assert_allclose(by_signs.covariances(), by_matrix.covariances(), atol=1e-7)
    np.testing.assert_array_equal(half_turned(by_signs).means, gaussians().means)


def test_a_turn_carries_shapes_along():
    matrix = turn_matrix(20, 35, -50)
    back = turned(gaussians(), matrix)
    expected = matrix @ gaussians().covariances() @ matrix.T
    np.testing.assert_allclose(back.covariances(), expected, atol=1e-7)
    np.testing.assert_allclose(back.normals, gaussians().normals @ matrix.T, atol=1e-6)
