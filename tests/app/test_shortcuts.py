"""Which keys run what, and how the user changes them."""

from __future__ import annotations

from collections import Counter

import pytest
from imgui_bundle import imgui

from objectmorpher.commands import COMMANDS, GROUPS, keys_of
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.settings import Settings
from objectmorpher.editor.shortcuts import FIXED, Shortcuts
from objectmorpher.gui.window.input import part_frames


@pytest.fixture
def shortcuts(shared_editor: Editor) -> Shortcuts:
    shared_editor.settings = Settings(gaussians=3000)
    return Shortcuts(shared_editor)


def test_no_two_commands_have_the_same_keys() -> None:
    keys = [k for c in COMMANDS.values() for k in (c.keys, *c.other_keys) if k]
    assert [k for k, count in Counter(keys).items() if count > 1] == []
    assert not set(keys) & set(FIXED)


def test_no_command_is_in_two_groups() -> None:
    assert sum(len(group) for group in GROUPS.values()) == len(COMMANDS)


def test_every_key_runs_its_command(shortcuts: Shortcuts) -> None:
    for name, command in COMMANDS.items():
        for keys in (command.keys, *command.other_keys):
            assert not keys or shortcuts.command_of(keys) == name
    assert shortcuts.command_of("Ctrl+Alt+Shift+J") is None


def test_new_keys_replace_the_usual_ones(shortcuts: Shortcuts, shared_editor: Editor) -> None:
    shortcuts.recording = "lift"
    assert shortcuts.take("Ctrl+Shift+L")
    assert shortcuts.command_of("Ctrl+Shift+L") == "lift"
    assert shortcuts.command_of(COMMANDS["lift"].keys) is None
    assert shortcuts.changed == {"lift"}
    shortcuts.reset("lift")
    assert shortcuts.command_of(COMMANDS["lift"].keys) == "lift"
    assert shared_editor.settings.shortcuts == {}


def test_keys_that_are_taken_change_hands(shortcuts: Shortcuts, shared_editor: Editor) -> None:
    shortcuts.choose("lift", "Ctrl+S")
    assert shortcuts.command_of("Ctrl+S") == "lift"
    assert keys_of(shared_editor, "save") == ""
    shortcuts.reset("save")
    assert shortcuts.command_of("Ctrl+S") == "save"
    assert keys_of(shared_editor, "lift") == ""
    shortcuts.reset_all()
    assert shortcuts.command_of(COMMANDS["lift"].keys) == "lift"


@pytest.mark.parametrize("keys", ["Escape", "Enter", "Left", "Shift+Up", "X", "Space", "?"])
def test_keys_with_a_fixed_meaning_are_refused(shortcuts: Shortcuts, keys: str) -> None:
    shortcuts.recording = "lift"
    assert shortcuts.take(keys)
    assert shortcuts.recording is None
    assert shortcuts.changed == set()


def test_keys_are_not_taken_unless_awaited(shortcuts: Shortcuts) -> None:
    assert not shortcuts.take("Ctrl+S")


def test_a_field_sees_a_chord_whole_that_one_slow_frame_brings() -> None:
    """Ctrl is let go before A is, and ImGui would take A and that in the same frame."""
    imgui.create_context()
    try:
        io, key, text = imgui.get_io(), imgui.Key, "abc"
        io.set_ini_filename("")
        io.display_size = imgui.ImVec2(400, 300)
        io.backend_flags |= imgui.BackendFlags_.renderer_has_textures.value

        def draw(typed: str, is_new: bool = False) -> str:
            for n in range(4):
                imgui.new_frame()
                if is_new and n == 0:
                    imgui.set_keyboard_focus_here()
                typed = imgui.input_text("##field", typed)[1]
                imgui.end_frame()
            return typed

        text = draw(text, is_new=True)
        for event in ((key.end, True), (key.end, False), (key.mod_ctrl, True)):
            io.add_key_event(*event)
            text = draw(text)
        io.add_key_event(key.a, True)
        part_frames()
        io.add_key_event(key.mod_ctrl, False)
        io.add_key_event(key.a, False)
        text = draw(text)
        io.add_input_character(ord("x"))
        assert draw(text) == "x", "all was selected, and is replaced"
    finally:
        imgui.destroy_context()
