"""`objectmorpher bench pipeline`: the whole edit, stage by stage, with the embedded defaults.

Every photo is edited in a process of its own. Its first run is what `objectmorpher edit` costs:
networks are opened and kernels loaded in the stages that need them. The runs after it are what
they cost where both are at hand, as in the window.
"""

from __future__ import annotations

import multiprocessing
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

SAMPLE = "assets/samples/coffee.jpg"
SAMPLE_CLICK = (280.0, 150.0)  # px, on its cup
ENLARGED = 2.1  # x the sample photo's sides: 1.06 megapixels
MADE = 1024  # px, sides of the made photo, half of which is its object
TURN = (18.0, 0.0, 0.0)  # degrees, as the first start of the program turns the cup
PHOTOS = ("sample", "enlarged", "made")
AGAIN = 3  # runs after the first: the median of each stage is reported
Row = dict[str, Any]


@dataclass(frozen=True, eq=False)
class BenchCase:
    """A photo, the bytes of its file, and where it is clicked, in px."""

    name: str
    data: bytes
    click: tuple[float, float]


def bench_pipeline(is_quick: bool) -> list[Row]:
    """The first run and the later ones with every photo; quick: with the sample photo, twice."""
    rows: list[Row] = []
    for name in PHOTOS[:1] if is_quick else PHOTOS:
        case, context = _case(name), multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(1, context) as alone:
            rows += alone.submit(_rows, case, 1 if is_quick else AGAIN, time.time()).result()
    return rows


def _case(name: str) -> BenchCase:
    from objectmorpher.system.resources import resource
    from objectmorpher_core.pictures.image import Picture, encode_picture, read_picture, resized

    from .scenes import made_mask, made_photo

    data, (x, y) = resource(SAMPLE).read_bytes(), SAMPLE_CLICK
    if name == "sample":
        return BenchCase(name, data, (x, y))
    if name == "made":
        pixels = made_photo(MADE, made_mask(MADE))
        return BenchCase(name, encode_picture(Picture(pixels), ".png"), (MADE / 2, MADE / 2))
    pixels = read_picture(data).pixels
    height, width = (round(ENLARGED * n) for n in pixels.shape[:2])
    large = Picture(resized(pixels, width, height))
    return BenchCase(name, encode_picture(large, ".png"), (ENLARGED * x, ENLARGED * y))


def _rows(case: BenchCase, again: int, asked: float) -> list[Row]:
    """The rows of one photo, in this process; it was `asked` for then, s since 1970."""
    from objectmorpher_core.pictures.image import encode_picture
    from objectmorpher_core.pipeline import run_script
    from objectmorpher_core.scripting.options import EditScript

    start, reports = time.time() - asked, []
    script = EditScript(click=(case.click,), turn=TURN)
    for _ in range(1 + again):
        edited = run_script(case.data, case.name, script)
        with edited.stopwatch.stage("save"):
            encode_picture(edited.picture, ".png")
        reports.append(edited.report())
    first, *later = reports
    return [
        _row(case.name, "first", [first]) | {"start_s": round(start, 3)},
        _row(case.name, "again", later),
    ]


def _row(name: str, run: str, reports: list[dict[str, Any]]) -> Row:
    """What `edit --report` tells, its seconds the medians of these runs."""
    told = reports[-1]
    stages = told["seconds"]
    return {
        "photo": name,
        "run": run,
        **told["photo"],
        **told["backends"],
        "mask_area_px": told["object"]["mask_area_px"],
        "gaussians": told["object"]["gaussians"],
        "seconds": {s: round(float(np.median([r["seconds"][s] for r in reports])), 4)
                    for s in stages},
        "peak_memory_mb": told["peak_memory_mb"],
    }  # fmt: skip
