"""The worker process: answers, progress, cancelling, failures and crashes, with a real spawn."""

from __future__ import annotations

import errno
import logging
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import UnidentifiedImageError

import job_functions
from objectmorpher.editor.opening import OpeningError
from objectmorpher.worker.jobs import Jobs
from objectmorpher.worker.requests import JobError


class Log:
    """What a job told."""

    def __init__(self) -> None:
        self.answers: list[object] = []
        self.errors: list[JobError] = []
        self.cancels = 0

    def cancelled(self) -> None:
        self.cancels += 1


@pytest.fixture(scope="module")
def wakes() -> list[float]:
    """When `worker` woke the window."""
    return []


@pytest.fixture(scope="module")
def worker(wakes: list[float]) -> Iterator[Jobs]:
    jobs = Jobs(wake=lambda: wakes.append(time.monotonic()))
    yield jobs
    jobs.close()


@pytest.fixture
def jobs() -> Iterator[Jobs]:
    """With a worker of its own, for what ends it."""
    jobs = Jobs()
    yield jobs
    jobs.close()


def start(jobs: Jobs, log: Log, function: Callable, *arguments: object, kind: str = "") -> None:
    jobs.start(
        "Test", function, *arguments, done=log.answers.append, failed=log.errors.append,
        cancelled=log.cancelled, kind=kind,
    )  # fmt: skip


def run_until(jobs: Jobs, is_reached: Callable[[], bool], seconds: float = 20.0) -> None:
    end = time.monotonic() + seconds
    while not is_reached():
        assert time.monotonic() < end, "nothing came in time"
        jobs.poll()
        time.sleep(0.005)


def test_an_answer_arrives_read_only(worker: Jobs) -> None:
    log = Log()
    start(worker, log, job_functions.double, np.arange(5.0))
    run_until(worker, lambda: bool(log.answers))
    answer = log.answers[0]
    assert isinstance(answer, np.ndarray)
    np.testing.assert_array_equal(answer, 2 * np.arange(5.0))
    assert not answer.flags.writeable


def test_a_large_array_is_the_same_object_in_the_worker_twice(worker: Jobs) -> None:
    photo = np.zeros((1000, 1000, 3), np.uint8)
    photo.setflags(write=False)
    log = Log()
    for _ in range(2):
        start(worker, log, job_functions.is_same_as_last_time, photo)
        run_until(worker, lambda: worker.is_idle)
    assert log.answers == [False, True]


def test_progress_is_seen_while_the_job_runs_but_is_no_news(
    worker: Jobs, wakes: list[float]
) -> None:
    """Frames for each report would take the cores that the job needs."""
    log = Log()
    wakes.clear()
    start(worker, log, job_functions.wait, 1.0)
    assert worker.current is not None
    end = time.monotonic() + 20
    while worker.current.fraction <= 0.3 and time.monotonic() < end:
        assert not worker.poll()
        time.sleep(0.005)
    assert worker.current.note == "waiting"
    assert wakes == []
    run_until(worker, lambda: worker.is_idle)
    assert log.answers == ["waited"]
    assert len(wakes) == 1


def test_cancelling_stops_a_job_that_asks(worker: Jobs) -> None:
    log = Log()
    start(worker, log, job_functions.wait, 30.0)
    run_until(worker, lambda: worker.current is not None and worker.current.fraction > 0)
    worker.cancel()
    run_until(worker, lambda: worker.is_idle, seconds=1.5)
    assert (log.answers, log.cancels) == ([], 1)


def test_only_the_newest_request_of_a_kind_is_answered(worker: Jobs) -> None:
    log = Log()
    for seconds in (10.0, 9.0, 0.0):
        start(worker, log, job_functions.wait, seconds, kind="segment")
    run_until(worker, lambda: worker.is_idle, seconds=3)
    assert log.answers == ["waited"]
    assert log.cancels == 0


def test_a_spare_request_waits_for_those_that_come_later(worker: Jobs) -> None:
    log = Log()
    start(worker, log, job_functions.wait, 0.1)
    for value, is_spare in ((1.0, True), (2.0, False)):
        worker.start(
            "Test", job_functions.double, np.array([value]), done=log.answers.append,
            failed=log.errors.append, kind=f"double {value}", is_spare=is_spare,
        )  # fmt: skip
    run_until(worker, lambda: len(log.answers) == 3)
    assert [np.asarray(answer).item() for answer in log.answers[1:]] == [4.0, 2.0]


def test_what_waits_for_a_job_that_is_nobodys_is_shown(worker: Jobs) -> None:
    log = Log()
    worker.start("Quiet", job_functions.wait, 5.0, done=log.answers.append,
                 failed=log.errors.append, is_quiet=True, is_spare=True)  # fmt: skip
    run_until(worker, lambda: worker.current is not None and worker.current.fraction > 0)
    assert worker.shown is None
    start(worker, log, job_functions.double, np.ones(3))
    assert worker.shown is not None and worker.shown.title == "Test"
    assert worker.current is not worker.shown
    run_until(worker, lambda: worker.is_idle)
    assert worker.shown is None


def test_what_a_job_of_the_users_holds_up_is_known(worker: Jobs) -> None:
    log = Log()
    start(worker, log, job_functions.wait, 5.0, kind="write")
    run_until(worker, lambda: worker.current is not None and worker.current.fraction > 0)
    assert worker.held_up == ()
    for kind in ("segment", "lift"):
        start(worker, log, job_functions.double, np.ones(3), kind=kind)
    worker.start("Quiet", job_functions.double, np.ones(3), done=log.answers.append,
                 failed=log.errors.append, kind="draw", is_quiet=True)  # fmt: skip
    assert worker.shown is worker.current
    assert [job.kind for job in worker.held_up] == ["segment", "lift"]
    start(worker, log, job_functions.double, np.ones(3), kind="write")
    assert "write" not in [job.kind for job in worker.held_up], "it takes the other's place"
    worker.cancel()
    run_until(worker, lambda: worker.is_idle)
    assert worker.held_up == ()


def test_a_failure_is_a_sentence(worker: Jobs) -> None:
    log = Log()
    start(worker, log, job_functions.fail)
    run_until(worker, lambda: worker.is_idle)
    assert [(e.name, e.sentence) for e in log.errors] == [("ValueError", "the mask is empty")]
    assert "job_functions" in log.errors[0].trace
    assert log.errors[0].retry is None, "the same request would fail in the same way"


def test_what_failed_for_the_system_can_be_asked_for_again(worker: Jobs, tmp_path: Path) -> None:
    log = Log()
    (tmp_path / "FULL").touch()
    start(worker, log, job_functions.write_when_there_is_room, tmp_path / "out")
    run_until(worker, lambda: bool(log.errors))
    assert "No space left" in log.errors[0].sentence
    assert log.errors[0].retry is not None
    log.errors[0].retry()
    run_until(worker, lambda: bool(log.answers))
    assert (tmp_path / "out").read_text() == "written"


@pytest.mark.parametrize(
    ("error", "may_pass"),
    [
        (MemoryError(), True),
        (OSError(errno.ENOSPC, "full"), True),
        (PermissionError(errno.EACCES, "locked"), True),
        (FileNotFoundError(errno.ENOENT, "gone"), False),
        (IsADirectoryError(errno.EISDIR, "a folder"), False),
        (UnidentifiedImageError("cannot identify image file"), False),
        (ValueError("nonsense"), False),
        (RuntimeError("a mistake of ours"), False),
    ],
)
def test_only_what_another_try_may_mend_can_be_retried(error: Exception, may_pass: bool) -> None:
    wrapped = OpeningError("it cannot be opened")
    wrapped.__cause__ = error
    assert JobError.of(error, "It").may_pass is JobError.of(wrapped, "It").may_pass is may_pass


def test_the_log_tells_the_programs_failures_from_the_requests(
    worker: Jobs, caplog: pytest.LogCaptureFixture
) -> None:
    log = Log()
    with caplog.at_level(logging.INFO, "objectmorpher.worker.requests"):
        for function in (job_functions.fail, job_functions.divide, job_functions.refuse):
            start(worker, log, function)
            run_until(worker, lambda: worker.is_idle)
    told = [r.levelname for r in caplog.records if "failed" in r.message]
    assert told == ["ERROR", "ERROR", "INFO"]


def test_an_answer_that_cannot_be_used_is_a_failure(worker: Jobs) -> None:
    log = Log()

    def refuse(_: object) -> None:
        raise ValueError("nothing is selected")

    worker.start("Test", job_functions.double, np.ones(1), done=refuse, failed=log.errors.append)
    run_until(worker, lambda: worker.is_idle)
    assert [e.sentence for e in log.errors] == ["nothing is selected"]


def test_a_crash_is_a_failure_and_the_next_job_runs(jobs: Jobs) -> None:
    log = Log()
    start(jobs, log, job_functions.crash)
    start(jobs, log, job_functions.double, np.ones(1))
    run_until(jobs, lambda: bool(log.answers))
    assert log.errors[0].name == "Crash"


def test_what_crashed_can_be_asked_for_again(jobs: Jobs) -> None:
    log = Log()
    start(jobs, log, job_functions.wait, 0.3)
    run_until(jobs, lambda: jobs.current is not None and jobs.current.fraction > 0)
    assert jobs._worker is not None
    jobs._worker.process.kill()
    run_until(jobs, lambda: bool(log.errors))
    retry = log.errors[0].retry
    assert retry is not None
    retry()
    run_until(jobs, lambda: bool(log.answers))
    assert log.answers == ["waited"]


def test_a_worker_that_cannot_live_is_not_started_without_end() -> None:
    restarts: list[int] = []
    jobs = Jobs(warm=("no_such_module",))
    jobs.restarted = lambda: restarts.append(1)
    run_until(jobs, lambda: jobs._worker is None, seconds=60)
    assert len(restarts) < 3
    log = Log()
    start(jobs, log, job_functions.double, np.ones(1))
    run_until(jobs, lambda: bool(log.errors), seconds=60)
    assert log.errors[0].name == "Crash"
    jobs.close()


def test_a_job_that_does_not_listen_is_ended_within_half_a_second(jobs: Jobs) -> None:
    restarts: list[int] = []
    jobs.restarted = lambda: restarts.append(1)
    log = Log()
    start(jobs, log, job_functions.double, np.ones(1))
    run_until(jobs, lambda: bool(log.answers))
    log.answers.clear()
    start(jobs, log, job_functions.hang, 60.0)
    jobs.cancel()
    assert jobs.current is not None and jobs.current.ends_at - time.monotonic() <= 0.5
    run_until(jobs, lambda: jobs.is_idle, seconds=30)  # of 60; it takes no more than it was given
    assert (log.cancels, restarts) == (1, [1])
    start(jobs, log, job_functions.double, np.ones(1))
    run_until(jobs, lambda: bool(log.answers))
