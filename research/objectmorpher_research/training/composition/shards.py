"""Triplets on the disk: a folder of shards, each of which is there whole or not at all.

    OUT/plan.json                 how they were made, and of which pairs
    OUT/shard-00000/shard.json    how many were made, and why the others were not
    OUT/shard-00000/NAME.json     of each pair: pose, agreement, or why it was rejected
    OUT/shard-00000/NAME.b.png, NAME.coarse.png, NAME.a.png, NAME.alpha.png

A shard is written to a folder of another name, down to the disk, and renamed. Whoever comes second
with the same shard throws its own away: each is there once, whatever is killed and run again.
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from objectmorpher_core.base.arrays import RGB
from objectmorpher_core.base.files import write_all
from objectmorpher_core.base.progress import Progress, part, silent
from objectmorpher_core.pictures.image import Picture, encode_coverage, encode_picture

from . import TrainingError
from .sources import SourcePair, fingerprint
from .triplet import VERSION, Rejected, Triplet, TripletPlan, make_triplet

PLAN, SHARD = "plan.json", "shard.json"
UNFINISHED = ".unfinished-"
PICTURES = ("b", "coarse", "a")
Make = Callable[[SourcePair, TripletPlan, Progress], Triplet]


@dataclass(frozen=True)
class Shard:
    """Some of the pairs."""

    number: int
    pairs: tuple[SourcePair, ...]

    @property
    def name(self) -> str:
        """Return its folder's name."""
        return f"shard-{self.number:05d}"


def shards_of(pairs: tuple[SourcePair, ...], size: int) -> tuple[Shard, ...]:
    """`size` pairs each, in their order. Raises TrainingError."""
    if size < 1:
        raise TrainingError(f"a shard of {size} pairs is none")
    starts = range(0, len(pairs), size)
    return tuple(Shard(k, pairs[at : at + size]) for k, at in enumerate(starts))


def left_over(out: Path, shards: tuple[Shard, ...]) -> tuple[Shard, ...]:
    """The shards that are not there yet."""
    return tuple(s for s in shards if not (out / s.name / SHARD).is_file())


def begin(out: Path, shards: tuple[Shard, ...], how: TripletPlan) -> None:
    """The plan of a new folder; in an old one the plan has to be the same. Raises TrainingError."""
    pairs = tuple(pair for shard in shards for pair in shard.pairs)
    plan = {
        "version": VERSION, "pairs": len(pairs), "shards": len(shards),
        "of": fingerprint(pairs), "how": asdict(how),
    }  # fmt: skip
    plan = json.loads(json.dumps(plan))  # as it is read again
    at = out / PLAN
    if not at.exists():
        if out.is_dir() and any(out.iterdir()):
            raise TrainingError(f"{out} is not empty, and holds no {PLAN}: choose another folder")
        out.mkdir(parents=True, exist_ok=True)
        write_all({at: json.dumps(plan, indent=1).encode()})
        return
    known = read_json(at)
    if other := sorted(key for key in plan if known.get(key) != plan[key]):
        what = {"how": "in another way", "of": "of other pairs", "shards": "in other shards"}
        raise TrainingError(
            f"{out} was begun {what.get(other[0], 'otherwise')}: give the same source and options,"
            " or another folder"
        )


def write_shard(
    out: Path,
    shard: Shard,
    how: TripletPlan,
    progress: Progress = silent,
    make: Make = make_triplet,
) -> bool:
    """Makes a shard's triplets, unless they are there; whether they were made now.

    May run at the same time on several machines that share `out`. Raises TrainingError.
    """
    target = out / shard.name
    if (target / SHARD).is_file():
        return False
    try:
        folder = Path(tempfile.mkdtemp(prefix=f"{UNFINISHED}{shard.name}-", dir=out))
    except OSError as error:
        raise TrainingError(f"{out} cannot be written: {error.strerror or error}") from error
    try:
        _fill(folder, shard, how, progress, make)
        return _renamed(folder, target)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def finish(out: Path, shards: tuple[Shard, ...]) -> dict[str, Any]:
    """Join the shards when all are there; left-overs of killed processes are removed.

    Raises TrainingError where one is missing.
    """
    if missing := left_over(out, shards):
        raise TrainingError(f"{len(missing)} shards are not made: run the same command again")
    for folder in out.glob(f"{UNFINISHED}*"):
        shutil.rmtree(folder, ignore_errors=True)
    told = [read_json(out / shard.name / SHARD) for shard in shards]
    reasons: dict[str, int] = {}
    for one in told:
        for sentence in one["rejected"].values():
            reasons[sentence] = reasons.get(sentence, 0) + 1
    made = sum(len(one["made"]) for one in told)
    return {"made": made, "rejected": sum(reasons.values()), "reasons": reasons}


def read_json(at: Path) -> dict[str, Any]:
    """Raises TrainingError."""
    try:
        told = json.loads(at.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise TrainingError(f"{at} cannot be read: {error}") from error
    if not isinstance(told, dict):
        raise TrainingError(f"{at} holds no named values")
    return told


def _fill(folder: Path, shard: Shard, how: TripletPlan, progress: Progress, make: Make) -> None:
    made: list[str] = []
    rejected: dict[str, str] = {}
    count = len(shard.pairs)
    for k, pair in enumerate(shard.pairs):
        step = part(progress, k / count, (k + 1) / count)
        step(0.0, f"{shard.name}, pair {k + 1} of {count}")
        facts: dict[str, Any] = {"version": VERSION, "name": pair.name, "rejected": ""}
        facts["pair"] = {"b": asdict(pair.b), "a": asdict(pair.a)}
        outputs: dict[Path, bytes] = {}
        try:
            triplet = make(pair, how, step)
        except Rejected as error:
            rejected[pair.name] = facts["rejected"] = str(error)
            facts |= error.facts
        else:
            made.append(pair.name)
            facts |= triplet.facts
            for name in PICTURES:
                outputs[folder / f"{pair.name}.{name}.png"] = _png(getattr(triplet, name))
            outputs[folder / f"{pair.name}.alpha.png"] = encode_coverage(triplet.alpha)
        told = json.dumps(facts, indent=1)
        write_all(outputs | {folder / f"{pair.name}.json": told.encode()})
    told = json.dumps({"version": VERSION, "made": made, "rejected": rejected}, indent=1)
    write_all({folder / SHARD: told.encode()})


def _png(pixels: RGB) -> bytes:
    return encode_picture(Picture(pixels), ".png")


def _renamed(folder: Path, target: Path) -> bool:
    """Whether it has become `target`; not where another was there first."""
    os.chmod(folder, 0o755)  # mkdtemp's is for one user alone
    try:
        os.rename(folder, target)
    except OSError as error:
        if (target / SHARD).is_file():
            return False
        raise TrainingError(f"{target} cannot be written: {error.strerror or error}") from error
    return True
