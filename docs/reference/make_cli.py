"""Writes cli.md, the reference of the command line, from the program's own parsers.

`python docs/reference/make_cli.py` writes it; tests/test_docs.py tells when that was forgotten.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

from objectmorpher.cli.parser import build_parser, window_parser
from objectmorpher.cli.terminal import PROGRAM

PAGE = Path(__file__).with_name("cli.md")
HEAD = f"""# The command line

Made from the program's own parsers by `python docs/reference/make_cli.py`;
`{PROGRAM} COMMAND --help` says the same. A command that fails says why in one sentence on stderr,
writes nothing, and ends with 1; 2 means that the command line itself is wrong.
"""
UNTITLED = ("positional arguments", "options", "optional arguments")


def page() -> str:
    """The whole page."""
    parts = [HEAD, *_window()]
    for name, parser, told in _subparsers(build_parser(), PROGRAM):
        parts += _command(name, parser, told)
    return "\n".join(parts)


def _window() -> Iterator[str]:
    parser = window_parser()
    yield f"## {PROGRAM}\n\nOpens the editor, on a photo or a session.\n"
    yield _usage(parser, PROGRAM) + "\n"
    yield from _tables(parser)


def _command(name: str, parser: argparse.ArgumentParser, told: str) -> Iterator[str]:
    level = "#" * min(len(name.split()), 4)
    yield f"{level} {name}\n"
    lines = dict.fromkeys((_sentence(told), parser.description or "", parser.epilog or ""))
    yield "\n\n".join(line for line in lines if line) + "\n"
    inner = list(_subparsers(parser, name))
    if inner:
        yield "\n".join(f"- [`{sub}`](#{_anchor(sub)}): {text}" for sub, _, text in inner) + "\n"
        for each in inner:
            yield from _command(*each)
        return
    yield _usage(parser, name) + "\n"
    yield from _tables(parser)


def _subparsers(
    parser: argparse.ArgumentParser, name: str
) -> Iterator[tuple[str, argparse.ArgumentParser, str]]:
    """Full name, parser and help of each command that follows `name`."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            helps = {each.dest: each.help or "" for each in action._choices_actions}
            for key, sub in action.choices.items():
                yield f"{name} {key}", sub, helps.get(key, "")


def _usage(parser: argparse.ArgumentParser, name: str) -> str:
    """What has to be said, and in which order."""
    words = [name]
    for action in _shown(parser):
        if action.option_strings and not action.required:
            continue
        value = _value(action)
        word = f"{_shortest(action)} {value}".strip() if action.option_strings else value
        words.append(f"[{word}]" if action.nargs in ("?", "*") else word)
    words.append("[OPTIONS]")
    return "```\n" + " ".join(words) + "\n```"


def _tables(parser: argparse.ArgumentParser) -> Iterator[str]:
    plain: list[argparse.Action] = []
    titled: list[tuple[str, list[argparse.Action]]] = []
    for group in parser._action_groups:
        actions = [a for a in _shown(parser) if a in group._group_actions]
        title = group.title or ""
        if title.lower() in UNTITLED:
            plain += actions
        else:
            titled.append((f"**{title[:1].upper()}{title[1:]}**\n\n", actions))
    for title, actions in [("", plain), *titled]:
        if actions:
            rows = [f"| {_names(a)} | {_cell(_told(a))} |" for a in actions]
            yield title + "\n".join(["| | |", "|---|---|", *rows]) + "\n"


def _shown(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    hidden = (argparse._HelpAction, argparse._SubParsersAction)
    return [
        action for action in parser._actions
        if not isinstance(action, hidden) and action.help != argparse.SUPPRESS
    ]  # fmt: skip


def _names(action: argparse.Action) -> str:
    value = _value(action)
    if not action.option_strings:
        return f"`{_cell(value)}`"
    names = ", ".join(f"`{name}`" for name in action.option_strings)
    return f"{names} `{_cell(value)}`" if value else names


def _value(action: argparse.Action) -> str:
    if action.nargs == 0:
        return ""
    if isinstance(action.metavar, str):
        return action.metavar
    if action.choices is not None:
        return "|".join(map(str, action.choices))
    return action.dest.upper()


def _shortest(action: argparse.Action) -> str:
    return min(action.option_strings, key=len)


def _told(action: argparse.Action) -> str:
    told = action.help or ""
    is_repeated = isinstance(action, argparse._AppendAction)
    default = action.default
    is_flag = default is None or isinstance(default, bool | list)
    if action.option_strings and not is_flag and "default" not in told:
        told = f"{told}; default {_plain(default)}".removeprefix("; ")
    return f"{told} (may be repeated)" if is_repeated else told


def _plain(value: object) -> str:
    if isinstance(value, tuple | list):
        return ",".join(map(_plain, value))
    return f"{value:g}" if isinstance(value, float) else str(value)


def _cell(text: str) -> str:
    return text.replace("%%", "%").replace("|", "\\|")


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}." if text else ""


def _anchor(name: str) -> str:
    return name.replace(" ", "-")


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
