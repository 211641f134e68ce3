"""A report: one HTML file with the tables and the pictures of a run, complete in itself."""

from __future__ import annotations

import base64
import html
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from objectmorpher_core.base.arrays import RGB
from objectmorpher_core.pictures.image import Picture, encode_picture, read_picture

from .methods import EditMethod
from .running import CaseRow
from .scores import FIGURES
from .tables import COSTS, TruthTable, interval, short

MEANINGS = {
    "psnr": "PSNR inside the edit region, dB; higher is better",
    "dinov2": "dinov2-perceptual inside the edit region; lower is better",
    "ssim": "SSIM inside the edit region; higher is better",
    "iou": "overlap of the thing's coverage with the true one; higher is better",
    "reach": "px from where the guidance's points must be; lower is better",
    "outside": "PSNR outside the region, dB; 60 is equal to the last bit",
    "changed": "share of the pixels outside that differ from the photo",
    "seconds": "seconds beyond the lift and the plate, which all share",
    "cpu": "the same of all cores together",
    "memory": "MiB that the process held at most",
}
SHOWN = 190  # px, width of a picture
MARGIN = 12  # px about the region
QUALITY = 82
STYLE = """body{font:14px sans-serif;margin:24px;color:#222}table{border-collapse:collapse;
margin:6px 0 22px}td,th{padding:3px 9px;text-align:right;border-bottom:1px solid #ddd}
td:first-child,th:first-child{text-align:left}
small{color:#777;display:block}
figure{display:inline-block;margin:3px;font-size:12px;text-align:center}
figcaption{max-width:190px}h3{margin:18px 0 2px}"""


def report(
    folder: Path, rows: Sequence[CaseRow], table: TruthTable, methods: Mapping[str, EditMethod]
) -> str:
    """The page."""
    parts = [f"<!doctype html><meta charset='utf-8'><title>Truth</title><style>{STYLE}</style>"]
    cases = len({row.case for row in rows})
    parts.append(f"<h1>Edits with a known result: {cases} cases</h1><ul>")
    parts += [
        f"<li><i>{html.escape(name)}</i>: {html.escape(methods[name].told)}</li>"
        for name in table.methods
    ]
    parts.append("</ul><p>Means, with the middle 95 % of 10,000 bootstrap means.</p>")
    for figure in dict.fromkeys((*MEANINGS, *FIGURES, *COSTS)):
        parts.append(_table(table, figure))
    parts.append("<h2>Cases</h2>")
    for case in dict.fromkeys(row.case for row in rows):
        parts.append(_case(folder / "cases" / case, [row for row in rows if row.case == case]))
    return "\n".join(parts)


def _table(table: TruthTable, figure: str) -> str:
    head = "".join(f"<th>{html.escape(c)}</th>" for c in table.categories)
    lines = [f"<h3>{html.escape(MEANINGS.get(figure, figure))}</h3><table><tr><th></th>{head}</tr>"]
    for name in table.methods:
        cells = []
        for category in table.categories:
            cell = table.cells.get((category, name, figure))
            cells.append(f"<td>{short(cell, figure)}<small>{interval(cell, figure)}</small></td>")
        lines.append(f"<tr><td>{html.escape(name)}</td>{''.join(cells)}</tr>")
    return "".join(lines) + "</table>"


def _case(home: Path, rows: Sequence[CaseRow]) -> str:
    region = _picture(home / "region.png")
    captions = {"photo": "photo", "truth": "truth"}
    captions |= {
        row.method: f"{row.method}: {row.score.psnr:.1f} dB, {row.score.dinov2:.3f}" for row in rows
    }
    figures = []
    for name, caption in captions.items():
        path = home / f"{name}.png"
        if path.exists():
            data = base64.b64encode(_shown(_picture(path), region)).decode()
            figures.append(
                f"<figure><img width='{SHOWN}' src='data:image/jpeg;base64,{data}'>"
                f"<figcaption>{html.escape(caption)}</figcaption></figure>"
            )
    return f"<h3>{html.escape(home.name)}</h3>{''.join(figures)}"


@lru_cache(maxsize=4)
def _picture(path: Path) -> RGB:
    return np.asarray(read_picture(path.read_bytes()).pixels, np.uint8)


def _shown(picture: RGB, region: RGB) -> bytes:
    """JPEG of what surrounds the region."""
    inside = region.reshape(*region.shape[:2], -1)[..., 0] > 0
    rows, columns = np.flatnonzero(inside.any(1)), np.flatnonzero(inside.any(0))
    top, left = max(int(rows[0]) - MARGIN, 0), max(int(columns[0]) - MARGIN, 0)
    part = picture[top : int(rows[-1]) + MARGIN, left : int(columns[-1]) + MARGIN]
    scale = SHOWN / part.shape[1]
    size = (SHOWN, max(round(part.shape[0] * scale), 1))
    small = cv2.resize(part, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC)
    return encode_picture(Picture(np.asarray(small, np.uint8)), ".jpg", QUALITY)
