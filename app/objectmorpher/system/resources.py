"""The program's own files: shaders, sample photos, fonts, the icon."""

from __future__ import annotations

from pathlib import Path

PACKAGE = Path(__file__).parents[1]
CHECKOUT = PACKAGE.parents[1]


def resource(name: str) -> Path:
    """The file or folder called `name`, such as "shaders/splat.vert".

    A wheel holds it inside the package, a checkout at its root. Raises FileNotFoundError.
    """
    for folder in (PACKAGE, CHECKOUT):
        path = folder / name
        if path.exists():
            return path
    raise FileNotFoundError(f"{name} is missing from the installation in {PACKAGE}")
