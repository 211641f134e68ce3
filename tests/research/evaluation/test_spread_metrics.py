"""What a worker of a cluster measures of a pair, said in JSON, is what is measured here."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from objectmorpher_research.evaluation.error import EvaluationError
from objectmorpher_research.evaluation.metrics import Choices, OpenedMeasures, measure
from objectmorpher_research.evaluation.pairs import find_pairs
from objectmorpher_research.evaluation.spread_metrics import _job, _taken, take_there
from tests import shapes

NAMES = ("disc", "ellipse", "star")


@pytest.fixture
def folders(tmp_path: Path) -> tuple[Path, Path, Path]:
    """Shapes, the same with noise, and their masks."""
    a, b, masks = (tmp_path / name for name in ("a", "b", "masks"))
    random = np.random.default_rng(3)
    for folder in (a, b, masks):
        folder.mkdir()
    for name in NAMES:
        inside = shapes.mask(name)
        picture = shapes.picture(inside)
        noise = random.integers(-30, 30, picture.shape)
        noisy = np.clip(picture.astype(int) + noise, 0, 255).astype(np.uint8)
        (a / f"{name}.png").write_bytes(shapes.png(picture))
        (b / f"{name}.png").write_bytes(shapes.png(noisy))
        (masks / f"{name}.png").write_bytes(shapes.mask_png(inside))
    (b / f"{NAMES[0]}.png").write_bytes((a / f"{NAMES[0]}.png").read_bytes())  # infinite PSNR
    return a, b, masks


def test_measured_by_workers_in_any_order_is_measured_here(folders: tuple[Path, Path, Path]):
    pairs = find_pairs(*folders)
    choices = Choices()  # all whose networks are here
    answers = {}
    for k in (2, 0, 1):
        job = json.loads(json.dumps(_job(k, pairs[k], choices, len(pairs))))
        answers[k] = json.loads(json.dumps(take_there(job)))
    there = OpenedMeasures(choices, len(pairs)).results(
        [_taken(answers[k]) for k in range(len(pairs))]
    )
    here = measure(pairs, choices)
    assert repr(there) == repr(here)  # nan is nan, too
    assert {"psnr", "ssim"} <= {score.metric for score in here.scores}


def test_a_pair_that_cannot_be_measured_is_named(folders: tuple[Path, Path, Path]):
    pairs = find_pairs(*folders)
    job = _job(1, pairs[1], Choices(("psnr",)), len(pairs))
    pairs[1].b.write_bytes(b"no picture")
    with pytest.raises(EvaluationError, match=str(pairs[1].b)):
        take_there(json.loads(json.dumps(job)))
