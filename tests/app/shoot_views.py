"""Pictures of every view, taken in the program's own window: for golden tests and for the docs.

`python tests/app/shoot_views.py OUT [SESSION]` needs a display; it writes a PNG of the canvas for
each view into the folder OUT. Without a session it draws the made one of the tests; of a square
photo's session, `--montage docs/views.jpg` puts them side by side.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from PIL import Image

from objectmorpher.canvas.derived import Derived
from objectmorpher.cli.options import WindowOptions
from objectmorpher.commands import COMMANDS
from objectmorpher.editor.view import Shown
from objectmorpher.gui.window.glfw_window import open_window
from objectmorpher.gui.window.window import Window
from objectmorpher_core import pipeline
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, LiftSettings, Placement, Prompt
from objectmorpher_core.pictures.image import Picture, encode_picture
from objectmorpher_core.session.file import decode_session
from tests import remembered

WIDTH, HEIGHT = 240, 160  # px of the made photo
AROUND = (48 + 300, 32 + 28)  # points of the window beside the canvas
CORNER = (48, 32)  # points, of the canvas in the window
CANVAS = (660, 420)  # with what is beside it wide enough for the panel
LARGE = (780, 780)  # of a session's pictures
TILE, GAP = 440, 6  # px, of the montage
NAMES = (
    "composite", "object", "depth", "normals", "provenance", "strain", "graph", "split", "rest",
)  # fmt: skip
SETTLE = 4  # frames until the interface and the picture are as they stay
GAUSSIANS = 2500
TURN = (-65.0, 0.0, 0.0)  # degrees


def made_document() -> Document:
    """A striped club before a plain wall, bent and turned: some of its back is seen."""
    return remembered.once(b"the striped club", _made)


def _made() -> Document:
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
    wall = np.stack([60 + 0.1 * x, 92 + 0.25 * y, 120 + 0.1 * x], -1)
    across = (x - 100) / np.interp(y, [20, 60, 110, 145], [17, 20, 36, 28])
    ends = np.minimum(y - 18, 146 - y)
    inside = np.minimum(1 - across**2, ends / 16)
    light = 0.5 + 0.5 * np.sqrt(np.clip(inside, 0, 1)) - 0.12 * across
    stripe = (np.floor(y / 12) % 2 == 0)[..., None]
    body = np.where(stripe, (226, 84, 48), (244, 214, 150)) * light[..., None]
    share = np.clip(inside / 0.08, 0, 1)[..., None]
    pixels = (wall * (1 - share) + body * share).clip(0, 255).astype(np.uint8)
    mask = share[..., 0] > 0.5
    document = pipeline.open_photo(encode_picture(Picture(pixels), ".png"), "club.png")
    document = edits.add_object(document)
    document = edits.set_mask(document, 0, mask, Prompt())
    photo = document.photo
    matte, lifted = pipeline.lift_mask(
        photo.pixels, photo.camera, mask, "relief", LiftSettings(GAUSSIANS, trust=0)
    )
    document = edits.set_lifted(document, 0, matte, lifted)
    plate = pipeline.make_plate(photo.pixels, mask, "telea")
    return _bent(edits.set_plate(document, plate))


def _bent(document: Document) -> Document:
    """Its top is pulled to the right, its foot is pinned; then all of it is turned."""
    derived = Derived()
    for xy, move in (((100.0, 28.0), (62.0, 26.0)), ((100.0, 132.0), (0.0, 0.0))):
        shape = derived.shape(document.photo, document.objects[0])
        point = shape.puppet.pick(xy, None, Placement(), shape.texture)
        assert point is not None
        spot = derived.spot(document, 0, point.rest).moved(np.array(move), 0.0)
        target = derived.unplaced(document, 0, document.photo.camera.unproject(spot.xy, spot.depth))
        document = edits.add_handle(document, 0, point.rest, target, is_pin=move == (0.0, 0.0))
    document = derived.solved(document, 0, None)
    return edits.set_placement(document, 0, Placement(turn=TURN))


def _at_rest(document: Document) -> Document:
    for h in reversed(range(len(document.objects[0].handles))):
        document = edits.remove_handle(document, 0, h)
    return edits.set_placement(edits.set_pose(document, 0, None), 0, Placement())


class Shooter:
    """A window whose canvas is `size` px, and the folder for what it shows."""

    def __init__(self, out: Path, renderer: str, size: tuple[int, int]) -> None:
        self._out, self._canvas = out, size
        self._whole = (size[0] + AROUND[0], size[1] + AROUND[1])
        options = WindowOptions(renderer=renderer, size=self._whole, scale=1.0, frames=1)
        self._window = Window(options, open_window(options))  # `frames`: every picture is exact
        self.gl_name = self._window._renderer.gl_name
        self.editor = self._window.editor

    def press(self, name: str) -> None:
        """A command by its shortcut, as a hand would."""
        self._window._input.take_key(COMMANDS[name].keys)

    def write(self, name: str) -> None:
        for _ in range(SETTLE):
            self._window._frame()
        (left, top), (width, height) = CORNER, self._canvas
        pixels = self._window._renderer.read(self._whole)
        part = Image.fromarray(pixels[top : top + height, left : left + width])
        part.save(self._out / f"{name}.png", optimize=True)

    def close(self) -> None:
        self._window.close()


def shoot(document: Document, out: Path, renderer: str, size: tuple[int, int]) -> None:
    """A PNG for each view, for the control graph, for a split, and for an object at rest."""
    shooter = Shooter(out, renderer, size)
    print(shooter.gl_name)
    shooter.editor.start(document)
    for shown in Shown:
        shooter.press(f"show_{shown.name.lower()}")
        shooter.write(shown.name.lower())
    shooter.press("show_composite")
    shooter.press("points")
    shooter.write("graph")
    shooter.press("points")
    shooter.press("show_depth")
    shooter.press("split")
    shooter.write("split")
    shooter.editor.start(_at_rest(document))
    shooter.press("show_normals")
    shooter.write("rest")
    shooter.close()


def montage(folder: Path, path: Path) -> None:
    """Two rows of four views, as in docs/views.jpg."""
    sheet = Image.new("RGB", (4 * TILE + 3 * GAP, 2 * TILE + GAP), (20, 21, 23))
    for k, name in enumerate(NAMES[:8]):
        shot = Image.open(folder / f"{name}.png")
        shot = shot.crop((8, 8, shot.width - 8, shot.height - 8))
        shot = shot.resize((TILE, TILE), Image.Resampling.LANCZOS)
        sheet.paste(shot, ((k % 4) * (TILE + GAP), (k // 4) * (TILE + GAP)))
    sheet.save(path, quality=80, optimize=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("session", type=Path, nargs="?")
    parser.add_argument("--renderer", choices=("tiles", "gl"), default="tiles")
    parser.add_argument("--montage", type=Path, metavar="F.jpg")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    if options.session is None:
        shoot(made_document(), options.out, options.renderer, CANVAS)
    else:
        document = decode_session(options.session.read_bytes())
        shoot(document, options.out, options.renderer, LARGE)
    if options.montage is not None:
        montage(options.out, options.montage)


if __name__ == "__main__":
    main()
