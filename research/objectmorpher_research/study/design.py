"""Who sees what in which order: balanced orders, and checks of attention in between.

Orders are rows of a Williams design (Williams, Australian Journal of Scientific Research A 2,
1949): over all its rows each thing stands in each place equally often, and is preceded equally
often by each other thing. Participant p takes row p of the subjects' design, and for each subject
another row of the methods'. Which thing is which label is drawn once, by the study's seed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeVar

import numpy as np

T = TypeVar("T")
CRITERIA = ("guidance", "realism", "identity")  # what is rated, in the paper's order
LEAST, MOST = 1, 5  # of a rating


@dataclass(frozen=True)
class Item:
    """A page: a result to be rated, or a check that says what to answer."""

    subject: str  # the subject whose photo stands beside it
    method: str = ""  # of a result
    check: tuple[int, ...] = ()  # the ratings that a check asks for


def williams_design(count: int) -> tuple[tuple[int, ...], ...]:
    """`count` rows of 0..count-1, twice as many where `count` is odd."""
    first = [0]
    for step in range(1, count):
        first.append((first[-1] + (step if step % 2 else -step)) % count)
    rows = [tuple((k + shift) % count for k in first) for shift in range(count)]
    return tuple(rows + [row[::-1] for row in rows] if count % 2 and count > 1 else rows)


def plan_items(
    methods: Mapping[str, Sequence[str]], number: int, seed: int, checks: int
) -> tuple[Item, ...]:
    """The pages of participant `number` (from 0): `methods` that each subject has results of.

    A function of its arguments alone.
    """
    subjects = sorted(methods)
    items = [
        Item(subject, method)
        for k, subject in _ordered(list(enumerate(subjects)), number, (seed,))
        for method in _ordered(sorted(methods[subject]), number + k, (seed, 1 + k))
    ]
    return _with_checks(items, np.random.default_rng((seed, 0, 1 + number)), checks)


def _ordered(things: Sequence[T], row: int, seeds: tuple[int, ...]) -> list[T]:
    design = williams_design(len(things))
    labels = np.random.default_rng(seeds).permutation(len(things))
    return [things[labels[k]] for k in design[row % len(design)]]


def _with_checks(items: list[Item], random: np.random.Generator, count: int) -> tuple[Item, ...]:
    """One check somewhere in each of `count` equal parts, never before the first item."""
    result: list[Item] = []
    bounds = np.linspace(1, max(len(items), 1), count + 1).round().astype(int)
    places = [int(random.integers(a, max(b, a + 1))) for a, b in pairwise(bounds)]
    for k, item in enumerate(items):
        result += [Item(item.subject, check=_asked(random)) for place in places if place == k]
        result.append(item)
    result += [Item(items[-1].subject, check=_asked(random)) for p in places if p >= len(items)]
    return tuple(result)


def _asked(random: np.random.Generator) -> tuple[int, ...]:
    """Ratings that are not all the same."""
    while len(set(asked := random.integers(LEAST, MOST + 1, len(CRITERIA)).tolist())) == 1:
        pass
    return tuple(asked)
