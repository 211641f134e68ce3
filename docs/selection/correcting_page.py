"""The part of docs/selection.md about corrections and confidence."""

from __future__ import annotations

import numpy as np
from correcting import CLICKS, RANDOM_RUNS, WORSE, Made

from objectmorpher_core.segment import UNSURE

BINS = ((0.0, 0.5), (0.5, 0.6), (0.6, 0.7), (0.7, 0.8), (0.8, 0.9), (0.9, 0.95), (0.95, 1.01))
BAD = 0.75  # IoU below which a mask is not what was meant
GROUPS = (("outlined", "Outlined things"), ("composite", "Composites"))
# The same measure on the commit before corrections were local, b183b34: the cells of `_cells`.
BEFORE = {
    ("outlined", False): (
        "127", "1.6 %", "+0.019", "112", "0.9 %", "+0.058",
        "0.956", "0.960", "0.862", "0.888",
    ),
    ("outlined", True): (
        "84", "8.3 %", "+0.040", "108", "5.6 %", "+0.091",
        "0.853", "0.896", "0.650", "0.698",
    ),
    ("composite", False): (
        "113", "8.0 %", "+0.038", "66", "10.6 %", "+0.033",
        "0.834", "0.893", "0.753", "0.794",
    ),
    ("composite", True): (
        "117", "7.7 %", "+0.037", "63", "1.6 %", "+0.025",
        "0.784", "0.867", "0.657", "0.711",
    ),
}  # fmt: skip
BEFORE_SURENESS = (
    ("33", "0.38", "0.32"),
    ("35", "0.56", "0.49"),
    ("78", "0.66", "0.51"),
    ("117", "0.76", "0.63"),
    ("288", "0.86", "0.72"),
    ("237", "0.92", "0.80"),
    ("182", "0.97", "0.80"),
)  # of all answers: lower end of a bin, how many, what it said, true IoU
HEAD = """## Corrections

The simulated artist above on the 25 outlined things and on {composites} composites: touching fruit,
fur before leaves and bricks, thin limbs, gaps that arms, handles or a tail enclose, each with known
truth ([how](../tests/core/segment/composites.py)). One run of {clicks} clicks in the middle of the
largest error, and {runs} runs that begin at a random place of the thing and go on at random places
in errors, of either kind where there are both, at least 2 px deep. (A part is clicked at the level
*part*.) *Worse* is a click that costs more than {worse:.2f} of IoU. LIKELY_GONE, LIKELY_ADDED and
the weights of the confidence were chosen on the half that was seen, and not on the held out one.
*Before* is the same artist on the program before corrections were weighed by their like.
What a walk from the click reaches was one more region until it was found to gain nothing: over
these 45 things, clicked in the middle, the IoU after two, three and six clicks was 0.842, 0.880
and 0.918 with it, and is 0.841, 0.881 and 0.922 without (in no figure below).
"""


def corrections(made: list[Made]) -> str:
    """Markdown: what each click does, and how sure the segmenter is."""
    composites = {m.case.name for m in made if m.case.group == "composite"}
    heads = ["", "Right-clicks", "worse", "mean change", "Clicks", "worse", "mean change",
             "Wholes, IoU, 3 clicks", "6", "3 at random", "6"]  # fmt: skip
    lines = [HEAD.format(composites=len(composites), clicks=CLICKS, runs=RANDOM_RUNS, worse=WORSE),
             _line(heads), "|---" + "|---:" * (len(heads) - 1) + "|"]  # fmt: skip
    for group, title in GROUPS:
        for is_held_out, half in ((False, "seen"), (True, "held out")):
            chosen = [m for m in made if (m.case.group, m.case.is_held_out) == (group, is_held_out)]
            lines.append(_line([f"{title}, {half}", *_cells(chosen)]))
            lines.append(_line(["– before", *BEFORE[group, is_held_out]]))
    return "\n".join([*lines, "", _sureness(made)])


def _cells(made: list[Made]) -> list[str]:
    cells = []
    for is_foreground in (False, True):
        gains = [m.gain for m in made if m.number > 1 and m.is_foreground == is_foreground]
        worse = np.mean([gain < -WORSE for gain in gains])
        cells += [str(len(gains)), f"{100 * worse:.1f} %", f"{np.mean(gains):+.3f}"]
    wholes = [m for m in made if m.case.kind == "whole"]
    for run in ("middle", "random"):
        for number in (3, CLICKS):
            cells.append(f"{np.mean(_after([m for m in wholes if m.run == run], number)):.3f}")
    return cells


def _after(made: list[Made], number: int) -> list[float]:
    """IoU of each run after so many clicks, or its last one."""
    last: dict[tuple[str, int], float] = {}
    run = 0
    for m in made:
        run += m.number == 1
        if m.number <= number:
            last[m.case.name, run] = m.after
    return list(last.values())


def _sureness(made: list[Made]) -> str:
    told = np.array([(m.sureness, m.after, m.case.is_held_out) for m in made])
    lines = ["## How sure it is\n\nThe segmenter states the overlap with what is meant that is to "
             "be expected. All answers to the clicks above:\n",
             _line(["It says", "Answers, seen", "it says", "true IoU", "Held out", "it says",
                    "true IoU", "Before, all", "it said", "true IoU"]),
             "|---" + "|---:" * 9 + "|"]  # fmt: skip
    for (low, high), before in zip(BINS, BEFORE_SURENESS, strict=True):
        cells = [f"{low:.2f} to {min(high, 1):.2f}"]
        for half in (0, 1):
            own = told[(told[:, 2] == half) & (told[:, 0] >= low) & (told[:, 0] < high)]
            means = [f"{v:.2f}" for v in own[:, :2].mean(0)] if len(own) else ["", ""]
            cells += [str(len(own)), *means]
        lines.append(_line([*cells, *before]))
    seen, held = (told[told[:, 2] == half] for half in (0, 1))
    bad, warned = held[:, 1] < BAD, held[:, 0] < UNSURE
    return (
        "\n".join(lines)
        + f"""

What it says is off by {_off(seen):.2f} on average over the bins of the seen half, by
{_off(held):.2f} on the held out one; before, by 0.10 and 0.18. The correlation with the true IoU
is {_correlation(seen):.2f} and {_correlation(held):.2f}; before, 0.50 and 0.34. Below
{UNSURE:.2f} the status line says what helps: on the held out half for {(bad & warned).sum()} of the
{bad.sum()} answers with an IoU below {BAD:.2f}, and for {(~bad & warned).sum()} of the
{(~bad).sum()} others.
"""
    )


def _off(told: np.ndarray) -> float:
    """Expected calibration error over tenths."""
    tenth = np.minimum(told[:, 0] * 10, 9).astype(int)
    gaps = [abs(np.diff(told[tenth == k, :2].sum(0))[0]) for k in range(10)]
    return float(np.sum(gaps) / len(told))


def _correlation(told: np.ndarray) -> float:
    return float(np.corrcoef(told[:, 0], told[:, 1])[0, 1])


def _line(cells: list[str]) -> str:
    return "| " + " | ".join(cells) + " |"
