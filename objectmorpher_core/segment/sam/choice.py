"""Which of SAM's three masks a click means: they are a part, an object and a group, unordered.

The paper of SAM trains three masks for one click because it may mean any of the three. The best
score is the object; of what lies clearly within, or around it, the level says.
"""

from __future__ import annotations

import numpy as np

from .network import Masks

CLEARLY = 0.85  # x area: a mask smaller than so much of another is a part of it
NESTED = 0.7  # share of a part that must lie in its whole
DOUBTFUL = 0.6  # x best score: worse masks are no alternatives


def at_level(masks: Masks, level: str) -> int:
    """Index of the mask that a click means at a level: "part", "object" or "group"."""
    inside = masks.logits > 0
    areas = inside.sum((1, 2))
    whole = int(np.argmax(np.where(areas > 0, masks.scores, -np.inf)))
    if level == "object" or not areas[whole]:
        return whole
    is_fair = masks.scores >= DOUBTFUL * masks.scores[whole]
    if level == "part":
        nested = (inside & inside[whole]).sum((1, 2)) >= NESTED * areas
        fits = is_fair & nested & (areas > 0) & (areas < CLEARLY * areas[whole])
        return int(np.argmax(np.where(fits, areas, -1))) if fits.any() else whole
    nested = (inside & inside[whole]).sum((1, 2)) >= NESTED * areas[whole]
    fits = is_fair & nested & (CLEARLY * areas > areas[whole]) & ~inside.all((1, 2))
    smallest = np.where(fits, -areas, -np.inf)
    return int(np.argmax(smallest)) if fits.any() else whole
