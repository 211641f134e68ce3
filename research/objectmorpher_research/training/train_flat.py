"""`objectmorpher train flat`: what the shape network says of flatness, trained further by itself.

Prints, round things with the same pictures on them, and others, each photographed three times. The
surfaces of the network stay as they are. Called again it goes on with the samples that are there.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from objectmorpher_core.base.progress import Progress, silent
from objectmorpher_core.lift.shapes.recognition import FLAT

from . import flatness
from .export_shape import export_flatness, weights_of
from .shape_data import write_shards
from .shape_net import ShapeNet
from .shapes.families import FAMILIES
from .train_shape import APART, UNSEEN, SampleSet

TAKES = 3
BETWEEN = (flatness.FLAT, "sheets")  # families whose members are not all solid
SOLIDS = tuple(name for name in FAMILIES if name not in BETWEEN)
KINDS = ((flatness.FLAT,), (flatness.ROUND,), SOLIDS)  # of the things
NAMES = ("prints", "round things with such pictures", "other solids")
SHARES = (13, 8, 13)  # of each kind
FIRST = 45  # seed of the first kind's
CHECKED = 12  # seed of the first kind's, counted from UNSEEN, on which nothing was trained


def sets(things: int) -> list[SampleSet]:
    """About so many things in all, by kind."""
    return [
        SampleSet(FIRST + k, round(things * SHARES[k] / sum(SHARES)), names)
        for k, names in enumerate(KINDS)
    ]


def train_flat(
    folder: Path, things: int, start: Path, output: Path, progress: Progress = silent
) -> dict[str, Any]:
    """Train on so many `things` from the weights `start`, and write `output`; what came of it."""
    files: list[Path] = []
    unseen: dict[str, list[Path]] = {}
    for k, (name, own) in enumerate(zip(NAMES, sets(things), strict=True)):
        count, first = max(own.samples // 3, 1), UNSEEN + (CHECKED + k) * APART
        unseen[name] = write_shards(folder / "unseen", first, count, progress, own.families)
        count, first = own.samples, own.seed * APART
        files += write_shards(folder / "samples", first, count, progress, own.families, TAKES)
    net = ShapeNet()
    net.load_state_dict(weights_of(start, net))
    net.eval()
    learned = flatness.samples_of(files, progress)
    checked = {name: flatness.samples_of(own, progress) for name, own in unseen.items()}
    before = {name: _taken(net, own) for name, own in checked.items()}
    flatness.tune(net.flat, learned)
    return {
        "flat": int(learned.is_flat.sum()), "solid": int((1 - learned.is_flat).sum()),
        "found": {
            name: {
                "things": len(own.is_flat), "before": before[name], "after": _taken(net, own),
            }
            for name, own in checked.items()
        },
        "sha256": export_flatness(net, start, output),
    }  # fmt: skip


def _taken(net: ShapeNet, samples: flatness.FlatSamples) -> int:
    """How many are taken for flat."""
    found = flatness.found(net.flat, samples, FLAT)
    return found["found"] + found["mistaken"]
