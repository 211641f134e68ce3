"""A process that edits without end, for tests that kill it: `python edit_until_killed.py LOG`.

Each line of the log is a step's number and the time (s, monotonic) when it was made.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from objectmorpher_core.base.camera import Camera
from objectmorpher_core.document.model import Document, EditObject, Matte, Photo, Placement
from objectmorpher_core.pictures.image import Picture, encode_picture, read_picture

STEP = 0.05  # s between two steps


def base_document() -> Document:
    """A photo of noise, nothing in it."""
    pixels = np.random.default_rng(1).integers(0, 256, (300, 400, 3), dtype=np.uint8)
    source = encode_picture(Picture(pixels), "png")
    return Document(Photo(read_picture(source), Camera.from_fov(400, 300), source, "noise.png"))


def step_document(base: Document, n: int) -> Document:
    """Step `n`; the same number gives the same document. Heavy arrays change now and then."""
    random = np.random.default_rng(n // 20)
    mask = random.random((300, 400)) > 0.5
    matte = Matte(0, 0, random.random((300, 400), np.float32),
                  random.random((300, 400, 3), np.float32))  # fmt: skip
    thing = EditObject("Object 1", mask=mask, placement=Placement(move=(float(n), 0.0)))
    return replace(base, objects=(replace(thing, matte=matte),))


def main(log: Path) -> None:
    from objectmorpher.editor.editor import Editor
    from objectmorpher.editor.settings import Settings

    editor = Editor(Settings())
    base = base_document()
    editor.start(base)
    document = base
    for n in range(1, 1_000_000):
        fresh = step_document(base, n)
        if n % 20 and document is not base:  # the arrays stay, as they do in an edit
            thing = replace(document.objects[0], placement=fresh.objects[0].placement)
            fresh = document.with_object(0, thing)
        document = fresh
        editor.apply(f"Step {n}", document)
        with log.open("a") as file:
            file.write(f"{n} {time.monotonic()}\n")
        end = time.monotonic() + STEP
        while time.monotonic() < end:
            editor.poll()
            time.sleep(0.01)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
