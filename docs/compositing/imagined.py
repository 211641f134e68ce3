"""Shadows found and imagined on the scenes of tests/shadow_scenes.py, by halves.

PYTHONPATH=. python docs/compositing/imagined.py [COUNT]: by default 360 scenes, in some minutes.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT))
from objectmorpher_core.compose.shadow.shadow_evidence import LIKELY, SURE  # noqa: E402
from objectmorpher_core.compose.shadow.shadow_fit import find_old_shadow  # noqa: E402
from objectmorpher_core.segment.matting.matte import build_matte  # noqa: E402
from tests.shadow_scenes import scene  # noqa: E402

COUNT = 360
MARGIN = 20  # px of the matte
LARGE = 0.15  # x the thing's area: a shadow that one sees at once
LEAST = 50  # px of a thing


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else COUNT
    hits: dict[tuple[int, bool, float], list[bool]] = {}
    for seed in range(count):
        made = scene(seed)
        is_large = made.has_shadow and made.shade.sum() > LARGE * made.mask.sum()
        if made.mask.sum() < LEAST or (made.has_shadow and not is_large):
            continue
        matte = build_matte(made.photo, made.mask, MARGIN)
        for margin in (SURE, LIKELY):
            old = find_old_shadow(made.photo, matte, margin=margin)
            hits.setdefault((seed % 2, made.has_shadow, margin), []).append(old is not None)
    for (half, has_shadow, margin), found in sorted(hits.items()):
        part = "held out" if half else "chosen on"
        what = "found" if has_shadow else "imagined"
        share = float(np.mean(found))
        print(f"{part}, margin {margin:g}: {what} {sum(found)} of {len(found)}, {share:.0%}")


if __name__ == "__main__":
    main()
