"""Words of the command line that have options of their own."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any


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
    """One of them must follow; of what was read `dest` is its name, and `run` what it does."""
    words = parser.add_subparsers(dest=dest, required=True, parser_class=type(parser))
    for subcommand in subcommands:
        word = words.add_parser(subcommand.name, help=subcommand.help)
        subcommand.add_options(word)
        if subcommand.run is not None:
            word.set_defaults(run=subcommand.run)


def lazily(module: str, function: str) -> Callable[[Any], None]:
    """A function of one of our modules, imported when it is called: `--help` stays instant."""

    def call(argument: Any) -> None:
        getattr(import_module(f".{module}", __package__), function)(argument)

    return call
