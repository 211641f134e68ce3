"""Writes keys.md, the window's keys and gestures, from the program's own table of commands.

`python docs/reference/make_keys.py` writes it; tests/test_docs.py tells when that was forgotten.
"""

from __future__ import annotations

from pathlib import Path

from objectmorpher.commands import GROUPS
from objectmorpher.editor.shortcuts import GESTURES

PAGE = Path(__file__).with_name("keys.md")
HEAD = """# Keys and gestures of the window

Made from the program's own table by `python docs/reference/make_keys.py`. `F1` shows the same in
the window, and there a click on keys changes them. Commands without keys are in the menus and
panels. On macOS the command key takes the place of `Ctrl`.
"""


def page() -> str:
    """The whole page."""
    parts = [HEAD, "## The pointer\n"]
    for tool, gestures in GESTURES.items():
        parts += [f"**{tool}**\n", _table(("gesture", "what it does"), gestures)]
    parts.append("## Commands\n")
    for title, commands in GROUPS.items():
        rows = [
            (command.label, ", ".join(_keys(keys) for keys in (command.keys, *command.other_keys)))
            for command in commands.values()
        ]
        parts += [f"**{title}**\n", _table(("command", "keys"), rows)]
    return "\n".join(parts)


def _keys(keys: str) -> str:
    return f"`{keys}`" if keys else ""


def _table(head: tuple[str, str], rows: object) -> str:
    lines = [f"| {a} | {b} |" for a, b in (head, ("---", "---"), *rows)]  # type: ignore[misc]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
