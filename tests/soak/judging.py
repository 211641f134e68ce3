"""Whether a long session stayed as it was; and its picture."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from typing import Any

GROWN = 1.05  # x the memory
SLOWER = 1.1  # x the time of the same edits at the beginning
ENDS = 3  # of the repeated edits at either end, whose least time counts: others load the machine
WIDTH, HEIGHT, LEFT, TOP, GAP = 720, 150, 60, 24, 40  # px of a panel, and around it
PANELS = (
    ("MiB", (("memory", "editor", "#0072b2"), ("worker", "worker", "#d55e00"))),
    ("ms of a drag", (("drag", "", "#0072b2"),)),
    ("count", (("files", "open files", "#0072b2"), ("threads", "threads", "#009e73"),
               ("textures", "GL textures", "#d55e00"), ("buffers", "GL buffers", "#cc79a7"))),
)  # fmt: skip


def problems(samples: Sequence[Any]) -> list[str]:
    """What grew; `samples` are `session.Sample`s at even distances.

    The first quarter fills the history and every cache, and is not judged.
    """
    quarter = len(samples) // 4
    early, late = samples[quarter : 2 * quarter], samples[-quarter:]
    found = []
    before, after = (max(s.worker for s in part) for part in (early, late))
    if after > GROWN * before:
        found.append(f"worker: {before:.0f} MiB, and {after:.0f} at the end")
    for name in ("files", "threads", "children"):  # they come and go
        before, after = max(getattr(s, name) for s in early), min(getattr(s, name) for s in late)
        if after > before:
            found.append(f"{name}: {before}, and {after} at the end")
    return found


def slower(hundreds: Sequence[Any], most: float = SLOWER) -> list[str]:
    """Where the same edits, `session.Hundred`s, take more than `most` x as long at the end.

    And where they leave more in memory or on the GPU. The samples' own are of objects and handles
    that become more and fewer. The first quarter fills memory, and is not judged.
    """
    ends = min(ENDS, len(hundreds) // 2)
    found = []
    for name in ("main", "drag"):
        first, last = (
            min(getattr(h, name) for h in p) for p in (hundreds[:ends], hundreds[-ends:])
        )
        if last > most * first:
            found.append(f"{name}: {first:.3g}, and {last:.3g} at the end")
    quarter = max(len(hundreds) // 4, 1)
    before, after = (
        statistics.median(h.memory for h in part)
        for part in (hundreds[quarter : 2 * quarter + 1], hundreds[-quarter:])
    )
    if after > GROWN * before:
        found.append(f"memory: {before:.0f} MiB, and {after:.0f} at the end")
    for name in ("textures", "buffers"):
        before, after = (getattr(hundreds[k], name) for k in (0, -1))
        if after > before:
            found.append(f"{name}: {before:.4g}, and {after:.4g} at the end")
    return found


def chart(samples: Sequence[Any]) -> str:
    """As SVG: memory, time of a drag, and what is open, over the edits."""
    width, height = LEFT + WIDTH + 120, len(PANELS) * (HEIGHT + GAP) + TOP
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
        'font-family="sans-serif" font-size="12">',
        '<rect width="100%" height="100%" fill="white"/>',
    ]
    for k, (unit, lines) in enumerate(PANELS):
        top = TOP + k * (HEIGHT + GAP)
        most = _round(max(getattr(s, name) for s in samples for name, *_ in lines))
        parts.append(f'<text x="{LEFT}" y="{top - 6}">{unit}</text>')
        for share in (0.0, 0.5, 1.0):
            y = top + HEIGHT * (1 - share)
            parts.append(f'<path d="M{LEFT} {y:.1f}h{WIDTH}" stroke="#ddd"/>')
            parts.append(f'<text x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">'
                         f"{most * share:,g}</text>")  # fmt: skip
        ends = []
        for name, label, colour in lines:
            points = [
                (LEFT + WIDTH * s.edits / samples[-1].edits,
                 top + HEIGHT * (1 - getattr(s, name) / most))
                for s in samples
            ]  # fmt: skip
            path = "L".join(f"{x:.1f} {y:.1f}" for x, y in points)
            parts.append(f'<path d="M{path}" fill="none" stroke="{colour}" stroke-width="1.5"/>')
            ends.append((points[-1][1], label, colour))
        place = -1e9
        for y, label, colour in sorted(ends):
            place = max(y + 4, place + 14)
            parts.append(
                f'<text x="{LEFT + WIDTH + 8}" y="{place:.1f}" fill="{colour}">{label}</text>'
            )
    last = samples[-1]
    parts.append(f'<text x="{LEFT + WIDTH}" y="{height - 8}" text-anchor="end">'
                 f"{last.edits:,} edits, {last.minutes:.0f} minutes</text></svg>\n")  # fmt: skip
    return "\n".join(parts)


def _round(most: float) -> float:
    """The next of some round numbers, as the end of an axis."""
    decade = 10.0 ** math.floor(math.log10(max(most, 1)))
    return next(n * decade for n in (1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10) if n * decade >= most)
