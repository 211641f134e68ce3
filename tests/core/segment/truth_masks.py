"""Objects in real photos, outlined by hand: what a selection is measured against."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import cv2
import numpy as np

from tests.photos import photo

FOLDER = Path(__file__).parent / "truth"
OUTLINES = FOLDER / "outlines.json"
FINER = 8  # subpixels a pixel is cut into, each way, where an outline is drawn


@dataclass(frozen=True)
class Truth:
    """One object."""

    name: str
    photo: str  # tests.photos
    kind: str  # "whole", or "part" of a whole
    is_held_out: bool  # no constant was tuned on it, but those that docs/selection.md names


TRUTHS = (
    Truth("astronaut", "astronaut", "whole", False),  # cut by the frame, orange, white and black
    Truth("cat", "chelsea", "whole", False),  # cut by the frame, partly out of focus
    Truth("coffee", "coffee", "whole", False),  # a cup, its saucer, a spoon
    Truth("rocket", "rocket", "whole", False),  # narrow
    Truth("cameraman", "camera", "whole", False),  # grey, black coat and light face, three pieces
    Truth("tower", "camera", "whole", False),  # small and distant
    Truth("pagoda", "china", "whole", False),  # many colours, half hidden by trees
    Truth("dahlia", "flower", "whole", False),
    Truth("shuttle", "astronaut", "whole", True),  # in the background, white, brown and black
    Truth("motorcycle", "motorcycle", "whole", True),  # in front of clutter, with holes
    Truth("tripod", "camera", "whole", True),  # thin
    Truth("second flower", "flower", "whole", True),  # cut by the frame, small
    Truth("coin", "coins", "whole", True),  # one of many
    Truth("helmet", "astronaut", "part", False),
    Truth("iris", "chelsea", "part", False),
    Truth("coffee surface", "coffee", "part", False),
    Truth("spoon", "coffee", "part", False),
    Truth("seat", "motorcycle", "part", False),
    Truth("face", "astronaut", "part", True),
    Truth("headlight", "motorcycle", "part", True),
)

# Drawn before corrections were decided in finer pieces, to see whether that holds for other things.
LATER = (
    Truth("flag", "astronaut", "whole", True),  # cut by the frame, of the background's white
    Truth("mast", "rocket", "whole", True),  # six pixels wide, half in a lattice
    Truth("dim coin", "coins", "whole", True),
    Truth("patch", "astronaut", "part", True),
    Truth("valve", "astronaut", "part", True),  # cut by the frame
)


def truth(name: str) -> Truth:
    """The one called `name`."""
    return next(each for each in (*TRUTHS, *LATER) if each.name == name)


@cache
def truth_mask(name: str) -> np.ndarray:
    """(H, W) bool, the object called `name`, from its PNG; read-only."""
    coded = np.fromfile(_file(name), np.uint8)
    image = cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE)
    assert image is not None, name
    mask = image > 0
    mask.setflags(write=False)
    return mask


def draw_mask(name: str) -> np.ndarray:
    """(H, W) bool, the same from its outline: pixels that it covers by more than half."""
    height, width = photo(truth(name).photo).shape[:2]
    rings = json.loads(OUTLINES.read_text(encoding="utf-8"))[name]
    fine = np.zeros((height * FINER, width * FINER), np.uint8)
    corners = [np.round(np.array(ring) * FINER * 16 - 8).astype(np.int32) for ring in rings]
    cv2.fillPoly(fine, corners, (1,), cv2.LINE_8, 4)  # even-odd: a ring inside another is a hole
    share = fine.reshape(height, FINER, width, FINER).mean((1, 3))
    return share > 0.5


def write_masks() -> None:
    """Draws every PNG anew: `python -m tests.core.segment.truth_masks`."""
    for each in (*TRUTHS, *LATER):
        image = draw_mask(each.name).astype(np.uint8) * 255
        _, coded = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_BILEVEL, 1])
        _file(each.name).write_bytes(coded.tobytes())


def _file(name: str) -> Path:
    return FOLDER / f"{name.replace(' ', '_')}.png"


if __name__ == "__main__":
    write_masks()
