"""Photoshop files: read back by psd-tools and Pillow, and in GIMP and Krita where they are."""

from __future__ import annotations

import io
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageCms
from psd_tools import PSDImage
from skimage import data

from objectmorpher_core.compose.layers import Layer
from objectmorpher_core.pictures.image import ImageError, Picture, to_u8
from objectmorpher_core.pictures.psd import encode_psd

PROFILE = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()


def scene(dtype: type, mode: str = "normal") -> tuple[list[Layer], Picture]:
    """A cat, a soft piece of a cup over it, and a hidden layer; and what they look like."""
    top = np.iinfo(dtype).max // 255
    cat = data.chelsea()[:201, :303].astype(dtype) * dtype(top)
    cup = data.coffee()[100:221, 150:301].astype(dtype) * dtype(top)
    rows, columns = np.mgrid[:121, :151]
    soft = np.clip(2 - np.hypot((rows - 60) / 40, (columns - 75) / 50), 0, 1)
    alpha = (soft * np.iinfo(dtype).max).astype(dtype)
    merged = cat.copy()
    part = merged[40:161, 70:221]
    part[:] = np.rint(cup * soft[..., None] + part * (1 - soft[..., None])).astype(dtype)
    pile = [
        Layer("Photo", cat), Layer("Hidden", cup, 3, 5, is_shown=False),
        Layer("Tasse, größer ☕", np.dstack([cup, alpha]), 70, 40, mode=mode),
    ]  # fmt: skip
    return pile, Picture(merged, icc=PROFILE)


@pytest.mark.parametrize(
    ("dtype", "mode"),
    [(np.uint8, "normal"), (np.uint16, "soft light"), (np.uint8, "multiply"), (np.uint8, "screen")],
)
def test_layers_come_back(dtype: type, mode: str) -> None:
    pile, merged = scene(dtype, mode)
    file = encode_psd(pile, merged)
    psd = PSDImage.open(io.BytesIO(file))
    assert psd.depth == 8 * np.dtype(dtype).itemsize
    assert [layer.name for layer in psd] == [layer.name for layer in pile]
    assert [layer.visible for layer in psd] == [True, False, True]
    assert psd[2].blend_mode.name == mode.upper().replace(" ", "_")
    most = np.iinfo(dtype).max
    for stored, layer in zip(psd, pile, strict=True):
        assert (stored.left, stored.top) == (layer.left, layer.top)
        pixels = np.rint(stored.numpy() * most)
        np.testing.assert_array_equal(pixels, layer.pixels)
    np.testing.assert_array_equal(np.rint(psd.numpy() * most), merged.pixels)
    assert psd.image_resources.get_data(1039) == PROFILE
    if dtype is np.uint8:
        np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(file))), merged.pixels)


def test_a_transparent_photo_becomes_a_group_with_a_mask() -> None:
    pile, merged = scene(np.uint8)
    alpha = np.full(merged.pixels.shape[:2], 255, np.uint8)
    alpha[:, :100] = 60
    psd = PSDImage.open(io.BytesIO(encode_psd(pile, Picture(merged.pixels, alpha))))
    (group,) = psd
    assert group.is_group() and [layer.name for layer in group][-1] == pile[-1].name
    assert group.mask is not None
    np.testing.assert_array_equal(np.asarray(group.mask.topil()), alpha)


def test_what_the_format_cannot_hold_is_refused() -> None:
    wide = np.zeros((1, 30_001, 3), np.uint8)
    with pytest.raises(ImageError, match="30001 x 1 px"):
        encode_psd([Layer("Photo", wide)], Picture(wide))


@pytest.mark.slow
@pytest.mark.parametrize(("dtype", "is_transparent"), [(np.uint8, False), (np.uint16, True)])
def test_krita_shows_what_it_should(tmp_path: Path, dtype: type, is_transparent: bool) -> None:
    """Krita composes the layers anew; it does not look at the merged picture."""
    if shutil.which("krita") is None or shutil.which("xvfb-run") is None:
        pytest.skip("needs Krita and xvfb-run")
    pile, merged = scene(dtype)
    if is_transparent:
        alpha = np.full(merged.pixels.shape[:2], np.iinfo(dtype).max, dtype)
        alpha[:, :100] //= 4
        merged = Picture(merged.pixels, alpha, icc=PROFILE)
    source, target = tmp_path / "layers.psd", tmp_path / "out.png"
    source.write_bytes(encode_psd(pile, merged))
    command = ["xvfb-run", "-a", "krita", "--export", "--export-filename", target, source]
    subprocess.run(command, check=True, timeout=120, capture_output=True)
    shown = Image.open(target)
    difference = np.abs(np.asarray(shown.convert("RGB")).astype(int) - to_u8(merged.pixels))
    assert difference.max() <= 2  # its blending rounds
    if is_transparent:
        assert merged.alpha is not None
        found = np.asarray(shown.convert("RGBA"))[..., 3].astype(int)
        assert np.abs(found - to_u8(merged.alpha)).max() <= 1
