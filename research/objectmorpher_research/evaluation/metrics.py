"""Measures two sets of pictures by name; every measure says where it cannot be taken, and why."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from objectmorpher_core.base.arrays import F64, RGB
from objectmorpher_core.base.progress import Progress, silent

from .bootstrap import Estimate, mean_with_interval
from .error import EvaluationError
from .measures import dino, fidelity, trunk_files
from .measures.frechet import frechet_of_samples
from .measures.mmd import Subsets, kid, paired_kid
from .measures.regions import Measure, Region
from .pairs import MaskedPair

WHOLE, INSIDE, OUTSIDE = "whole", "inside", "outside"
Features = Callable[[RGB], F64]  # (d,) of a picture
Distance = Callable[[F64, F64], Estimate]  # of two sets (n, d)


@dataclass(frozen=True)
class RegionScore:
    """A measure of one region."""

    metric: str
    region: str  # WHOLE, INSIDE or OUTSIDE the mask
    estimate: Estimate
    each: Mapping[str, float]  # by the pair's name; empty for a distance of two sets


@dataclass(frozen=True)
class Lacking:
    """A measure that was not taken, and why."""

    metric: str
    reason: str


@dataclass(frozen=True)
class Results:
    """The results of one comparison."""

    pairs: int
    scores: tuple[RegionScore, ...]
    lacking: tuple[Lacking, ...]
    weights: Mapping[str, str]  # sha256 by the name of the file, of the networks used


@dataclass(frozen=True)
class Choices:
    """The choice of measures and their settings."""

    metrics: tuple[str, ...] = ()  # names of METRICS; none: USUAL
    weights: Path | None = None  # folder with the official networks' files
    subsets: Subsets = field(default_factory=Subsets)
    is_lenient: bool = False  # those of `metrics` that cannot be taken are reported as lacking


class _Networks:
    """Opens what the measures need, each once. Raises EvaluationError."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self.used: dict[str, str] = {}  # sha256 by the file's name
        self._dino = dino.Dino()
        self._fid: Features | None = None

    def file(self, id: str) -> Path:
        path, self.used[path.name] = trunk_files.checked(id, self._folder)
        return path

    def lpips(self, net: str) -> Measure:
        from .measures.lpips import Lpips

        trunk, heads = trunk_files.NEEDS[f"lpips-{net}"]
        return Lpips(net, self.file(trunk), self.file(heads))

    def sifid(self, channels: int) -> Measure:
        from .measures.inception_measures import Sifid

        return Sifid(self.file("inception-v3"), channels)

    def hed_vgg(self) -> Measure:
        from .measures.hed_vgg import WEIGHT, read_hed_vgg

        return read_hed_vgg(self.file(WEIGHT))

    def fid_features(self) -> Features:
        from .measures.inception_measures import FidFeatures

        path = self.file("fid-inception")
        if self._fid is None:
            self._fid = FidFeatures(path)
        return self._fid

    def dino(self) -> dino.Dino:
        self.file(dino.WEIGHT)
        return self._dino


def _frechet(x: F64, y: F64) -> Estimate:
    return Estimate(frechet_of_samples(x, y))


# By name: how the measure of two pictures is opened.
ONE_BY_ONE: Mapping[str, Callable[[_Networks], Measure]] = {
    "psnr": lambda _: fidelity.psnr,
    "ssim": lambda _: fidelity.ssim,
    "lpips-alex": lambda networks: networks.lpips("alex"),
    "lpips-vgg": lambda networks: networks.lpips("vgg"),
    "sifid-64": lambda networks: networks.sifid(64),
    "sifid-192": lambda networks: networks.sifid(192),
    "sifid-768": lambda networks: networks.sifid(768),
    "hed-vgg-perceptual": lambda networks: networks.hed_vgg(),
    "dinov2-perceptual": lambda networks: networks.dino().perceptual,
    "dinov2-identity": lambda networks: networks.dino().identity,
}
# By name: how the features of a picture are opened that two sets are compared by.
AS_SETS: Mapping[str, Callable[[_Networks], Features]] = {
    "fid": lambda networks: networks.fid_features(),
    "kid": lambda networks: networks.fid_features(),
    "kid-paired": lambda networks: networks.fid_features(),
    "dinov2-mmd-paired": lambda networks: networks.dino().picture,
}
METRICS = (*ONE_BY_ONE, *AS_SETS)
USUAL = tuple(name for name in METRICS if name not in ("sifid-64", "sifid-768"))


@dataclass(frozen=True)
class Taken:
    """The input of the measures from one pair."""

    name: str
    values: Mapping[tuple[str, str], float]  # by measure and region
    features: Mapping[str, tuple[F64, F64]]  # (d,) of A and B, by the first measure that needs them


class OpenedMeasures:
    """The measures of `choices` that can be taken here of `pairs` pairs, and why others cannot."""

    def __init__(self, choices: Choices, pairs: int) -> None:
        """Raises EvaluationError: an unknown name, or one asked for that cannot be taken."""
        names = tuple(dict.fromkeys(choices.metrics or USUAL))
        unknown = [name for name in names if name not in METRICS]
        if unknown:
            known = ", ".join(METRICS)
            raise EvaluationError(f"there is no measure {unknown[0]!r}; there are {known}")
        self._choices = choices
        self._networks = _Networks(choices.weights)
        self._ones: dict[str, Measure] = {}
        self._sets: dict[str, Features] = {}
        self._lacking = tuple(self._open(names, pairs))
        if self._lacking and choices.metrics and not choices.is_lenient:
            left = self._lacking[0]
            raise EvaluationError(f"{left.metric} cannot be measured: {left.reason}")

    def _open(self, names: Sequence[str], pairs: int) -> Iterator[Lacking]:
        for name in names:
            reason = trunk_files.why_missing(name, self._choices.weights)
            if name in AS_SETS and pairs < 2:
                reason = "the distance of two sets needs two pictures in each"
            if reason:
                yield Lacking(name, reason)
            elif name in ONE_BY_ONE:
                self._ones[name] = ONE_BY_ONE[name](self._networks)
            else:
                self._sets[name] = AS_SETS[name](self._networks)

    @property
    def _leaders(self) -> dict[str, str]:
        """By the name of a measure of sets: the first one of the same features."""
        first: dict[Features, str] = {}
        return {name: first.setdefault(features, name) for name, features in self._sets.items()}

    def take(self, pair: MaskedPair) -> Taken:
        """Take all measures of one pair. Raises EvaluationError."""
        a, b, mask = pair.read()
        regions = _regions(mask)
        values: dict[tuple[str, str], float] = {}
        for name, take in self._ones.items():
            try:
                found = take(a, b, tuple(regions.values()))
            except EvaluationError as error:
                raise EvaluationError(f"{pair.name}: {error}") from error
            values |= {(name, region): v for region, v in zip(regions, found, strict=True)}
        leaders = dict.fromkeys(self._leaders.values())
        return Taken(pair.name, values, {n: (self._sets[n](a), self._sets[n](b)) for n in leaders})

    def results(self, taken: Sequence[Taken]) -> Results:
        """Combine the results of all pairs in their order, whoever took them."""
        values: dict[tuple[str, str], dict[str, float]] = {}
        for one in taken:
            for key, value in one.values.items():
                values.setdefault(key, {})[one.name] = value
        seed = self._choices.subsets.seed
        scores = [
            RegionScore(name, region, mean_with_interval(tuple(each.values()), seed), each)
            for (name, region), each in values.items()
        ]
        distances = _distances(self._choices.subsets)
        for name, leader in self._leaders.items():
            sides = zip(*(one.features[leader] for one in taken), strict=True)
            x, y = (np.stack(side) for side in sides)
            scores.append(RegionScore(name, WHOLE, distances[name](x, y), {}))
        return Results(len(taken), tuple(scores), self._lacking, self._networks.used)


def measure(pairs: Sequence[MaskedPair], choices: Choices, progress: Progress = silent) -> Results:
    """Take all chosen measures of all pairs. Raises EvaluationError: one sentence.

    A region that holds nothing in some picture is left out of the mean there. A measure whose
    network is not here is told among the lacking; if it is asked for by its name, that is an error.
    """
    opened, taken = OpenedMeasures(choices, len(pairs)), []
    for k, pair in enumerate(pairs):
        progress(k / len(pairs), pair.name)
        taken.append(opened.take(pair))
    progress(1.0, "measured")
    return opened.results(taken)


def _distances(subsets: Subsets) -> Mapping[str, Distance]:
    return {
        "fid": _frechet,
        "kid": partial(kid, subsets=subsets),
        "kid-paired": paired_kid,
        "dinov2-mmd-paired": paired_kid,
    }


def _regions(mask: F64 | None) -> dict[str, Region]:
    if mask is None:
        return {WHOLE: None}
    return {WHOLE: None, INSIDE: mask, OUTSIDE: 1 - mask}
