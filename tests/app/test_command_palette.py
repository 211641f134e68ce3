"""The command palette and the pages of help, which come with the program."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from hands import opened
from objectmorpher.commands import COMMANDS, GROUPS, OTHER_WORDS, SETTINGS
from objectmorpher.editor.editor import Editor
from objectmorpher.gui.dialogs.popups.palette import CommandPalette
from objectmorpher.system.help_pages import FIRST, ORDER, Kind, blocks_of, pages
from objectmorpher.system.texts import languages

ROOT = Path(__file__).parents[2]
PANELS = ROOT / "app" / "objectmorpher" / "gui"
SEARCH = "Type what you want to do"


def test_every_page_of_help_is_there_without_markdowns_marks() -> None:
    assert {path.stem for path in (ROOT / "docs" / "howto").glob("*.md")} == set(ORDER)
    assert pages()[0].name == FIRST
    for page in pages():
        assert page.title and len(page.blocks) > 3, page.name
        plain = [block.text for block in page.blocks if block.kind is not Kind.CODE]
        marked = [text for text in plain if re.search(r"\]\(|\*\*|^#|^\||`", text)]
        assert marked == [], page.name


def test_a_page_keeps_its_order_and_its_code() -> None:
    text = "# One\n\nA [link](x.md), *this*\nline.\n\n```sh\na  b\n```\n\n- **a *2nd* one**\n"
    found = [(block.kind, block.text) for block in blocks_of(text)]
    assert found == [
        (Kind.HEADING, "One"), (Kind.TEXT, "A link, this line."), (Kind.CODE, "a  b"),
        (Kind.ITEM, "a 2nd one"),
    ]  # fmt: skip


def test_the_settings_it_names_are_those_of_the_panels() -> None:
    source = "".join(path.read_text(encoding="utf-8") for path in PANELS.rglob("*.py"))
    assert set(SETTINGS) <= set(COMMANDS)
    missing = [
        label for labels in SETTINGS.values() for label in labels
        if not re.search(rf'(\bt|\bNumber)\("{re.escape(label)}"', source)
    ]  # fmt: skip
    assert missing == []


def test_no_setting_looks_like_a_command(editor: Editor) -> None:
    """Of the same tool, that is; beside each the palette says which."""
    found = [(entry.title, entry.group) for entry in CommandPalette()._found(editor)]
    assert len(set(found)) == len(found)
    settings = {(title, group.removeprefix("Setting: ")) for title, group in found
                if group.startswith("Setting: ")}  # fmt: skip
    assert not settings & {(title, group) for title, group in found if group in GROUPS}
    assert ("Shadow", "Compose") in settings and ("Symmetry", "Pose") not in settings


def test_it_names_every_number_and_every_tick_of_the_panels() -> None:
    panels = "".join(p.read_text(encoding="utf-8") for p in (PANELS / "panels").rglob("*.py"))
    labels = re.findall(r'(?:\bNumber|checkbox)\(\s*(?:t\()?"([^"]+)"', panels)
    assert {"Opacity", "Yaw", "Show it alone"} <= set(labels)
    known = {label for labels in SETTINGS.values() for label in labels}
    known |= {command.label for command in COMMANDS.values()}
    assert set(labels) - known == set()


def test_other_words_are_of_things_that_there_are() -> None:
    known = {label for labels in SETTINGS.values() for label in labels}
    known |= {command.label for command in COMMANDS.values()}
    assert set(OTHER_WORDS) <= known


def test_whatever_is_typed_finds_commands_settings_gestures_and_pages(editor: Editor) -> None:
    palette = CommandPalette()

    def first(typed: str) -> tuple[str, str]:
        palette._typed = typed
        entry = palette._found(editor)[0]
        return entry.title, entry.command

    assert first("invert") == ("Invert selection", "invert")
    assert first("thickn") == ("Thickness", "look")
    assert first("opac") == ("Opacity", "compose")
    assert first("bend a") == ("Bend a part and keep the rest", "")
    assert first("stays pin")[0] == "Pin that stays"
    for typed, title in (
        ("rotate", "Place"), ("resize", "Scale"), ("jpeg", "Export photo…"),
        ("transparency", "Opacity"), ("100%", "Actual size"), ("dark mode", "Theme"),
        ("heal", "Background alone"), ("drop shadow", "Shadow"), ("deselect", "Clear selection"),
        ("hotkeys", "Keyboard and pointer…"), ("hue", "Saturation"), ("flip", "Symmetry"),
        ("hide", "Hide object"), ("take away", "Hide object"), ("animation", "Add key pose"),
        ("remove object", "Take out of the photo"), ("delete", "Take out of the photo"),
        ("erase", "Take out of the photo"), ("discard", "Put back into the photo"),
        ("recover", "Recover unsaved work"), ("autosave", "Recover unsaved work"),
        ("mirror object", "Symmetry"), ("brush size", "Larger brush"), ("rectangle", "Select by"),
        ("delete handle", "Remove handle"), ("remove shadow", "Add or remove shadow"),
        ("undo", "Undo"), ("redo", "Redo"), ("duplicate", "Duplicate object"),
        ("stop", "Cancel the running job"), ("load", "Open…"),
    ):  # fmt: skip
        palette._typed = typed
        assert title in [entry.title for entry in palette._found(editor)][:3], typed
    palette._typed = "language"
    is_there = "Language" in [entry.title for entry in palette._found(editor)]
    assert is_there is (len(languages()) > 1), "as in Preferences"
    palette._typed = ""
    everything = {entry.command for entry in palette._found(editor)}
    assert everything >= set(COMMANDS) - {"palette"}
    palette._typed = "xyzzy"
    assert palette._found(editor) == []


@pytest.mark.slow
@pytest.mark.window
def test_a_command_is_found_and_run_by_typing(
    without_networks: dict[str, str], photo_path: Path
) -> None:
    with opened(without_networks, photo_path) as hands:
        hands.area("Photo")
        hands.press("ctrl+k")
        hands.area(SEARCH)
        hands.settle()
        hands.xdotool("type", "--delay", 30, "panel")
        hands.area("Panel")
        hands.press("Return")
        hands.wait(lambda: "Select subject" not in hands.places(), "folding the panel up")
        hands.press("ctrl+k")
        hands.area(SEARCH)
        hands.settle()
        hands.xdotool("type", "--delay", 30, "select by")
        hands.press("Return")
        framed, row = hands.area("Sought"), hands.area("Box")
        assert framed[1] < row[1] and "Select subject" in hands.places(), "the panel is back"
        hands.press("ctrl+k")
        hands.area(SEARCH)
        hands.settle()
        hands.xdotool("type", "--delay", 30, "take an object away")
        hands.press("Return")
        hands.area("Take an object away")
        hands.wait(lambda: "A first edit" in hands.places(), "reading help")
        hands.press("Escape")
        hands.wait(lambda: "A first edit" not in hands.places(), "closing help")
