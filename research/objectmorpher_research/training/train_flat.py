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
    files, unseen = [], []
    for k, own in enumerate(sets(things)):
        first = UNSEEN + (CHECKED + k) * APART
        unseen += write_shards(
            folder / "unseen", first, max(own.samples // 3, 1), progress, own.families
        )
        first = own.seed * APART
        files += write_shards(folder / "samples", first, own.samples, progress, own.families, TAKES)
    net = ShapeNet()
    net.load_state_dict(weights_of(start, net))
    net.eval()
    learned, checked = flatness.samples_of(files, progress), flatness.samples_of(unseen, progress)
    before = flatness.found(net.flat, checked, FLAT)
    flatness.tune(net.flat, learned)
    return {
        "flat": int(learned.is_flat.sum()), "solid": int((1 - learned.is_flat).sum()),
        "before": before, "after": flatness.found(net.flat, checked, FLAT),
        "sha256": export_flatness(net, start, output),
    }  # fmt: skip
