"""How times grow: a frame with its Gaussians, the solver with its nodes, an edit with its pixels.

`python docs/rendering/growth.py [frame] [solve] [edit]` measures anew what is named, writes
`growth.json` and draws `growth.png`; `make rendering` measures all. Frames and solves are measured
in processor time, which other programs on the machine disturb less, edits by the clock.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy, as the program itself does

import cv2
import numpy as np
from cost import Canvas

from objectmorpher_core.deform.deformer import Deformer
from objectmorpher_core.document.settings import DeformSettings
from objectmorpher_core.pictures.image import Picture, encode_picture
from objectmorpher_research.bench.bodies import five_limbs, limb_handles
from objectmorpher_research.bench.render import tiles_frame
from objectmorpher_research.bench.scenes import cloud_scene, made_mask, made_photo

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
GAUSSIANS = (1_000, 10_000, 100_000, 300_000, 1_000_000)
NODES = (64, 128, 256, 512, 1024, 2048, 4096)
MEGAPIXELS = (0.3, 1.0, 3.0, 10.0, 24.0)
REPEATS = 9
BOUND = 20_000  # Gaussians of the body whose nodes are solved for
STEPS, BEND = 60, 90.0  # of a drag, and degrees in all
PLOT, LEFT, RIGHT, TOP, BOTTOM = 340, 62, 16, 42, 52  # px
HEIGHT = 330
BLUE, GREY, PALE = (60, 110, 180), (120, 120, 130), (225, 225, 230)
LAST = 3  # points from which the exponent is taken: the largest, where what is fixed counts least

Rows = list[tuple[float, float]]  # how many, and ms
TITLES = {
    "frame": ("a frame, by Gaussians", "ms of processor"),
    "solve": ("a frame's solve, by nodes", "ms of processor"),
    "edit": ("an edit, by megapixels", "ms by the clock"),
}


def _taken(run: Callable[[], object]) -> float:
    """Median ms of processor time."""
    run()
    taken = []
    for _ in range(REPEATS):
        start = time.process_time()
        run()
        taken.append(1000 * (time.process_time() - start))
    return float(np.median(taken))


def measure_frames() -> Rows:
    """A frame of `bench render`'s cloud, 1024 px: skinning, projection, sorting, drawing."""
    rows = []
    for count in GAUSSIANS:
        scene, frames = cloud_scene(count), iter(range(10**6))
        rows.append((float(count), _taken(lambda s=scene, f=frames: tiles_frame(s, next(f)))))
    return rows


def measure_solves() -> Rows:
    """A frame of a drag of `bench deform`'s body, solved until nothing moves: no budget ends it."""
    rows = []
    for nodes in NODES:
        lifted = five_limbs(BOUND, nodes)
        deformer = Deformer(lifted, DeformSettings())
        pose, step = deformer.rest(), 0

        def solve(deformer: Deformer = deformer, lifted=lifted) -> None:
            nonlocal pose, step
            step += 1
            handles = limb_handles(lifted, BEND * (step % STEPS) / STEPS)
            pose = deformer.solve(handles, start=pose, seconds=1e3).pose

        rows.append((float(nodes), _taken(solve)))
    return rows


def measure_edits() -> Rows:
    """A whole `objectmorpher edit` in a process of its own, its object on half of the photo."""
    rows, mask = [], made_mask(1024)
    photo = made_photo(1024, mask)
    for megapixels in MEGAPIXELS:
        side = round(1000 * megapixels**0.5)
        pixels = cv2.resize(photo, (side, side), interpolation=cv2.INTER_CUBIC)
        with tempfile.TemporaryDirectory() as folder:
            source, made = Path(folder) / "photo.png", Path(folder) / "out.png"
            source.write_bytes(encode_picture(Picture(pixels.astype(np.uint8)), ".png"))
            command = [sys.executable, "-m", "objectmorpher", "edit", str(source), "--subject"]
            start = time.perf_counter()
            subprocess.run([*command, "--turn", "15,0,0", "-o", str(made)], cwd=ROOT, check=True)
            rows.append((megapixels, 1000 * (time.perf_counter() - start)))
    return rows


MEASURES = {"frame": measure_frames, "solve": measure_solves, "edit": measure_edits}


def exponent(rows: Rows) -> float:
    """The slope of the largest `LAST` in logarithms, least squares."""
    count, taken = np.log(np.array(rows[-LAST:])).T
    return float(np.polyfit(count, taken, 1)[0])


def draw_growth(figures: dict[str, Rows], path: Path) -> None:
    """Three plots side by side, both axes logarithmic."""
    canvas = Canvas((PLOT * len(TITLES), HEIGHT))
    for k, name in enumerate(TITLES):
        _draw(canvas, PLOT * k, name, figures[name])
    canvas.save(path)


def _draw(canvas: Canvas, left: float, name: str, rows: Rows) -> None:
    counts, taken = np.log10(np.array(rows)).T
    low, high = np.floor(counts.min() * 2) / 2, np.ceil(counts.max() * 2) / 2
    fast, slow = np.floor(taken.min()), np.ceil(taken.max())
    x0, x1, y0, y1 = left + LEFT, left + PLOT - RIGHT, HEIGHT - BOTTOM, TOP

    def at(count: float, ms: float) -> tuple[float, float]:
        return (
            x0 + (x1 - x0) * (count - low) / (high - low),
            y0 + (y1 - y0) * (ms - fast) / (slow - fast),
        )

    for power in range(int(fast), int(slow) + 1):
        y = at(low, power)[1]
        canvas.line([(x0, y), (x1, y)], PALE, 1)
        canvas.text(x0 - 6, y, f"{10.0**power:,.10g}", "rm")
    for power in range(int(np.ceil(low)), int(np.floor(high)) + 1):
        x = at(power, fast)[0]
        canvas.line([(x, y0), (x, y1)], PALE, 1)
        canvas.text(x, y0 + 16, f"{10.0**power:,.10g}")
    points = [at(c, t) for c, t in zip(counts, taken, strict=True)]
    slope = exponent(rows)
    end = points[-1]
    begin = at(counts[-LAST], taken[-1] - slope * (counts[-1] - counts[-LAST]))
    canvas.line([begin, end], GREY, 6)
    for a, b in pairwise(points):
        canvas.line([a, b], BLUE, 2)
    for x, y in points:
        canvas.box(x - 3, y - 3, x + 3, y + 3, BLUE)
    title, unit = TITLES[name]
    canvas.text(x0, 14, f"{title}: exponent {slope:.2f}", "lm")
    canvas.text(x0, y1 - 12, unit, "lm")


def section() -> str:
    """What docs/performance.md says of it."""
    figures = read()
    slopes = {name: exponent(figures[name]) for name in TITLES}
    return TEXT.format(
        frame=slopes["frame"], solve=slopes["solve"], edit=slopes["edit"],
        frames=_listed(figures["frame"]), solves=_listed(figures["solve"]),
        edits=_listed(figures["edit"]),
    )  # fmt: skip


def _listed(rows: Rows) -> str:
    return ", ".join(f"{count:,.10g}: {ms:,.0f}" for count, ms in rows)


TEXT = """
## Growth: `python docs/rendering/growth.py`

![](rendering/growth.png)

Both axes are logarithmic; the exponent is that of the three largest. Milliseconds of processor
time, of both cores together; an edit's are by the clock, of first runs.

- A frame of the cloud at 1024² grows with the power {frame:.2f} of its Gaussians ({frames}).
- A frame's solve, until nothing moves, with the power {solve:.2f} of its nodes ({solves}).
- An edit with the power {edit:.2f} of its megapixels ({edits}).
"""


def read() -> dict[str, Rows]:
    """The figures that were measured last."""
    found = json.loads((HERE / "growth.json").read_text(encoding="utf-8"))
    return {name: [(count, ms) for count, ms in rows] for name, rows in found.items()}


def main(names: list[str]) -> None:
    """Measures anew what is named, and draws."""
    path = HERE / "growth.json"
    figures = read() if path.exists() else {}
    for name in names:
        figures[name] = MEASURES[name]()
        path.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    if set(figures) == set(TITLES):
        draw_growth(figures, HERE / "growth.png")


if __name__ == "__main__":
    main(sys.argv[1:])
