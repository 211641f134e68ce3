"""Workers in the window: seen with their licence, accepted by a box, chosen, used."""

from __future__ import annotations

from pathlib import Path

import pytest

from editor_steps import wait_until
from objectmorpher.cli.parser import main
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.settings import Settings
from objectmorpher_core.lift.workers import file as worker_file

WORKER = """
command = ["{python}", "-c", "raise SystemExit(9)"]
licence = "Terms of Use"
licence_kind = "non-commercial"
page = "https://example.org/terms"
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(worker_file.FOLDER, str(tmp_path))
    (tmp_path / "mine.toml").write_text(WORKER, "utf-8")
    (tmp_path / "bad.toml").write_text("command = 7", "utf-8")
    return tmp_path


def test_a_worker_is_accepted_by_its_box_and_then_among_the_methods(
    folder: Path, photo_path: Path
) -> None:
    editor = Editor(Settings())  # its worker process knows the folder
    try:
        workers, methods = editor.models.workers, editor.methods
        workers.look()
        bad, mine = workers.states
        assert bad.worker is None and "of no use" in (bad.why_not or "")
        assert mine.worker is not None and not mine.is_accepted

        def listed() -> dict[str, str | None]:
            return {method.name: method.why_not for method in methods.of("lift")}

        wait_until(editor, lambda: methods.taken("lift") != "")
        assert "Terms of Use" in (listed()["mine"] or "") and listed()["bad"] is not None
        workers.accept("mine", True)
        assert workers.states[1].is_accepted and workers.states[1].why_not is None
        wait_until(editor, lambda: methods.taken("lift") != "")
        wait_until(editor, lambda: "mine" in listed())
        assert listed()["mine"] is None
        workers.choose("mine")
        assert editor.settings.backends.lift == "mine" == methods.chosen("lift")
        assert workers.is_chosen("mine") and not workers.is_chosen("bad")
        workers.accept("mine", False)
        assert not workers.states[1].is_accepted
    finally:
        editor.shut_down()


def test_the_command_line_lists_accepts_and_forgets(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["models", "list"]) == 0
    line = next(x for x in capsys.readouterr().out.splitlines() if x.startswith("mine "))
    assert "Terms of Use*" in line and "not usable" in line
    assert main(["models", "get", "mine"]) == 1
    told = capsys.readouterr().err
    assert "--accept-licence 'Terms of Use'" in told and told.count("\n") == 1
    assert main(["models", "get", "mine", "--accept-licence", "Terms of Use"]) == 0
    assert "yours" in capsys.readouterr().out
    assert main(["models", "remove", "mine"]) == 0
    assert not worker_file.read_worker("mine").is_accepted
