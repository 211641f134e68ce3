"""The text of the page. Its numbers come from the figures that it is given."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from gaps import GapRow
from methods import METHODS, Result

HEAD = """# Deformation, compared

Made by `make ablations`; every number and picture on this page comes from that one command.

ObjectMorpher deforms an object as rigidly as possible through 512 control points. Its solver
departs from the paper in several places. Here each departure is taken back alone, and then all
of them together. The objects are closed surfaces made by the script, so that volume and area are
well defined. Gaussians lie at the vertices. All pictures come from this repository's rasteriser;
the light is that of the deformed surface, so that dents show. Blue dots are handles that stay,
red dots are where handles were dragged to.

## What is compared

- **Ours** is the default.
- **Laplacian instead of ARAP**: the same energy with all rotations left at the identity.
- **The paper's links**: within 0.3 diameters along a graph of the control points that knows
  nothing of the surface, and weights with the mean length of a link as falloff. No struts: these
  are our links through the body, from one side of a limb to the other.
- **Euclidean links**: our weights, but links by straight distance, and no struts.
- **Pins that are hinges**: they hold a point, as the paper's do, not the turn of what is around it.
- **3 iterations from rest**: the paper's number, from a cold start, instead of our sub-steps and
  iteration until nothing moves.
- **Eq. 5 skinning**: our pose, but the Gaussians follow by the paper's Eq. 5.
- **The paper as printed**: the paper's links, iterations, skinning, and handles that hold a single
  control point.
- **The paper, dragged in 60 steps**: the same, with three iterations at each step of a drag, each
  from where the last one ended. That is how an editor would use it, and fairer than a cold start.

## What is measured

- **Energy**, in thousandths: Eq. 2 of the posed control points, always on our default links and
  with the rotations that fit them best, over the links' squares at rest; the mean over the control
  points. It compares poses, whatever solver they come from. It is low, too, where the object
  did not follow its handles.
- **Stretch** and **squeeze**: the factor by which a triangle of the surface is longer or
  shorter than at rest in its worst direction; 0.1 % of the triangles exceed it.
- **Volume** and **area**: change of the closed surface.
- **Miss**: the largest distance of a handle's surface point from its target, in % of the object's
  diameter.
- **Inside out**: the area of triangles that face against the surface around them.
- **Solve**: median of five solves from rest, with the links and the set of handles known, in time
  of the solving thread. It is of the machine that made this page, and the only number here that
  changes from run to run.
"""


@dataclass(frozen=True, eq=False)
class Task:
    """A deformation that all methods are given."""

    title: str
    text: str
    file: str  # picture of three of them
    results: Mapping[str, Result]
    turns: Mapping[str, float] | None = None  # degrees that arrive on the surface


@dataclass(frozen=True, eq=False)
class Facts:
    """What the text names besides the tables."""

    anchored: int
    before: int  # Gaussians before the split
    after: int


def write_page(tasks: list[Task], gaps: Mapping[str, list[GapRow]], facts: Facts) -> str:
    return "\n".join([HEAD, *map(_task, tasks), _strain(), _gaps(gaps), _rest(facts)])


def _task(task: Task) -> str:
    columns = ["Energy", "Stretch", "Squeeze", "Volume %", "Area %", "Miss %", "Inside out %"]
    columns += ["Turn °"] if task.turns else []
    rows = [
        f"## {task.title}\n\n{task.text}\n\n![]({task.file})\n",
        _row(["", *columns, "Solve ms"]),
    ]
    rows.append("|---|" + "---:|" * (len(columns) + 1))
    for method in METHODS:
        r = task.results[method.name]
        cells = [f"{r.energy:.1f}", f"{r.stretch:.2f}", f"{r.squeeze:.2f}", f"{r.volume:+.1f}",
                 f"{r.area:+.1f}", f"{r.miss:.2f}", f"{r.flipped:.2f}"]  # fmt: skip
        if task.turns:
            cells.append(f"{task.turns[method.name]:.0f}")
        rows.append(_row([method.name, *cells, f"{r.milliseconds:.1f}"]))
    return "\n".join(rows) + "\n\n" + _verdict(task) + "\n"


def _verdict(task: Task) -> str:
    """Where ours is not the best: computed, so that it cannot go stale."""
    ours = task.results["Ours"]
    others = {k: r for k, r in task.results.items() if k != "Ours"}
    by = {
        "energy": lambda r: r.energy,
        "stretch": lambda r: r.stretch,
        "squeeze": lambda r: -r.squeeze,
        "volume": lambda r: abs(r.volume),
        "area": lambda r: abs(r.area),
        "miss": lambda r: r.miss,
    }
    lines = []
    for name, cost in by.items():
        better = [k for k, r in others.items() if cost(r) < cost(ours) - 0.005]
        if better:
            lines.append(f"{name} ({'; '.join(better)})")
    return "Better than ours in " + ", ".join(lines) + "." if lines else "None is better than ours."


def _strain() -> str:
    return """## Where the strain is

![](strain.jpg)

The same bend, coloured by the energy at each control point. A good pose spreads the strain over
the joint. Where a handle pulls a single point out of its surroundings, the strain is a dark spot
around it.
"""


def _gaps(gaps: Mapping[str, list[GapRow]]) -> str:
    rows = ["""## Links across gaps

Parts that come near without being joined there must not be linked. A link is false when its ends
lie on two different parts and the way between them along the surface is longer than the paper's
own limit, 0.3 diameters. One part is dragged by 0.2 diameters, with pins at the root: *carried
along* is the farthest that the surface of another part moves, in % of the drag. For the
cup it leaves out what is within 0.1 diameters of where the handle is joined on.

*Bound across* counts vertices that follow a control point of another part most, although they are
far from the joint. The nearest control point is found by straight distance: where two parts touch
it may be the other part's. Such vertices are torn off when the parts come apart.

In each row of pictures: some of the paper's false links at rest, in red; one part dragged under
the paper's links; the same under ours. Both are solved and skinned in our way: only the links
differ.
"""]  # fmt: skip
    rows += [_row(["", "Rule", "Links", "False", "Bound across", "Carried along %"]),
             "|---|---|---:|---:|---:|---:|"]  # fmt: skip
    for name, of_gap in gaps.items():
        for k, r in enumerate(of_gap):
            cells = [
                name if k == 0 else "",
                r.name,
                f"{r.links:,}",
                f"{r.false_links:,}",
                f"{r.bound:,}",
            ]
            rows.append(_row([*cells, f"{r.carried:.0f}"]))
    kept = [f"{name} ({of_gap[-1].false_links:,})" for name, of_gap in gaps.items()
            if of_gap[-1].false_links]  # fmt: skip
    rows.append(f"\nOurs keeps false links in: {', '.join(kept)}." if kept
                else "\nOurs keeps no false link.")  # fmt: skip
    rows += [f"\n**{name}**\n\n![](gap-{k}.jpg)" for k, name in enumerate(gaps, 1)]
    return "\n".join(rows) + "\n"


def _rest(facts: Facts) -> str:
    return f"""## One handle alone

![](one-handle.jpg)

One handle alone is only a translation for ARAP. So the quarter of the object that is farthest
along the surface holds still by itself: {facts.anchored} control points, the blue dots. The
grey dot is where the handle was.

## Splitting

![](split.jpg)

A limb pulled to 2.5 times its length, close up. The ellipses are the Gaussians at half a standard
deviation. Without splitting each is drawn out with the limb. Split at rest before it is
skinned, a stretched one becomes several short ones: {facts.before:,} Gaussians are {facts.after:,}.
They keep the colour of the one that they come from, so the colours look the same.
"""


def _row(cells: list[str]) -> str:
    return "| " + " | ".join(cells) + " |"
