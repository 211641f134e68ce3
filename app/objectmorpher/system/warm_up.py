"""Compile what the editor uses, so that nobody waits for it later.

Run it as `python -m objectmorpher.system.warm_up`.
"""

from __future__ import annotations

from objectmorpher_core import warm_up as core

from ..canvas.shape import build_shape, rehearse
from ..render import flattening
from ..render.splat_pass import near_to_far


def warm_up() -> None:
    """A minute or two the first time after an installation, seconds afterwards."""
    document = core.warm_up()
    camera, thing = document.photo.camera, document.objects[0]
    shape = build_shape(camera, thing)
    rehearse(shape, camera)
    near_to_far(shape.puppet.posed(thing.pose, thing.placement))
    flattening.rehearse()


if __name__ == "__main__":
    warm_up()
