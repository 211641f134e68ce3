"""Fixtures for every test: the real photos, as (H, W, 3) u8 RGB arrays.

`--note=FILE` adds the names of what passed to a file, `--without=FILE` leaves those out: a later
stage, for which more is installed, does not do again what passed without it.
"""

from __future__ import annotations

import gc
import hashlib
import os
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy
os.environ.setdefault("OMP_NUM_THREADS", "1")  # those of PyTorch wait busily for each other

import numpy as np

from objectmorpher_core import segment
from objectmorpher_core.base.progress import silent
from objectmorpher_core.models.onnx_session import EarlyAnswers
from objectmorpher_core.segment import dino_tokens, salience
from tests import photos, remembered


def _photo_fixture(name: str):
    @pytest.fixture(name=name, scope="session")
    def fixture():
        return photos.photo(name)

    return fixture


chelsea, coffee, astronaut, rocket, flower, china = map(_photo_fixture, photos.NAMES)


@pytest.fixture(scope="session", autouse=True)
def remembered_folder(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Where the processes of this run keep what networks say: see `tests/remembered.py`."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "remembered"
    folder.mkdir(exist_ok=True)
    os.environ[remembered.FOLDER] = str(folder)


@pytest.fixture
def afresh(monkeypatch: pytest.MonkeyPatch) -> None:
    """Networks run in this process whatever is remembered: for tests of them and of their time."""
    monkeypatch.delenv(remembered.FOLDER)
    for module in (dino_tokens, salience):
        monkeypatch.setattr(module, "_early", EarlyAnswers(module.KEPT))


@pytest.fixture(scope="session")
def networks() -> None:
    """Leaves a test out where the weights with which things are selected are not installed."""
    for name in ("dino", "subject"):
        if (reason := segment.load(name).missing()) is not None:
            pytest.skip(reason)


_known: dict[bytes, tuple[Any, ...]] = {}  # what `lifted_once` remembers: see `_remembering`


def _digest(value: Any) -> bytes:
    """Tells values apart: arrays by what they hold, objects by their kind and fields."""
    if isinstance(value, np.ndarray):
        return repr((value.shape, value.dtype)).encode() + value.tobytes()
    if hasattr(value, "__dict__") and not callable(value):
        value = (type(value).__qualname__, *vars(value).values())
    if isinstance(value, tuple):
        return b"(" + b",".join(map(_digest, value)) + b")"
    return repr(value).encode()


def _remembering(function: Callable[..., Any]) -> Callable[..., Any]:
    """`function`, computed once for the same arguments; its progress is repeated."""

    def remembered(*arguments: Any) -> Any:
        steps: list[tuple[float, str]] = []

        def note(fraction: float, text: str) -> None:
            steps.append((fraction, text))
            progress(fraction, text)

        progress = next((a for a in arguments if callable(a)), silent)
        said = _digest((function.__qualname__, *(a for a in arguments if not callable(a))))
        key = hashlib.sha256(said).digest()
        if key in _known:
            for step in _known[key][1]:
                progress(*step)
        else:  # the arguments stay alive: addresses in the digest are nobody else's
            found = function(*(note if callable(a) else a for a in arguments))
            _known[key] = found, steps, arguments
        return _known[key][0]

    return remembered


@pytest.fixture(scope="module")
def lifted_once() -> Iterator[None]:
    """For a module: what is dear about the same object of the same photo is computed once.

    It is the lift, the search for the shadow that it throws, and that for what of it a fill would
    leave. All are immutable and are remembered for other modules, too. That they are the same each
    time is tested in tests/core/lift, and in the slow stage by processes of their own.
    """
    from objectmorpher_core.compose.plate import plate
    from objectmorpher_core.lift.relief.lifter import ReliefLifter
    from objectmorpher_core.scripting import background

    yield from _remembering_all(
        (ReliefLifter, "lift"), (plate, "find_residue"), (background, "find_old_shadow")
    )


@pytest.fixture(scope="module")
def filled_once() -> Iterator[None]:
    """For a module: the same hole of the same photo is filled in once, with the same seed.

    That a fill is the same each time is tested in tests/core/compose.
    """
    from objectmorpher_core.compose.plate.inpaint_patchmatch import PatchMatchInpainter

    yield from _remembering_all((PatchMatchInpainter, "inpaint_from"))


def _remembering_all(*functions: tuple[Any, str]) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        for owner, name in functions:
            patch.setattr(owner, name, _remembering(getattr(owner, name)))
        yield


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--note", type=Path, help="add the names of the tests that pass to this file")
    parser.addoption("--without", type=Path, help="leave out the tests that this file names")


def pytest_configure(config: pytest.Config) -> None:
    path = config.getoption("--note")
    if path is not None and not hasattr(config, "workerinput"):  # reports come to the first process
        config.pluginmanager.register(_Notes(path))


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Files of which all is in the other stage, and what they import, are not read."""
    stage = config.option.markexpr
    if stage not in ("slow", "not slow") or not collection_path.match("test_*.py"):
        return None
    text = collection_path.read_text(encoding="utf-8")
    if stage == "slow":
        return None if re.search(r"\bmark\.slow\b|\bquick\(", text) else True
    return True if re.search(r"^pytestmark = .*\bmark\.slow\b", text, re.MULTILINE) else None


LONG = (  # files and folders of which a test takes long: they begin
    "test_worker_killed",  # it lifts the ball, while the next ones do not need that
    "test_documented", "test_accuracy", "tests/fuzz", "test_undo", "test_cluster", "test_plugins",
    "test_warm_up", "tests/faults", "tests/soak", "test_cli_truth", "test_tools", "test_train",
    "test_served_front", "core/segment", "test_autosave", "test_torch_setup", "test_estimates",
    "test_worker", "test_window", "test_first_use", "test_refin", "app/editing", "app/tools",
    "tests/app", "core/compose",
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


@pytest.hookimpl(hookwrapper=True)
def pytest_collection() -> Iterator[None]:
    """Without garbage collections, which look again and again through what stays: a fifth of it."""
    gc.disable()
    yield
    gc.enable()


def pytest_collection_finish() -> None:
    """Modules stay: a garbage collection that looks through them, too, takes 0.3 s."""
    gc.collect()
    gc.freeze()


class _Notes:
    """Adds to the file as tests pass."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "call" and report.passed:
            with self._path.open("a", encoding="utf-8") as file:
                file.write(report.nodeid + "\n")
