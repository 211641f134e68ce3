"""Every view in the real window, compared with pictures that were looked at.

Where a change of the pictures is meant, make them anew, look at them, and commit them:

    OBJECTMORPHER_GOLDEN=1 python -m pytest tests/app/test_views.py
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageChops

from hands import PATIENCE, ROOT, Hands, opened
from objectmorpher_core.session.file import save_session
from shoot_views import NAMES, made_document
from tests.tree import PYTHONPATH

pytestmark = [pytest.mark.window, pytest.mark.slow]

GOLDEN = Path(__file__).parent / "golden"
IS_MADE_ANEW = bool(os.environ.get("OBJECTMORPHER_GOLDEN"))
# Grey levels, mean over the canvas. The two renderers differ by 0.01, another processor's rounding
# by as little; a legend that moves by a pixel, or a hatch that is gone, by more than 0.3.
TOLERANCE = 0.15
AMPLIFIED = 8  # x the difference, in the picture of a failure


def shoot(environment: dict[str, str], out: Path, renderer: str) -> None:
    """The made document's views as PNGs in `out`; skips where OpenGL is not llvmpipe."""
    if shutil.which("xdotool"):  # a pointer on the canvas would show what it is over
        subprocess.run(["xdotool", "mousemove", "1430", "890"], env=environment, check=False)
    command = [sys.executable, str(Path(__file__).parent / "shoot_views.py"), str(out)]
    result = subprocess.run(
        [*command, "--renderer", renderer],
        env={**environment, "PYTHONPATH": PYTHONPATH},
        capture_output=True, text=True, timeout=3 * PATIENCE, cwd=ROOT,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    if "llvmpipe" not in result.stdout:
        pytest.skip(f"the pictures are llvmpipe's, and this is {result.stdout.strip()}")


@pytest.mark.parametrize("renderer", ["tiles", "gl"])
def test_views_look_as_they_did(
    without_networks: dict[str, str], tmp_path: Path, renderer: str
) -> None:
    shoot(without_networks, tmp_path, renderer)
    if IS_MADE_ANEW and renderer == "tiles":
        GOLDEN.mkdir(exist_ok=True)
        for name in NAMES:
            shutil.copy(tmp_path / f"{name}.png", GOLDEN / f"{name}.png")
    complaints = [c for name in NAMES if (c := difference(tmp_path / f"{name}.png"))]
    assert not complaints, "; ".join(complaints)


def difference(path: Path) -> str:
    """What is wrong with a picture, "" for nothing; what differs is drawn beside it."""
    shown, golden = Image.open(path), Image.open(GOLDEN / path.name)
    if shown.size != golden.size:
        return f"{path.name} is {shown.size}, not {golden.size}"
    apart = ImageChops.difference(shown, golden)
    mean = float(np.asarray(apart).mean())
    if mean <= TOLERANCE:
        return ""
    beside = path.with_name(f"{path.stem}-difference.png")
    apart.point(lambda level: level * AMPLIFIED).save(beside)
    return f"{path.name} differs by {mean:.2f} grey levels, see {beside}"


def test_the_golden_pictures_are_small() -> None:
    sizes = [path.stat().st_size for path in GOLDEN.glob("*.png")]
    assert len(sizes) == len(NAMES)
    assert max(sizes) < 120_000 and sum(sizes) < 1_000_000


@pytest.fixture
def posed(without_networks: dict[str, str], tmp_path: Path) -> Iterator[Hands]:
    """Hands on a window that shows the made document."""
    session = tmp_path / "club.omorph"
    save_session(made_document(), session)
    with opened(without_networks, session) as hands:
        yield hands


def test_keys_switch_views(posed: Hands) -> None:
    at = (180, 200)  # on the photo, beside the object: wall, or the views' paper
    posed.wait(lambda: posed.picture()[at[1], at[0], 2] > 90, "showing the photo")
    wall = posed.picture()[at[1], at[0], :3]

    def is_paper() -> bool:
        return bool((posed.picture()[at[1], at[0], :3] == (0x26, 0x28, 0x2C)).all())

    def is_wall() -> bool:
        return bool((posed.picture()[at[1], at[0], :3] == wall).all())

    posed.press("alt+3")
    posed.wait(is_paper, "showing depth")
    posed.press("x")  # the photo as it was while X is held: it is let go here
    posed.wait(is_paper, "showing depth again")
    posed.press("alt+6")
    posed.wait(is_wall, "showing strain")
    posed.press("alt+4")
    posed.wait(is_paper, "showing normals")
    posed.press("alt+1")
    posed.wait(is_wall, "showing the photo")
    assert "edited" not in posed.title()  # a view is no step
