"""The regions that were painted, and the brush that paints them: each kind has its own hatch."""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2

from objectmorpher_core.base.arrays import F64, I32

from ...editor.intents.rigging import MovedPart
from ...editor.view import BRUSHES, PoseMode
from ..widgets.theme import theme
from .canvas import ACCENT, DARK, WARM, WHITE, CanvasPainter

YELLOW = "#F2B84B"
STEP = 7.0  # points between hatch lines
SPREAD = 0.9  # x the spacing of control points: the disc of each
LEAST = 5.0  # points, of that disc
HATCHES: dict[PoseMode, tuple[tuple[float, ...], str]] = {  # angles of the lines, colour
    PoseMode.FREEZE: ((45.0, -45.0), WHITE),
    PoseMode.STIFFEN: ((0.0,), YELLOW),
    PoseMode.BODY: ((-60.0,), ACCENT),
}


def draw_regions(canvas: CanvasPainter) -> None:
    """On the side that is seen."""
    editor = canvas.editor
    document = editor.document
    assert document is not None
    for region in editor.rigging.regions():
        if region.kind in HATCHES:
            _draw_hatched(canvas, region.kind, region.nodes)
        else:
            _draw_seam(canvas, region)


def draw_brush(canvas: CanvasPainter) -> None:
    """Draw the marks of the stroke in progress, and the brush itself."""
    editor = canvas.editor
    mode, rigging = editor.view.pose.mode, editor.rigging
    if mode in HATCHES and len(rigging.painted):
        _draw_hatched(canvas, mode, rigging.painted)
    if mode in (PoseMode.CUT, PoseMode.GLUE) and len(rigging.drawn) > 1:
        color = WARM if mode is PoseMode.CUT else ACCENT
        places = canvas.at(rigging.drawn)
        if mode is PoseMode.GLUE:
            canvas.line(places[0], places[-1], color)
        else:
            canvas.polyline(places, color, is_closed=False)
    if mode in BRUSHES or mode is PoseMode.GLUE:
        canvas.brush()


def _visible(canvas: CanvasPainter, nodes: I32) -> F64:
    """Where these control points are seen, (n, 2) window units; those behind are left out."""
    editor = canvas.editor
    assert editor.document is not None
    seen = editor.cache.facts.seen(editor.document, editor.current)
    picture = editor.derived.control_points(editor.document, editor.current)
    xy = editor.view.canvas_from_image(picture[nodes[seen[nodes]]])
    return xy / canvas.ratio + (canvas.rect.x, canvas.rect.y)


def _draw_hatched(canvas: CanvasPainter, kind: PoseMode, nodes: I32) -> None:
    editor = canvas.editor
    assert editor.document is not None
    spacing = editor.cache.facts.spacing(editor.document, editor.current)
    radius = max(SPREAD * spacing * editor.view.zoom / canvas.ratio, theme.pt(LEAST))
    places = _visible(canvas, nodes)
    angles, color = HATCHES[kind]
    dark, light = theme.u32(DARK, 0.45), theme.u32(color, 0.85)
    for angle in angles:
        ends = hatch(places, radius, angle, theme.pt(STEP))
        lines = [(ImVec2(*a), ImVec2(*b)) for a, b in ends.tolist()]
        for start, end in lines:
            canvas.draw.add_line(start, end, dark, 3.0 * theme.scale)
        for start, end in lines:
            canvas.draw.add_line(start, end, light, 1.2 * theme.scale)


def _draw_seam(canvas: CanvasPainter, region: MovedPart) -> None:
    """A cut: crosses along it; glue: lines from side to side."""
    rigging = canvas.editor.rigging
    seam = rigging.rig.seams[region.seam]
    first, second = _visible(canvas, seam.first), _visible(canvas, seam.second)
    if len(first) == 0 or len(second) == 0:
        return
    gaps = np.linalg.norm(first[:, None] - second[None], axis=2)
    if seam.is_glued:
        for a, b in zip(first, second[gaps.argmin(1)], strict=True):
            canvas.line(ImVec2(*a), ImVec2(*b), ACCENT, width=1.2)
        return
    # The cut itself runs midway between two points that are nearest to each other across it.
    there, back = gaps.argmin(1), gaps.argmin(0)
    middles = 0.5 * (first + second[there])
    near = back[there] == np.arange(len(first))
    arm = theme.pt(3)
    for x, y in middles[near].tolist():
        canvas.line(ImVec2(x - arm, y - arm), ImVec2(x + arm, y + arm), WARM)
        canvas.line(ImVec2(x - arm, y + arm), ImVec2(x + arm, y - arm), WARM)


# Hatch lines over a region that is the union of equal discs.


def hatch(centres: F64, radius: float, angle: float, step: float) -> F64:
    """Lines (S, 2, 2) px at `angle` degrees, `step` px apart, within discs around (N, 2) px.

    The lines lie on one grid for the whole picture, so that those of neighbouring discs join.
    """
    if len(centres) == 0:
        return np.empty((0, 2, 2))
    along = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    across = np.array([-along[1], along[0]])
    u, v = centres @ along, centres @ across
    first = np.ceil((v - radius) / step).astype(int)
    last = np.floor((v + radius) / step).astype(int)
    disc = np.repeat(np.arange(len(centres)), last - first + 1)
    line = np.concatenate([np.arange(a, b + 1) for a, b in zip(first, last, strict=True)])
    half = np.sqrt(np.maximum(radius**2 - (line * step - v[disc]) ** 2, 0.0))
    low, high = u[disc] - half, u[disc] + half
    order = np.lexsort((low, line))
    line, low, high = line[order], low[order], high[order]
    pieces: list[list[float]] = []
    for row, start, end in zip(line.tolist(), low.tolist(), high.tolist(), strict=True):
        if pieces and pieces[-1][0] == row and start <= pieces[-1][2]:
            pieces[-1][2] = max(pieces[-1][2], end)
        else:
            pieces.append([row, start, end])
    rows = np.array(pieces)
    ends = rows[:, 1:, None] * along + (rows[:, :1, None] * step) * across
    return ends.astype(np.float64)
