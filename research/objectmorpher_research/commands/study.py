"""`objectmorpher evaluate study` and `study-results`: people judge results, and what they said."""

from __future__ import annotations

import argparse
import json
import math
import signal
import sys
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any

from objectmorpher.cli.terminal import UsageError

from .figures import Number, aligned, cell, numbers
from .paper import named_folder

if TYPE_CHECKING:
    from ..evaluation.bootstrap import Estimate
    from ..study.figures import Figures

PORT = 8718
FOLDER = "study"  # beside the subjects
MOST_CHECKS = 20
FORMAT = ".2f"  # of means


def add_study(parser: argparse.ArgumentParser) -> None:
    """The options of `objectmorpher evaluate study`."""
    parser.description = (
        "Serves a page to browsers on which people judge results without knowing whose they are;"
        " see docs/evaluation.md. Started again, it goes on."
    )
    add = parser.add_argument
    add("folder", type=Path, metavar="FOLDER", help="of subjects, as for paper")
    add("--results", action="append", type=named_folder, default=[], metavar="METHOD=DIR",
        help="where a method's results lie, if not beside the subjects")  # fmt: skip
    add("--only", metavar="A,B", help="these methods; default all that have results")
    add("--out", type=Path, metavar="DIR", help=f"of the answers; default FOLDER/{FOLDER}")
    add("--checks", type=int, default=2, metavar="N", help="of attention, default 2")
    add("--consent", type=Path, metavar="FILE.txt", help="to be agreed to, in place of our text")
    add("--seed", type=int, default=0, metavar="N", help="of the orders")
    add("--host", default="127.0.0.1", metavar="H", help="default: this computer only")
    add("--port", type=int, default=PORT, metavar="P", help=f"default {PORT}; 0: any free one")


def add_results(parser: argparse.ArgumentParser) -> None:
    """The options of `objectmorpher evaluate study-results`."""
    add = parser.add_argument
    add("folder", type=Path, metavar="DIR", help=f"of the answers, or FOLDER with {FOLDER} in it")
    add("--csv", type=Path, metavar="FILE", help="every answer, of the excluded too")
    add("--json", type=Path, metavar="FILE", help="the figures")
    add("--chart", type=Path, metavar="FILE.svg", help="means and intervals as a picture")
    add("--seed", type=int, default=0, metavar="N", help="of the intervals")


def run_study(options: argparse.Namespace) -> None:
    """Serves until it is interrupted or ended."""
    from objectmorpher.server.address import LOOPBACK

    from ..study.pages import CONSENT, Pages, study_of
    from ..study.server import StudyServer
    from ..study.store import StudyStore

    if not 0 <= options.port < 65536 or options.seed < 0 or not 0 <= options.checks <= MOST_CHECKS:
        raise UsageError(f"--port, --seed and --checks are not below 0, checks to {MOST_CHECKS}")
    subjects = _subjects(options)
    consent = CONSENT if options.consent is None else _text(options.consent)
    store = StudyStore(
        options.out or options.folder / FOLDER, study_of(subjects, options.seed, options.checks)
    )
    server = StudyServer((options.host, options.port), Pages(store, subjects, consent))
    stop = threading.Event()
    signal.signal(signal.SIGTERM, lambda number, frame: stop.set())
    server.start()
    try:
        sys.stdout.write(f"the study is on {server.url}\nanswers: {store.folder}\n")
        if server.address[0] not in LOOPBACK:
            sys.stdout.write("plain HTTP, and whoever reaches this computer can take part\n")
        sys.stdout.flush()
        stop.wait()
    finally:
        server.close()


def run_results(options: argparse.Namespace) -> None:
    """Prints the figures, and writes what is asked for."""
    from objectmorpher_core.base.files import write_all

    from ..study.chart import draw_chart
    from ..study.figures import figures
    from ..study.store import (
        STUDY,
        encode_table,
        read_participants,
        read_study,
    )

    if options.seed < 0:
        raise UsageError("--seed is at least 0")
    folder = options.folder
    if not (folder / STUDY).is_file() and (folder / FOLDER / STUDY).is_file():
        folder = folder / FOLDER
    read_study(folder)  # says so where there is none
    people = read_participants(folder)
    found = figures(people, options.seed)
    sys.stdout.write(as_text(found))
    outputs: dict[Path, bytes] = {}
    if options.csv is not None:
        outputs[options.csv] = encode_table(people)
    if options.json is not None:
        outputs[options.json] = (json.dumps(as_json(found), indent=1) + "\n").encode()
    if options.chart is not None:
        if options.chart.suffix.lower() != ".svg":
            raise UsageError(f"{options.chart}: the ending must be .svg")
        outputs[options.chart] = draw_chart(found).encode()
    if len(outputs) < sum(path is not None for path in (options.csv, options.json, options.chart)):
        raise UsageError("two outputs have the same name")
    write_all(outputs)


def as_text(found: Figures) -> str:
    """Return text for the terminal."""
    from ..study.design import CRITERIA

    lines = [f"{found.participants} took part, {found.counted} count"]
    for rule in dict.fromkeys(found.excluded.values()):
        numbers = [str(number) for number, own in found.excluded.items() if own == rule]
        lines.append(f"excluded: {', '.join(numbers)}: {rule}")
    if found.counted:
        rows = [["method", "n", *CRITERIA]]
        for method in found.methods:
            cells = [cell(method.means[criterion], FORMAT) for criterion in CRITERIA]
            rows.append([method.method, str(method.ratings), *cells])
        rows.append(["Krippendorff's alpha", "", *(cell(found.alpha[c], FORMAT) for c in CRITERIA)])
        lines += aligned(rows)
    return "".join(line.rstrip() + "\n" for line in lines)


def as_json(found: Figures) -> dict[str, Any]:
    """Return plain numbers for JSON; missing ones are null."""
    return {
        "participants": found.participants,
        "counted": found.counted,
        "excluded": {str(number): rule for number, rule in found.excluded.items()},
        "methods": [
            {
                "method": method.method,
                "ratings": method.ratings,
                "means": {c: _numbers(e) for c, e in method.means.items()},
            }
            for method in found.methods
        ],
        "alpha": {c: _numbers(e) for c, e in found.alpha.items()},
    }


def _subjects(options: argparse.Namespace) -> tuple[Any, ...]:
    """What is to be judged: subjects that have results and guidance."""
    from dataclasses import replace

    from ..evaluation.subjects.folders import read_subjects
    from ..evaluation.subjects.subject import methods_of

    methods = dict(options.results)
    if len(methods) < len(options.results):
        raise UsageError("--results: two methods have the same name")
    subjects = read_subjects(options.folder, methods)
    if options.only:
        only = {name.strip() for name in options.only.split(",")}
        if unknown := sorted(only - set(methods_of(subjects))):
            raise UsageError(f"--only: there is no result of {unknown[0]!r}")
        subjects = tuple(
            replace(s, results={m: r for m, r in s.results.items() if m in only}) for s in subjects
        )
    subjects = tuple(subject for subject in subjects if subject.results)
    if not subjects:
        raise UsageError(f"{options.folder} has no result of any method")
    for subject in subjects:
        if not subject.guidance.is_shown:
            told = "nothing tells what is asked: guidance.json or guidance.png"
            raise UsageError(f"{subject.name}: {told}")
    return subjects


def _text(path: Path) -> str:
    try:
        text = path.read_text(encoding="utf-8").strip()
    except UnicodeDecodeError as error:
        raise UsageError(f"{path} is no text") from error
    if not text or len(text) > 20_000:
        raise UsageError(f"{path} is empty or longer than a consent can be")
    return text


def _numbers(found: Estimate) -> dict[str, Number] | None:
    return None if math.isnan(found.value) else numbers(found)
