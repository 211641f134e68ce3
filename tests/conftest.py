"""Fixtures for every test: the real photos, as (H, W, 3) u8 RGB arrays.

`--note=FILE` adds the names of what passed to a file, `--without=FILE` leaves those out: a later
stage, for which more is installed, does not do again what passed without it.
"""

from __future__ import annotations

import os
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


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--note", type=Path, help="add the names of the tests that pass to this file")
    parser.addoption("--without", type=Path, help="leave out the tests that this file names")


def pytest_configure(config: pytest.Config) -> None:
    path = config.getoption("--note")
    if path is not None and not hasattr(config, "workerinput"):  # reports come to the first process
        config.pluginmanager.register(_Notes(path))


LONG = (  # files and folders that take longest, by the process that does them: they begin
    "test_first_use", "test_window", "test_train", "tests/faults", "test_refin", "test_hostile",
    "app/editing", "app/tools", "tests/app", "core/compose",
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
