"""A parser of the command line whose errors are one sentence that names what was meant."""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from objectmorpher_core.base.quoting import meant, named

from .terminal import PROGRAM, UsageError

# Words of the command line that have options of their own.

HERE = __name__.rpartition(".")[0]
GROUP = "objectmorpher.commands"  # of entry points, each a Subcommand
RESEARCH = ("bench", "train", "evaluate")  # commands of research/, which is installed apart


@dataclass(frozen=True)
class Subcommand:
    """A word, what `--help` says of it, and what it does."""

    name: str
    help: str
    add_options: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], None] | None = None  # None: words below it have theirs


def add_subcommands(
    parser: argparse.ArgumentParser, dest: str, subcommands: Sequence[Subcommand]
) -> None:
    """Add subcommands, one of which is required.

    Of what is read, `dest` holds its name, `run` its function and `parser` its own parser.
    """
    words = parser.add_subparsers(dest=dest, required=True, parser_class=type(parser))
    for subcommand in subcommands:
        word = words.add_parser(subcommand.name, help=subcommand.help)
        subcommand.add_options(word)
        if subcommand.run is not None:
            word.set_defaults(run=subcommand.run, parser=word)


def lazily(module: str, function: str, package: str = HERE) -> Callable[[Any], None]:
    """A function of a module in `package`, imported when it is called: `--help` stays instant."""

    def call(argument: Any) -> None:
        getattr(import_module(f".{module}", package), function)(argument)

    return call


def research_commands() -> tuple[Subcommand, ...]:
    """Return those of RESEARCH that an installed package offers, in the order of RESEARCH.

    A package whose files are gone, as those of a moved checkout are, counts as not installed.
    """
    from importlib.metadata import entry_points

    offered = {point.name: point for point in entry_points(group=GROUP)}
    try:
        return tuple(offered[name].load() for name in RESEARCH if name in offered)
    except ImportError:
        return ()


MISUSED = 2  # exit code
HEADING, OPTION, PLAIN = "\033[1m", "\033[36m", "\033[0m"  # ANSI


class Parser(argparse.ArgumentParser):
    """An ArgumentParser that suggests the nearest word, and names choices where one is missing."""

    def error(self, message: str) -> Any:
        told = re.sub(r"\S+", lambda word: named(word[0]), self._helpful(message))
        sys.stderr.write(f"{PROGRAM}: {told}\n")
        raise SystemExit(MISUSED)

    def print_help(self, file: Any = None) -> None:
        """Write the help, in colour where it goes to a terminal that has any."""
        stream, text = file or sys.stdout, self.format_help()
        is_argparses_own = sys.version_info >= (3, 14)
        if not is_argparses_own and has_colour(stream):
            text = coloured(text)
        stream.write(text)

    def _helpful(self, message: str) -> str:
        """argparse's message with what would have been right."""
        wrong = re.search(r"invalid choice: '(.*?)' \(choose from (.*)\)", message, re.S)
        if wrong is not None:
            known = wrong[2].replace("'", "")
            return f"there is no {wrong[1]!r} here{meant(wrong[1], known.split(', '))}: {known}"
        number = re.search(r"invalid (float|int) value: (.*)", message, re.S)
        if number is not None:
            kind = "number" if number[1] == "float" else "whole number"
            return f"{message[: number.start()]}{number[2]} is not a {kind}"
        missing = message.removeprefix("the following arguments are required: ")
        if missing == message:
            return message
        choices = self._choices_of(missing.split(", ")[0])
        return f"{self.prog.partition(' ')[2] or 'the command line'} needs {choices or missing}"

    def _choices_of(self, name: str) -> str:
        """The words that an argument may be, where there are only some."""
        for action in self._actions:
            if name in (action.dest, action.metavar) and action.choices is not None:
                words = ", ".join(map(str, action.choices))
                return f"a {action.dest}, one of {words}" if self._is_top() else f"one of {words}"
        return ""

    def _is_top(self) -> bool:
        return " " not in self.prog

    def parse_args(self, args: Sequence[str], namespace: Any = None) -> argparse.Namespace:  # type: ignore[override]
        """Parse a command line; an unknown option is reported with the one probably meant."""
        if "-" in args:
            self.error("- is no file name, and nothing is read from or written to a pipe")
        options, rest = self.parse_known_args(list(args), namespace)
        if rest:
            parser = self._chosen(options)
            command = parser.prog.partition(" ")[2] or PROGRAM
            word = next((w for w in rest if w.startswith("-")), rest[0]).partition("=")[0]
            what = "has no option" if word.startswith("-") else "cannot do anything with"
            self.error(f"{command} {what} {word}{_meant_option(word, parser)}")
        return options

    def _chosen(self, options: argparse.Namespace) -> argparse.ArgumentParser:
        """The parser of the word that stands on the command line, or of the word below it."""
        parser: argparse.ArgumentParser = self
        while True:
            below = next(
                (a for a in parser._actions if isinstance(a, argparse._SubParsersAction)), None
            )
            name = None if below is None else getattr(options, below.dest, None)
            if below is None or name is None:
                return parser
            parser = below.choices[name]


def _meant_option(word: str, parser: argparse.ArgumentParser) -> str:
    """`, did you mean --handle?`: the one whose help begins so, that is like it, or begins it."""
    options = [action for action in parser._actions if action.option_strings]
    known = [name for option in options for name in option.option_strings]
    verbs = {f"--{(o.help or '').partition(' ')[0]}": o.option_strings[-1] for o in options}
    begun = [name for name in known if word.startswith(name)]
    like = meant(word, known)
    name = verbs.get(word) or next(iter(begun if not like else ()), None)
    return f", did you mean {name}?" if name else like


def has_colour(stream: Any) -> bool:
    """Whether a stream is a terminal that shows colour, and nobody has asked for none."""
    is_wanted = not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"
    return is_wanted and stream.isatty()


def coloured(text: str) -> str:
    """A help text with its headings and options marked for a terminal."""
    text = re.sub(r"^\S.*:$", rf"{HEADING}\g<0>{PLAIN}", text, flags=re.M)
    return re.sub(r"(?<![\w-])--?[a-z][a-z-]*", rf"{OPTION}\g<0>{PLAIN}", text)


def completed_files(parser: argparse.ArgumentParser) -> argparse.ArgumentParser:
    """`parser` with its files, and those of the commands below it, marked for shtab."""
    import shtab

    for action in parser._actions:
        if action.type is Path or str(action.metavar).endswith(("FILE", "M.png")):
            action.complete = shtab.FILE  # type: ignore[attr-defined]
        if isinstance(action, argparse._SubParsersAction):
            for below in action.choices.values():
                completed_files(below)
    return parser


def misspelt_command(arguments: Sequence[str], commands: Sequence[str]) -> str | None:
    """The sentence about a first word that is neither a command nor a file; None where it is."""
    word = arguments[0] if arguments else ""
    if not re.fullmatch(r"[A-Za-z][A-Za-z-]*", word) or Path(word).exists():
        return None
    suggestion = meant(word, commands)
    if not suggestion and len(arguments) == 1:
        return None  # a file that is not there, which the window says
    return f"there is no command and no file {word}{suggestion or ': ' + ', '.join(commands)}"


# `--ray ADDRESS`: the option of the commands whose work can be spread over many machines.

NEEDED = ("ray", "pyarrow", "pandas")


def add_ray(parser: argparse.ArgumentParser) -> None:
    """The option."""
    parser.add_argument(
        "--ray", metavar="ADDRESS",
        help="spread over a Ray cluster; local starts one here; default without Ray",
    )  # fmt: skip


def check_ray(options: argparse.Namespace) -> None:
    """Raises UsageError where it is asked for and cannot be had."""
    absent = [name for name in NEEDED if find_spec(name) is None]
    if options.ray is not None and absent:
        names = " and ".join(absent)
        raise UsageError(f"--ray needs {names}: `pip install 'objectmorpher[cluster]'`")
