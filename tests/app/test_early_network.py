"""DINOv2 is opened while modules are imported, where that gains anything."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

from objectmorpher.system.warm_up import open_early
from objectmorpher_core import models
from objectmorpher_core.segment import dino_tokens, salience

ROOT = Path(__file__).parents[2]
PHOTO = ROOT / "assets/samples/coffee.jpg"
TOLD = """
import sys
from pathlib import Path
from objectmorpher.system.warm_up import open_early
for photo, segmenter in zip(sys.argv[1::2], sys.argv[2::2]):
    opening = open_early(Path(photo), segmenter or None, True)
    if opening is None:
        print("nothing")
        continue
    opening.join()
    from objectmorpher_core.segment import dino_tokens
    print("opened", dino_tokens._opened.cache_info().currsize)
    later = ("objectmorpher_core.pipeline", "objectmorpher.cli.commands")
    print(any(name in sys.modules for name in later))
    from objectmorpher_core.pictures.image import read_picture
    from objectmorpher_core.segment import salience
    from objectmorpher_core.segment.dino_walk import DinoWalk
    waiting = len(dino_tokens._early._known), len(salience._early._known)
    rgb = read_picture(Path(photo).read_bytes()).pixels
    found = DinoWalk().encode(rgb)  # it asks about no other pictures than those that were begun
    asked = len(dino_tokens._early._known), len(salience._early._known)
    for module in (dino_tokens, salience):
        module._early = type(module._early)(module.KEPT)
    anew = DinoWalk().encode(rgb)
    print(*waiting, *asked)
    print((found.tokens == anew.tokens).all(), (found.salience == anew.salience).all())
"""


def told(*asked: tuple[Path, str]) -> str:
    """What a new process says of photos, each with the segmenter that is asked for."""
    command = [sys.executable, "-c", TOLD, *(str(each) for pair in asked for each in pair)]
    return subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout


def test_it_has_seen_the_photo_before_the_stages_are_imported(tmp_path: Path) -> None:
    if None in (models.path(dino_tokens.WEIGHT), models.path(salience.WEIGHT)):
        pytest.skip("the weights are not here")
    opened, answers = ["opened", "1", "False"], ["1", "1", "1", "1", "True", "True"]
    small = tmp_path / "small.png"  # of a few patches: the network looks at it three times
    with Image.open(PHOTO) as photo:
        photo.resize((96, 64)).save(small)
    assert told((small, "")).split() == opened + answers


def test_nothing_is_opened_that_is_not_needed() -> None:
    found = told((PHOTO, "grabcut"), (ROOT / "assets/none.jpg", ""))
    assert found.split() == ["nothing", "nothing"]


def test_nothing_is_gained_once_everything_is_imported() -> None:
    import objectmorpher_core.pipeline  # noqa: F401

    assert open_early(PHOTO, None) is None
