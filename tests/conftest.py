"""Fixtures for every test: the real photos, as (H, W, 3) u8 RGB arrays.

`--note=FILE` adds the names of what passed to a file, `--without=FILE` leaves those out: a later
stage, for which more is installed, does not do again what passed without it.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy: ARCHITECTURE section 8

from tests import photos


def _photo_fixture(name: str):
    @pytest.fixture(name=name, scope="session")
    def fixture():
        return photos.photo(name)

    return fixture


chelsea, coffee, astronaut, rocket, flower, china = map(_photo_fixture, photos.NAMES)


@pytest.fixture(scope="module")
def lifted_once() -> Iterator[None]:
    """For a module: the same object of the same photo is lifted once, and its progress repeated.

    What is lifted is immutable, and that two lifts are equal is tested in tests/core/lift.
    """
    from objectmorpher_core.lift.relief.lifter import ReliefLifter

    lift, known = ReliefLifter.lift, {}

    def remembered(self, subject, settings, progress, seed=0):
        matte = subject.matte
        arrays = (subject.pixels, subject.mask, matte.alpha, matte.foreground, settings.hidden,
                  settings.nearness)  # fmt: skip
        told = repr((matte.box, subject.camera, vars(settings), seed)).encode()
        digest = hashlib.sha256(told)
        for array in arrays:
            digest.update(b"" if array is None else repr(array.shape).encode() + array.tobytes())
        if (key := digest.digest()) in known:
            lifted, steps = known[key]
            for step in steps:
                progress(*step)
            return lifted
        steps = []

        def note(fraction: float, text: str) -> None:
            steps.append((fraction, text))
            progress(fraction, text)

        known[key] = lift(self, subject, settings, note, seed), steps
        return known[key][0]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ReliefLifter, "lift", remembered)
        yield


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--note", type=Path, help="add the names of the tests that pass to this file")
    parser.addoption("--without", type=Path, help="leave out the tests that this file names")


def pytest_configure(config: pytest.Config) -> None:
    path = config.getoption("--note")
    if path is not None and not hasattr(config, "workerinput"):  # reports come to the first process
        config.pluginmanager.register(_Notes(path))


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Whole files of the slow stage, and what they import, are not read where it is not run."""
    if config.option.markexpr != "not slow" or not collection_path.match("test_*.py"):
        return None
    text = collection_path.read_text(encoding="utf-8")
    return True if re.search(r"^pytestmark = .*\bmark\.slow\b", text, re.MULTILINE) else None


LONG = (  # files and folders of which a test takes long: they begin
    "tests/fuzz", "tests/faults", "tests/soak", "test_train", "test_autosave", "test_worker",
    "test_window", "test_first_use", "test_refin", "app/editing", "app/tools", "tests/app",
    "core/compose",
)  # fmt: skip


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: next((k for k, n in enumerate(LONG) if n in item.nodeid), 99))
    path = config.getoption("--without")
    if path is None:
        return
    known = set(path.read_text(encoding="utf-8").splitlines())
    left = [item for item in items if item.nodeid in known]
    items[:] = [item for item in items if item.nodeid not in known]
    config.hook.pytest_deselected(items=left)


class _Notes:
    """Adds to the file as tests pass."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "call" and report.passed:
            with self._path.open("a", encoding="utf-8") as file:
                file.write(report.nodeid + "\n")
