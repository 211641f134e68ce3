"""Which keys run which command, the usual ones and those the user has chosen; and gestures."""

from __future__ import annotations

from dataclasses import replace

from ..commands import COMMANDS, keys_of
from ..system.texts import t
from .editor import Editor

# What has a meaning everywhere.
FIXED = (
    "Escape", "Enter", "Left", "Right", "Up", "Down", "PageUp", "PageDown", "X", "Space", "?",
    "Tab", "F6", "F10",
)  # fmt: skip


class Shortcuts:
    """Looks commands up by their keys, and gives them others."""

    def __init__(self, editor: Editor) -> None:
        self._editor = editor
        self.recording: str | None = None  # the command whose new keys are awaited
        self._settled: dict[str, str] | None = None  # the user's keys that `_by_keys` is made of
        self._by_keys: dict[str, str] = {}

    @property
    def changed(self) -> set[str]:
        """The commands with keys of the user's own."""
        return self._editor.settings.shortcuts.keys() & COMMANDS.keys()

    def command_of(self, keys: str) -> str | None:
        """The command that a chord ("Ctrl+S") runs."""
        chosen = self._editor.settings.shortcuts
        if chosen is not self._settled:
            self._settled, self._by_keys = chosen, self._index()
        return self._by_keys.get(keys)

    def _index(self) -> dict[str, str]:
        """Commands by keys; the shown ones go before others that do the same."""
        found: dict[str, str] = {}
        for name, command in COMMANDS.items():
            found |= {keys: name for keys in command.other_keys}
        found |= {keys_of(self._editor, name): name for name in COMMANDS}
        found.pop("", None)
        return found

    def take(self, keys: str) -> bool:
        """A chord was pressed; whether it was awaited as a command's new keys."""
        name, self.recording = self.recording, None
        if name is None:
            return False
        if keys == "Escape":
            return True
        if keys.removeprefix("Shift+").removeprefix("Alt+") in FIXED:
            self._editor.complain(t("{keys} has a fixed meaning; choose other keys", keys=keys))
            return True
        self.choose(name, keys)
        return True

    def choose(self, name: str, keys: str) -> None:
        """`keys` run command `name` from now on, and no other command."""
        editor = self._editor
        chosen = {n: k for n, k in editor.settings.shortcuts.items() if n in COMMANDS}
        for other in COMMANDS:
            if other != name and keys_of(editor, other) == keys:
                chosen[other] = ""
                label = t(COMMANDS[other].label)
                editor.say(
                    t("{keys} was for “{label}”, which has none now", keys=keys, label=label)
                )
        chosen[name] = keys
        self._use(chosen)

    def reset(self, name: str) -> None:
        """The usual keys of a command; whoever has them now loses them."""
        chosen = {n: k for n, k in self._editor.settings.shortcuts.items() if n != name}
        self._use(chosen)
        if COMMANDS[name].keys:
            self.choose(name, COMMANDS[name].keys)

    def reset_all(self) -> None:
        """The usual keys of all commands."""
        self._use({})

    def _use(self, chosen: dict[str, str]) -> None:
        """Remembers what differs from the usual."""
        kept = {name: keys for name, keys in chosen.items() if keys != COMMANDS[name].keys}
        self._editor.settings = replace(self._editor.settings, shortcuts=kept)


GESTURES: dict[str, tuple[tuple[str, str], ...]] = {
    "Everywhere": (
        ("Space-drag, middle drag", "Pan"),
        ("Wheel", "Zoom at the pointer"),
        ("X (hold)", "Show the photo as it was"),
        ("Esc", "Take back the stroke, deselect"),
        ("Enter", "The next step, which the large button names"),
        ("Tab, Shift+Tab", "To the panel, from control to control"),
        ("F6, Shift+F6, F10", "Next part of the window, the one before, the menus"),
        ("Arrows", "A crosshair on the photo · Shift: far · Alt: 1 px"),
        ("Space, Shift+Space", "Click, right-click at the crosshair"),
        ("Shift+Enter", "Take hold at the crosshair, let go: arrows drag"),
    ),
    "Select": (
        ("Click, Enter", "Add to the selection"),
        ("Right-click, Alt-click", "Remove from the selection"),
        ("Drag", "Draw a box around the object"),
    ),
    "Refine mask": (
        ("Drag", "Paint"),
        ("Alt-drag, right drag", "Erase"),
    ),
    "Pose": (
        ("Drag", "Move a point of the object"),
        ("Shift-drag", "Along one axis of the picture"),
        ("Alt-drag", "Along the surface's normal"),
        ("Ctrl-drag", "Turn the point"),
        ("Wheel while dragging", "Nearer, farther"),
        ("Alt-click, P", "Pin that stays"),
        ("Right-click", "Remove a point"),
        ("Click on another object", "Choose it"),
        ("Arrows, with Shift, Alt", "Nudge by 1 px, by 10 px, by 0.1 px"),
        ("PageUp, PageDown", "Farther, nearer · Shift: much · Alt: little"),
    ),
    "Place": (
        ("Drag", "Move the object"),
        ("Drag another object", "Choose and move it"),
        ("Drag on to a tab", "Copy it into that photo"),
        ("Wheel while dragging", "Nearer, farther"),
        ("Corner", "Scale"),
        ("Ring", "Turn · Shift: in steps of 15°"),
        ("Arrows, with Shift, Alt", "Nudge by 1 px, by 10 px, by 0.1 px"),
        ("PageUp, PageDown", "Farther, nearer · Shift: much · Alt: little"),
    ),
    "Compose": (
        ("Drag on the background alone", "Paint what is to be filled in again"),
        ("Drag while filling from a spot", "From what it is filled with to where"),
        ("Drag while painting on the object", "Paint, clone"),
        ("Alt-drag, right drag", "Bring back what was painted over"),
    ),
}
