"""Pictures survive the way through a file: pixels exactly, metadata too."""

from __future__ import annotations

import io
import struct
import zlib
from dataclasses import replace

import numpy as np
import pytest
import tifffile
from PIL import Image, ImageCms, ImageOps

from objectmorpher_core.pictures import png
from objectmorpher_core.pictures.image import (
    ImageError,
    Picture,
    encode_mask,
    encode_picture,
    encode_pil,
    pil_of,
    read_mask,
    read_picture,
    resized,
    to_u8,
)
from tests.tree import over

LOSSLESS = (".png", ".tif", ".webp")
DEEP = (".png", ".tif")
SRGB = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
GREY_PROFILE = SRGB[:16] + b"GRAY" + SRGB[20:]


def deep(pixels: np.ndarray) -> np.ndarray:
    """u16 pixels that really use all 16 bits."""
    noise = np.random.default_rng(5).integers(0, 256, pixels.shape, dtype=np.uint16)
    return pixels.astype(np.uint16) * 256 + noise


def pil_bytes(image: Image.Image, kind: str, **options) -> bytes:
    out = io.BytesIO()
    image.save(out, kind, **options)
    return out.getvalue()


def tiff_bytes(samples: np.ndarray, **options) -> bytes:
    out = io.BytesIO()
    tifffile.imwrite(out, samples, **options)
    return out.getvalue()


def exif_block(orientation: int) -> Image.Exif:
    exif = Image.Exif()
    exif[0x0112] = orientation
    exif[0x010F] = "A camera"
    exif.get_ifd(0x8769)[0xA405] = 35
    exif.get_ifd(0x8769)[0x927C] = b"a maker's note"
    return exif


def pictures(rgb: np.ndarray) -> dict[str, Picture]:
    alpha = rgb[..., 1].copy()
    alpha[:4] = 0
    grey = np.repeat(rgb[..., :1], 3, axis=2)
    return {
        "rgb": Picture(rgb),
        "rgba": Picture(rgb, alpha=alpha),
        "grey": Picture(grey, is_grey=True),
        "grey alpha": Picture(grey, alpha=alpha, is_grey=True),
    }


def assert_same(got: Picture, expected: Picture) -> None:
    assert got.pixels.dtype == expected.pixels.dtype
    np.testing.assert_array_equal(got.pixels, expected.pixels)
    assert (got.alpha is None) == (expected.alpha is None)
    if got.alpha is not None:
        np.testing.assert_array_equal(got.alpha, expected.alpha)


@over("ending", LOSSLESS)
@over("kind", ["rgb", "rgba", "grey", "grey alpha"])
def test_8_bit_round_trip(ending, kind, chelsea):
    picture = pictures(chelsea[:97, :131])[kind]
    back = read_picture(encode_picture(picture, ending))
    assert_same(back, picture)
    assert back.is_grey == (picture.is_grey and ending != ".webp")  # WebP has no grey


@over("ending", LOSSLESS)
@over("is_deep", [False, True])
def test_a_grey_photo_that_something_coloured_came_into_has_colour(ending, is_deep, chelsea):
    pixels = np.repeat(chelsea[:97, :131, :1], 3, axis=2)
    pixels[..., 1] -= (pixels[..., 1] > 0).astype(np.uint8)  # rounded otherwise: still grey
    pixels = deep(pixels) if is_deep and ending in DEEP else pixels
    back = read_picture(encode_picture(Picture(pixels, is_grey=True), ending))
    assert (np.ptp(back.pixels, axis=2) == 0).all() or ending == ".webp"
    painted = pixels.copy()
    painted[20:30, 20:30, 0] //= 2
    back = read_picture(encode_picture(Picture(painted, is_grey=True), ending))
    np.testing.assert_array_equal(back.pixels, painted)
    assert not back.is_grey
    shown = pil_of(Picture(painted, is_grey=True))
    np.testing.assert_array_equal(np.asarray(shown), to_u8(painted))
    assert pil_of(Picture(pixels, is_grey=True)).mode == ("I;16" if pixels.itemsize > 1 else "L")


@pytest.mark.parametrize("ending", DEEP)
@pytest.mark.parametrize("kind", ["rgb", "rgba", "grey", "grey alpha"])
def test_16_bit_round_trip(ending, kind, chelsea):
    picture = pictures(deep(chelsea[:97, :131]))[kind]
    back = read_picture(encode_picture(picture, ending))
    assert_same(back, picture)
    assert back.is_grey == picture.is_grey


@pytest.mark.parametrize("kind", ["rgb", "rgba", "grey", "grey alpha"])
@pytest.mark.parametrize("is_deep", [False, True])
def test_other_programs_read_our_tiff(kind, is_deep, chelsea):
    pixels = chelsea if not is_deep else deep(chelsea)  # several strips
    picture = pictures(pixels)[kind]
    stored = tifffile.imread(io.BytesIO(encode_picture(picture, "tiff")))
    colours = picture.pixels[..., :1] if picture.is_grey else picture.pixels
    channels = [colours] if picture.alpha is None else [colours, picture.alpha[..., None]]
    np.testing.assert_array_equal(stored, np.concatenate(channels, axis=2).squeeze())


@pytest.mark.parametrize("kind", ["rgb", "rgba", "grey", "grey alpha"])
def test_other_programs_read_our_png(kind, chelsea):
    picture = pictures(np.tile(chelsea, (3, 2, 1)))[kind]  # several strips
    image = Image.open(io.BytesIO(encode_picture(picture, "png")))
    assert image.mode == {"rgb": "RGB", "rgba": "RGBA", "grey": "L", "grey alpha": "LA"}[kind]
    stored = np.asarray(image).reshape(*picture.pixels.shape[:2], -1)
    colours = 1 if picture.is_grey else 3
    np.testing.assert_array_equal(stored[..., :colours], picture.pixels[..., :colours])
    if picture.alpha is not None:
        np.testing.assert_array_equal(stored[..., -1], picture.alpha)


@over("kind", ["rgb", "rgba", "grey", "grey alpha"])
@over("shape", [(1, 1), (1, 300), (300, 1), (5, 3), (700, 411)])
@over("is_deep", [False, True])
def test_a_png_is_a_whole_stream_of_filtered_rows(kind, shape, is_deep):
    pixels = np.random.default_rng(0).integers(0, 256, (*shape, 3), np.uint8)
    picture = pictures(deep(pixels) if is_deep else pixels)[kind]
    data = encode_picture(picture, "png")
    assert_same(read_picture(data), picture)
    packed, at = b"", len(png.SIGNATURE)
    while at < len(data):
        size, name = struct.unpack_from(">I4s", data, at)
        packed += data[at + 8 : at + 8 + size] if name == b"IDAT" else b""
        at += 12 + size
    stored = zlib.decompress(packed)  # raises where its checksum is wrong
    channels = (1 if picture.is_grey else 3) + (picture.alpha is not None)
    assert len(stored) == shape[0] * (1 + shape[1] * channels * (1 + is_deep))


def test_a_png_is_about_as_small_as_others_make_it(chelsea):
    ours, others = (
        len(encode_picture(Picture(chelsea), "png")),
        pil_bytes(Image.fromarray(chelsea), "PNG"),
    )
    assert ours < 1.15 * len(others)
    flat = Picture(np.full((1000, 1000, 3), 77, np.uint8))
    assert len(encode_picture(flat, "png")) < 20_000


@pytest.mark.parametrize("ending", [".png", ".tif", ".webp", ".jpg"])
def test_profile_and_exif_are_kept(ending, chelsea):
    block = exif_block(1).tobytes().removeprefix(b"Exif\0\0")
    picture = Picture(chelsea, icc=SRGB, exif=block)
    back = read_picture(encode_picture(picture, ending))
    assert back.icc == SRGB
    assert back.focal_35mm == 35.0
    exif = Image.Exif()
    exif.load(back.exif)
    assert exif[0x010F] == "A camera"
    assert exif.get_ifd(0x8769)[0x927C] == b"a maker's note"


@over("note", [60_000, 100_000])
@over("more", [0, 80_000])
def test_a_jpeg_keeps_as_much_exif_as_it_has_room_for(note, more, chelsea):
    """64 kB: without a long maker's note, and without any where the rest is too long, too."""
    exif = exif_block(1)
    exif.get_ifd(0x8769)[0x927C] = bytes(note)
    exif[0x013B] = "x" * more
    picture = Picture(chelsea, exif=exif.tobytes().removeprefix(b"Exif\0\0"))
    back = read_picture(encode_picture(picture, ".jpg"))
    assert back.focal_35mm == (None if more else 35.0)
    if not more:
        kept = Image.Exif()
        kept.load(back.exif)
        assert kept[0x010F] == "A camera"
        assert (0x927C in kept.get_ifd(0x8769)) == (note < 65_000)
    assert read_picture(encode_picture(picture, ".png")).focal_35mm == 35.0


def chunks_of(data: bytes) -> list[bytes]:
    """A PNG's chunks, whole."""
    found, at = [], len(png.SIGNATURE)
    while at < len(data):
        end = at + 12 + struct.unpack_from(">I", data, at)[0]
        found.append(data[at:end])
        at = end
    return found


def chunk(kind: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


@over("kind", ["behind the pixels", "grey alpha", "further channel"])
def test_16_bit_files_are_described_wherever_that_stands(kind, chelsea):
    """Behind a PNG's pixels, and in a TIFF of channels that Pillow cannot read."""
    pixels = deep(chelsea[:20, :30])
    block = exif_block(1).tobytes().removeprefix(b"Exif\0\0")
    if kind == "behind the pixels":
        *before, end = chunks_of(encode_picture(Picture(pixels, icc=SRGB), "png"))
        data = b"".join([png.SIGNATURE, *before, chunk(b"eXIf", block), end])
    elif kind == "grey alpha":
        grey = pictures(pixels)["grey alpha"]
        data = encode_picture(replace(grey, icc=GREY_PROFILE, exif=block), "tif")
    else:
        data = tiff_bytes(
            np.dstack([pixels, pixels[..., :2]]), photometric="rgb", iccprofile=SRGB,
            extrasamples=["unassalpha", "unspecified"],
            extratags=[(271, 2, None, "A camera", True)],  # tifffile writes no directory of EXIF
        )  # fmt: skip
    back = read_picture(data)
    assert back.icc == (GREY_PROFILE if kind == "grey alpha" else SRGB)
    assert back.focal_35mm == (None if kind == "further channel" else 35.0)
    exif = Image.Exif()
    exif.load(back.exif)
    assert exif[0x010F] == "A camera"


@over("bits", [1, 2, 4, 8, 16])
def test_one_value_of_a_grey_png_may_be_clear(bits):
    most = (1 << bits) - 1
    values = np.arange(most + 1) if bits <= 8 else np.arange(0, most + 1, 257)
    for clear in (0, 1, most):
        values[-2:] = clear, most - clear  # of 16 bits, too, one that is just beside another
        stored = sum(int(v) << bits * k for k, v in enumerate(values[::-1]))
        width = bits * len(values)
        row = b"\0" + (stored << -width % 8).to_bytes(-(-width // 8), "big")
        head = struct.pack(">IIBBBBB", len(values), 1, bits, 0, 0, 0, 0)
        parts = {b"IHDR": head, b"tRNS": struct.pack(">H", clear), b"IDAT": zlib.compress(row)}
        data = b"".join(chunk(*part) for part in [*parts.items(), (b"IEND", b"")])
        picture = read_picture(png.SIGNATURE + data)
        assert picture.is_grey and picture.alpha is not None
        np.testing.assert_array_equal(picture.alpha[0] == 0, values == clear)
        top = np.iinfo(picture.pixels.dtype).max
        np.testing.assert_array_equal(picture.pixels[0, :, 0], values * top // most)


def grey_profile(gamma: float) -> bytes:
    """An ICC profile of greys, as Photoshop's "Gray Gamma"."""
    white = struct.pack(">4s4x3i", b"XYZ ", 63190, 65536, 54061)
    name = "Grey".encode("utf-16-be")
    tags = {
        b"desc": struct.pack(">4s3I4s2I", b"mluc", 0, 1, 12, b"enUS", len(name), 28) + name,
        b"wtpt": white,
        b"kTRC": struct.pack(">4s4xIHxx", b"curv", 1, round(gamma * 256)),
    }
    table, body, at = struct.pack(">I", len(tags)), b"", 132 + 12 * len(tags)
    for tag, data in tags.items():
        table += struct.pack(">4s2I", tag, at + len(body), len(data))
        body += data + bytes(-len(data) % 4)
    head = struct.pack(">I4xI4s4s4s", at + len(body), 0x0420_0000, b"mntr", b"GRAY", b"XYZ ")
    head += struct.pack(">6H4s28x", 2026, 11, 30, 0, 0, 0, b"acsp") + white[8:]
    return head + bytes(128 - len(head)) + table + body


def as_srgb(image: Image.Image) -> np.ndarray:
    own = ImageCms.ImageCmsProfile(io.BytesIO(image.info["icc_profile"]))
    found = ImageCms.profileToProfile(image, own, ImageCms.createProfile("sRGB"), outputMode="RGB")
    return np.asarray(found).astype(int)


@over("gamma", [1.0, 2.2, 1.8])
@over("ending", [".webp", ".avif", ".png", ".tif", ".jpg"])
def test_a_grey_photos_tones_are_kept_where_a_file_has_colours(gamma, ending):
    """In a format without grey, and where something coloured came into the photo."""
    pixels = np.repeat(np.arange(256, dtype=np.uint8)[None, :, None], 3, axis=2).repeat(8, axis=0)
    picture = Picture(pixels, is_grey=True, icc=grey_profile(gamma))
    grey = Image.open(io.BytesIO(encode_picture(picture, ".png")))
    assert grey.mode == "L" and grey.info["icc_profile"] == picture.icc
    colours = Image.open(io.BytesIO(encode_picture(replace(picture, is_grey=False), ending)))
    assert colours.mode == "RGB"
    light = (pixels / 255) ** gamma
    truth = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    slack = 3 * 13 if ending == ".avif" else 1  # lossy, and the dark tones of gamma 1 are steep
    assert np.abs(as_srgb(colours) - 255 * truth).max() <= slack
    assert (
        colours.info["icc_profile"] == pil_of(replace(picture, is_grey=False)).info["icc_profile"]
    )
    if slack == 1:
        np.testing.assert_array_equal(np.asarray(colours), pixels)


def test_a_profile_that_does_not_fit_is_left_out(chelsea):
    grey = np.repeat(chelsea[..., :1], 3, axis=2)
    picture = Picture(grey, is_grey=True, icc=GREY_PROFILE)  # which has no tones
    assert read_picture(encode_picture(picture, "png")).icc == GREY_PROFILE
    assert read_picture(encode_picture(picture, "webp")).icc is None
    assert read_picture(encode_picture(replace(picture, icc=SRGB), "png")).icc is None


@over("orientation", range(1, 9))
@over("kind", ["JPEG", "PNG", "TIFF", "WEBP", "PNG16", "TIFF16"])
def test_orientation(orientation, kind, chelsea):
    stored = chelsea[:60, :90]
    exif = exif_block(orientation)
    expected = np.asarray(ImageOps.exif_transpose(with_exif(stored, exif)))
    if kind == "PNG16":
        block = exif.tobytes().removeprefix(b"Exif\0\0")
        data = encode_picture(Picture(stored.astype(np.uint16) * 257, exif=block), "png")
    elif kind == "TIFF16":
        tags = [(274, 3, 1, orientation, True)]
        data = tiff_bytes(stored.astype(np.uint16) * 257, photometric="rgb", extratags=tags)
    else:
        lossless = {"lossless": True} if kind == "WEBP" else {}
        data = pil_bytes(Image.fromarray(stored), kind, exif=exif, **lossless)
    picture = read_picture(data)
    assert picture.pixels.dtype == (np.uint16 if kind.endswith("16") else np.uint8)
    if kind == "JPEG":
        assert np.abs(picture.pixels.astype(int) - expected).mean() < 6  # lossy; a wrong turn: > 20
    else:
        np.testing.assert_array_equal(to_u8(picture.pixels), expected)
    if picture.exif is not None:  # written and read again, it must not turn a second time
        again = read_picture(encode_picture(picture, "png"))
        np.testing.assert_array_equal(again.pixels, picture.pixels)


@pytest.mark.parametrize("orientation", [3, 6, 8])
def test_exif_says_the_size_of_the_upright_picture(orientation, chelsea):
    stored = chelsea[:60, :90]
    exif = exif_block(orientation)
    exif.get_ifd(0x8769).update({0xA002: 90, 0xA003: 60})  # as cameras store them
    data = pil_bytes(Image.fromarray(stored), "JPEG", exif=exif)
    written = Image.open(io.BytesIO(encode_picture(read_picture(data), "jpg"))).getexif()
    size = (90, 60) if orientation == 3 else (60, 90)
    own = written.get_ifd(0x8769)
    assert written[0x0112] == 1 and (own[0xA002], own[0xA003]) == size
    assert own[0xA405] == 35 and own[0x927C] == b"a maker's note"


def with_exif(pixels: np.ndarray, exif: Image.Exif) -> Image.Image:
    return Image.open(io.BytesIO(pil_bytes(Image.fromarray(pixels), "PNG", exif=exif)))


def test_thumbnail_of_the_unedited_photo_is_dropped():
    # Big-endian block: orientation 6 in the first directory, a 5-byte thumbnail in the second.
    first = struct.pack(">HHHIHHI", 1, 0x0112, 3, 1, 6, 0, 26)
    second = struct.pack(">HHHIIHHIII", 2, 0x0201, 4, 1, 56, 0x0202, 4, 1, 5, 0)
    block = b"MM\0*" + struct.pack(">I", 8) + first + second + b"THUMB"
    data = pil_bytes(Image.new("RGB", (3, 2)), "JPEG", exif=b"Exif\0\0" + block)
    picture = read_picture(data)
    assert picture.pixels.shape == (3, 2, 3)
    assert b"THUMB" not in picture.exif
    assert len(picture.exif) == len(block)


@pytest.mark.filterwarnings("ignore:Corrupt EXIF")
def test_broken_exif_does_not_cost_the_picture():
    for block in (b"II*\0\xff\xff\xff\xff", b"MM\0*\0\0\0\x08\xff\xff", b"nonsense", b"II"):
        data = pil_bytes(Image.new("RGB", (3, 2)), "JPEG", exif=b"Exif\0\0" + block)
        assert read_picture(data).pixels.shape == (2, 3, 3)


@pytest.mark.parametrize(
    "options",
    [
        {"planarconfig": "separate"},
        {"byteorder": ">"},
        {"tile": (32, 32)},
        {"compression": "zlib", "predictor": True},
    ],
)
def test_16_bit_tiff_layouts(options, chelsea):
    pixels = deep(chelsea[:64, :96])
    stored = np.moveaxis(pixels, 2, 0) if "planarconfig" in options else pixels
    data = tiff_bytes(stored, photometric="rgb", **options)
    np.testing.assert_array_equal(read_picture(data).pixels, pixels)


def test_16_bit_lzw_tiff_lying_on_its_side(chelsea):
    import cv2

    pixels = deep(chelsea[:64, :96])
    data = cv2.imencode(".tif", pixels[..., ::-1], [cv2.IMWRITE_TIFF_COMPRESSION, 5])[1].tobytes()
    np.testing.assert_array_equal(read_picture(data).pixels, pixels)


def test_white_is_zero_tiff(chelsea):
    grey = deep(chelsea)[..., 0]
    picture = read_picture(tiff_bytes(grey, photometric="miniswhite"))
    assert picture.is_grey
    np.testing.assert_array_equal(picture.pixels[..., 0], 65535 - grey)


def test_palette_with_transparency(chelsea):
    palette = Image.fromarray(chelsea).quantize(16)
    data = pil_bytes(palette, "PNG", transparency=3)
    picture = read_picture(data)
    np.testing.assert_array_equal(picture.alpha == 0, np.asarray(palette) == 3)
    np.testing.assert_array_equal(picture.pixels, np.asarray(palette.convert("RGB")))
    assert not picture.is_grey


def test_cmyk_becomes_rgb(chelsea):
    data = pil_bytes(Image.fromarray(chelsea).convert("CMYK"), "JPEG", quality=95)
    picture = read_picture(data)
    assert np.abs(picture.pixels.astype(int) - chelsea).mean() < 3


def test_bilevel_is_grey():
    data = pil_bytes(Image.fromarray(np.eye(9, dtype=bool)), "PNG")
    picture = read_picture(data)
    assert picture.is_grey
    np.testing.assert_array_equal(picture.pixels[..., 0], np.eye(9, dtype=np.uint8) * 255)


def test_arrays_are_read_only(chelsea):
    picture = read_picture(encode_picture(pictures(chelsea)["rgba"], "png"))
    for array in (picture.pixels, picture.alpha):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_to_u8_rounds_every_value():
    values = np.arange(65536, dtype=np.uint16).reshape(256, 256)
    np.testing.assert_array_equal(to_u8(values), np.round(values / 257).astype(np.uint8))
    grey = Picture(np.repeat(values[..., None], 3, axis=2), is_grey=True)
    assert_same(read_picture(encode_picture(grey, "png")), grey)


def test_16_bit_is_rounded_for_8_bit_formats(chelsea):
    picture = Picture(deep(chelsea))
    back = read_picture(encode_picture(picture, "webp"))
    np.testing.assert_array_equal(back.pixels, to_u8(picture.pixels))


def test_jpeg_refuses_transparency_but_not_an_opaque_alpha(chelsea):
    with pytest.raises(ImageError, match="JPEG cannot hold transparency"):
        encode_picture(pictures(chelsea)["rgba"], "jpg")
    opaque = np.full(chelsea.shape[:2], 255, np.uint8)
    assert encode_picture(Picture(chelsea, alpha=opaque), ".JPG").startswith(b"\xff\xd8")


def bad_files(rgb: np.ndarray) -> dict[str, bytes]:
    picture = Image.fromarray(rgb)
    jpeg, png = pil_bytes(picture, "JPEG"), pil_bytes(picture, "PNG")
    png16, tif16 = (encode_picture(Picture(deep(rgb)), e) for e in DEEP)
    damaged = bytearray(png16)
    damaged[len(png16) // 2] ^= 1
    bomb = bytearray(png)
    bomb[16:24] = struct.pack(">II", 40000, 40000)
    return {
        "empty": b"",
        "text": b"this is no image, whatever its name says",
        "jpeg cut": jpeg[: len(jpeg) // 2],
        "png cut": png[: len(png) // 2],
        "png16 cut": png16[: len(png16) // 2],
        "png16 damaged": bytes(damaged),
        "tif16 cut": tif16[: len(tif16) // 2],
        "tif16 head": tif16[:60],
        "float tiff": tiff_bytes(rgb.astype(np.float32), photometric="rgb"),
        "32-bit tiff": tiff_bytes(rgb[..., 0].astype(np.uint32), photometric="minisblack"),
        "bomb": bytes(bomb),
        "svg": b"<svg xmlns='http://www.w3.org/2000/svg'/>",
    }


@over("kind", list(bad_files(np.zeros((60, 80, 3), np.uint8))))
def test_bad_files_give_one_sentence(kind, chelsea, capfd):
    with pytest.raises(ImageError) as caught:
        read_picture(bad_files(chelsea)[kind])
    assert 10 < len(str(caught.value)) < 160
    assert "\n" not in str(caught.value)
    assert capfd.readouterr().err == ""


def test_unknown_ending_is_refused(chelsea):
    with pytest.raises(ImageError, match=r"\.bmp"):
        encode_picture(Picture(chelsea), "bmp")


def test_masks(chelsea):
    mask = chelsea[..., 0] > 100
    height, width = mask.shape
    np.testing.assert_array_equal(read_mask(encode_mask(mask), (width, height)), mask)
    cut_out = np.dstack([np.full_like(chelsea, 255), mask * np.uint8(255)])
    data = pil_bytes(Image.fromarray(cut_out), "PNG")
    np.testing.assert_array_equal(read_mask(data, (width, height)), mask)
    with pytest.raises(ImageError, match=f"{width} x {height} px, the photo 10 x 20 px"):
        read_mask(encode_mask(mask), (10, 20))


def test_resized_keeps_the_mean(chelsea):
    for width, height in ((100, 60), (900, 600)):
        small = resized(chelsea, width, height)
        assert small.shape == (height, width, 3)
        assert abs(small.mean() - chelsea.mean()) < 0.5


@over("mode", ["1", "L", "LA", "La", "P", "PA", "RGB", "RGBA", "RGBa", "CMYK", "YCbCr", "HSV"])
def test_every_mode_of_pillow_becomes_a_picture(mode: str, chelsea: np.ndarray) -> None:
    image = Image.fromarray(chelsea[:20, :30]).convert("L" if mode in ("La", "PA") else "RGB")
    for step in {"La": ("LA", "La"), "PA": ("P", "PA"), "RGBa": ("RGBA", "RGBa")}.get(
        mode, (mode,)
    ):
        image = image.convert(step)
    assert read_picture(encode_pil(image)).pixels.shape == (20, 30, 3)


@over("mode", ["L", "RGB", "CMYK", "I;16"])
@over("kind", ["JPEG", "TIFF", "PNG", "WEBP"])
@over("orientation", [1, 6])
def test_an_image_of_pillow_is_the_photo_of_its_file(mode, kind, orientation, chelsea) -> None:
    if {"CMYK": "PNG WEBP", "I;16": "JPEG WEBP"}.get(mode, "").count(kind):
        return  # no such files
    image = Image.fromarray(chelsea[:20, :30])
    deep_grey = Image.fromarray(deep(chelsea[:20, :30, 0]))
    image = deep_grey if mode == "I;16" else image.convert(mode)
    icc = {"L": GREY_PROFILE, "I;16": GREY_PROFILE, "RGB": SRGB}.get(mode)
    exif = Image.Exif()
    exif.load(exif_block(orientation).tobytes())  # what TIFF files take it from
    data = pil_bytes(image, kind, exif=exif, icc_profile=icc)
    direct, opened = read_picture(data), read_picture(encode_pil(Image.open(io.BytesIO(data))))
    assert_same(opened, direct)
    assert opened.icc == direct.icc
    assert opened.focal_35mm == direct.focal_35mm == 35.0


def test_a_tiff_channel_that_is_no_alpha_is_left_out_at_any_depth(chelsea: np.ndarray) -> None:
    samples = np.dstack([chelsea[:20, :30], chelsea[:20, :30, :1]])
    for kind in (np.uint8, np.uint16):
        data = tiff_bytes(samples.astype(kind), photometric="rgb", extrasamples=["unspecified"])
        assert read_picture(data).alpha is None
