"""Readers of pictures: photos, masks, EXIF blocks, and what is written of them again."""

from __future__ import annotations

import io
from contextlib import suppress
from pathlib import Path

import numpy as np
from PIL import Image, ImageCms

from objectmorpher_core.pictures import exif
from objectmorpher_core.pictures.image import (
    ENDINGS,
    ImageError,
    Picture,
    encode_picture,
    read_coverage,
    read_picture,
)
from objectmorpher_core.pictures.psd import Layer, encode_psd
from objectmorpher_core.pipeline import open_photo
from tests.raw_photos import dng

from .checks import Reader, check_picture, refusing
from .damage import EXIF

WIDTH, HEIGHT = 37, 23
SMALL = 1 << 20  # pixels up to which a picture is written again


def noise(*shape: int, deep: bool = False) -> np.ndarray:
    """Pixels of noise."""
    random = np.random.default_rng(len(shape))
    return random.integers(0, 65536 if deep else 256, shape, np.uint16 if deep else np.uint8)


def seeds() -> list[bytes]:
    """Small pictures of all formats, depths and channels that are read."""
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    block = EXIF
    found = []
    for deep in (False, True):
        pixels, alpha = noise(HEIGHT, WIDTH, 3, deep=deep), noise(HEIGHT, WIDTH, deep=deep)
        picture = Picture(pixels, icc=profile, exif=block)
        found += [encode_picture(picture, ending) for ending in ENDINGS]
        found += [encode_picture(Picture(pixels, alpha), e) for e in (".png", ".tif", ".webp")]
        grey = Picture(np.repeat(alpha[..., None], 3, 2), is_grey=True, exif=block)
        found += [encode_picture(grey, ending) for ending in (".png", ".tif", ".jpg")]
    photo = Image.fromarray(noise(HEIGHT, WIDTH, 3))
    for mode, kind, options in (
        ("CMYK", "JPEG", {}), ("RGB", "JPEG", {"progressive": True, "exif": b"Exif\0\0" + EXIF}),
        ("P", "PNG", {"transparency": 3}), ("1", "PNG", {}), ("P", "GIF", {}), ("RGB", "BMP", {}),
        ("LAB", "TIFF", {}), ("CMYK", "TIFF", {}), ("RGB", "TIFF", {"compression": "tiff_lzw"}),
        ("RGB", "TIFF", {"compression": "jpeg"}), ("1", "TIFF", {"compression": "group4"}),
        ("L", "TIFF", {"compression": "packbits"}), ("RGB", "WEBP", {"quality": 60}),
        ("RGB", "AVIF", {}),
    ):  # fmt: skip
        out = io.BytesIO()
        photo.convert(mode).save(out, kind, **options) if mode != "LAB" else (
            _lab(photo).save(out, kind)
        )
        found.append(out.getvalue())
    phone = (Path(__file__).parents[1] / "core" / "files" / "cat-10-bit.heic").read_bytes()
    return [*found, *_deep_tiffs(), phone, dng(noise(24, 36, 3) / 255)]


def _lab(photo: Image.Image) -> Image.Image:
    srgb, lab = ImageCms.createProfile("sRGB"), ImageCms.createProfile("LAB")
    turned = ImageCms.profileToProfile(photo, srgb, lab, outputMode="LAB")
    assert turned is not None
    return turned


def _deep_tiffs() -> list[bytes]:
    """As other programs write them: planes, tiles, big-endian, BigTIFF, associated alpha."""
    import tifffile

    deep, found = noise(HEIGHT, WIDTH, 4, deep=True), []
    for pixels, options in (
        (deep[..., :3], {"photometric": "rgb", "byteorder": ">"}),
        (deep[..., :3], {"photometric": "rgb", "bigtiff": True, "compression": "zlib"}),
        (np.moveaxis(deep[..., :3], 2, 0), {"photometric": "rgb", "planarconfig": "separate"}),
        (deep, {"photometric": "rgb", "extrasamples": ["assocalpha"]}),
        (deep[..., 0], {"photometric": "miniswhite"}),
        (np.tile(deep[..., :3], (3, 2, 1)), {"photometric": "rgb", "tile": (32, 32)}),
    ):
        out = io.BytesIO()
        tifffile.imwrite(out, pixels, **options)
        found.append(out.getvalue())
    return found


def read(data: bytes, folder: Path) -> None:
    """A photo is opened, and written again in each format."""
    with refusing(ImageError):
        document = open_photo(data, "photo.png")
    picture = document.photo.picture
    check_picture(picture)
    assert document.photo.camera.focal > 0
    if picture.pixels[..., 0].size > SMALL:
        return
    kept = None
    for ending in ENDINGS:
        try:
            kept = encode_picture(picture, ending)
        except ImageError:
            continue
        if ending in (".png", ".tif"):
            back = read_picture(kept)
            np.testing.assert_array_equal(back.pixels, picture.pixels)
            assert (back.alpha is None) == (picture.alpha is None)
    assert kept is not None, "no format takes it"


def jxl_seeds() -> list[bytes]:
    """JPEG XL as the program writes it, and of other depths, channels and containers."""
    import pylibjxl

    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    pixels, alpha = noise(HEIGHT, WIDTH, 3), noise(HEIGHT, WIDTH)
    smooth = np.array(Image.fromarray(pixels[:6, :8]).resize((WIDTH * 4, HEIGHT * 4)))
    pictures = [Picture(pixels), Picture(pixels, alpha, icc=profile, exif=EXIF), Picture(smooth)]
    pictures.append(Picture(np.repeat(alpha[..., None], 3, 2), is_grey=True, exif=EXIF))
    found = [encode_picture(p, ".jxl", webp_quality=q) for p in pictures for q in (100, 80)]
    for samples, options in (
        (noise(HEIGHT, WIDTH, 3, deep=True), {"lossless": True}),
        (noise(HEIGHT, WIDTH, 4, deep=True), {"distance": 2.0, "icc": profile}),
        (noise(HEIGHT, WIDTH, 1), {"lossless": True}),
        (noise(HEIGHT, WIDTH, 3), {"effort": 1, "exif": EXIF, "xmp": b"<x:xmpmeta/>"}),
        (noise(HEIGHT, WIDTH, 4), {"effort": 9, "lossless": True}),
        (noise(1, 1, 3), {}),
    ):
        found.append(pylibjxl.encode(samples, **options))
    return found


def psd_seeds() -> list[bytes]:
    """Photoshop files, which are written and not read: flat, layered, raw, RLE, 8 and 16 bits."""
    from psd_tools import PSDImage
    from psd_tools.constants import Compression

    found = []
    for deep in (False, True):
        pixels, alpha = noise(HEIGHT, WIDTH, 3, deep=deep), noise(HEIGHT, WIDTH, deep=deep)
        whole = np.dstack([pixels, alpha])
        layers = [Layer("Photo", pixels), Layer("Object 1", whole[3:19, 2:29], 2, 3)]
        layers.append(Layer("Shadow", whole[5:9], 0, 5, is_shown=False, mode="multiply"))
        for merged in (Picture(pixels, exif=EXIF), Picture(pixels, alpha)):
            found += [encode_psd([], merged), encode_psd(layers, merged)]
    for mode in ("RGB", "RGBA", "L", "CMYK"):
        for packed in (Compression.RAW, Compression.RLE):
            photo = Image.fromarray(noise(HEIGHT, WIDTH, 3)).convert(mode)
            out = io.BytesIO()
            PSDImage.frompil(photo, compression=packed).save(out)
            found.append(out.getvalue())
    return found


def mask_seeds() -> list[bytes]:
    return [encode_picture(Picture(noise(HEIGHT, WIDTH, 3)), ending) for ending in (".png", ".tif")]


def read_mask(data: bytes, folder: Path) -> None:
    """A mask of the photo's size."""
    with refusing(ImageError):
        found = read_coverage(data, (WIDTH, HEIGHT))
    assert found.shape == (HEIGHT, WIDTH) and found.dtype == np.uint8


def exif_seeds() -> list[bytes]:
    block = EXIF
    flipped = b"MM\0*" + block[4:]
    return [block, flipped, b"II*\0" + bytes(60)]


def read_exif(data: bytes, folder: Path) -> None:
    """An EXIF block says something sensible, or nothing; it goes into every format."""
    assert 1 <= exif.orientation(data) <= 8
    focal = exif.focal_35mm(data)
    assert focal is None or focal > 0
    assert len(exif.upright(data)) == len(data)
    picture = Picture(noise(4, 5, 3), exif=data or None, icc=data or None)
    for ending in ENDINGS:
        with suppress(ImageError):  # not every format takes every block
            read_picture(encode_picture(picture, ending))


READERS = [
    Reader("photo", seeds, read, share=4),
    Reader("jxl", jxl_seeds, read, share=0.5),
    Reader("psd", psd_seeds, read, share=0.25),
    Reader("mask", mask_seeds, read_mask, share=0.5),
    Reader("exif", exif_seeds, read_exif),
]
