"""Outputs are written whole or not at all."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from objectmorpher_core.base.files import OutputError, write_all


def test_writes_new_and_existing_files(tmp_path):
    old, new = tmp_path / "old.png", tmp_path / "new.json"
    old.write_bytes(b"before")
    write_all({old: b"after", new: b"{}"})
    assert old.read_bytes() == b"after"
    assert new.read_bytes() == b"{}"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["new.json", "old.png"]


def test_missing_folder_changes_nothing(tmp_path):
    old = tmp_path / "old.png"
    old.write_bytes(b"before")
    with pytest.raises(OutputError, match=r"the folder .*nowhere does not exist"):
        write_all({old: b"after", tmp_path / "nowhere" / "x.png": b"x"})
    assert old.read_bytes() == b"before"
    assert list(tmp_path.iterdir()) == [old]


def test_a_folder_is_no_file(tmp_path):
    with pytest.raises(OutputError, match="is a folder"):
        write_all({tmp_path: b"x"})


def test_failing_rename_brings_the_others_back(tmp_path):
    # The second target turns into a folder while the files are written: its rename fails.
    class LateFolder(dict):
        def items(self):
            yield from super().items()
            (tmp_path / "c").mkdir()

    old, new = tmp_path / "a", tmp_path / "b"
    old.write_bytes(b"before")
    with pytest.raises(OutputError, match="c cannot be written"):
        write_all(LateFolder({old: b"after", new: b"new", tmp_path / "c": b"x"}))
    assert old.read_bytes() == b"before"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a", "c"]


@pytest.mark.skipif(os.name == "nt", reason="POSIX permissions")
def test_permissions_and_links_are_kept(tmp_path):
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_bytes(b"before")
    target.chmod(0o640)
    link.symlink_to(target)
    write_all({link: b"after"})
    assert link.is_symlink()
    assert target.read_bytes() == b"after"
    assert stat.S_IMODE(target.stat().st_mode) == 0o640
    write_all({tmp_path / "new": b""})
    mask = os.umask(0)
    os.umask(mask)
    assert stat.S_IMODE((tmp_path / "new").stat().st_mode) == 0o666 & ~mask


FULL_DISK = """
import resource, signal, sys
from pathlib import Path
from objectmorpher_core.base.files import OutputError, write_all
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # then writing past the limit is an OSError
resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, 50_000))
folder = Path(sys.argv[1])
try:
    write_all({folder / "small": b"new", folder / "large": b"x" * 60_000})
except OutputError as error:
    print(error)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs RLIMIT_FSIZE")
def test_disk_that_fills_up_changes_nothing(tmp_path):
    (tmp_path / "small").write_bytes(b"before")
    root = Path(__file__).parents[2]
    done = subprocess.run(
        [sys.executable, "-c", FULL_DISK, str(tmp_path)],
        cwd=root, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert "large cannot be written: file too large" in done.stdout
    assert (tmp_path / "small").read_bytes() == b"before"
    assert [p.name for p in tmp_path.iterdir()] == ["small"]


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root writes anywhere")
def test_unwritable_folder(tmp_path):
    folder = tmp_path / "locked"
    folder.mkdir()
    folder.chmod(0o555)
    with pytest.raises(OutputError, match="permission denied"):
        write_all({folder / "x": b"x"})
