"""The worker process is killed at random, again and again: the editor goes on, nothing is lost."""

from __future__ import annotations

import os
import random
import signal
import time
from collections import Counter
from pathlib import Path

import pytest

import job_functions
from editor_steps import wait_for_jobs, wait_until
from objectmorpher.commands import run
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.tasks import READ, WRITE
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Placement
from objectmorpher_core.pictures.image import ImageError, read_picture
from objectmorpher_core.session.file import decode_session

pytestmark = pytest.mark.slow

KILLS = int(os.environ.get("OBJECTMORPHER_KILLS", "3"))  # seconds each
HEARD = 0.02  # s in which the thread that reads the pipe hands over what it has read
FUNCTIONS = {  # what is asked -> what the worker runs
    "save": "write_session", "export": "write_export", "background": "inpaint",
}  # fmt: skip


def wait_for_answers(editor: Editor) -> None:
    """As `wait_for_jobs`, but not for what gives way: another process reads the photo again."""

    def is_answered() -> bool:
        current, waiting = editor.jobs.current, editor.jobs._waiting.values()
        jobs = [*waiting, *([current] if current else [])]
        return not editor.poll() and editor.chores.is_idle and all(job.is_spare for job in jobs)

    wait_until(editor, is_answered)


def is_running(editor: Editor, what: str) -> bool:
    """Whether it is what runs in the worker."""
    job = editor.jobs.current
    return job is not None and job.function.__name__ == FUNCTIONS[what]


def ask(editor: Editor, folder: Path, what: str) -> None:
    """One of the jobs that run in the worker; it is what runs there then."""
    wait_for_answers(editor)
    if what == "save":
        editor.filing.save_as(folder / "ball.omorph")
    elif what == "export":
        editor.exporting.export_to(folder / "ball.png")
    else:
        run(editor, "fill_again")
    wait_until(editor, lambda: is_running(editor, what))


def seconds(editor: Editor, folder: Path, what: str) -> float:
    """What the job takes where nobody kills it."""
    ask(editor, folder, what)
    start = time.monotonic()
    wait_until(editor, lambda: not is_running(editor, what))
    took = time.monotonic() - start
    wait_for_answers(editor)
    assert editor.message is None or not editor.message.details, editor.message
    return took


def kill(editor: Editor, after: float) -> bool:
    """Ends the worker as the system does where memory runs out; whether the job still ran.

    It is stopped first, and all that it has said until then is heard: a job without an answer
    then is one that the kill meets.
    """
    job, worker = editor.jobs.current, editor.jobs._worker
    assert job is not None and worker is not None and worker.process.pid is not None
    end = time.monotonic() + after
    while time.monotonic() < end:
        editor.poll()
        time.sleep(0.001)
    process = worker.process.pid
    os.kill(process, signal.SIGSTOP)
    while Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "T":
        time.sleep(0.001)
    while worker._connection.poll():  # the thread that reads takes it
        time.sleep(0.001)
    time.sleep(HEARD)
    editor.poll()
    if editor.jobs.current is not job:
        os.kill(process, signal.SIGCONT)
        return False
    os.kill(process, signal.SIGKILL)
    worker.process.join()
    return True


def assert_whole(folder: Path) -> None:
    """What was saved and exported is the last or the one before, never a part of it."""
    session, picture = folder / "ball.omorph", folder / "ball.png"
    if session.exists():
        assert len(decode_session(session.read_bytes()).objects) == 1
    if picture.exists():
        try:
            read_picture(picture.read_bytes())
        except ImageError as error:
            raise AssertionError("the export is damaged") from error


def killed_at_random(editor: Editor, ball: Document, folder: Path, kills: int) -> Counter[str]:
    """Edits, asks for jobs and kills their process while they run; how often in which job.

    The moments are random within what the job took when nobody killed it.
    """
    chance, found, moves = random.Random(5), Counter[str](), 0
    editor.start(ball)
    seconds(editor, folder, "save")  # the process has started
    lasts = {what: seconds(editor, folder, what) for what in FUNCTIONS}
    while found.total() < kills:
        what = tuple(FUNCTIONS)[found.total() % len(FUNCTIONS)]
        moves += 1
        document = editor.document
        assert document is not None
        placement = Placement(move=(float(moves), 0.0))
        editor.apply("Move object", edits.set_placement(document, 0, placement))
        ask(editor, folder, what)
        after = chance.uniform(0.0, lasts[what])
        is_hit = kill(editor, after)
        if not is_hit:
            lasts[what] = after  # it takes less
        found[what] += is_hit
        if is_hit:
            print(f"killed {found.total()} times, now: {what}", flush=True)  # seen with -s
        assert moves < 10 * kills + 10, f"{what} is over before it can be killed"
        wait_for_answers(editor)
        committed = editor.committed
        assert committed is not None and committed.objects[0].placement == placement
        assert_whole(folder)
        editor.message = None
        if is_hit:
            seconds(editor, folder, "save")  # another process does the next job
    assert editor.history is not None
    while editor.history.undo_label is not None:
        editor.undo()
    assert editor.committed is ball
    return found


def assert_it_goes_on(editor: Editor, folder: Path) -> None:
    """A job that nobody kills is done."""
    editor.filing.save_as(folder / "last.omorph")
    wait_until(editor, lambda: (folder / "last.omorph").exists() and editor.jobs.is_idle)
    saved = decode_session((folder / "last.omorph").read_bytes())
    assert editor.committed is not None
    assert saved.objects[0].placement == editor.committed.objects[0].placement


def test_what_is_asked_for_next_does_not_wait_for_the_photo(
    editor: Editor, ball: Document, tmp_path: Path
) -> None:
    """The new process has to read it again, which takes seconds; a click would need that."""
    editor.start(ball)
    seconds(editor, tmp_path, "save")
    worker = editor.jobs._worker
    assert worker is not None
    worker.process.kill()
    wait_until(editor, lambda: editor.jobs.is_busy(READ))
    path = tmp_path / "ball.omorph"
    editor.filing.save_as(path)
    wait_until(editor, lambda: not editor.jobs.is_busy(f"{WRITE} {path}"))
    assert editor.message is None or not editor.message.details, editor.message
    assert editor.jobs.is_busy(READ), "it is read afterwards"
    wait_for_jobs(editor)


def test_a_reading_that_did_not_stop_is_begun_again_only_once(
    editor: Editor, ball: Document
) -> None:
    """Two readings would end each other, without end where each takes longer than one waits."""
    editor.start(ball)
    wait_for_jobs(editor)
    editor.jobs.start(
        "Reading the photo", job_functions.hang, 60.0, done=print, failed=print,
        cancelled=editor.tasks._read_again, kind=READ, is_spare=True,
    )  # fmt: skip
    hanging = editor.jobs.current
    editor.jobs.cancel(READ)
    wait_until(editor, lambda: editor.jobs.current is not hanging)
    reading = editor.jobs.current
    assert reading is not None and reading.kind == READ
    assert reading.stop_asked is None and READ not in editor.jobs._waiting
    wait_for_jobs(editor)


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks into /proc")
def test_killed_many_times(editor: Editor, ball: Document, tmp_path: Path) -> None:
    found = killed_at_random(editor, ball, tmp_path, KILLS)
    assert_it_goes_on(editor, tmp_path)
    print(dict(found))
    assert found.total() == KILLS
    assert min(found[what] for what in FUNCTIONS) >= KILLS // len(FUNCTIONS)
