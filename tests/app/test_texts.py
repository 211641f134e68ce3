"""Every sentence of the window can be translated: it goes through t(), and it is in the list.

`python tests/app/test_texts.py` writes the list anew.
"""

from __future__ import annotations

import ast
import string
import tomllib
from collections.abc import Iterator
from enum import Enum
from pathlib import Path

import pytest

from objectmorpher.editor import view
from objectmorpher.editor.export_plan import VideoMotion, What
from objectmorpher.editor.filing import Dialog
from objectmorpher.system.texts import languages, t, use_language
from tests.tree import over

ROOT = Path(__file__).parents[2]
APP, LANGUAGES = ROOT / "app" / "objectmorpher", ROOT / "assets" / "languages"
LIST = LANGUAGES / "texts.txt"
# What shows its argument: a literal there would stay English.
SHOWING = {
    "text_unformatted", "text_colored", "note", "heading", "tooltip", "button", "checkbox", "say",
    "complain", "label", "menu_item", "begin_menu", "icon_button", "input_text_with_hint",
}  # fmt: skip
TABLES = ("Command", "Number", "Segment")  # constructors whose first argument is an English text
TABLE_FILES = ("editor/shortcuts.py", "commands/__init__.py")  # literals that are all texts
ENUMS = (view.ToolName, view.Composed, view.Shown, view.Popup, Dialog, What, VideoMotion)


def calls(path: Path) -> Iterator[ast.Call]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    yield from (node for node in ast.walk(tree) if isinstance(node, ast.Call))


def name_of(call: ast.Call) -> str:
    return call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")


def literals(node: ast.AST) -> Iterator[str]:
    """Texts that stand in an expression as they are; in t(...) they do not."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    elif isinstance(node, ast.JoinedStr | ast.FormattedValue | ast.BinOp | ast.IfExp):
        parts = [node.body, node.orelse] if isinstance(node, ast.IfExp) else None
        for child in parts or ast.iter_child_nodes(node):
            if not (isinstance(child, ast.Call)):
                yield from literals(child)


def is_language(text: str) -> bool:
    """Whether a person reads it: not an id, an icon or a format."""
    shown = text.partition("##")[0]
    return sum(c in string.ascii_letters for c in shown) > 1 and shown not in ("%.1f", "MP")


def texts() -> set[str]:
    """All that can be translated."""
    found = {member.value for kind in ENUMS for member in kind if issubclass(kind, Enum)}
    for path in sorted(APP.rglob("*.py")):
        for call in calls(path):
            name = name_of(call)
            if name == "t" or name in TABLES:
                found |= {t for arg in call.args[:1] for t in literals(arg)}
                if call.args and isinstance(call.args[0], ast.Subscript):
                    found |= looked_up(path, call.args[0])
    for name in TABLE_FILES:
        tree = ast.parse((APP / name).read_text(encoding="utf-8"))
        body = [node for node in tree.body if isinstance(node, ast.AnnAssign)]
        found |= {n.value for b in body for n in ast.walk(b) if _is_text(n)}  # type: ignore[attr-defined]
    return {text for text in found if text}


def looked_up(path: Path, wanted: ast.Subscript) -> set[str]:
    """The texts that TABLE[...] can be, of a dictionary in the same file."""
    table = getattr(wanted.value, "id", "")
    return {
        value.value
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.Assign | ast.AnnAssign) and isinstance(node.value, ast.Dict)
        if table in {getattr(target, "id", "") for target in _targets(node)}
        for value in node.value.values
        if isinstance(value, ast.Constant) and isinstance(value.value, str)
    }


def _targets(node: ast.Assign | ast.AnnAssign) -> list[ast.expr]:
    return node.targets if isinstance(node, ast.Assign) else [node.target]


def _is_text(node: ast.AST) -> bool:
    """A text, and not the lowercase name of a command."""
    is_string = isinstance(node, ast.Constant) and isinstance(node.value, str)
    return is_string and not node.value.islower()


def test_the_list_of_texts_is_complete() -> None:
    assert sorted(texts()) == LIST.read_text(encoding="utf-8").splitlines()


@over("path", sorted(APP.rglob("*.py")))
def test_nothing_is_shown_that_cannot_be_translated(path: Path) -> None:
    if path.relative_to(APP).parts[0] in ("cli", "render"):
        return
    shown = [
        text
        for call in calls(path)
        if name_of(call) in SHOWING
        for argument in call.args[2 * (name_of(call) == "icon_button") :]
        for text in literals(argument)
        if is_language(text) and not text.startswith("##")
    ]
    assert shown == []


def test_a_text_without_translation_stays_english(tmp_path: Path) -> None:
    use_language("xx")
    assert t("{count} handles", count=3) == "3 handles"
    use_language("en")


@pytest.mark.parametrize("code", [c for c in languages() if c != "en"])
def test_translations_fit_their_texts(code: str) -> None:
    table = tomllib.loads((LANGUAGES / f"{code}.toml").read_text(encoding="utf-8"))
    assert set(table) <= texts() | {"English"}
    for english, translated in table.items():
        assert fields(english) == fields(translated), english


def fields(text: str) -> set[str | None]:
    """The {names} in a text."""
    return {name for _, name, _, _ in string.Formatter().parse(text) if name is not None}


if __name__ == "__main__":
    LIST.write_text("\n".join(sorted(texts())) + "\n", encoding="utf-8")
