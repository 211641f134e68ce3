"""Old traces: the shadow and the reflection that an object leaves on the ground in the photo."""

from __future__ import annotations

from dataclasses import dataclass

from ...base.arrays import Mask, Pixels
from ...document.model import Matte
from .old_reflection import OldReflection
from .old_shadow import OldShadow
from .reflection_fit import find_old_reflection
from .shadow_evidence import SURE
from .shadow_fit import find_old_shadow


@dataclass(frozen=True, eq=False)
class OldTraces:
    """The traces that are sure."""

    shadow: OldShadow | None
    reflection: OldReflection | None

    @property
    def found(self) -> tuple[OldShadow | OldReflection, ...]:
        return tuple(trace for trace in (self.shadow, self.reflection) if trace is not None)


def find_old_traces(
    pixels: Pixels,
    matte: Matte,
    others: Mask,
    seen_from: float | None = None,
    margin: float = SURE,
) -> OldTraces:
    """Find shadow and reflection; what is a reflection is no shadow."""
    height, width = others.shape
    reflection = find_old_reflection(pixels, matte, others)
    if reflection is not None:
        others = others | reflection.covers((0, 0, width, height))
    return OldTraces(find_old_shadow(pixels, matte, others, seen_from, margin), reflection)
