"""What was written last comes back equal, wherever the writing was cut off."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_session_file import assert_equal, full_document

from objectmorpher_core.document.model import Document, Placement
from objectmorpher_core.pictures.image import Picture, encode_picture, read_picture
from objectmorpher_core.session.journal import DOCUMENT, Journal, read_about, read_journal
from objectmorpher_core.session.tree import SessionError


@pytest.fixture(scope="module")
def document() -> Document:
    pixels = np.random.default_rng(3).integers(0, 256, (100, 120, 3), dtype=np.uint8)
    source = encode_picture(Picture(pixels), "png")
    return full_document(read_picture(source), source)


def test_what_was_written_is_read(document: Document, tmp_path: Path) -> None:
    for name in ("cat.png", "caf\udce9.png"):  # the second is of a file whose name is not UTF-8
        named = replace(document, photo=replace(document.photo, name=name))
        Journal(tmp_path).write(named, {"name": name, "source": f"/photos/{name}"})
        assert_equal(read_journal(tmp_path), named)
        assert read_about(tmp_path) == {"name": name, "source": f"/photos/{name}"}


def test_a_step_writes_only_what_is_new_in_it(document: Document, tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    journal.write(document, {})
    before = {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    thing = replace(document.objects[0], placement=Placement(move=(3.0, 4.0)))
    moved = document.with_object(0, thing)
    journal.write(moved, {})
    after = {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    assert set(before) == set(after)
    assert [p.name for p in before if before[p] != after[p]] == [DOCUMENT]
    assert_equal(read_journal(tmp_path), moved)


def test_what_is_not_needed_any_more_is_removed(document: Document, tmp_path: Path) -> None:
    journal = Journal(tmp_path)
    journal.write(document, {})
    journal.write(replace(document, objects=(), plate=None), {})
    assert len(list(tmp_path.iterdir())) == 2  # document.json and the photo


def test_another_writer_goes_on_with_the_files_that_are_there(
    document: Document, tmp_path: Path
) -> None:
    Journal(tmp_path).write(document, {})
    before = {path.name: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    Journal(tmp_path).write(document, {})
    after = {path.name: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    del before[DOCUMENT], after[DOCUMENT]
    assert before == after


def test_a_write_that_is_cut_off_leaves_the_step_before(document: Document, tmp_path: Path) -> None:
    Journal(tmp_path).write(document, {})
    (tmp_path / "x.unfinished").write_bytes(b"half an array")
    (tmp_path / f"{'0' * 64}.npy").write_bytes(b"an array of a step that never came")
    assert_equal(read_journal(tmp_path), document)


@pytest.mark.parametrize("ending", [".json", ".npy", ".npy.z", ".photo"])
@pytest.mark.parametrize("harm", ["cut", "changed", "gone"])
def test_damage_is_one_sentence(document: Document, tmp_path: Path, ending: str, harm: str) -> None:
    Journal(tmp_path).write(document, {})
    victim = next(path for path in tmp_path.iterdir() if path.name.endswith(ending))
    data = victim.read_bytes()
    if harm == "gone":
        victim.unlink()
    elif harm == "cut":
        victim.write_bytes(data[: len(data) // 2])
    else:
        victim.write_bytes(data[:-20] + bytes(b ^ 1 for b in data[-20:]))
    with pytest.raises(SessionError) as caught:
        read_journal(tmp_path)
    assert "\n" not in str(caught.value)


def test_a_name_that_leaves_the_folder_is_refused(document: Document, tmp_path: Path) -> None:
    Journal(tmp_path).write(document, {})
    head = json.loads((tmp_path / DOCUMENT).read_text())
    head["arrays"] = dict.fromkeys(head["arrays"], "../secret.npy")
    (tmp_path / DOCUMENT).write_text(json.dumps(head))
    with pytest.raises(SessionError):
        read_journal(tmp_path)
