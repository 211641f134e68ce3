"""A stranger's value in a sentence of ours: on one line, and not longer than it can be read."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from typing import Any

LONGEST = 60  # characters
DIGITS = 10_000  # binary ones, beyond which Python does not write a number
REASON = 200  # characters of a sentence that quotes what a file says
LIKENESS = 0.7  # of difflib, from which on a word is taken for a misspelt one


def shown(value: Any) -> str:
    """`value` as Python writes it, its middle left out where it is long."""
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # a number of thousands of digits; depth
        return "..."
    return named(text)


def named(text: str) -> str:
    """A name without quotation marks, as `shown`."""
    text = "".join(c if c.isprintable() else "?" for c in text)  # lone surrogates are not
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 13]}...{text[-10:]}"


def counted(count: int) -> str:
    """A number that a file declares, which may have thousands of digits."""
    return named(f"{count:,}") if count.bit_length() < DIGITS else "too many"


def count_range(least: int, most: int) -> str:
    """How many there may be, as in `2`, `2 or 3`, `1 to 3`."""
    if least == most:
        return f"{least}"
    return f"{least} {'or' if most == least + 1 else 'to'} {most}"


def reason(error: BaseException) -> str:
    """Return an error's text, which may quote a file, on one line and cut where it is long."""
    text = "".join(c if c.isprintable() else "?" for c in str(error))
    return text if len(text) <= REASON else f"{text[: REASON - 3]}..."


def meant(word: str, known: Iterable[str]) -> str:
    """`, did you mean edit?`; nothing where no known word is like it."""
    bare = {name.lstrip("-"): name for name in known}  # or dashes would make all options alike
    near = get_close_matches(word.lstrip("-"), bare, n=1, cutoff=LIKENESS)
    return f", did you mean {bare[near[0]]}?" if near else ""
