"""Photos of extreme shapes and all kinds of pixels, and masks: what command lines are run on."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from PIL import Image
from skimage import data

from objectmorpher_core.pictures.image import Picture, encode_mask, encode_picture

SIDES = {  # px; small ones are run more often than large ones, see `command_lines`
    "plain": (64, 48), "one": (1, 1), "two": (2, 3), "thin": (1, 300), "flat": (300, 1),
    "strip": (340, 17), "wide": (5000, 17), "tall": (17, 5000), "widest": (20_000, 66),
    "tallest": (66, 20_000),
}  # fmt: skip
KINDS = {  # of pixels, of the plain photo
    "grey.png": "L", "alpha.png": "RGBA", "grey-alpha.png": "LA", "palette.png": "P",
    "bits.png": "1", "grey.jpg": "L", "cmyk.jpg": "CMYK", "alpha.webp": "RGBA", "rgb.bmp": "RGB",
    "palette.gif": "P", "float.tif": "F", "lab.tif": "LAB", "bits.tif": "1", "rgb.tif": "RGB",
}  # fmt: skip
LARGE = ("wide", "tall", "widest", "tallest")


def make_files(folder: Path) -> None:
    """Writes photos and masks, a session's script, splats, and files that are none of these."""
    folder.mkdir(exist_ok=True)
    cat = Image.fromarray(data.chelsea())
    for name, size in SIDES.items():
        cat.resize(size).save(folder / f"{name}.png")
        _masks(folder, name, size)
    plain = cat.resize(SIDES["plain"])
    for name, mode in KINDS.items():
        image = _in_mode(plain, mode)
        image.save(folder / name)
    deep = np.asarray(plain).astype(np.uint16) * 257
    for name, picture in {
        "deep.png": Picture(deep), "deep.tif": Picture(deep),
        "deep-alpha.png": Picture(deep, deep[..., 0]), "deep-grey.png": Picture(deep, is_grey=True),
    }.items():  # fmt: skip
        (folder / name).write_bytes(encode_picture(picture, Path(name).suffix))
    (folder / "broken.jpg").write_bytes((folder / "grey.jpg").read_bytes()[:300])
    (folder / "empty.png").write_bytes(b"")
    (folder / "text.png").write_text("not a picture", encoding="utf-8")
    (folder / "cloud.off").write_text("OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n"
                                      "3 0 3 2\n3 1 2 3\n", encoding="utf-8")  # fmt: skip
    script = {"click": [[32, 24]], "move": [4, 2], "gaussians": 200, "inpaint": "telea"}
    (folder / "script.json").write_text(json.dumps(script), encoding="utf-8")


def _in_mode(image: Image.Image, mode: str) -> Image.Image:
    if mode == "LAB":
        from PIL import ImageCms

        profile = ImageCms.createProfile
        turned = ImageCms.profileToProfile(image, profile("sRGB"), profile("LAB"), outputMode="LAB")
        assert turned is not None
        return turned
    if mode in ("RGBA", "LA"):
        image = image.convert(mode)
        image.putalpha(Image.linear_gradient("L").resize(image.size))
        return image
    return image.convert(mode)


def _masks(folder: Path, name: str, size: tuple[int, int]) -> None:
    """In the middle; of all but the rim; of one line; of nothing."""
    width, height = size
    middle, most, line, none = (np.zeros((height, width), bool) for _ in range(4))
    middle[height // 3 : -(-2 * height // 3), width // 3 : -(-2 * width // 3)] = True
    most[height // 20 : height - height // 20, 1 : width - 1] = True
    line[height // 2] = True
    for kind, mask in (("", middle), ("-most", most), ("-line", line), ("-none", none)):
        (folder / f"{name}-mask{kind}.png").write_bytes(encode_mask(mask))
