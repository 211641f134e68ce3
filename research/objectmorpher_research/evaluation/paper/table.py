"""The paper's table (section 4.3): LPIPS, SIFID, KID, RI and MT of every method's results.

The original image is the reference, as there: the measures reward who changes nothing, which the
row "nothing" shows, the photo itself taken as a result. RI and MT are read from what was recorded.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from objectmorpher_core.base.arrays import F64, RGB
from objectmorpher_core.base.progress import Progress, part, silent
from objectmorpher_core.pictures.image import resized

from ..bootstrap import Estimate, mean_with_interval
from ..error import EvaluationError
from ..measures.mmd import Subsets
from ..metrics import WHOLE, Choices, Lacking, measure
from ..pairs import MaskedPair, read_pixels
from ..subjects.subject import EvaluatedEdit, MethodResult, methods_of
from .interaction_log import Recorded, read_frames, read_recorded

NOTHING = "(nothing done)"
# By the table's columns, the paper's first; what stands in for them here is named for what it is.
COLUMNS = {
    "LPIPS": "lpips-alex",
    "SIFID": "sifid-192",
    "KID": "kid",
    "KID-paired": "kid-paired",
    "DINO-perceptual": "dinov2-perceptual",
    "DINO-identity": "dinov2-identity",
    "DINO-MMD-paired": "dinov2-mmd-paired",
}


@dataclass(frozen=True)
class MethodRow:
    """A method."""

    method: str
    subjects: tuple[str, ...]  # that it has results of
    scores: Mapping[str, Estimate]  # by column
    each: Mapping[str, Mapping[str, float]]  # by column, by subject; distances of sets have none
    latency: Estimate | None  # s, mean over the subjects of what 95 % of the inputs keep to
    computing: Estimate | None  # s, mean over the subjects
    inputs: float | None  # mean count
    recorded: int  # subjects with a log


@dataclass(frozen=True)
class PaperTable:
    """All methods, the row of doing nothing first."""

    subjects: int
    rows: tuple[MethodRow, ...]
    lacking: tuple[Lacking, ...]
    weights: Mapping[str, str]  # sha256 by file
    resized: tuple[str, ...]  # "METHOD: SUBJECT" whose result has another size than the photo


@dataclass(frozen=True)
class _Result(MaskedPair):
    """A photo and what became of it, which is brought to the photo's size where it has another."""

    def read(self) -> tuple[RGB, RGB, F64 | None]:
        a, b = read_pixels(self.a), read_pixels(self.b)
        if a.shape != b.shape:
            b = resized(b, a.shape[1], a.shape[0])
        return a, b, None


def measure_paper(
    subjects: Sequence[EvaluatedEdit],
    weights: Path | None = None,
    seed: int = 0,
    progress: Progress = silent,
) -> PaperTable:
    """The table of all methods that have a result. Raises EvaluationError: one sentence."""
    methods = methods_of(tuple(subjects))
    if not methods:
        raise EvaluationError("there is no result of any method")
    choices = Choices(tuple(COLUMNS.values()), weights, Subsets(seed=seed), is_lenient=True)
    rows: list[MethodRow] = []
    lacking: dict[str, Lacking] = {}
    hashes: dict[str, str] = {}
    for k, method in enumerate((NOTHING, *methods)):
        step = part(progress, k / (len(methods) + 1), (k + 1) / (len(methods) + 1))
        of = {
            s.name: MethodResult(s.image) if method == NOTHING else s.results[method]
            for s in subjects
            if method == NOTHING or method in s.results
        }
        pairs = [_Result(s.name, s.image, of[s.name].picture) for s in subjects if s.name in of]
        results = measure(pairs, choices, step)
        lacking |= {left.metric: left for left in results.lacking}
        hashes |= results.weights
        found = {s.metric: s for s in results.scores if s.region == WHOLE}
        taken = {column: found[name] for column, name in COLUMNS.items() if name in found}
        scores = {column: score.estimate for column, score in taken.items()}
        each = {column: score.each for column, score in taken.items() if score.each}
        recorded = [_recorded(r) for r in of.values() if r.log is not None or r.frames is not None]
        rows.append(
            MethodRow(method, tuple(of), scores, each, *_timing(recorded, seed), len(recorded))
        )
    return PaperTable(
        len(subjects), tuple(rows), tuple(lacking.values()), hashes, _resized(subjects)
    )


def _recorded(result: MethodResult) -> Recorded:
    """What the log says; how our window answered wins over a drag that was made again."""
    found = Recorded((), None) if result.log is None else read_recorded(result.log)
    if result.frames is None:
        return found
    return replace(found, latencies=read_frames(result.frames))


def _timing(
    recorded: Sequence[Recorded], seed: int
) -> tuple[Estimate | None, Estimate | None, float | None]:
    latencies = [r.latency for r in recorded if r.latency is not None]
    computing = [r.computing for r in recorded if r.computing is not None]
    counts = [len(r.latencies) for r in recorded if r.latencies]
    return (
        mean_with_interval(latencies, seed) if latencies else None,
        mean_with_interval(computing, seed) if computing else None,
        sum(counts) / len(counts) if counts else None,
    )


def _resized(subjects: Sequence[EvaluatedEdit]) -> tuple[str, ...]:
    """Whose results have another size than the photo, both upright."""
    told = []
    for subject in subjects:
        size = read_pixels(subject.image).shape
        for method, result in subject.results.items():
            if read_pixels(result.picture).shape != size:
                told.append(f"{method}: {subject.name}")
    return tuple(told)
