"""What is written comes back, to the precision of each format, whatever the values."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from objectmorpher_core.document.gaussians import Gaussians
from objectmorpher_core.splat_files import FORMATS, SplatFileError, ending_of, read
from objectmorpher_core.splat_files import encode as encode_file
from tests.core.splat_files.clouds import gaussians, matched, turn_between
from tests.tree import over

F32 = 2e-6  # relative; a value goes through a float32 logarithm or logit of size up to 14


@dataclass(frozen=True)
class Precision:
    """Largest errors; see docs/formats.md."""

    position: float  # x extent of the whole
    log_scale: float
    opacity: float
    color: float
    turn: float  # radians


FINEST = 2**-24  # a step of 24 bits after the point: .spz has none finer
BYTE = 0.5 / 255 + 1e-6
PRECISION = {
    ".ply": Precision(0.0, F32, F32, F32, F32),
    # a step of 11 and 10 bits in the chunk's extent, which is that of the whole at most
    ".compressed.ply": Precision(0.5 / 1023 + 1e-6, 10 / 1023, BYTE, BYTE, 4e-3),
    ".splat": Precision(0.0, F32, BYTE, BYTE, 0.018),
    # a position's step is 2^-22 of the reach, or FINEST; log-scales go in steps of 1/16
    ".spz": Precision(2**-22, 0.5 / 16 + 1e-5, BYTE, 0.0038, 4e-3),
}
formats = pytest.mark.parametrize("ending", FORMATS)


def there_and_back(cloud: Gaussians, ending: str) -> Gaussians:
    return FORMATS[ending].decode(FORMATS[ending].encode(cloud))


@formats
@over("count", [1, 2, 255, 256, 257, 3000])
def test_every_value_comes_back_to_the_precision_of_the_format(ending, count):
    cloud = gaussians(count)
    back = matched(there_and_back(cloud, ending), cloud)
    most = PRECISION[ending]
    extent = float(np.ptp(cloud.means, axis=0).max())
    reach = float(np.abs(cloud.means).max())
    assert np.abs(back.means - cloud.means).max() <= most.position * max(extent, reach)
    assert np.abs(np.log(back.scales / cloud.scales)).max() <= most.log_scale
    assert np.abs(back.opacities - cloud.opacities).max() <= most.opacity
    assert np.abs(back.colors - cloud.colors).max() <= most.color
    assert turn_between(back, cloud).max() <= most.turn


@formats
def test_the_shape_of_each_gaussian_comes_back(ending):
    """Covariances: the order and the signs of quaternions are the format's own affair."""
    cloud = gaussians(500)
    back = matched(there_and_back(cloud, ending), cloud)
    size = np.linalg.norm(cloud.covariances(), axis=(1, 2))
    error = np.linalg.norm(back.covariances() - cloud.covariances(), axis=(1, 2)) / size
    most = PRECISION[ending]
    assert error.max() <= 2.5 * most.log_scale + 3 * most.turn


@formats
def test_what_has_been_rounded_once_is_not_rounded_again(ending):
    """A second trip changes nothing but the last place of a float."""
    once = there_and_back(gaussians(700), ending)
    twice = matched(there_and_back(once, ending), once)
    extent = float(np.ptp(once.means, axis=0).max())
    np.testing.assert_allclose(twice.means, once.means, atol=2e-6 * extent)
    np.testing.assert_allclose(twice.colors, once.colors, atol=1e-5)
    np.testing.assert_allclose(twice.opacities, once.opacities, atol=1e-5)
    np.testing.assert_allclose(twice.scales, once.scales, rtol=1e-4)


@formats
def test_the_same_gaussians_give_the_same_bytes(ending):
    assert FORMATS[ending].encode(gaussians(300)) == FORMATS[ending].encode(gaussians(300))


@formats
def test_extreme_values_survive_or_are_bounded(ending):
    cloud = gaussians(40)
    opacities, colors = cloud.opacities.copy(), cloud.colors.copy()
    opacities[:2], colors[:3] = (0, 1), [[0, 0, 0], [1, 1, 1], [0, 1, 0]]
    quats = cloud.quats.copy()
    quats[:6] = [[1, 0, 0, 0], [-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1], [0.5] * 4]
    scales = cloud.scales.copy()
    scales[5] = 1e-4, 0.5, 3.0
    extreme = Gaussians(cloud.means, quats, scales, opacities, colors)
    back = matched(there_and_back(extreme, ending), extreme)
    most = PRECISION[ending]
    assert np.abs(back.opacities - opacities).max() <= most.opacity
    assert np.abs(back.colors - colors).max() <= most.color
    assert turn_between(back, extreme).max() <= most.turn
    # one chunk's log-scales now reach from -9.2 to 1.1
    assert np.abs(np.log(back.scales / scales)).max() <= max(most.log_scale, 0.006)


@formats
@over("scale", [1e-3, 1.0, 1e3])
def test_the_size_of_the_object_does_not_matter(ending, scale):
    cloud = gaussians(300)
    large = replace(
        cloud, means=cloud.means * np.float32(scale),
        scales=cloud.scales * np.float32(min(scale, 100)),
    )  # fmt: skip
    back = matched(there_and_back(large, ending), large)
    extent = float(np.ptp(large.means, axis=0).max())
    most = max(PRECISION[ending].position * extent, FINEST * (ending == ".spz"))
    assert np.abs(back.means - large.means).max() <= most + 1e-7 * extent


@formats
def test_objects_far_from_the_origin(ending):
    """Fixed-point positions are as fine as their reach lets them be."""
    cloud = gaussians(300)
    far = replace(cloud, means=cloud.means + np.float32(1000))
    back = matched(there_and_back(far, ending), far)
    assert np.abs(back.means - far.means).max() < 4e-3


def test_positions_beyond_fixed_point_numbers_are_refused():
    far = replace(gaussians(3), means=gaussians(3).means + np.float32(1e7))
    with pytest.raises(SplatFileError, match=r"more than an \.spz file can hold"):
        FORMATS[".spz"].encode(far)


@pytest.mark.parametrize("ending", [".compressed.ply", ".splat", ".spz"])
def test_an_empty_set_is_refused_where_readers_would_stumble(ending):
    with pytest.raises(SplatFileError, match="no Gaussians to write"):
        FORMATS[ending].encode(gaussians(1).select(np.zeros(0, int)))


@formats
def test_the_ending_chooses_the_format_in_either_case(ending, tmp_path):
    path = tmp_path / f"Object{ending.upper()}"
    path.write_bytes(encode_file(gaussians(), path))
    assert ending_of(path) == ending
    matched(read(path), gaussians())


def test_a_compressed_file_is_known_by_its_header(tmp_path):
    path = tmp_path / "plain.ply"
    path.write_bytes(FORMATS[".compressed.ply"].encode(gaussians()))
    matched(read(path), gaussians())


def test_an_unknown_ending_is_told():
    with pytest.raises(SplatFileError, match=r"cat\.doc has none of the endings"):
        ending_of(Path("cat.doc"))


def test_a_mesh_is_not_written():
    with pytest.raises(SplatFileError, match=r"cannot be written as \.glb"):
        encode_file(gaussians(), Path("o.glb"))
