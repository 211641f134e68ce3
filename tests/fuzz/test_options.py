"""The command line with values that nobody means: a picture, or one sentence."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from tests.fuzz import options
from tests.fuzz.command_lines import options_of, values
from tests.fuzz.shapes_of_photos import make_files

pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="the limits on a process are Linux's"
)

ONCE = {  # that ended otherwise; how each ends now
    "edit p/plain.png -o o.png --mask p/plain-mask.png --scale=1e9": "done",
    "edit p/plain.png -o o.png --mask p/plain-mask.png --move=5,5 --fov=170": "refused",
    "edit p/tall.png -o o.png --mask p/tall-mask.png --move=5,5 --gaussians=200": "done",
    "edit p/tall.png -o o.png --mask p/tall-mask-most.png --move=5,5": "done",
    "edit p/plain.png -o o.png --mask p/plain-mask-line.png --move=5,5": "done",
    "edit /dev/zero -o o.png --subject": "refused",
}


@pytest.mark.parametrize("line", ONCE)
def test_what_once_ended_in_a_traceback(line, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    make_files(Path("p"))
    how, why = options.verdict(line.split())
    assert how == ONCE[line], why


def test_every_option_with_a_value_is_drawn() -> None:
    """What has no strategy of its own takes numbers: then it must be one."""
    for action in options_of("edit"):
        if action.nargs != 0 and action.metavar not in values():
            assert action.type in (int, float), action.option_strings


@pytest.mark.slow
def test_a_few_hundred_command_lines() -> None:
    result = options.fuzz(number=1, runs=300, seconds=1500)
    assert result["found"] == []
    runs = result["runs"]
    assert min(runs["done"], runs["refused"]) > 30 and sum(runs.values()) == 300
