"""`objectmorpher evaluate`: how near pictures are to others, one by one and as sets."""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from objectmorpher.cli.command_parser import Subcommand, add_ray, add_subcommands, check_ray
from objectmorpher.cli.terminal import UsageError, progress_bar

from .figures import cell, number, numbers
from .paper import add_paper, run_paper
from .study import add_results, add_study, run_results, run_study
from .truth import add_truth, run_truth

if TYPE_CHECKING:
    from ..evaluation.metrics import Results

NAME, CELL = 26, 26  # characters of the table's columns
FORMAT = ".4g"
NAMED = 8  # pairs, at most, that one line names


def add_evaluate(parser: argparse.ArgumentParser) -> None:
    """The options of `objectmorpher evaluate`."""
    parser.description = "Measures results; what each measure is: docs/evaluation.md."
    measures = "distances of pictures A from pictures B"
    add_subcommands(parser, "what", (
        Subcommand("metrics", measures, _add_metrics, _run_metrics),
        Subcommand(
            "truth", "edits whose true result is known, and other methods", add_truth, run_truth
        ),
        Subcommand("paper", "the paper's table of several methods' results", add_paper, run_paper),
        Subcommand("study", "a page on which people judge results", add_study, run_study),
        Subcommand(
            "study-results", "what the people of a study have said", add_results, run_results
        ),
    ))  # fmt: skip


def _add_metrics(metrics: argparse.ArgumentParser) -> None:
    add = metrics.add_argument
    add("a", type=Path, metavar="A", help="a picture, or a folder of them")
    add("b", type=Path, metavar="B", help="the same: files of the same names are compared")
    add("--mask", type=Path, metavar="M",
        help="also inside and outside of it; a file, or a folder of one for each")  # fmt: skip
    add("--only", metavar="X,Y", help="these measures; default all that can be taken here")
    add("--weights", type=Path, metavar="DIR",
        help="official weights of AlexNet, VGG16 and Inception, and LPIPS's heads")  # fmt: skip
    add("--subset-size", type=int, default=1000, metavar="N", help="of KID, default 1000")
    add("--subsets", type=int, default=100, metavar="N", help="of KID, default 100")
    add("--seed", type=int, default=0, metavar="N", help="of KID's subsets and of the intervals")
    add("--json", type=Path, metavar="FILE", help="every figure, also of every picture")
    add_ray(metrics)


def _run_metrics(options: argparse.Namespace) -> None:
    """Measures, prints a table, writes the figures."""
    from objectmorpher.cli.commands import check_outputs
    from objectmorpher_core.base.files import write_all

    from ..evaluation.measures.mmd import Subsets
    from ..evaluation.metrics import Choices, measure
    from ..evaluation.pairs import find_pairs

    if options.subset_size < 2 or options.subsets < 1 or options.seed < 0:
        raise UsageError("--subset-size is at least 2, --subsets at least 1, --seed at least 0")
    check_ray(options)
    if options.weights is not None and not options.weights.is_dir():
        raise UsageError(f"there is no folder {options.weights}")
    if options.json is not None:
        check_outputs([options.a, options.b], {options.json: (options.json.suffix.lower(),)})
    only = tuple(w.strip() for w in options.only.split(",") if w.strip()) if options.only else ()
    subsets = Subsets(options.subsets, options.subset_size, options.seed)
    pairs = find_pairs(options.a, options.b, options.mask)
    choices = Choices(only, options.weights, subsets)
    with progress_bar("Measuring") as progress:
        if options.ray is not None:
            from ..evaluation.spread_metrics import measure_spread

            results = measure_spread(pairs, choices, options.ray, progress)
        else:
            results = measure(pairs, choices, progress)
    sys.stdout.write(table(results))
    if options.json is not None:
        told = json.dumps(as_json(results), indent=1, allow_nan=False)
        write_all({options.json: (told + "\n").encode()})


def table(results: Results) -> str:
    """Return a table for the terminal: a line for each measure, a column for each region."""
    regions = tuple(dict.fromkeys(score.region for score in results.scores))
    cells = {(score.metric, score.region): cell(score.estimate, FORMAT) for score in results.scores}
    count = f"{results.pairs} pair{'s' if results.pairs > 1 else ''}"
    lines = ["".join([f"{count:<{NAME}}", *(f"{region:<{CELL}}" for region in regions)])]
    for metric in dict.fromkeys(score.metric for score in results.scores):
        found = (cells.get((metric, region), "") for region in regions)
        lines.append("".join([f"{metric:<{NAME}}", *(f"{score:<{CELL}}" for score in found)]))
    for reason in dict.fromkeys(left.reason for left in results.lacking):
        names = ", ".join(left.metric for left in results.lacking if left.reason == reason)
        lines.append(f"not taken: {names}: {reason}")
    for region in regions[1:]:  # the first is the whole picture
        if empty := _without(results, region):
            more = f" and {len(empty) - NAMED} more" if len(empty) > NAMED else ""
            names = ", ".join(empty[:NAMED]) + more
            lines.append(f"nothing to measure {region} the mask, which is white inside: {names}")
    return "".join(line.rstrip() + "\n" for line in lines)


def _without(results: Results, region: str) -> list[str]:
    """Names of the pairs of which no measure has a value there."""
    found = [score.each for score in results.scores if score.region == region]
    return [name for name in found[0] if all(math.isnan(each[name]) for each in found)]


def as_json(results: Results) -> dict[str, Any]:
    """Return plain numbers for JSON; infinite ones are "inf", missing ones null."""
    return {
        "pairs": results.pairs,
        "scores": [
            {
                "metric": score.metric,
                "region": score.region,
                **numbers(score.estimate),
                "each": {name: number(value) for name, value in score.each.items()},
            }
            for score in results.scores
        ],
        "lacking": [{"metric": left.metric, "reason": left.reason} for left in results.lacking],
        "weights": dict(results.weights),
    }
