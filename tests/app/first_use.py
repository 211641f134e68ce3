"""A first use of the editor: what somebody does who only follows what the window says.

The test and the tour do the same steps; each is one click or one drag.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from hands import Hands

SAMPLE = "rocket.jpg"
SIZE = (640, 427)  # px of it
TOP, ASIDE = (321.0, 195.0), (362.0, 202.0)  # px, from where to where it is dragged


@dataclass(frozen=True)
class Step:
    """One click or drag: what the window says, what is done about it."""

    said: str  # by a label that is shown
    did: str
    act: Callable[[Hands], None]


def _bend(hands: Hands) -> None:
    hands.drag(hands.on_photo(*TOP, SIZE), hands.on_photo(*ASIDE, SIZE))


def _choose(label: str) -> Callable[[Hands], None]:
    return lambda hands: hands.choose(label)


STEPS = (
    Step("Rocket", "Click this sample", _choose("Rocket")),
    Step("Drag a point on the object", "Drag the rocket by its upper end to the right", _bend),
    Step("Export photo…", "Click this button", _choose("Export photo…")),
    Step("Export rocket-edited.jpg", "Click this button", _choose("Export rocket-edited.jpg")),
)
