"""The stages of the main job for which there are several backends."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from objectmorpher_core.doctor import StageReport

DOCTORS = {  # stage, as in the settings -> what the doctor calls it
    "segment": "select", "lift": "lift", "inpaint": "background", "refine": "refine",
}  # fmt: skip
STAGES = tuple(DOCTORS)


def by_stage(looked_at: Iterable[StageReport]) -> dict[str, StageReport]:
    """Return the doctor's findings by the names of STAGES."""
    found = {stage.name: stage for stage in looked_at}
    return {stage: found[name] for stage, name in DOCTORS.items()}
