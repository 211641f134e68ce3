"""Runs methods on cases, one photo after the other; what is done is kept in a folder.

FOLDER/cases/NAME holds photo, mask, truth, plate and guidance.json; a method's picture and its
figures lie beside them. A run that was broken off goes on where it was.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import groupby
from pathlib import Path

import numpy as np

from objectmorpher_core.base.files import write_all
from objectmorpher_core.base.progress import Progress, silent
from objectmorpher_core.pictures.image import Picture, encode_mask, encode_picture

from ..error import EvaluationError
from ..measures import dino
from .cases import EditOutcome, PlannedCase, TruthCase, make_case, wanted_cases
from .chain import Chain
from .methods import OURS, EditMethod, Given
from .motions import RIGID
from .scores import TruthScore, score
from .stereo import NAME as STEREO
from .stereo import stereo_case

VERSION = 1  # of the cases: raised when they change
VIEW = "view"  # the stereo pair's category
MIB = 1 << 20


@dataclass(frozen=True)
class CaseRow:
    """One method on one case."""

    case: str
    category: str
    method: str
    score: TruthScore
    seconds: float  # beyond what all methods share: the lift and the plate
    cpu: float  # of all cores together
    shared: float  # seconds of the default lift and the plate
    memory: float  # MiB, the most that the process held; nan where that is unknown


@dataclass(frozen=True)
class CaseJob:
    """Cases of one photo."""

    folder: Path
    wanted: tuple[PlannedCase, ...]  # empty: the stereo pair
    methods: tuple[EditMethod, ...]
    seed: int

    @property
    def name(self) -> str:
        """Return the name of the thing in the photo."""
        return self.wanted[0].setting.solid if self.wanted else STEREO

    @property
    def is_done(self) -> bool:
        """Whether all of it is in the folder."""
        return all(
            _is_whole(_kept_rows(self, name, category)) for name, category, _ in _cases(self)
        )


def run(
    folder: Path,
    methods: Mapping[str, EditMethod],
    seed: int = 0,
    is_quick: bool = False,
    progress: Progress = silent,
) -> list[CaseRow]:
    """Every method on every case. Raises EvaluationError: one sentence."""
    claim(folder, seed)
    jobs = jobs_of(folder, methods, seed, is_quick)
    rows: list[CaseRow] = []
    for k, job in enumerate(jobs):
        progress(k / len(jobs), job.name)
        rows += run_photo(job)
    progress(1.0, "Done")
    return sorted(rows, key=lambda row: row.case)


def jobs_of(
    folder: Path, methods: Mapping[str, EditMethod], seed: int = 0, is_quick: bool = False
) -> list[CaseJob]:
    """Return a job for each photo; they may be done in any order, and on several machines."""
    found = wanted_cases(seed, is_quick)
    by_photo = sorted(found, key=lambda w: (repr(w.setting), w.number))
    jobs = [
        CaseJob(folder, tuple(own), tuple(methods.values()), seed)
        for _, own in groupby(by_photo, key=lambda w: w.setting)
    ]
    return [*jobs, CaseJob(folder, (), tuple(methods.values()), seed)]


def run_photo(job: CaseJob) -> list[CaseRow]:
    """Run all methods on the cases of one photo; what is in the folder is not computed again."""
    network = dino.Dino() if dino.missing() is None else None
    chain: Chain | None = None
    rows: list[CaseRow] = []
    for name, category, make in _cases(job):
        home = job.folder / "cases" / name
        done = _kept_rows(job, name, category)
        if _is_whole(done):
            rows += [row for row in done.values() if row is not None]
            continue
        case = make()
        chain = chain or Chain(case.photo, case.mask, case.camera, job.seed)
        begun = time.perf_counter()
        given = Given(case, chain.lift()[0], chain.plate(case), chain)
        shared = time.perf_counter() - begun
        _write_case(home, case)
        own: dict[str, CaseRow] = {}
        for method in job.methods:
            if method.name not in done:
                continue
            if (kept := done[method.name]) is not None:
                own[method.name] = kept
                continue
            row, outcome = _measured(given, method, shared, network)
            own[method.name] = row
            figures = asdict(row.score) | {
                "seconds": row.seconds, "cpu": row.cpu, "shared": shared, "memory": row.memory,
            }  # fmt: skip
            told = json.dumps(figures, indent=1)
            picture = encode_picture(Picture(outcome.pixels), ".png")
            write_all({home / f"{method.name}.png": picture})
            write_all({home / f"{method.name}.json": told.encode()})  # last: it says "done"
        rows += own.values()
    return rows


def _cases(job: CaseJob) -> Iterator[tuple[str, str, Callable[[], TruthCase]]]:
    if not job.wanted:
        yield STEREO, VIEW, stereo_case
    for wanted in job.wanted:
        yield wanted.name, wanted.motion.category, lambda w=wanted: make_case(w)


def _measured(
    given: Given, method: EditMethod, shared: float, network: dino.Dino | None
) -> tuple[CaseRow, EditOutcome]:
    _forget_peak()
    begun, worked = time.perf_counter(), time.process_time()
    outcome = method.apply(given)
    seconds, cpu = time.perf_counter() - begun, time.process_time() - worked
    memory, case = _peak(), given.case
    found = score(case, outcome, network)
    return CaseRow(
        case.name, case.category, method.name, found, seconds, cpu, shared, memory
    ), outcome


def _kept_rows(job: CaseJob, case: str, category: str) -> dict[str, CaseRow | None]:
    """The methods that are to be run on a case; None of those that were not yet."""
    names = {m.name for m in job.methods}
    is_same = category in (*RIGID, VIEW) and OURS in names  # as ours, for what only bends
    home = job.folder / "cases" / case
    return {
        m.name: _kept(home / f"{m.name}.json", case, category)
        for m in job.methods
        if not (is_same and m.only_bends)
    }


def _is_whole(rows: Mapping[str, CaseRow | None]) -> bool:
    return None not in rows.values()


def _kept(path: Path, case: str, category: str) -> CaseRow | None:
    if not path.exists():
        return None
    try:
        told = json.loads(path.read_text("utf-8"))
        extra = [told.pop(key) for key in ("seconds", "cpu", "shared", "memory")]
        return CaseRow(case, category, path.stem, TruthScore(**told), *extra)
    except (ValueError, KeyError, TypeError) as error:
        raise EvaluationError(f"{path} does not hold a case's figures: delete it") from error


def claim(folder: Path, seed: int) -> None:
    """The folder is for these cases: empty, or begun with the same. Raises EvaluationError."""
    path, told = folder / "run.json", {"cases": VERSION, "seed": seed}
    if path.exists():
        try:
            known = json.loads(path.read_text("utf-8"))
        except ValueError as error:
            raise EvaluationError(f"{path} does not hold what a run writes there") from error
        if known != told:
            raise EvaluationError(f"{folder} holds a run of other cases ({known}): use another one")
        return
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise EvaluationError(f"{folder} is not an empty folder, nor one of an earlier run")
    folder.mkdir(parents=True, exist_ok=True)
    write_all({path: (json.dumps(told) + "\n").encode()})


def _write_case(home: Path, case: TruthCase) -> None:
    home.mkdir(parents=True, exist_ok=True)
    guidance, rigid = case.guidance, case.guidance.rigid
    points = [
        {"at": _rounded(a), "to": _rounded(b), "away": round(float(z), 5), "pin": bool(pin)}
        for a, b, z, pin in zip(
            guidance.at, guidance.to, guidance.away, guidance.is_pin, strict=True
        )
    ]
    told = {
        "category": case.category, "focal": case.camera.focal, "points": points,
        "whole": None if rigid is None else asdict(rigid),
    }  # fmt: skip
    pictures = {"photo": case.photo, "truth": case.truth, "plate": case.plate}
    outputs = {
        home / f"{name}.png": encode_picture(Picture(pixels), ".png")
        for name, pixels in pictures.items()
        if pixels is not None
    }
    outputs[home / "mask.png"] = encode_mask(case.mask)
    outputs[home / "region.png"] = encode_mask(case.region > 0.5)
    outputs[home / "guidance.json"] = json.dumps(told, indent=1).encode()
    write_all(outputs)


def _rounded(xy: Sequence[float] | np.ndarray) -> list[float]:
    return [round(float(v), 2) for v in xy]


def _forget_peak() -> None:
    """Lets Linux count this process's most memory anew."""
    try:
        with open("/proc/self/clear_refs", "w", encoding="ascii") as file:
            file.write("5")
    except OSError:
        return


def _peak() -> float:
    """MiB that this process held at most since then; nan where that is unknown."""
    if os.name != "posix":
        return float("nan")
    try:
        lines = Path("/proc/self/status").read_text("ascii").splitlines()
    except OSError:
        return float("nan")
    found = [line for line in lines if line.startswith("VmHWM:")]
    return float(found[0].split()[1]) * 1024 / MIB if found else float("nan")
