"""`objectmorpher evaluate paper`: the paper's table, of results that lie in a folder."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from objectmorpher.cli.command_parser import add_ray, check_ray
from objectmorpher.cli.terminal import FAILURES, UsageError, failure_sentence, progress_bar

from .figures import Number, aligned, cell, number, numbers

if TYPE_CHECKING:
    from ..evaluation.bootstrap import Estimate
    from ..evaluation.paper.table import MethodRow, PaperTable
    from ..evaluation.subjects.subject import EvaluatedEdit

OURS = "objectmorpher"  # the method's name
PAPERS = ("LPIPS", "SIFID", "KID")  # the paper's columns, before RI and MT
FORMAT = ".3f"  # of the scores
ABSENT = "absent"  # a measure that could not be taken


def add_paper(parser: argparse.ArgumentParser) -> None:
    """The options of `objectmorpher evaluate paper`."""
    parser.description = "The layout of the folder, of logs and of benchmarks: docs/evaluation.md."
    add = parser.add_argument
    add("folder", type=Path, metavar="FOLDER", help="of subjects, or DragBench's or GeoBench's")
    add("--results", action="append", type=named_folder, default=[], metavar="METHOD=DIR",
        help="where a method's results lie, if not beside the subjects")  # fmt: skip
    add("--run", dest="ours", type=Path, metavar="DIR",
        help=f"edit every subject with this program, into DIR, as the method {OURS}")  # fmt: skip
    add("--overwrite", action="store_true", help="also what --run has made already")
    add_ray(parser)
    add("--weights", type=Path, metavar="DIR", help="official weights, as for metrics")
    add("--seed", type=int, default=0, metavar="N", help="of the intervals")
    add("--json", type=Path, metavar="FILE", help="every figure, also of every subject")


def run_paper(options: argparse.Namespace) -> None:
    """Measures, prints the table, writes the figures."""
    from objectmorpher.cli.commands import check_outputs
    from objectmorpher_core.base.files import write_all

    from ..evaluation.paper.table import measure_paper
    from ..evaluation.subjects.folders import read_subjects, with_results

    if options.seed < 0:
        raise UsageError("--seed is at least 0")
    if options.weights is not None and not options.weights.is_dir():
        raise UsageError(f"there is no folder {options.weights}")
    if options.json is not None:
        check_outputs([], {options.json: (options.json.suffix.lower(),)})
    check_ray(options)
    if options.ray is not None and options.ours is None:
        raise UsageError("--ray spreads what --run edits; without --run there is nothing to spread")
    methods = dict(options.results)
    if len(methods) < len(options.results) or (options.ours and OURS in methods):
        raise UsageError("--results: two methods have the same name")
    subjects = read_subjects(options.folder, methods)
    left: tuple[str, ...] = ()
    if options.ours is not None:
        left = run_ours(options, subjects)
        if len(left) == len(subjects):
            raise UsageError(f"none of the subjects could be edited: {left[0]}")
        subjects = with_results(subjects, OURS, options.ours)
    with progress_bar("Measuring") as progress:
        table = measure_paper(subjects, options.weights, options.seed, progress)
    sys.stdout.write(as_text(table) + "".join(f"not edited: {told}\n" for told in left))
    if options.json is not None:
        told = json.dumps(as_json(table), indent=1, allow_nan=False)
        write_all({options.json: (told + "\n").encode()})


def as_text(table: PaperTable) -> str:
    """Return text for the terminal: a line for each method, and notes on the figures below."""
    from ..evaluation.paper.table import COLUMNS, NOTHING

    paper = [["method", "n", *PAPERS, "RI", "MT"]]
    others = [["method", "n", *(column for column in COLUMNS if column not in PAPERS)]]
    for row in table.rows:
        timing = ["", ""] if row.method == NOTHING else [interaction(row.latency), _time(row)]
        for lines, more in ((paper, timing), (others, [])):
            scores = [_cell(row.scores.get(column)) for column in lines[0] if column in COLUMNS]
            lines.append([row.method, str(len(row.subjects)), *scores, *more])
    text = [*aligned(paper), "", *aligned(others), ""]
    for reason in dict.fromkeys(left.reason for left in table.lacking):
        names = [c for c, name in COLUMNS.items() if name in
                 {left.metric for left in table.lacking if left.reason == reason}]  # fmt: skip
        text.append(f"absent: {', '.join(names)}: {reason}")
    for row in table.rows:
        if len(row.subjects) < table.subjects:
            text.append(f"{row.method} has results of {len(row.subjects)} of {table.subjects}")
        if row.method != NOTHING and row.recorded < len(row.subjects):
            text.append(f"{row.method} has logs of {row.recorded} of {len(row.subjects)}")
    if table.resized:
        count = len(table.resized)
        text.append(f"{count} results had another size than their photo and were resized")
    return "".join(line.rstrip() + "\n" for line in text)


def interaction(latency: Estimate | None) -> str:
    """RI: whether one sees at once what one does, and after which time."""
    from ..evaluation.paper.interaction_log import IMMEDIATE, UNBROKEN

    if latency is None:
        return "not recorded"
    if not math.isfinite(latency.value):
        return "no: an input was never answered"
    kinds = ((IMMEDIATE, "yes"), (UNBROKEN, "borderline"), (math.inf, "no"))
    verdict = next(word for limit, word in kinds if latency.value <= limit)
    return f"{verdict}, {_seconds(latency)}"


def as_json(table: PaperTable) -> dict[str, Any]:
    """Return plain numbers for JSON; missing ones are null, infinite ones "inf"."""
    return {
        "subjects": table.subjects,
        "methods": [
            {
                "method": row.method,
                "subjects": list(row.subjects),
                "scores": {column: _numbers(e) for column, e in row.scores.items()},
                "each": {c: {n: number(v) for n, v in e.items()} for c, e in row.each.items()},
                "interaction_s": _numbers(row.latency),
                "computing_s": _numbers(row.computing),
                "inputs": row.inputs,
                "logs": row.recorded,
            }
            for row in table.rows
        ],
        "absent": [{"measure": left.metric, "reason": left.reason} for left in table.lacking],
        "resized": list(table.resized),
        "weights": dict(table.weights),
    }


def run_ours(options: argparse.Namespace, subjects: Sequence[EvaluatedEdit]) -> tuple[str, ...]:
    """Edits every subject into the folder; what was made already stays. Why some were not."""
    folder, left = options.ours, []
    wanted = []
    for subject in subjects:
        is_made = all(path.is_file() for path in _made(folder, subject.name))
        if is_made and not options.overwrite:
            continue
        if subject.guidance.item is None:
            left.append(f"{subject.name}: {subject.guidance.reason}")
            continue
        wanted.append(subject)
    if options.ray is not None:
        from objectmorpher.server.spread import spread

        at = {"source": str(options.folder.absolute()), "folder": str(folder.absolute())}
        jobs = [at | {"name": subject.name} for subject in wanted]
        with progress_bar("Editing") as progress:
            for done, answer in enumerate(spread(_run_there, jobs, options.ray), 1):
                left += answer["left"]
                progress(done / len(jobs), answer["name"])
    else:
        left += [told for subject in wanted for told in _run_one(subject, folder)]
    return tuple(left)


def _run_there(job: dict[str, Any]) -> dict[str, Any]:
    """In a worker of a cluster: one subject."""
    from ..evaluation.subjects.folders import read_subjects

    subjects = {subject.name: subject for subject in read_subjects(Path(job["source"]), {})}
    name = job["name"]
    return {"name": name, "left": _run_one(subjects[name], Path(job["folder"]))}


def _run_one(subject: EvaluatedEdit, folder: Path) -> list[str]:
    """Edits a subject; why not, if not."""
    from objectmorpher_core.base.files import write_all
    from objectmorpher_core.pictures.image import encode_picture

    from ..evaluation.paper.interaction_log import encode_events
    from ..evaluation.paper.timed_run import run_subject

    _warm_up()
    try:
        with progress_bar(subject.name) as progress:
            timed = run_subject(subject, progress)
    except FAILURES as error:
        return [f"{subject.name}: {failure_sentence(error)}"]
    picture, log = _made(folder, subject.name)
    picture.parent.mkdir(parents=True, exist_ok=True)
    pixels = encode_picture(timed.picture, ".png")
    write_all({picture: pixels, log: encode_events(timed.events)})
    return []


@cache
def _warm_up() -> None:
    """Once: compiling is an installation's time, not an edit's."""
    from objectmorpher_core.warm_up import warm_up

    warm_up()


def _made(folder: Path, name: str) -> tuple[Path, Path]:
    """The picture and its log."""
    picture = folder / f"{name}.png"
    return picture, picture.with_suffix(".jsonl")


def named_folder(text: str) -> tuple[str, Path]:
    """The value of --results."""
    method, equals, where = text.partition("=")
    if not (method and equals and where):
        raise argparse.ArgumentTypeError(f"{text!r} is not METHOD=DIR")
    return method, Path(where)


def _time(row: MethodRow) -> str:
    return "not recorded" if row.computing is None else _seconds(row.computing)


def _seconds(found: Estimate) -> str:
    is_short = found.value < 1
    unit, factor = ("ms", 1000) if is_short else ("s", 1)
    values = [found.value, found.low, found.high]
    told = [f"{factor * v:.3g}" for v in values if v is not None]
    return f"{told[0]} {unit}" + (f" [{told[1]}, {told[2]}]" if len(told) == 3 else "")


def _cell(found: Estimate | None) -> str:
    return ABSENT if found is None else cell(found, FORMAT)


def _numbers(found: Estimate | None) -> Mapping[str, Number] | None:
    return None if found is None else numbers(found)
