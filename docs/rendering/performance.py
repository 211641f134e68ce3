"""docs/performance.md: what the budgets of the design ask, and what was measured."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import growth
import numpy as np
from page import row

from objectmorpher_core import segment
from objectmorpher_core.document.model import Click, Prompt
from objectmorpher_core.pictures.image import Picture, encode_mask, encode_picture
from objectmorpher_core.pipeline import read_photo
from objectmorpher_research.bench.scenes import made_mask, made_photo
from objectmorpher_research.bench.timing import cpu_name, seconds
from objectmorpher_research.commands.bench import figures

ROOT = Path(__file__).resolve().parents[2]
PHOTO = 1024  # px, sides of the photo of 1 MP
LARGE = 6000, 4000  # px, of 24 MP
LOAD = os.getloadavg()[0]  # of other work, when this began
Row = dict[str, Any]

HEAD = """# Performance

Made by `make rendering`. Every figure was taken on one machine, in one go: {machine}.
Each whole 1 of that load is a core that somebody else was using; the figures are then too high.

## Budgets

The budgets are for two ordinary cores without a GPU. A frame of the tables below begins at
the posed control points; *drag to pixels* adds the median solve. Medians; in brackets the least of
all frames, which is nearer to what the program itself needs where the machine had other work.

"""

PROFILE = """
### Where an edit's time goes

Of the first edit of *enlarged*, a process of its own, 7.0 s of the processors in 4.3 on the clock:

| What | Processor s |
|---|---:|
| imports | 1.1 |
| DINOv2, opened and run | 1.7 |
| U²-Net-p, its two looks | 0.7 |
| lifting | 1.7 |
| filling in behind it, selecting, drawing, writing, the rest | 1.8 |

A living thing takes longer: the samples' astronaut and cat, as large, take 5.1 s (8.9 of the
processors), and 3.4 s again. They have sides to be invented, and are compared with solids, of which
the cup is one at once.

The photo is encoded while the rest of the program is imported, and the background is filled in
while the object is lifted. The last second has one core without work: each round of the search for
a fill follows from the one before, and the picture waits for it. *Again* needs no network, for what
they said of the last photos is kept. Of DINOv2's run four fifths are matrix products, a tenth
softmax. The first `edit` of an installation compiles kernels besides, for about a minute: three
quarters of that is numba's own work in Python, a quarter LLVM's.

*made* is noise all over, in which no patch is like another and everything stands out.
"""

FRAMES = """
## Frames: `objectmorpher bench render`

*tiles* is the CPU rasteriser, as the window shows its pictures; *gl* the same picture by OpenGL;
*reference* the specification in plain numpy. *classic-gl* draws the cloud as public splat viewers
do: depths sorted on the CPU, quads of three standard deviations, covariances computed at each
corner; it skins nothing, its frames are of what stands still. The *cloud* is plain Gaussians of
1 to 3 px on a bumpy ball, the *lift* a photo-textured object that covers half of the view; both
are dragged by one handle. *First* is the first frame of an object, with all that is done once.
OpenGL: {gl}.

"""

EDITS = """
## The whole edit: `objectmorpher bench pipeline`

With the embedded defaults: {backends}. Each photo is
edited in a process of its own. Its *first* run opens the networks and loads the kernels in the
stages that need them; what the process took to start is listed apart. *Again* are the medians of
three more, as in the window. *sample* is the cup of the first start, *enlarged* the same photo with
1.06 megapixels, *made* the photo of the frames below, half of which is its object. Seconds; the
most memory that the process had used by then.

"""

BESIDE_A_VIEWER = """
### OpenGL beside a plain viewer, and what a frame sends

On 30 November 2026, on two cores with much other work, OpenGL emulated (llvmpipe): frames of *gl*
and *classic-gl* alternating, nine each (five of 300,000), every one of *gl* in another pose.
Medians of milliseconds of processor time, before and since a Gaussian of a plain colour is one
triangle with a shader of its own, which knows nothing of photos, and is blended in 16 bits a
channel:

| Gaussians | px | gl | classic-gl | gl / classic-gl, before | now |
|---:|---|---:|---:|---:|---:|
| 10,000 | 512 × 512 | 10 | 9 | 1.26 | 1.04 |
| 10,000 | 1024 × 1024 | 18 | 19 | 1.41 | 0.94 |
| 10,000 | 1920 × 1080 | 18 | 17 | 1.45 | 1.03 |
| 100,000 | 512 × 512 | 110 | 136 | 1.19 | 0.81 |
| 100,000 | 1024 × 1024 | 176 | 192 | 1.24 | 0.92 |
| 100,000 | 1920 × 1080 | 187 | 205 | 1.24 | 0.91 |
| 300,000 | 512 × 512 | 340 | 470 | 1.18 | 0.72 |
| 300,000 | 1024 × 1024 | 532 | 647 | 1.18 | 0.82 |
| 300,000 | 1920 × 1080 | 551 | 619 | 1.12 | 0.89 |

Of the 176 ms sorting takes 2, skinning and projecting 11, drawing 164; *classic-gl* sorts in 1.
What had cost more: the second triangle of each Gaussian (a sixth of drawing), and a pixel's place
on the screen and the numbers of a Gaussian's kind, which an emulated GPU looks up for each
4 × 4 px (another sixth).

What a frame sends to the GPU, and what it draws there:

| Object | px | Draw calls | Bytes, first frame | Of a drag | Same pose | Fragments, millions |
|---|---|---:|---:|---:|---:|---:|
| cloud, 100,000 | 1024 × 1024 | 2 | 17,616,384 | 416,384 | 0 | 9.7 |
| cloud, 300,000 | 1920 × 1080 | 2 | 52,816,384 | 1,216,384 | 0 | 31.9 |
| lift, 20,000 | 1024 × 1024 | 21 | 38,034,136 | 16,384 | 0 | not counted |

A frame of a drag sends the table of control points (16,384 bytes) and, of a cloud, the order of
its Gaussians. Nothing is sent twice, and nothing for an object that stays as it is:
`tests/app/render/test_traffic.py` records all that is sent. Fragments are those that are blended.
None of this was measured on a real GPU.
"""

SOLVES = """
## Solver and skinning: `objectmorpher bench deform`

A body with five limbs, one of which is bent by 90°. *Gap* is the energy after a single frame from
rest, over the converged one, minus 1.

"""


FRAME_OF_A_DRAG = """
## Where the time of a dragged frame goes

No frame is held back. A place of the pointer waits half a frame on average for the next one to
begin and is on the screen at its end: *hand to picture* ([how the window feels](tour/feel.md)) is
one and a half frames. The window's own frames of a drag, the usual lift of the sample photo (16,655
Gaussians) on a canvas of 1024², OpenGL emulated; of 20 ms, on the clock, in November 2026:

| What | Where | ms |
|---|---|---:|
| the pointer's new place, solve (2 to 6 iterations, 0.1 px from the minimum) | main thread | 2.4 |
| panels, with the events before them | main thread | 1.1 |
| marks over the photo | main thread | 0.7 |
| light, background, where the edit is shown | main thread | 1.8 |
| posing, projecting, binning; drawing a draft at half of the resolution or less | all cores | 3.9 |
| sharpening the draft | all cores | 3.6 |
| putting the canvas together | all cores | 0.8 |
| the canvas to the driver, and into its window | driver | 1.1 |
| drawing the panels, swap | driver | 3.2 |
| between them | main thread | 1.3 |

Drafts have 8 ms of a frame. They miss the exact picture by 1.5 to 2.5 levels (the worst channel, on
average over the canvas), mostly along its edge, where a draft has a third of the Gaussians.

Of this gained nothing, and is left out: drawing the canvas before the panels are laid out, so that
the driver copies meanwhile; the canvas put together in one pass over its rows; a quad in place of
the copy; where the edit is shown computed beside the draft's drawing; sharpening only there, which
is 97 % of this lift while it is dragged, or along straight pieces of the map.

While a job computes and the hand rests, the window draws ten frames a second. It drew eighty, for
each report of the job; emulated, they took the cores that it computes on: a photo of 1 MP was read
in 1.6 s in place of 0.85.
"""


@dataclass(frozen=True)
class Budget:
    what: str
    asked: str
    measured: str
    is_met: bool | None  # None: not measured


def machine() -> str:
    """The machine in words."""
    return f"{cpu_name()}, {os.cpu_count()} cores, load {LOAD:.1f} when it began"


def write_page() -> str:
    """Measures, for some minutes, and tells."""
    edits = figures("pipeline", False)["rows"]
    render, deform = figures("render", False), figures("deform", False)
    gl = render["machine"]["gl_renderer"] or "not to be had"
    frames = FRAMES.format(gl=gl) + _frames(render["rows"])
    budgets = _budgets(_budgets_of(edits, render["rows"], deform["rows"]))
    head = HEAD.format(machine=machine())
    whole = EDITS.format(backends=_backends(edits[0])) + _edits(edits)
    return (
        head
        + budgets
        + whole
        + PROFILE
        + frames
        + BESIDE_A_VIEWER
        + SOLVES
        + _solves(deform["rows"])
        + FRAME_OF_A_DRAG
        + growth.section()
    )


def _budgets_of(edits: list[Row], frames: list[Row], solves: list[Row]) -> list[Budget]:
    paper = next(r for r in solves if r["mode"] == "faithful")
    ours = next(r for r in solves if (r["mode"], r["nodes"]) == ("default", 512))
    lift = _frame(frames, "lift", None)
    cloud = _frame(frames, "cloud", 100_000)
    many = _frame(frames, "cloud", 300_000)
    edit_of_large, large = _large_edit_report(), _export_report()
    export, memory = large["composite_s"] + large["encode_s"], large["peak_mb"] / 1000
    gap, solve = max(100 * ours["energy_gap"], 0.0), ours["solve_ms"]
    return [
        Budget("ARAP frame, 512 nodes, paper graph, 3 iterations", "≤ 1.5 ms",
               f"{paper['solve_ms']:.1f} ms", paper["solve_ms"] <= 1.5),
        Budget("within 1 % of the energy minimum after a large cold drag", "≤ 10 ms",
               f"{gap:.1f} % after a frame of 10 ms; {solve:.1f} ms a frame of a drag", gap <= 1),
        _framed(f"frame, an embedded lift ({lift['gaussians']:,} Gaussians)", lift, 33),
        _framed("frame, 100k plainly coloured Gaussians", cloud, 35),
        _framed("frame, 300k of them", many, 90),
        _dragged(f"drag to pixels, an embedded lift ({lift['gaussians']:,} Gaussians)", lift,
                 "≤ 33 ms, then 16 ms", 33),
        _dragged("drag to pixels, 100k plainly coloured Gaussians", cloud, "≤ 35 ms", 35),
        Budget("the same on a real GPU", "≤ 4 ms", "no GPU here", None),
        _clicked(),
        _timed("lift, 1 MP photo, the background beside it", edits, "lift", 1.5),
        _whole(f"whole `edit`, 1 MP photo, {_backends(edits[0])}", edits, "first", 5),
        _whole("the same again", edits, "again", 3),
        _timed_large(edit_of_large),
        Budget("export of a 24 MP photo", "≤ 10 s, < 2 GB",
               f"{export:.1f} s, {memory:.1f} GB", export <= 10 and memory < 2),
        Budget("the whole edit of it, object on half of the photo", "–",
               f"{edit_of_large['seconds']['total']:.0f} s, "
               f"{edit_of_large['peak_memory_mb'] / 1000:.1f} GB (in matting)", None),
        *_felt(),
    ]  # fmt: skip


def _frame(rows: list[Row], scene: str, count: int | None) -> Row:
    """The tiles' row of the largest view."""
    own = [r for r in rows if (r["renderer"], r["scene"]) == ("tiles", scene)]
    return max((r for r in own if count in (None, r["gaussians"])), key=lambda r: r["width"])


def _framed(what: str, frame: Row, limit: float) -> Budget:
    taken, least = frame["frame_ms"], frame["frame_least_ms"]
    return Budget(
        f"{what}, 1024²", f"≤ {limit:g} ms", f"{taken:.0f} ms ({least:.0f})", taken <= limit
    )


def _dragged(what: str, frame: Row, asked: str, limit: float) -> Budget:
    least, solve = frame["frame_least_ms"], frame["solve_ms"]
    total = frame["frame_ms"] + solve
    measured = f"{total:.0f} ms: {solve:.0f} solve, {frame['frame_ms']:.0f} frame ({least:.0f})"
    return Budget(f"{what}, 1024²", asked, measured, total <= limit)


def _timed(what: str, edits: list[Row], stage: str, limit: float) -> Budget:
    """Of the first edits of both photos of a megapixel; the slower one counts."""
    first = [r for r in edits if r["run"] == "first" and r["photo"] != "sample"]
    told = ", ".join(f"{r['seconds'][stage]:.1f} s {r['photo']}" for r in first)
    slowest = max(r["seconds"][stage] for r in first)
    return Budget(what, f"≤ {limit:g} s", told, slowest <= limit)


def _whole(what: str, edits: list[Row], run: str, limit: float) -> Budget:
    """With the start of its process; both photos of a megapixel."""
    own = [r for r in edits if r["run"] == run and r["photo"] != "sample"]
    taken = {r["photo"]: r["seconds"]["total"] + r.get("start_s", 0) for r in own}
    measured = ", ".join(f"{s:.1f} s {photo}" for photo, s in taken.items())
    return Budget(what, f"≤ {limit:g} s", measured, max(taken.values()) <= limit)


def _felt() -> list[Budget]:
    """What a hand and an eye feel in the window, of the last `make feel`."""
    page, found = (ROOT / "docs/tour/feel.md").read_text(encoding="utf-8"), []
    asked = {
        "hand to picture, in the window": (r"usual number of Gaussians \| (\d+) ms", 33, "ms"),
        "the same of nine places in ten": (r"usual number of Gaussians .*?\((\d+)\)", 50, "ms"),
        "a frame of that": (r"usual number of Gaussians (?:.*?\|){3} (\d+) ms", 20, "ms"),
        "a photo of 1 MP opened to its first click's answer": (r"settled it: ([\d.]+) s", 1.5, "s"),
        "start to a drawn window": (r"first frame on the screen: ([\d.]+) s", 1.5, "s"),
    }
    for what, (pattern, limit, unit) in asked.items():
        told = re.search(pattern, page)
        assert told is not None, what
        is_met = float(told[1]) <= limit
        found.append(Budget(what, f"≤ {limit:g} {unit}", f"{told[1]} {unit}", is_met))
    return found


def _clicked() -> Budget:
    """The second of two clicks: what is made once was made by the first."""
    pixels = made_photo(PHOTO, made_mask(PHOTO))
    told, slowest = [], 0.0
    for name in ("dino", "grabcut"):
        try:
            reading = read_photo(pixels, segment.load(name))
        except ValueError:  # its model is not installed
            continue
        first, second = (Prompt((Click(x, x),)) for x in (PHOTO / 2, PHOTO / 2 - 20))
        reading.segment(first)
        taken = seconds(lambda reading=reading, second=second: reading.segment(second))
        slowest = max(slowest, taken)
        told.append(f"{taken:.2f} s {name}")
    return Budget("click to mask, 1 MP", "≤ 0.3 s", ", ".join(told), slowest <= 0.3)


def _timed_large(report: Row) -> Budget:
    """The lift of a photo of 24 MP."""
    taken, count = report["seconds"]["lift"], report["object"]["gaussians"]
    return Budget("lift, 24 MP photo, object on half of it, likewise", "≤ 6 s",
                  f"{taken:.1f} s, {count:,} Gaussians", taken <= 6)  # fmt: skip


def _export_report() -> Row:
    """What the export of a photo of 24 MP costs, whose edit is made up."""
    command = [sys.executable, "-m", "tests.large", "600", "400", "10"]
    return json.loads(subprocess.run(command, cwd=ROOT, check=True, capture_output=True).stdout)


def _large_edit_report() -> Row:
    """The edit of a photo of 24 MP whose mask is given."""
    size, mask = LARGE, made_mask(PHOTO)
    pixels = cv2.resize(made_photo(PHOTO, mask), size, interpolation=cv2.INTER_CUBIC)
    large = cv2.resize(mask.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)
    return _run(pixels.astype(np.uint8), large > 0, "--turn", "15,0,0")


def _run(pixels: np.ndarray, mask: np.ndarray | None, *options: str) -> Row:
    """`objectmorpher edit` in a process of its own; its report."""
    with tempfile.TemporaryDirectory() as folder:
        photo, report = Path(folder) / "photo.png", Path(folder) / "report.json"
        photo.write_bytes(encode_picture(Picture(pixels), ".png"))
        if mask is not None:
            chosen = Path(folder) / "mask.png"
            chosen.write_bytes(encode_mask(mask))
            options = (*options, "--mask", str(chosen))
        command = [sys.executable, "-m", "objectmorpher", "edit", str(photo), *options]
        command += ["-o", str(Path(folder) / "out.png"), "--report", str(report)]
        subprocess.run(command, cwd=ROOT, check=True)
        return json.loads(report.read_text())


def _budgets(budgets: list[Budget]) -> str:
    lines = [row(["What", "Asked", "Measured", "Met"]), "|---|---|---|---|"]
    words = {True: "yes", False: "**no**", None: "–"}
    lines += [row([b.what, b.asked, b.measured, words[b.is_met]]) for b in budgets]
    return "\n".join(lines) + "\n"


def _backends(edit: Row) -> str:
    return ", ".join(edit[stage] for stage in ("segment", "lift", "inpaint"))


def _edits(rows: list[Row]) -> str:
    stages = ["load", "segment", "lift", "inpaint", "render", "save", "total"]
    heads = ["Photo", "px", "Run", "Start", *(stage.capitalize() for stage in stages), "MB"]
    lines = [row(heads), "|---|---|---" + "|---:" * (len(heads) - 3) + "|"]
    for r in rows:
        start = f"{r['start_s']:.1f}" if "start_s" in r else ""
        seconds = [f"{r['seconds'][stage]:.2f}" for stage in stages]
        size, memory = f"{r['width']} × {r['height']}", f"{r['peak_memory_mb']:,.0f}"
        lines.append(row([r["photo"], size, r["run"], start, *seconds, memory]))
    return "\n".join(lines) + "\n"


def _frames(rows: list[Row]) -> str:
    heads = ["Renderer", "Scene", "Gaussians", "px", "Frame ms", "Least", "First", "Sort",
             "Skin, project", "Bin", "Draw"]  # fmt: skip
    keys = ["frame_ms", "frame_least_ms", "first_frame_ms", "sort_ms", "project_ms", "bin_ms",
            "draw_ms"]  # fmt: skip
    lines = [row(heads), "|---|---" + "|---:" * (len(heads) - 2) + "|"]
    for r in rows:
        cells = [f"{r[key]:.1f}" if key in r else "" for key in keys]
        lines.append(
            row([r["renderer"], r["scene"], f"{r['gaussians']:,}", str(r["width"]), *cells])
        )
    return "\n".join(lines) + "\n"


def _solves(rows: list[Row]) -> str:
    keys = ["solve_ms", "solve_p99_ms", "set_handles_ms", "energy_gap", "skin_ms"]
    heads = ["Mode", "Nodes", "Links", "Solve ms", "99 %", "New handles ms", "Gap", "Skin ms",
             "Gaussians"]  # fmt: skip
    lines = [row(heads), "|---" + "|---:" * (len(heads) - 1) + "|"]
    for r in rows:
        cells = [f"{r[key]:.3g}" if key in r else "" for key in keys]
        count = f"{r['gaussians']:,}" if "gaussians" in r else ""
        lines.append(row([r["mode"], str(r["nodes"]), f"{r['links']:,}", *cells, count]))
    return "\n".join(lines) + "\n"
