"""Writes docs/registration/pairs.md: made-up objects photographed twice, the turn found again.

python docs/registration/make_pairs.py [COUNT]
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.document.model import GAUSSIANS, LiftSettings, Matte
from objectmorpher_core.lift import LiftSubject
from objectmorpher_core.lift.registration.placement import Hints, Registrar, Registration, register
from objectmorpher_core.lift.registration.view import Target
from objectmorpher_core.pipeline import lift_mask
from objectmorpher_research.training.composition.made_pairs import FAMILIES, turn_of
from objectmorpher_research.training.composition.pose_sources import Two, carried, matched
from objectmorpher_research.training.composition.triplet import drawn_in
from objectmorpher_research.training.shapes.views import TrainingView, make_views

SEED, COUNT = 7, 12
SIDE = 320  # px
HEAD = """# Turns between two photos, measured

Made by `python docs/registration/make_pairs.py`: {count} made-up objects of `train pairs --made`
(seed {seed}, {side} px), each photographed twice, the camera going around it by 12 to 35 degrees,
with other lamps and another backdrop. It is lifted out of one photo (**B**), its other side and its
depths guessed, and registered to the other (**A**); each pair both ways. *error*: the turn between
the pose found and the true one, degrees. *outline and colours*: the search alone; *details*: with
matches of SIFT (`objectmorpher_core/lift/registration/sketch.py`): that is `--poses own`.
*score* is that of the pose as the registration with details rates it. No constant was chosen on
these pairs.

|  | median error | within 5 degrees | within 10 | called ambiguous |
| --- | ---: | ---: | ---: | ---: |
"""


@dataclass(frozen=True)
class Row:
    """One pair, one way, by one registration."""

    error: float  # degrees
    turn: float  # degrees, that was found
    score: float  # of the pose, matches included
    is_ambiguous: bool


def main(count: int) -> None:
    rows: list[tuple[str, float, int, Row, Row, float]] = []
    for k in range(count):
        b, a = make_views(SEED * 1_000_000 + k, (0.0, turn_of(k)), SIDE, FAMILIES)
        for way, views in (("", (b, a)), (", back", (a, b))):
            rows.append((f"{k}{way}", turn_of(k), *_measured(*views)))
            print(rows[-1], flush=True)
    page = HEAD.format(count=count, seed=SEED, side=SIDE)
    for name, column in (("outline and colours", 3), ("details", 4)):
        own: list[Row] = [row[column] for row in rows]  # type: ignore[misc]
        errors = np.array([row.error for row in own])
        page += (
            f"| {name} | {np.median(errors):.1f} | {np.mean(errors <= 5):.0%} |"
            f" {np.mean(errors <= 10):.0%} | {sum(row.is_ambiguous for row in own)} |\n"
        )
    page += "\n| pair | true turn | matches | outline and colours: error | turn | score |"
    page += " details: error | turn | score | ambiguous | s of the processor |\n"
    page += "| --- |" + " ---: |" * 10 + "\n"
    for name, turn, matches, old, new, busy in rows:
        cells = (f"{r.error:.1f} | {r.turn:.0f} | {r.score:.3f}" for r in (old, new))
        told = "yes" if new.is_ambiguous else ""
        page += f"| {name} | {turn:.0f} | {matches} | {' | '.join(cells)} | {told} | {busy:.1f} |\n"
    (Path(__file__).parent / "pairs.md").write_text(page, "utf-8")


def _measured(b: TrainingView, a: TrainingView) -> tuple[int, Row, Row, float]:
    """How many matches, the registration without them and with them, seconds of the second."""
    camera, nothing = Camera.from_fov(SIDE, SIDE), np.zeros((1, 1, 4), np.float32)
    matte, lifted = lift_mask(b.rgb, camera, b.mask, "auto", LiftSettings(GAUSSIANS))
    blank = Matte(0, 0, nothing[..., 3], nothing[..., :3])
    two = Two(
        LiftSubject(b.rgb, camera, b.mask, matte), LiftSubject(a.rgb, camera, a.mask, blank), lifted
    )
    target, start = Target(a.rgb, a.mask, camera), carried(two) @ lifted.world_from_object
    blind = register(lifted.body, target, Hints(start=start))
    begun = time.process_time()
    matches = matched(two, drawn_in(two, np.eye(4), camera).depth)
    found = register(lifted.body, target, Hints(start=start, matches=matches))
    busy = time.process_time() - begun
    judge = Registrar(lifted.body, target, matches=matches)
    true = a.axes @ b.axes.T

    def row(registration: Registration) -> Row:
        matrix = registration.best.world_from_object
        motion = matrix @ np.linalg.inv(lifted.world_from_object)
        score = judge.rated(matrix).score
        return Row(
            _degrees(motion, true), _degrees(motion, np.eye(3)), score, registration.is_ambiguous
        )

    return len(matches), row(blind), row(found), busy


def _degrees(motion: F64, turn: F64) -> float:
    own = motion[:3, :3] / np.cbrt(np.linalg.det(motion[:3, :3]))
    return float(np.degrees(np.arccos(np.clip((np.trace(own @ turn.T) - 1) / 2, -1, 1))))


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else COUNT)
