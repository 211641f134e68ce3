"""Compiles what the editor uses, so that nobody waits for it: `python -m app.warm_up`."""

from __future__ import annotations

from objectmorpher_core import warm_up as core

from .render import flattening
from .shape import build_shape, rehearse


def warm_up() -> None:
    """A minute or two the first time after an installation, a second afterwards."""
    document = core.warm_up()
    rehearse(build_shape(document.photo.camera, document.objects[0]), document.photo.camera)
    flattening.rehearse()


if __name__ == "__main__":
    warm_up()
