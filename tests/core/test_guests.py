"""HEIC, JPEG XL, AVIF and camera RAW: what comes in and goes out, and what is said without them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageCms
from skimage import data

from objectmorpher_core.pictures.guests import kind_of
from objectmorpher_core.pictures.image import ImageError, Picture, encode_picture, read_picture
from tests.raw_photos import dng
from tests.tree import PYTHONPATH

FILES = Path(__file__).parent / "files"  # written by libheif from scikit-image's cat
PROFILE = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
CODED = 4 / 255  # mean error of HEVC at the quality of these files


def exif(focal: int) -> bytes:
    block = Image.Exif()
    block.get_ifd(0x8769)[0xA405] = focal
    return block.tobytes().removeprefix(b"Exif\0\0")


def error(found: np.ndarray, truth: np.ndarray) -> float:
    """Mean difference of two pictures, each of its own depth, in [0, 1]."""
    a, b = (p / np.iinfo(p.dtype).max for p in (found, truth))
    return float(np.abs(a - b).mean())


def test_a_phones_photo_is_upright_and_keeps_profile_and_focal_length() -> None:
    picture = read_picture((FILES / "cat-turned.heic").read_bytes())
    stored = data.chelsea()[60:240, 100:340]
    assert error(picture.pixels, np.rot90(stored, -1)) < CODED  # EXIF said 6: a quarter clockwise
    assert picture.icc is not None and picture.focal_35mm == 35
    assert picture.exif is not None
    written = encode_picture(picture, ".png")
    np.testing.assert_array_equal(read_picture(written).pixels, picture.pixels)  # not turned again


UNDER_A_LIMIT = """
import resource, sys
from pathlib import Path
from objectmorpher_core.pictures.image import read_picture
resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))
for path in sys.argv[1:]:
    print(*read_picture(Path(path).read_bytes()).pixels.shape)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux limits the decoder")
def test_the_decoder_keeps_to_a_lower_limit_of_memory(tmp_path: Path) -> None:
    """As a shell's `ulimit -v` or a batch system sets it: it cannot be raised again."""
    jxl, raw = tmp_path / "a.jxl", tmp_path / "a.dng"
    jxl.write_bytes(encode_picture(Picture(data.chelsea()[:60, :80]), ".jxl"))
    raw.write_bytes(dng(np.full((24, 36, 3), 0.5)))
    done = subprocess.run(
        [sys.executable, "-c", UNDER_A_LIMIT, FILES / "cat-10-bit.heic", jxl, raw],
        capture_output=True, text=True, env=os.environ | {"PYTHONPATH": PYTHONPATH},
    )  # fmt: skip
    assert done.stdout.splitlines()[:2] == ["60 80 3", "60 80 3"], done.stderr[-2000:]
    assert len(done.stdout.splitlines()) == 3, done.stderr[-2000:]


def test_ten_bits_come_in_as_sixteen() -> None:
    picture = read_picture((FILES / "cat-10-bit.heic").read_bytes())
    assert picture.pixels.dtype == np.uint16
    assert error(picture.pixels, data.chelsea()[60:120, 100:180]) < CODED
    assert len(np.unique(picture.pixels)) > 256


def test_a_raw_file_is_developed_in_sixteen_bits_to_the_light_that_fell_on_the_sensor() -> None:
    scene = np.empty((120, 180, 3))
    rows, columns = np.mgrid[:120, :180]
    scene[:] = 0.02 + 0.6 * (rows / 120)[..., None] * np.array([1.0, 0.7, 0.3])
    scene[..., 2] += 0.3 * columns / 180
    file = dng(scene)
    assert kind_of(file) == "camera RAW"
    picture = read_picture(file)
    assert picture.pixels.dtype == np.uint16 and picture.icc is not None
    encoded = picture.pixels / 65535
    light = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    inner = np.s_[8:-8, 8:-8]  # without the border, where the filters are not all there
    kept = encoded[inner].max(2) < 0.999
    gain = np.median(light[inner][kept] / scene[inner][kept])  # brightness is the developer's
    np.testing.assert_allclose(light[inner][kept], gain * scene[inner][kept], rtol=0.03, atol=0.01)


@pytest.mark.parametrize("is_grey", [False, True])
@pytest.mark.parametrize("has_alpha", [False, True])
def test_jpeg_xl_keeps_every_pixel(is_grey: bool, has_alpha: bool) -> None:
    rgb = data.coffee()[:61, :83]
    pixels = np.repeat(rgb[..., :1], 3, 2) if is_grey else rgb
    alpha = rgb[..., 1].copy() if has_alpha else None
    icc = None if is_grey else PROFILE
    picture = Picture(pixels, alpha, is_grey, icc=icc, exif=exif(28))
    back = read_picture(encode_picture(picture, ".jxl"))
    np.testing.assert_array_equal(back.pixels, picture.pixels)
    assert back.focal_35mm == 28
    if icc is not None:
        assert back.icc == icc
    if alpha is not None:
        assert back.alpha is not None
        np.testing.assert_array_equal(back.alpha, alpha)


def test_quality_makes_jpeg_xl_and_avif_smaller_and_hardly_worse() -> None:
    picture = Picture(data.coffee(), data.coffee()[..., 0].copy(), icc=PROFILE, exif=exif(28))
    small = encode_picture(picture, ".jxl", webp_quality=85)
    assert len(small) < len(encode_picture(picture, ".jxl")) - 150_000  # alpha stays whole
    for file in (small, encode_picture(picture, ".avif", 85)):
        back = read_picture(file)
        assert error(back.pixels, picture.pixels) < 0.02
        assert back.alpha is not None and picture.alpha is not None
        assert error(back.alpha, picture.alpha) < 0.02
        assert back.icc == PROFILE and back.focal_35mm == 28


@pytest.mark.parametrize(
    ("package", "make"),
    [
        ("pi_heif", lambda: (FILES / "cat-turned.heic").read_bytes()),
        ("rawpy", lambda: dng(np.full((16, 16, 3), 0.4))),
        ("pylibjxl", lambda: encode_picture(Picture(data.coffee()[:9, :9]), ".jxl")),
    ],
)
def test_a_package_that_is_missing_is_named(
    package: str, make, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = make()
    monkeypatch.setitem(sys.modules, package, None)
    said = rf"need the package {package.replace('_', '-')}: pip install 'objectmorpher\[formats\]'"
    with pytest.raises(ImageError, match=said):
        read_picture(file)


def test_damaged_files_are_refused_in_a_sentence() -> None:
    files = [
        (FILES / "cat-turned.heic").read_bytes(),
        encode_picture(Picture(data.coffee()[:60, :80]), ".jxl"),
        dng(np.full((32, 32, 3), 0.4)),
    ]
    for file in files:
        with pytest.raises(ImageError, match=r"^[a-zA-Z]"):
            read_picture(file[: len(file) // 3])
        with pytest.raises(ImageError, match="more than"):
            read_picture(file, most=100)
