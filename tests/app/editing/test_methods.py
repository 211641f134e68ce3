"""Who does a stage is chosen among what can run here; the rest says why not."""

from __future__ import annotations

from editor_steps import wait_until
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.settings import Backends, Settings
from objectmorpher_core import compose, segment


def looked(editor: Editor) -> Editor:
    """An editor that knows what can run here."""
    editor.settings = Settings()
    editor.methods.of("segment")
    wait_until(editor, lambda: editor.methods.taken("segment") != "")
    return editor


def test_automatic_is_what_the_core_would_load(editor: Editor) -> None:
    methods = looked(editor).methods
    assert methods.taken("segment") == segment.load().name
    assert methods.taken("inpaint") == compose.load().name


def test_what_cannot_run_says_why_and_all_else_can(editor: Editor) -> None:
    methods = looked(editor).methods
    for stage, able in (("inpaint", "telea"), ("lift", "relief"), ("segment", "grabcut")):
        why_not = {method.name: method.why_not for method in methods.of(stage)}
        assert why_not["auto"] is None and why_not[able] is None
        assert all(reason is None or len(reason.split()) > 3 for reason in why_not.values())
    assert {m.name: m.why_not for m in methods.of("inpaint")} == {
        "auto": None, **{name: compose.missing(name) for name in compose.BACKENDS}
    }  # fmt: skip


def test_what_fills_is_asked_once_until_a_model_comes_or_goes(editor: Editor) -> None:
    """Every frame of the panel wants to know, and the core looks for packages on the disk."""
    methods = editor.methods
    for name in ("auto", *compose.BACKENDS):
        reason = compose.missing(name)
        assert methods.filler(name) == (reason, reason is None and compose.is_random(name))
    before = methods.filler("auto")
    assert methods.filler("auto") is before
    methods.forget()
    assert methods.filler("auto") is not before


def test_a_choice_is_a_setting_and_is_used(editor: Editor) -> None:
    methods = looked(editor).methods
    methods.choose("segment", "grabcut")
    methods.choose("inpaint", "telea")
    assert editor.settings.backends == Backends(segment="grabcut", inpaint="telea")
    assert methods.chosen("segment") == "grabcut" and editor.composing.inpainter == "telea"
    before = editor.settings
    methods.choose("inpaint", "telea")
    assert editor.settings is before, "nothing changed"


def test_a_name_that_is_not_known_is_automatic(editor: Editor) -> None:
    editor.settings = Settings(backends=Backends(segment="magic", lift="magic", inpaint="magic"))
    for stage in ("segment", "lift", "inpaint"):
        assert editor.methods.chosen(stage) == "auto"


def test_a_models_own_id_is_in_the_list(editor: Editor) -> None:
    editor.settings = Settings(backends=Backends(segment="sam2.1-tiny"))
    assert editor.methods.chosen("segment") == "sam2.1-tiny"
    assert "sam2.1-tiny" in [method.name for method in editor.methods.of("segment")]


def test_it_is_looked_at_again_when_a_model_came_or_went(editor: Editor) -> None:
    looked(editor)
    editor.models.look()
    wait_until(editor, lambda: editor.chores.is_idle)
    editor.methods.of("lift")
    wait_until(editor, lambda: editor.methods.taken("lift") == "relief")
