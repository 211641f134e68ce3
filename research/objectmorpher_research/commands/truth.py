"""`objectmorpher evaluate truth`: edits whose true result is known."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from objectmorpher.cli.command_parser import add_ray, check_ray
from objectmorpher.cli.terminal import UsageError, progress_bar


def add_truth(parser: argparse.ArgumentParser) -> None:
    """The options of `evaluate truth`, which makes its own cases."""
    add = parser.add_argument
    add("folder", type=Path, metavar="FOLDER",
        help="for cases, results and report; a run that was broken off goes on there")  # fmt: skip
    add("--quick", action="store_true", help="12 cases instead of all")
    add("--seed", type=int, default=0, metavar="N", help="of the made photos")
    add_ray(parser)


def run_truth(options: argparse.Namespace) -> None:
    """The benchmark with ground truth."""
    from objectmorpher_core.base.files import write_all

    from ..evaluation.truth.methods import METHODS
    from ..evaluation.truth.report import report
    from ..evaluation.truth.running import run
    from ..evaluation.truth.tables import as_csv, as_json, as_text, build_table

    if options.seed < 0:
        raise UsageError("--seed is at least 0")
    check_ray(options)
    with progress_bar("Making the cases") as progress:
        if options.ray is not None:  # what is in the folder then is not computed again
            from ..evaluation.truth.spread_photos import run_photos

            run_photos(options.folder, options.seed, options.quick, options.ray, progress)
        rows = run(options.folder, METHODS, options.seed, options.quick, progress)
    table = build_table(rows, METHODS)
    for figure in ("psnr", "dinov2", "iou"):
        sys.stdout.write(as_text(table, figure) + "\n")
    page = report(options.folder, rows, table, METHODS)
    told = json.dumps(as_json(rows, table), indent=1, allow_nan=False) + "\n"
    outputs = {".html": page, ".csv": as_csv(rows), ".json": told}
    write_all({options.folder / f"report{end}": text.encode() for end, text in outputs.items()})
    sys.stdout.write(f"Pictures and all figures: {options.folder / 'report'}.html, .csv, .json\n")
