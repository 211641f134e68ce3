"""Layers in a file that paint programs open, read back by nothing of ours."""

from __future__ import annotations

import io
import zipfile
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

from objectmorpher_core.compose.layers import Layer, layers
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Placement
from objectmorpher_core.pictures.image import Picture
from objectmorpher_core.pictures.openraster import encode_openraster
from tests import shapes


@pytest.fixture(scope="module")
def exported() -> tuple[Picture, bytes]:
    document = shapes.scene("ellipse").document()
    result, pile = layers(edits.set_placement(document, 0, Placement(move=(18.0, -7.0))))
    merged = Picture(result.pixels)
    return merged, encode_openraster(pile, merged)


def drawn(data: bytes) -> Image.Image:
    """What the specification says that a file looks like, by Pillow's own blending."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        root = ElementTree.fromstring(archive.read("stack.xml"))
        picture = Image.new("RGBA", (int(root.attrib["w"]), int(root.attrib["h"])))
        stack = root.find("stack")
        assert stack is not None
        for layer in reversed(stack.findall("layer")):
            told = layer.attrib
            if told["visibility"] == "hidden":
                continue
            over = Image.new("RGBA", picture.size)
            image = Image.open(io.BytesIO(archive.read(told["src"]))).convert("RGBA")
            over.paste(image, (int(told["x"]), int(told["y"])))
            if told["composite-op"] == "svg:dst-in":
                picture.putalpha(over.getchannel("A"))
            else:
                picture = Image.alpha_composite(picture, over)
    return picture


def test_its_layers_look_like_the_export(exported):
    merged, data = exported
    found = np.asarray(drawn(data))
    assert (found[..., 3] == 255).all()
    assert np.abs(found[..., :3].astype(int) - merged.pixels).max() <= 3
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        whole = np.asarray(Image.open(io.BytesIO(archive.read("mergedimage.png"))))
        assert np.array_equal(whole, merged.pixels)
        assert max(Image.open(io.BytesIO(archive.read("Thumbnails/thumbnail.png"))).size) <= 256


def test_the_kind_of_file_stands_at_its_head(exported):
    _, data = exported
    assert data[30:54] == b"mimetypeimage/openraster"  # after the zip's first header, not packed
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        assert archive.testzip() is None
        assert archive.infolist()[0].compress_type == zipfile.ZIP_STORED


def test_a_transparent_photo_stays_transparent():
    pixels = np.full((20, 30, 3), 90, np.uint8)
    alpha = np.tile(np.linspace(0, 255, 30).astype(np.uint8), (20, 1))
    dot = np.dstack([np.full((4, 5, 3), 200, np.uint8), np.full((4, 5), 128, np.uint8)])
    data = encode_openraster([Layer("Photo", pixels), Layer("dot", dot, 3, 2)],
                             Picture(pixels, alpha))  # fmt: skip
    assert np.array_equal(np.asarray(drawn(data))[..., 3], alpha)


def test_any_name_and_twice_the_same_bytes():
    pixels = np.zeros((3, 4, 3), np.uint8)
    pile = [Layer('a<b>&"c" \x00\x1f\ud800 \u00e4\u6f22', pixels)]
    data = encode_openraster(pile, Picture(pixels))
    assert data == encode_openraster(pile, Picture(pixels))
    assert drawn(data).size == (4, 3)


def test_another_program_opens_it(exported, tmp_path):
    pyora = pytest.importorskip("pyora", reason="an independent reader, if it is there")
    path = tmp_path / "edit.ora"
    path.write_bytes(exported[1])
    project = pyora.Project.load(str(path))
    names = [layer.name for layer in project.children]
    assert names[0] == "Photo" and names[-1] == "Photo, untouched"
    found = np.asarray(project.get_image_data(use_original=False).convert("RGB")).astype(int)
    assert np.abs(found - exported[0].pixels).max() <= 3
