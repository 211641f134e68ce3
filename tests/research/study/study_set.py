"""A small comparison in a folder: photos, guidance, and what two methods made of them."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np

from objectmorpher_core.image import Picture, encode_picture
from tests.photos import photo

METHODS = ("blurrer-x", "shifter-y")  # words that occur nowhere else
SIZE = (150, 100)  # px
GUIDANCE = {
    "coffee": {"click": [[70, 50]], "move": [12, -6, 0]},
    "chelsea": {"subject": True, "handle": [{"at": [40, 20], "to": [60, 30]}], "text": "An ear."},
}


def save(path: Path, rgb: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(encode_picture(Picture(np.ascontiguousarray(rgb)), ".png"))


def small(name: str) -> np.ndarray:
    """(100, 150, 3) of one of the photos."""
    return cv2.resize(photo(name), SIZE, interpolation=cv2.INTER_AREA)


def made(rgb: np.ndarray) -> dict[str, np.ndarray]:
    """What the methods make of a photo."""
    return {
        METHODS[0]: cv2.GaussianBlur(rgb, (0, 0), 2.0),
        METHODS[1]: np.roll(rgb, 6, axis=1),
    }


def write_set(folder: Path) -> Path:
    """The folder with two subjects, each with results of both methods."""
    for name, guidance in GUIDANCE.items():
        rgb = small(name)
        save(folder / name / "image.png", rgb)
        (folder / name / "guidance.json").write_text(json.dumps(guidance))
        for method, result in made(rgb).items():
            save(folder / name / "results" / f"{method}.png", result)
    return folder
