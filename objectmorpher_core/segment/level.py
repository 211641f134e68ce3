"""How much around a click is meant: a part lies in its object, and the object in its group."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from ..base.arrays import Mask
from ..document.model import Prompt
from .selection import SMALLEST, SelectionError


def at_level(prompt: Prompt, find: Callable[[Prompt], Mask]) -> Mask:
    """What `find` makes of a prompt (H, W), kept within, or around, what it makes of the object.

    A part that is a speck and a group that is everything say nothing: then it is the object.
    """
    whole = find(replace(prompt, level="object"))
    if prompt.level == "object" or not any(c.is_foreground for c in prompt.clicks):
        return whole
    try:
        found = find(prompt)
    except SelectionError:
        return whole
    found = found & whole if prompt.level == "part" else found | whole
    return whole if found.all() or found.sum() < SMALLEST else found
