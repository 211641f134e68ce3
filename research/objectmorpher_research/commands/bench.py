"""`objectmorpher bench`: measures, on objects it makes itself. It reports and judges nothing."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import Any


def add_bench(parser: argparse.ArgumentParser) -> None:
    """The options of `objectmorpher bench`."""
    parser.add_argument("what", choices=("deform", "render", "pipeline"),
        help="which part of the program; pipeline: the whole edit")  # fmt: skip
    parser.add_argument("--json", type=Path, metavar="FILE", help="write there, not to stdout")
    parser.add_argument("--quick", action="store_true", help="few repetitions, one size")


def run_bench(options: argparse.Namespace) -> None:
    """Print the figures of one benchmark, or write them into a file."""
    from objectmorpher.cli.commands import check_outputs, json_bytes
    from objectmorpher_core.base.files import write_all

    if options.json:
        check_outputs([], {options.json: (options.json.suffix.lower(),)})
    encoded = json_bytes(figures(options.what, options.quick))
    if options.json:
        write_all({options.json: encoded})
    else:
        sys.stdout.write(encoded.decode())


def figures(what: str, is_quick: bool) -> dict[str, Any]:
    """The figures of one benchmark, ready for JSON."""
    from ..bench.timing import cpu_name

    gl_renderer = None
    if what == "render":
        from ..bench.render import bench_render

        rows, gl_renderer = bench_render(is_quick)
    elif what == "pipeline":
        from ..bench.pipeline import bench_pipeline

        rows = bench_pipeline(is_quick)
    else:
        from ..bench.deform import bench_deform

        rows = bench_deform(is_quick)
    machine = {"cpu": cpu_name(), "cores": os.cpu_count(), "gl_renderer": gl_renderer}
    return {"machine": machine, "rows": rows}
