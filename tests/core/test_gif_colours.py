"""The few colours of a GIF are those that its frames show."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from PIL import Image, ImageSequence

from objectmorpher_core.document import edits
from objectmorpher_core.pictures.video import encode_video
from objectmorpher_core.scripting.animation import Clip, frames
from objectmorpher_core.scripting.outputs import Export
from tests import shapes
from tests.photos import photo

CYAN = (10, 240, 230)


def test_what_is_clear_takes_none_of_them():
    """Under clear ground any colours may lie: what is seen is as fine as without them."""
    shown = cv2.resize(photo("coffee"), (160, 120), interpolation=cv2.INTER_AREA)
    alpha = np.zeros(shown.shape[:2], np.uint8)
    alpha[:, :40] = 255
    noise = np.random.default_rng(5).integers(0, 256, shown.shape).astype(np.uint8)
    found = []
    for hidden in (noise, np.zeros_like(noise)):
        frame = np.dstack([np.where(alpha[..., None] > 0, shown, hidden), alpha])
        with Image.open(io.BytesIO(encode_video(iter([frame, frame]), 10.0, ".gif"))) as image:
            found.append(np.asarray(image.convert("RGBA"))[:, :36])  # beside what is dithered
    off = [np.abs(each[..., :3].astype(int) - shown[:, :36]).mean() for each in found]
    assert max(off) < 4 and abs(off[0] - off[1]) < 0.1


def test_a_picture_of_nothing_is_a_film_too():
    nothing = np.zeros((20, 30, 4), np.uint8)
    with Image.open(io.BytesIO(encode_video(iter([nothing]), 10.0, ".gif"))) as image:
        assert (np.asarray(image.convert("RGBA"))[..., 3] == 0).all()


def test_what_shows_only_midway_has_its_colours(tmp_path: Path):
    """Behind a thing that turns there is cyan, which neither the photo nor the edit shows."""
    document = shapes.scene("ellipse").document()
    plate = document.plate
    assert plate is not None
    behind = replace(plate, pixels=np.full_like(plate.pixels, CYAN))
    document, clip = edits.set_plate(document, behind), Clip("turn", seconds=2.0, rate=12)
    data = Export(document, clip=clip).encode("video", tmp_path / "made.gif")
    is_cyan = [np.abs(f.astype(int) - CYAN).max(-1) < 20 for f in frames(document, clip)]
    assert not is_cyan[0].any() and max(each.sum() for each in is_cyan) > 500
    with Image.open(io.BytesIO(data)) as image:
        for found, there in zip(ImageSequence.Iterator(image), is_cyan, strict=True):
            if there.sum() > 500:
                colours = np.asarray(found.convert("RGB"))[there].astype(int)
                assert np.abs(colours - CYAN).mean() < 15
