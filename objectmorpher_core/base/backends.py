"""A stage's backends: a table of names and where each is, imported when it is chosen.

Each stage keeps its own table, error and rule for "auto"; what is the same in all of them is here.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from importlib import import_module
from typing import Any, Protocol, TypeVar

Table = Mapping[str, str]  # name -> "package.module:what makes one"


class Backend(Protocol):
    """The common protocol of every stage's backends."""

    def missing(self) -> str | None:
        """Return what has to be installed first, as one sentence; None where it can run."""
        ...


Kind = TypeVar("Kind", bound=Backend)


def create(table: Table, name: str) -> Any:
    """A backend of the table, whether it can run here or not."""
    module, _, kind = table[name].partition(":")
    return getattr(import_module(module), kind)()


def known(
    table: Table, name: str, what: str, error: type[ValueError], others: Iterable[str] = ()
) -> Any:
    """The backend called `name`, a `what`; raises `error` where the table has none.

    `others`: names that are known, too.
    """
    if name not in table:
        raise error(f"there is no {what} {name!r}; known are {', '.join((*table, *others))}")
    return create(table, name)


def able(backend: Kind, error: type[ValueError]) -> Kind:
    """Return the backend if it can run here; raise `error` with what is missing otherwise."""
    if (sentence := backend.missing()) is not None:
        raise error(sentence)
    return backend


def absent(table: Table) -> tuple[tuple[str, str], ...]:
    """Return the backends that cannot run here, each with its sentence."""
    told = ((name, create(table, name).missing()) for name in table)
    return tuple((name, reason) for name, reason in told if reason is not None)
