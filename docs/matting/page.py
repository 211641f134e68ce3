"""The text of the page. Its numbers come from the figures that it is given."""

from __future__ import annotations

import os

from cost import Cost
from measures import Score
from truth import ROUGH, Case

HEAD = f"""# Cut-outs, compared

Made by `python docs/matting/make_matting.py`; every number and picture on this page comes from
that one command.

One photo's object is put over another photo, with an alpha and colours that are known at every
pixel (`truth.py`). A method gets the composite and a rough mask, where alpha is above one half but
up to about {ROUGH:g} px off, and of hair only what a selection has of it; of glass, the coverage
that an artist would brush. No other hints.

- **SAD**: sum of alpha's absolute errors, in px. **MSE** (x 1000) and **gradient** (x 1000):
  mean squared errors of alpha and of its slopes, over the pixels about the edge.
- **Colour**: RMS error of the object's own colour where it has a share above 0.1, in 8-bit levels.
- **Halo**: RMS error of the cut-out put on white, on black and on a photo, in 8-bit levels: what
  an artist sees.

**First version** is closed-form matting in a band of fixed width, with colours gathered nearby
(`first_version.py`). **pymatting** is its closed-form matting and its multi-level colours, in a
narrow band (1.5 times the first version's) and in one as wide as ours; no other was tried.

Our constants were chosen on these very composites, over some sixty settings, with the exception of
the four *outlined* ones, which were looked at afterwards. How a veil's colours are found was chosen
on the two glasses. The means therefore flatter ours; the outlined objects do not.
"""

KINDS = {
    "hair": "Hair and fur", "blur": "Out of focus", "crisp": "Sharp edges",
    "glass": "Seen through: alpha is given, the colours are asked for",
}  # fmt: skip

NOTES = """## What falls short

- A wide blur over a busy background comes out narrower than it is.
- Where an object's colours are those behind it, a rough mask's errors stay: no colour tells.
- Reflections on glass are taken for what is behind it, unless they are too bright for that.
- Where edges are sharp, pymatting's narrow band (on three of the four outlined objects) or the
  first version (on the other) has a smaller halo: nothing can be far off where nothing may be
  soft. pymatting's wide band is better for hair before something plain, and far worse
  elsewhere. Ours must do for both, from the mask alone.
"""


def write_page(
    cases: list[Case], names: list[str], scores: dict[tuple[str, str], Score],
    pictures: dict[str, str], costs: list[Cost],
) -> str:  # fmt: skip
    parts = [HEAD, "## In the mean\n"]
    hard = [case.name for case in cases if case.kind != "glass"]
    parts.append(_table([(n, _mean([scores[c, n] for c in hard])) for n in names]))
    gain = (
        _mean([scores[c, names[0]] for c in hard]).halo
        / _mean([scores[c, names[-1]] for c in hard]).halo
    )
    parts.append(f"\nWithout glass. The halo is {gain:.1f} times smaller than the hard mask's.\n")
    for kind, title in KINDS.items():
        parts.append(f"## {title}\n")
        for case in (c for c in cases if c.kind == kind):
            parts.append(f"**{case.name}**\n")
            if case.name in pictures:
                parts.append(f"![]({pictures[case.name]})\n")
            parts.append(_table([(n, scores[case.name, n]) for n in names]) + "\n")
    return "\n".join([*parts, NOTES, _costs(costs)])


def _mean(scores: list[Score]) -> Score:
    total = scores[0]
    for more in scores[1:]:
        total = total + more
    return total / len(scores)


def _table(rows: list[tuple[str, Score]]) -> str:
    lines = ["|  | SAD | MSE | Gradient | Colour | Halo |", "|---|---:|---:|---:|---:|---:|"]
    for name, s in rows:
        cells = [f"{s.sad:,.0f}", f"{s.mse:.1f}", f"{s.gradient:.2f}", f"{s.colour:.1f}",
                 f"{s.halo:.1f}"]  # fmt: skip
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _costs(costs: list[Cost]) -> str:
    load, cores = os.getloadavg()[0], os.cpu_count()
    lines = [f"""## What it costs

A furry object on a quarter of the photo; seconds of the process and by the clock (medians), and
the most memory that numpy held, the result included. pymatting was not asked for 24 MP. The
machine's load was {load:.0f} on {cores} cores: where that is more than one, the clock says little.

|  |  | s of the process | s by the clock | MB |
|---|---|---:|---:|---:|"""]  # fmt: skip
    lines += [f"| {c.name} | {c.size} | {c.seconds:.2f} | {c.waiting:.2f} | {c.peak:,.0f} |"
              for c in costs]  # fmt: skip
    return "\n".join(lines) + "\n"
