"""`objectmorpher train`: makes the product's own networks."""

from __future__ import annotations

import argparse
import json
from importlib.util import find_spec

from objectmorpher_core.files import write_all

from .terminal import UsageError, progress_bar

NEEDED = {"torch": "torch", "onnx": "onnx", "skimage": "scikit-image", "sklearn": "scikit-learn"}


def run_train(options: argparse.Namespace) -> None:
    """Makes samples, trains, measures, and writes weights and figures."""
    absent = [name for module, name in NEEDED.items() if find_spec(module) is None]
    if absent:
        raise UsageError(f"training needs {' and '.join(absent)}: `pip install {' '.join(absent)}`")
    from objectmorpher_core.training.shapes.families import FAMILIES
    from objectmorpher_core.training.train_shape import Plan, figures, train, trained

    held_out = tuple(options.hold_out or ())
    unknown = sorted(set(held_out) - set(FAMILIES))
    if unknown:
        raise UsageError(f"there is no family {unknown[0]!r}; there are {', '.join(FAMILIES)}")
    if options.start is not None and not options.start.is_file():
        raise UsageError(f"there is no file {options.start}")
    plan = Plan(options.samples, options.passes, held_out=held_out, seed=options.seed)
    with progress_bar("training") as progress:
        checkpoint = train(options.folder, plan, options.minutes, progress, options.start)
    net = trained(checkpoint)
    found = figures(checkpoint, net)
    from objectmorpher_core.training.export_shape import export

    weights = options.output or options.folder / "shape.onnx"
    found["sha256"] = export(net, weights)
    report = options.report or weights.with_suffix(".json")
    write_all({report: json.dumps(found, indent=1).encode()})
    print(f"{weights}, figures in {report}")
