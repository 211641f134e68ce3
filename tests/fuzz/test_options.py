"""The command line with values that nobody means: a picture, or one sentence."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from objectmorpher_core.lift.relief import shape_look
from tests.fuzz import options
from tests.fuzz.command_lines import options_of, values
from tests.fuzz.shapes_of_photos import make_files
from tests.tree import quick

pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="the limits on a process are Linux's"
)

# What the shape network sees has no depth in so wide a view; the outline alone has one.
WIDE = "done" if shape_look.missing() else "refused"
ONCE = {  # that ended otherwise; how each ends now
    "edit p/plain.png -o o.png --mask p/plain-mask.png --scale=1e9": "done",
    "edit p/plain.png -o o.png --mask p/plain-mask.png --move=5,5 --fov=170": WIDE,
    "edit p/tall.png -o o.png --mask p/tall-mask.png --move=5,5 --gaussians=200": "done",
    "edit p/tall.png -o o.png --mask p/tall-mask-most.png --move=5,5": "done",
    "edit p/plain.png -o o.png --mask p/plain-mask-line.png --move=5,5": "done",
    "edit /dev/zero -o o.png --subject": "refused",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """With the files that command lines name."""
    folder = tmp_path_factory.mktemp("options")
    make_files(folder / "p")
    return folder


@pytest.mark.parametrize("line", quick(sorted(ONCE, key=lambda line: ONCE[line] == "done"), 2))
def test_what_once_ended_in_a_traceback(line, folder, monkeypatch) -> None:
    monkeypatch.chdir(folder)
    how, why = options.verdict(line.split())
    assert how == ONCE[line], why


def test_every_option_with_a_value_is_drawn() -> None:
    """What has no strategy of its own takes numbers: then it must be one."""
    for action in options_of("edit"):
        if action.nargs != 0 and action.metavar not in values():
            assert action.type in (int, float), action.option_strings


@pytest.mark.slow
def test_sixty_command_lines() -> None:
    result = options.fuzz(number=2, runs=60, seconds=600)
    assert result["found"] == []
    runs = result["runs"]
    assert min(runs["done"], runs["refused"]) > 10 and sum(runs.values()) == 60
