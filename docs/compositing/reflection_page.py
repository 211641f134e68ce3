"""The section about old reflections of docs/compositing/README.md."""

from __future__ import annotations

import numpy as np
from reflections import Mirrored

REFLECTION = """## The old reflection

Photographed things stand on grounds that mirror them: {strengths} of the ground's light is the
thing's mirror image at its foot and less farther down, blurred by 0 to 3 px, about a line that
leans by 0 to 2 degrees. The mirror image is fitted to the photo, and taken off in linear light;
only what that does not explain is filled in. As with the shadow, `--shadow auto` and *Shadow as in
the photo* do it where it is sure, the brush (B) takes more or less, and no new one is drawn. Mean
differences in levels of 255 from the ground alone, in the photo and taken off; *ghost* is how much
what is seen there correlates with the mirror image (0 on the ground alone, about).

{summary}

{table}

![The photo, without the thing and its reflection, the ground alone](reflections.jpg)

What is left is mostly noise, which is stronger where little of the ground's light was left, and
edges of strong mirror images. The cases are made as light adds up, with mirror images that are
exact; real ones are so only on flat ground: a thing seen from far above is mirrored from another
side than its own, smooth or narrow ones (rocket) show little to compare, and waves tear a
reflection to pieces; then nothing is sure, and the brush is for that. What is found but does not
fit is filled in. There is no photograph with a true reflection among these cases.
"""


def reflection_section(cases: list[Mirrored], imagined: dict[str, bool]) -> str:
    strengths = sorted({case.strength for case in cases})
    summary = _summary(cases, imagined)
    text = f"{strengths[0]:.0%} to {strengths[-1]:.0%}".replace("%", " %")
    return REFLECTION.format(strengths=text, summary=summary, table=_table(cases)) + "\n"


def _summary(cases: list[Mirrored], imagined: dict[str, bool]) -> str:
    found = [case for case in cases if case.is_found]
    before, after, filled, covered = (
        np.mean([getattr(case, name) for case in found])
        for name in ("before", "after", "filled", "covered")
    )
    ghosts = np.mean([case.ghost for case in found], axis=0)
    bare = sum(case.is_imagined for case in cases)
    return (
        f"Found: {len(found)} of {len(cases)}, {covered:.0%} of their area. Where found, "
        f"{before:.1f} levels become {after:.1f} ({filled:.1f} if all of it were filled in), and "
        f"the ghost {ghosts[0]:.2f} becomes {ghosts[1]:.2f}. On the same grounds without a "
        f"reflection {bare} of {len(cases)} are imagined, and of the {len(imagined)} outlined "
        f"objects in photographs {sum(imagined.values())}. By grounds, where found, filled in in "
        f"brackets: {_by_grounds(found)}."
    ).replace("%", " %")


def _by_grounds(found: list[Mirrored]) -> str:
    texts = []
    for ground in dict.fromkeys(case.ground for case in found):
        own = [(c.before, c.after, c.filled) for c in found if c.ground == ground]
        texts.append("{} {:.1f} → {:.1f} ({:.1f})".format(ground, *np.mean(own, axis=0)))
    return ", ".join(texts)


def _table(cases: list[Mirrored]) -> str:
    """Things x kinds of reflections."""
    kinds = list(dict.fromkeys((c.strength, c.blur, c.tilt) for c in cases))
    heads = " | ".join(f"{100 * s:.0f} %, {b:g} px, {t:g}°" for s, b, t in kinds)
    lines = [f"|  | {heads} |", "| --- |" + " ---: |" * len(kinds)]
    for thing in dict.fromkeys(case.thing for case in cases):
        cells = " | ".join(_cell(case) for case in cases if case.thing == thing)
        lines.append(f"| {thing} | {cells} |")
    return "\n".join(lines)


def _cell(case: Mirrored) -> str:
    after = f"{case.after:.1f}" if case.is_found else "not found"
    return f"{case.ground}: {case.before:.1f} → {after}"
