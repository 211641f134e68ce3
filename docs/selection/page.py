"""The page of docs/selection.md."""

from __future__ import annotations

import numpy as np
from correcting import Made
from correcting_page import corrections
from measure import BOX_CLICKS, Clicked, Large, Measure, Row, boundary, encoding_seconds, iou

CHANGED = 0.005  # IoU
KINDS = (("whole", "Whole objects"), ("part", "Parts"))


def write_page(
    rows: list[Row], later: list[Row], large: Large, made: list[Made], machine: str
) -> str:
    """Markdown."""
    intro = _intro(rows, later, large, machine)
    return "\n".join([intro, _means(rows), _tables(rows), _later(later), corrections(made),
                      _large(large)])  # fmt: skip


def _intro(rows: list[Row], later: list[Row], large: Large, machine: str) -> str:
    seconds = [value for row in rows for value in row.ours.seconds]
    return f"""# Selecting, measured

{len(rows)} objects in photos that scikit-image and scikit-learn carry, outlined by hand
([how](../tests/core/segment/truth/README.md)). *Held out* are things on
which the first answer's constants were not tuned. That says less of later clicks: how a correction
is found was mended by looking at the errors of all, and the constants of the vote of like pieces,
of the closer look and of the finer pieces were chosen with all in view.

The simulated user first clicks the inmost point of the object (farthest from its edge; the photo's
frame is an edge), at the level *object*. Each further click is on the inmost point of the largest
connected error: positive where something is missing, negative where there is too much. Who wants a
part may instead click the first place again, as the second click: that asks for the *part*; of the
two answers the better is kept. So a part is out of reach of the first click. *F* is the F measure
of the outlines within 2 px; the frame is no outline. A refusal counts as nothing selected.

Baselines in the same run: *colours alone* (`--segment grabcut`: no learned model; it
gets the same kind of clicks, for its own errors) and *subject only* (`--segment subject`: no
click). *Box*: one box around the object, no click, and then one click and two on the largest error.

A click takes {_milliseconds(seconds)} of a busy core (median; 90 % within
{_milliseconds(seconds, 90)}, closer looks that encode anew among them), once the photo is encoded,
which takes {encoding_seconds():.1f} s and happens once per photo (beside other work, which slows
a core's own time, too).
{machine}.

{_glances(rows, later, large)}

`make evidence PAGES=selection` makes this page anew.
"""


def _glances(rows: list[Row], later: list[Row], large: Large) -> str:
    glances = [glance for row in (*rows, *later) for glance in row.ours.glances]
    seconds = [glance.seconds for glance in glances]
    firsts = [(row.ours.truth.name, row.ours.glances[0]) for row in (*rows, *later)]
    firsts.append((f"{large.clicked.truth.name} in {large.megapixels:.0f} megapixels",
                   large.clicked.glances[0]))  # fmt: skip
    changed = [
        f"{name} {glance.iou:.3f} to {glance.then:.3f}"
        for name, glance in firsts
        if abs(glance.iou - glance.then) > CHANGED
    ]
    quick = sum(value <= 0.3 for value in seconds)
    same = sum(not glance.is_final for _, glance in firsts) - len(changed)
    return f"""A closer look that encodes anew takes a second or two of a core. The editor does not
wait for it: it answers at a glance, by what is encoded already, and puts the better mask into the
same step a moment later, if the user has not gone on. A rested pointer has the closer look taken
before the click. Of {len(seconds)} answers at a glance {quick} took at most 0.3 s of a core (median
{_milliseconds(seconds)}, 90 % within {_milliseconds(seconds, 90)}, the longest
{_milliseconds(seconds, 100)}); the first click in {large.megapixels:.0f} megapixels took
{large.clicked.glances[0].seconds:.2f} s. First answers that the closer look changed, IoU:
{"; ".join(changed) or "none"}. It left {same} as they were. All other figures here are of the whole
answer, as the command line gives it."""


def _milliseconds(seconds: list[float], percent: float = 50) -> str:
    return f"{np.percentile(seconds, percent) * 1000:.0f} ms"


def _means(rows: list[Row]) -> str:
    lines = ["## Means\n",
             _line(["", "Objects", "IoU, 1 click", "2", "3", "F, 1 click", "3",
                    "Box, IoU", "and 1 click", "2"]),
             "|---" + "|---:" * 9 + "|"]  # fmt: skip
    for kind, title in KINDS:
        of_kind = [row for row in rows if row.ours.truth.kind == kind]
        held = [row for row in of_kind if row.ours.truth.is_held_out]
        tuned = [row for row in of_kind if not row.ours.truth.is_held_out]
        for name, chosen in (
            (title, of_kind),
            ("– seen while tuning", tuned),
            ("– held out", held),
        ):
            ours, box = [row.ours for row in chosen], [row.box for row in chosen]
            lines.append(_line([name, str(len(chosen)), *_mean_cells(ours), *_box_cells(box)]))
        colors, box = [row.colors for row in of_kind], [row.color_box for row in of_kind]
        lines.append(_line(["– Colours alone", str(len(of_kind)), *_mean_cells(colors),
                            *_box_cells(box)]))  # fmt: skip
        subject = _number([row.subject for row in of_kind])
        lines.append(_line(["– subject only, no click", str(len(of_kind)), subject,
                            "", "", "", "", "", "", ""]))  # fmt: skip
    return "\n".join([*lines, ""])


def _mean_cells(clicked: list[Clicked]) -> list[str]:
    measures: list[Measure] = [iou(1), iou(2), iou(3), boundary(1), boundary(3)]
    return [_number([measure(each) for each in clicked]) for measure in measures]


def _box_cells(boxes: list[list[float]]) -> list[str]:
    return [_number([box[k] for box in boxes]) for k in range(BOX_CLICKS + 1)]


def _number(values: list[float]) -> str:
    return f"{np.mean(values):.3f}"


def _tables(rows: list[Row]) -> str:
    lines = ["## Every object\n\n![](selection/objects.jpg)\n\nThe mask after one click, and after "
             "three; parts after three. Dots are clicks, green for the object and red for what is "
             "not; yellow is missing, purple is too much.\n"]  # fmt: skip
    heads = ["", "IoU, 1 click", "2", "3", "F, 3 clicks", "Box", "and 1 click",
             "Colours, 1 click", "3", "F", "Subject"]  # fmt: skip
    for kind, title in KINDS:
        lines += [_line([title, *heads[1:]]), "|---" + "|---:" * (len(heads) - 1) + "|"]
        for row in rows:
            if row.ours.truth.kind == kind:
                held = " *(held out)*" if row.ours.truth.is_held_out else ""
                ours, colors = row.ours, row.colors
                values = [iou(1)(ours), iou(2)(ours), iou(3)(ours), boundary(3)(ours), *row.box[:2],
                          iou(1)(colors), iou(3)(colors), boundary(3)(colors),
                          row.subject]  # fmt: skip
                lines.append(_line([row.ours.truth.name + held, *(f"{v:.3f}" for v in values)]))
        lines.append("")
    return "\n".join(lines)


def _later(rows: list[Row]) -> str:
    lines = ["## Drawn later\n\nOutlined before corrections were decided in finer pieces, to see "
             "whether that holds for other things: their figures were in view while DEEP was "
             "chosen, those of flag and mast while NARROW, MINOR_FINE and LARGER_FINE were. "
             "In no mean above.\n",
             _line(["", "Kind", "IoU, 1 click", "2", "3", "F, 3 clicks", "Box", "and 1 click"]),
             "|---|---" + "|---:" * 6 + "|"]  # fmt: skip
    for row in rows:
        values = [*(iou(k)(row.ours) for k in (1, 2, 3)), boundary(3)(row.ours), *row.box[:2]]
        each = row.ours.truth
        lines.append(_line([each.name, each.kind, *(f"{v:.3f}" for v in values)]))
    return "\n".join([*lines, ""])


def _large(large: Large) -> str:
    steps = large.clicked.steps
    return f"""## A small thing in a large photo

The {large.clicked.truth.name} in the same photo of {large.megapixels:.0f} megapixels (enlarged). A
closer look at the tile that it is in is taken with the first click, and kept.

IoU {", ".join(f"{step.iou:.3f}" for step in steps)} after one, two and three clicks; encoding
{large.encoding:.1f} s, the first click {large.first:.1f} s, the later ones
{np.median(large.clicked.seconds[1:]):.1f} s.
"""


def _line(cells: list[str]) -> str:
    return "| " + " | ".join(cells) + " |"
