"""Where the program's own files are: shaders, sample photos, fonts, the icon."""

from __future__ import annotations

from pathlib import Path

PACKAGE = Path(__file__).parent


def resource(name: str) -> Path:
    """The file or folder called `name`, such as "shaders/splat.vert".

    A wheel carries it inside this package, a checkout beside it. Raises FileNotFoundError.
    """
    for folder in (PACKAGE, PACKAGE.parent):
        path = folder / name
        if path.exists():
            return path
    raise FileNotFoundError(f"{name} is missing from the installation in {PACKAGE}")
