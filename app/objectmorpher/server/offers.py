"""Which backends a server can run, and which of them "auto" is there."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from ..editor.settings import STAGES, by_stage

MOST_NAMES = 64  # of a stage's backends that a server may name
MOST_LETTERS = 48


@dataclass(frozen=True)
class Offer:
    """The backends that can be asked for in a stage."""

    auto: str  # the backend that "auto" is; empty: none can run
    able: tuple[str, ...]


Offers = dict[str, Offer]  # by stage


def look_at_offers() -> Offers:
    """Return the offers of this machine; may load PyTorch to ask for a GPU."""
    from objectmorpher_core import doctor

    found = by_stage(doctor.look_at_stages())
    return {stage: Offer(looked.auto, looked.able) for stage, looked in found.items()}


def told_offers(offers: Offers) -> dict[str, Any]:
    """Return the offers as JSON."""
    return {stage: asdict(offer) for stage, offer in offers.items()}


def read_offers(told: Any) -> Offers:
    """Read a server's offers; those of another form are left out."""
    if not isinstance(told, dict):
        return {}
    return {stage: _offer(told[stage]) for stage in STAGES if isinstance(told.get(stage), dict)}


def _offer(told: dict[str, Any]) -> Offer:
    auto, able = told.get("auto"), told.get("able")
    names = able[:MOST_NAMES] if isinstance(able, list) else []
    fitting = tuple(name for name in names if _is_name(name))
    return Offer(next((name for name in fitting if name == auto), ""), fitting)


def _is_name(value: Any) -> bool:
    return isinstance(value, str) and 0 < len(value) <= MOST_LETTERS and value.isprintable()
