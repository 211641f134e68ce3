"""`objectmorpher evaluate truth` and `ablation`: edits whose true result is known."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from objectmorpher.cli.command_parser import add_ray, check_ray
from objectmorpher.cli.terminal import UsageError, progress_bar
from objectmorpher_core.base.progress import Progress

ABLATIONS = ("mesh", "harmonise", "links", "deform", "iterations", "camera")


def add_truth(parser: argparse.ArgumentParser) -> None:
    """The options of `evaluate truth`."""
    _add_made(parser)


def add_ablation(parser: argparse.ArgumentParser) -> None:
    """The options of `evaluate ablation`."""
    parser.add_argument("name", metavar="NAME", choices=ABLATIONS, help=", ".join(ABLATIONS))
    _add_made(parser)


def _add_made(parser: argparse.ArgumentParser) -> None:
    """Of what makes its own cases."""
    add = parser.add_argument
    add("folder", type=Path, metavar="FOLDER",
        help="for cases, results and report; a run that was broken off goes on there")  # fmt: skip
    add("--quick", action="store_true", help="12 cases instead of all")
    add("--seed", type=int, default=0, metavar="N", help="of the made photos")
    add_ray(parser)


def run_made(options: argparse.Namespace) -> None:
    """The benchmark with ground truth, or an ablation on its cases."""
    from objectmorpher_core.base.files import write_all

    from ..evaluation.truth.methods import ABLATIONS, METHODS
    from ..evaluation.truth.report import report
    from ..evaluation.truth.running import run
    from ..evaluation.truth.tables import as_csv, as_json, as_text, build_table

    if options.seed < 0:
        raise UsageError("--seed is at least 0")
    check_ray(options)
    is_all = options.what == "truth"
    methods = METHODS if is_all else ABLATIONS[options.name]
    with progress_bar("Making the cases") as progress:
        if options.ray is not None:
            _run_spread(options, progress)  # what is in the folder then is not computed again
        rows = run(options.folder, methods, options.seed, options.quick, progress)
    table = build_table(rows, methods)
    for figure in ("psnr", "dinov2", "iou"):
        sys.stdout.write(as_text(table, figure) + "\n")
    name = "report" if is_all else options.name
    page = report(options.folder, rows, table, methods)
    told = json.dumps(as_json(rows, table), indent=1, allow_nan=False) + "\n"
    outputs = {".html": page, ".csv": as_csv(rows), ".json": told}
    write_all({options.folder / (name + end): text.encode() for end, text in outputs.items()})
    sys.stdout.write(f"Pictures and all figures: {options.folder / name}.html, .csv, .json\n")


def _run_spread(options: argparse.Namespace, progress: Progress) -> None:
    """Fills the folder on a cluster, a photo with all its cases and methods after the other."""
    from ..evaluation.truth.spread_photos import run_photos

    whose = "" if options.what == "truth" else options.name
    run_photos(options.folder, whose, options.seed, options.quick, options.ray, progress)
