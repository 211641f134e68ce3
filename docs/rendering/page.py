"""The text of the page. Its numbers come from the figures that it is given."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import photos
import truth

HEAD = """# Rendering, compared

Made by `make rendering`; every number and picture on this page comes from that one command. The
times are of the machine that made the page, and the only numbers that change from run to run.

A lifted object is drawn with Gaussians that carry a map into the photo, not a colour. Here they
are compared with *the same* Gaussians in plain colours, in two ways:

- **plain**: the colours that the lifter gives them, the photo averaged over their surroundings;
- **plain, fitted**: colours for which the picture at rest comes as near to the photo as the fit
  gets, without limits: what training these Gaussians' colours against the photo would end in.

*Detail* is the mean squared Sobel gradient of the luma inside the object, over that of what it is
compared with. It is high for noise, too: read it beside the pictures, or the decibels.
"""


def write_page(
    of_photos: list[tuple[photos.Subject, list[photos.Row]]],
    of_truth: Mapping[str, list[truth.Row]],
    costs: list[dict[str, Any]],
    machine: str,
) -> str:
    parts = [HEAD, _photos(of_photos), _turn(of_truth["turn"]), _sizes(of_truth)]
    return "\n".join([*parts, _cost(costs, machine)])


def _photos(of_photos: list[tuple[photos.Subject, list[photos.Row]]]) -> str:
    lines = ["""## Real photos, turned by 20°

The embedded lifter, no other help. The cat's face is an oval of the photo, the portrait is selected
by two clicks (with the learned models, where they are installed). Detail is over the photo's own.
"""]  # fmt: skip
    for subject, rows in of_photos:
        lines += [f"**{subject.title}** (`assets/samples/{subject.file}`)\n",
                  f"![]({subject.file})\n"]  # fmt: skip
        lines += ["|  | Gaussians | Detail at rest | Detail turned |", "|---|---:|---:|---:|"]
        for r in rows:
            cells = [r.name, f"{r.gaussians:,}", f"{r.at_rest:.3f}", f"{r.turned:.3f}"]
            lines.append(row(cells))
        lines.append("")
    return "\n".join(lines)


def _turn(rows: list[truth.Row]) -> str:
    return f"""## With the truth known: turned by 20°

An ellipsoid with a texture as fine as the photo's pixels, ray cast in numpy: one view is the photo,
another what the edit should show. Gaussians lie on the true surface, so that nothing but the
rendering is judged. *Seen* is what the photo showed of it. The first row is no rendering:
each ray of the new view looks the photo up where its point of the surface was. It is about what the
photo can give.

![](turn.jpg)

{_truth_table(rows, has_rest=True)}
"""


def _sizes(of_truth: Mapping[str, list[truth.Row]]) -> str:
    return f"""## Smaller: {truth.SMALL} times the size

The photo's pixels are averaged over a pixel of the view by its halved copies; without them they
are picked, and shimmer in a drag. The truth is the mean of {truth.SMALL_RAYS**2} rays a pixel.

![](small.jpg)

{_truth_table(of_truth["small"])}

## Longer: stretched {truth.LONG:g} times

![](stretched.jpg)

{_truth_table(of_truth["stretched"])}

## Turned too far: {truth.FAR:g}°

What the photo saw at a grazing angle now faces the camera: its pixels would become streaks, as
they do in the exact look-up at the upper right. There the Gaussians' plain colours take over. This
costs decibels where the photo still saw the surface (*seen*), and gains them over the *whole*.
What lies beyond the strip was never seen: the photo goes on behind the edge, mirrored.

![](far.jpg)

{_truth_table(of_truth["far"])}
"""


def _truth_table(rows: list[truth.Row], has_rest: bool = False) -> str:
    heads = [
        "",
        "Gaussians",
        *(["At rest dB"] if has_rest else []),
        "Seen dB",
        "Whole dB",
        "Detail",
    ]
    lines = [row(heads), "|---" + "|---:" * (len(heads) - 1) + "|"]
    for r in rows:
        rest = [] if not has_rest else ["" if r.at_rest is None else _decibels(r.at_rest)]
        count = "" if r.gaussians is None else f"{r.gaussians:,}"
        own = [_decibels(r.seen), _decibels(r.whole), f"{r.detail:.2f}"]
        lines.append(row([r.name, count, *rest, *own]))
    return "\n".join(lines)


def _decibels(value: float) -> str:
    return "equal" if value > 90 else f"{value:.1f}"


def _cost(costs: list[dict[str, Any]], machine: str) -> str:
    heads = ["Scene", "Gaussians", "px", "Frame ms", "least ms", "Skin, project", "Sort", "Bin",
             "Draw"]  # fmt: skip
    lines = [row(heads), "|---" + "|---:" * (len(heads) - 1) + "|"]
    for r in costs:
        parts = [r["frame_ms"], r["frame_least_ms"], r["project_ms"], r["sort_ms"], r["bin_ms"],
                 r["draw_ms"]]  # fmt: skip
        cells = [r["scene"], f"{r['gaussians']:,}", str(r["width"]), *(f"{v:.1f}" for v in parts)]
        lines.append(row(cells))
    table = "\n".join(lines)
    return f"""## What a frame costs

Frames of a drag on the CPU, `tiles`, from the posed control points to 8-bit pixels.
{machine}.
*Cloud*: plain Gaussians of 1 to 3 px on a bumpy ball, sorted and composited one by one. *Lift*:
a photo-textured object that covers half of the view; its cost is that of its pixels, and nothing
is sorted. Medians; thin lines, and *least*: the least that was taken, which matters where the
machine had other work. The parts were timed apart, and need not add up.

![](cost.png)

![](parts.png)

{table}

Where it goes, and the limit. A Gaussian of the cloud touches 22 rows of eight pixels, of which it
colours half; a row takes 15 multiplications, of which a core begins two at a time: 100,000
Gaussians are about 17 million cycles of one core, a third of the time that drawing takes. As much
goes into fetching them in the order of their depth and into loops that are eight rows long. A lift
spends a quarter of its frame on the photo (sixteen texels a pixel, from memory that is asked for
before it is needed), a sixth on sums inside the surface, and half on the few hundred tiles of its
silhouette, where every pixel gets sums, slopes and coverage of its own.

All renderers, and the budgets: [performance](../performance.md).
"""


def row(cells: list[str]) -> str:
    return "| " + " | ".join(cells) + " |"
