"""ObjectMorpher as a library: the main job in a few lines, or its parts, without a window.

    import objectmorpher_core as om

    edit = om.open("photo.jpg").click(310, 240).lift()
    edit = edit.pin(300, 330).drag((310, 180), (340, 190)).turn(yaw=20)
    edit.plate().harmonise().render().save("edited.png")

The names in `__all__` are stable (docs/python.md) and imported when they are used. Everything
below is the program's own and may change: numpy in, numpy out. Where the parts of the paper
(ObjectMorpher, CVPR 2026) are:

    3.1    choosing the object            segment/, models/
    3.1    image to 3D Gaussians          lift/, document/gaussians.py
    3.2.1  control points and graph       deform/control_points.py, deform/graph.py
    3.2.2  ARAP, Eq. 2-4                  deform/arap.py, deform/links.py, deform/deformer.py
    3.2.2  skinning, Eq. 5 and ours       deform/skinning.py
    3.3    picture, background, blending  raster/, compose/

A `document.Document` is all that is saved and undone; `edits` are its changes; `puppet.Puppet` is a
lifted object that can be posed, drawn and picked; `pipeline` strings the stages together.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .api import Edit, Result, Shape, open, read_scripts, replay

__all__ = ["Edit", "Result", "Shape", "__version__", "open", "read_scripts", "replay"]

__version__ = "0.1.0"


def __getattr__(name: str) -> Any:
    if name in __all__:
        return getattr(import_module(".api", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
