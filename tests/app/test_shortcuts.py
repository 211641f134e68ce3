"""Which keys run what, and how the user changes them."""

from __future__ import annotations

from collections import Counter

import pytest

from objectmorpher.commands import COMMANDS, GROUPS, keys_of
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.settings import Settings
from objectmorpher.editor.shortcuts import FIXED, Shortcuts


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
