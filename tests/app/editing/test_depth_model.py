"""A depth model of the user's: brought in the window and on the command line, used, left out."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from editor_steps import CENTRE, open_file, wait_for_jobs
from objectmorpher.cli import parser as cli
from objectmorpher.commands import run
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.filing import Dialog
from objectmorpher.editor.settings import Settings
from objectmorpher_core import models
from objectmorpher_core.session.file import decode_session, encode_session
from tests import shapes
from tests.core.models.small_networks import brightness


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache" / "models"


@pytest.fixture
def network(tmp_path: Path) -> Path:
    path = tmp_path / "bright.onnx"
    path.write_bytes(brightness())
    return path


@pytest.fixture
def own_editor(cache: Path, compiled: None, photo_path: Path) -> Iterator[Editor]:
    """An editor whose worker has an empty cache, too."""
    editor = Editor(Settings(gaussians=1500))
    editor.view.resize((720, 560), 1.0, None)
    open_file(editor, photo_path)
    yield editor
    editor.shut_down()


def depths(editor: Editor) -> np.ndarray:
    assert editor.object is not None and editor.object.lifted is not None, editor.message
    lifted = editor.object.lifted
    return lifted.world_points(lifted.gaussians.means)[:, 2]


@pytest.mark.slow
def test_it_is_added_used_and_left_out_again(
    own_editor: Editor, network: Path, tmp_path: Path
) -> None:
    editor = own_editor
    editor.selection.add_click(*CENTRE, True)
    wait_for_jobs(editor)
    run(editor, "lift")
    wait_for_jobs(editor)
    before = depths(editor)
    assert not editor.models.has_depth
    editor.filing.choose(Dialog.MODEL_OPEN, network)
    wait_for_jobs(editor)
    assert editor.models.has_depth, editor.message
    assert editor.message is not None and "bright.onnx" in editor.message.text
    np.testing.assert_array_equal(depths(editor), before, "it was lifted without")
    assert editor.message.action is not None and editor.message.action.label == "Lift it again"
    editor.message.action.run()
    wait_for_jobs(editor)
    deep = depths(editor)
    assert len(deep) != len(before) or not np.array_equal(deep, before)
    editor.shaping.say("Depth model", uses_depth=False)
    wait_for_jobs(editor)
    np.testing.assert_array_equal(depths(editor), before)
    assert editor.history is not None and editor.history.undo_label == "Depth model"
    assert editor.document is not None
    back = decode_session(encode_session(editor.document))
    assert back.objects[0].shape.uses_depth is False
    editor.models.remove()
    wait_for_jobs(editor)
    assert not editor.models.has_depth


def test_a_file_that_does_not_fit_is_one_sentence(own_editor: Editor, photo_path: Path) -> None:
    own_editor.filing.choose(Dialog.MODEL_OPEN, photo_path)
    wait_for_jobs(own_editor)
    assert own_editor.message is not None and own_editor.message.is_error
    assert "not an ONNX network" in own_editor.message.text
    assert "\n" not in own_editor.message.text
    assert not own_editor.models.has_depth


# The command line -----------------------------------------------------------------------------


def test_the_command_line_adds_lists_and_removes_it(
    network: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["models", "list"]) == 0
    assert "depth" in (listed := capsys.readouterr().out) and "models add depth FILE" in listed
    assert cli.main(["models", "verify", "depth"]) != 0
    capsys.readouterr()
    assert cli.main(["models", "add", "depth", str(network)]) == 0
    own = models.added("depth")
    told = capsys.readouterr().out
    assert "bright.onnx" in told and own.sha256 in told
    assert cli.main(["models", "list"]) == 0
    assert own.sha256 in capsys.readouterr().out
    assert cli.main(["models", "verify", "depth"]) == 0
    assert capsys.readouterr().out == "depth: ok\n"
    assert cli.main(["models", "path", "depth"]) == 0
    assert capsys.readouterr().out == f"{own.path}\n"
    assert cli.main(["models", "remove", "depth"]) == 0
    assert models.added("depth").state == "missing"


@pytest.mark.parametrize(
    "words", [["add", "depth"], ["add"], ["add", "shape", "x.onnx"], ["remove"], ["list", "no"]]
)
def test_what_cannot_be_is_one_sentence(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["models", *words]) != 0
    said = capsys.readouterr()
    assert said.out == "" and len(said.err.splitlines()) == 1


def test_an_edit_uses_it_unless_told_not_to(
    network: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    inside = shapes.mask("ellipse")
    Path("photo.png").write_bytes(shapes.png(shapes.picture(inside)))
    Path("mask.png").write_bytes(shapes.mask_png(inside))

    def edited(out: str, *more: str) -> bytes:
        asked = ["edit", "photo.png", "-o", out, "--mask", "mask.png", "--gaussians", "300"]
        assert cli.main([*asked, "--inpaint", "telea", "--turn", "20,0,0", *more]) == 0
        return Path(out).read_bytes()

    before = edited("before.png")
    models.add("depth", network)
    assert edited("deep.png") != before
    assert edited("flat.png", "--no-depth") == before
