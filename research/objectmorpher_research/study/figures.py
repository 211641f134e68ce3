"""Figures of a study's answers: who counts, means by method, and agreement."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from objectmorpher_core.base.arrays import F64

from ..evaluation.bootstrap import RESAMPLES, Estimate
from .agreement import ordinal_alpha
from .design import CRITERIA
from .store import Participant

QUICKEST = 2.0  # s, median of a page, below which nobody can have looked
RULES = (
    "has not answered every page",
    "has answered a check of attention otherwise than it said",
    f"has taken less than {QUICKEST:g} s for half of the pages",
    "has given one and the same rating to everything",
)


@dataclass(frozen=True)
class MethodFigures:
    """The figures of one method."""

    method: str
    ratings: int  # how many results were rated, by all together
    means: Mapping[str, Estimate]  # by criterion; the intervals are over participants


@dataclass(frozen=True)
class Figures:
    """The figures of a study."""

    participants: int  # who began
    excluded: Mapping[int, str]  # by number: the rule that excludes
    methods: tuple[MethodFigures, ...]  # by the first criterion's mean, highest first
    alpha: Mapping[str, Estimate]  # by criterion

    @property
    def counted(self) -> int:
        """Participants whose answers count."""
        return self.participants - len(self.excluded)


def excluded_by(person: Participant) -> str:
    """The first of RULES that excludes, or ""."""
    if not person.is_finished:
        return RULES[0]
    answers = [(person.items[k], answer) for k, answer in person.answers.items()]
    if any(item.check and item.check != answer.ratings for item, answer in answers):
        return RULES[1]
    if np.median([answer.seconds for _, answer in answers]) < QUICKEST:
        return RULES[2]
    given = {r for item, answer in answers if not item.check for r in answer.ratings}
    return RULES[3] if len(given) < 2 and len(answers) > 1 else ""


def figures(people: Sequence[Participant], seed: int = 0) -> Figures:
    """Means, intervals and agreement of those whom no rule excludes."""
    excluded = {p.number: rule for p in people if (rule := excluded_by(p))}
    counted = [p for p in people if p.number not in excluded]
    units = sorted({(i.method, i.subject) for p in counted for i in p.items if i.method})
    ratings = _ratings(counted, units)
    drawn = _draws(len(counted), seed)
    methods = [
        MethodFigures(
            method,
            int(np.isfinite(ratings[:, own, 0]).sum()),
            {c: _mean(ratings[:, own, k], drawn) for k, c in enumerate(CRITERIA)},
        )
        for method in sorted({method for method, _ in units})
        for own in [[u for u, (m, _) in enumerate(units) if m == method]]
    ]
    methods.sort(key=lambda m: -m.means[CRITERIA[0]].value)
    alpha = {c: ordinal_alpha(ratings[:, :, k], seed=seed) for k, c in enumerate(CRITERIA)}
    return Figures(len(people), excluded, tuple(methods), alpha if units else {})


def _ratings(people: Sequence[Participant], units: Sequence[tuple[str, str]]) -> F64:
    """(people, units, criteria), nan where someone has not rated something."""
    place = {unit: u for u, unit in enumerate(units)}
    ratings = np.full((len(people), len(units), len(CRITERIA)), np.nan)
    for p, person in enumerate(people):
        for k, answer in person.answers.items():
            item = person.items[k]
            if item.method:
                ratings[p, place[item.method, item.subject]] = answer.ratings
    return ratings


def _draws(people: int, seed: int) -> F64:
    """(RESAMPLES, people): how often each is drawn."""
    if people < 2:
        return np.zeros((0, people))
    random = np.random.default_rng(seed)
    return random.multinomial(people, np.full(people, 1 / people), RESAMPLES).astype(np.float64)


def _mean(ratings: F64, drawn: F64) -> Estimate:
    """The mean of (people, units); a person is drawn with all of his or her ratings."""
    sums, counts = np.nansum(ratings, 1), np.isfinite(ratings).sum(1)
    if not counts.sum():
        return Estimate(float("nan"))
    mean = float(sums.sum() / counts.sum())
    if not len(drawn):
        return Estimate(mean)
    totals = drawn @ counts
    means = (drawn @ sums)[totals > 0] / totals[totals > 0]
    low, high = np.quantile(means, (0.025, 0.975))
    return Estimate(mean, float(low), float(high))
