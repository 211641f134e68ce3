"""Chores: answers of the newest of a kind, cancelling, and failures that the log tells apart."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Iterator

import pytest

from objectmorpher.editor.opening import OpeningError
from objectmorpher.worker.requests import Chores, JobError
from objectmorpher_core.base.progress import Progress


@pytest.fixture
def chores() -> Iterator[Chores]:
    chores = Chores(lambda: None)
    yield chores
    chores.close()


def finish(chores: Chores) -> None:
    end = time.monotonic() + 60
    while not chores.is_idle:
        assert time.monotonic() < end, "nothing came in time"
        chores.poll()
        time.sleep(0.002)


def test_only_the_newest_of_a_kind_is_answered(chores: Chores) -> None:
    is_let_go = threading.Event()
    answers: list[str] = []

    def wait(progress: Progress) -> str:
        is_let_go.wait(60)
        return "older"

    for function in (wait, lambda progress: "newer"):
        chores.start("Test", function, kind="open", done=answers.append, failed=pytest.fail)
    finish(chores)
    is_let_go.set()
    for thread in threading.enumerate():
        if thread.name == "open":
            thread.join(60)
    chores.poll()
    assert answers == ["newer"]


def test_what_is_cancelled_stops_at_its_next_report(chores: Chores) -> None:
    is_begun, is_over = threading.Event(), threading.Event()
    told: list[str] = []

    def work(progress: Progress) -> None:
        try:
            while True:
                progress(0.5, "reading")
                is_begun.set()
                time.sleep(0.001)
        finally:
            is_over.set()

    chores.start("Test", work, kind="open", done=lambda _: told.append("done"),
                 failed=lambda _: told.append("failed"),
                 cancelled=lambda: told.append("cancelled"))  # fmt: skip
    assert is_begun.wait(60)
    chores.cancel("open")
    assert is_over.wait(60)
    chores.poll()
    assert told == ["cancelled"]
    assert chores.is_idle


@pytest.mark.parametrize(("error", "level"), [
    (OpeningError("x.png is no file"), "INFO"), (ValueError("x is 3"), "ERROR"),
])  # fmt: skip
def test_the_log_tells_the_programs_failures_from_the_requests(
    chores: Chores, caplog: pytest.LogCaptureFixture, error: Exception, level: str
) -> None:
    errors: list[JobError] = []

    def fail(progress: Progress) -> None:
        raise error

    with caplog.at_level(logging.INFO):
        chores.start("Opening", fail, kind="open", done=pytest.fail, failed=errors.append)
        finish(chores)
    assert [e.sentence for e in errors] == [str(error)]
    assert [r.levelname for r in caplog.records if "Opening failed" in r.message] == [level]
