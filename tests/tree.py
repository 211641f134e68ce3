"""Where the sources are, a test over all files of a kind, and the first few of many examples."""

from __future__ import annotations

import ast
import functools
import inspect
import os
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
# For processes that a test starts in another folder.
PYTHONPATH = os.pathsep.join([str(ROOT / "app"), str(ROOT)])

Test = Callable[..., None]


@functools.cache
def parsed(path: Path) -> ast.Module:
    """A source file's syntax tree, read once: not to be changed."""
    return ast.parse(path.read_text(encoding="utf-8"))


def quick(items: Iterable[object], count: int) -> list[object]:
    """For `parametrize`: the first `count` run always, the others in the slow stage.

    A tuple is the values of several arguments.
    """
    values = [item if isinstance(item, tuple) else (item,) for item in items]
    marks = [() if k < count else pytest.mark.slow for k in range(len(values))]
    return [pytest.param(*value, marks=mark) for value, mark in zip(values, marks, strict=True)]


def over(name: str, items: Iterable[object]) -> Callable[[Test], Test]:
    """Run a test over all `items`, each as its argument `name`, as one test.

    Where pytest would make a test of each, thousands of them cost more than what they check. The
    item at which the test failed is in the report.
    """
    everything = list(items)

    def decorate(test: Test) -> Test:
        @functools.wraps(test)
        def all_of_them(*fixtures: object, **named: object) -> None:
            assert everything, f"there is no {name}"
            for item in everything:
                try:
                    test(*fixtures, **{name: item}, **named)
                except BaseException as error:
                    error.add_note(f"{name}: {item}")
                    raise

        signature = inspect.signature(test)
        left = [one for one in signature.parameters.values() if one.name != name]
        all_of_them.__signature__ = signature.replace(parameters=left)
        return all_of_them

    return decorate
