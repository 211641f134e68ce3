"""Words of the command line that have options of their own."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

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
    """Add subcommands, one of which is required: `dest` receives its name, `run` its function."""
    words = parser.add_subparsers(dest=dest, required=True, parser_class=type(parser))
    for subcommand in subcommands:
        word = words.add_parser(subcommand.name, help=subcommand.help)
        subcommand.add_options(word)
        if subcommand.run is not None:
            word.set_defaults(run=subcommand.run)


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
