"""Handles, pins, anchors, and the control points that they move."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from imgui_bundle import ImVec2, ImVec4, imgui

from objectmorpher_core.base.arrays import F64, I32
from objectmorpher_core.document.model import EditObject

from ...editor.intents.rigging import MovedPart
from ...editor.view import BRUSHES, PoseMode
from ...tools.pose_tool import RING, RING_PART
from ..widgets.panes import fades
from ..widgets.theme import theme
from ..window.landmarks import mark_on_canvas
from .canvas import ACCENT, DARK, WARM, WHITE, CanvasPainter
from .select import draw_other, draw_rubber

MAX_LINKED = 3  # links drawn from each control point
APART = 11.0  # points between two marks of anchors, or two control points
HINTS_APART = 14.0  # points between the dots that say: here is something to drag
MOVES = 0.02  # of the handle's way: what follows less is not marked
COLD, HOT = np.array([0.27, 0.42, 0.82]), np.array([1.0, 0.86, 0.2])  # of the influence


def draw_pose(canvas: CanvasPainter) -> None:
    """Draw the Pose tool's handles."""
    editor = canvas.editor
    document, thing = editor.document, editor.object
    if document is None or thing is None or thing.lifted is None:
        return
    pose, is_dragging = editor.view.pose, editor.view.pose.mode is PoseMode.DRAG
    if editor.posing.mirroring.is_on:
        _draw_mirror(canvas)
    if pose.has_influence and editor.posing.handle is not None:
        _draw_influence(canvas, editor.posing.handle)
    if pose.has_regions or not is_dragging:
        draw_regions(canvas)
    is_free = is_dragging and not thing.is_locked and thing.is_visible
    is_hinting = is_free and not thing.handles and editor.hover.surface is None
    hinting, share = fades.shown("hint points", thing.lifted if is_hinting else None)
    if hinting is thing.lifted:
        _draw_hint_points(canvas, share)
    if thing.handles and thing.is_visible:
        _draw_handles(canvas, thing)
    if not is_dragging:
        draw_brush(canvas)
    draw_other(canvas)
    if editor.hover.surface is not None and not editor.hand.is_busy:
        _draw_surface_point(canvas)
    if editor.rubber is not None:
        draw_rubber(canvas)


def _draw_handles(canvas: CanvasPainter, thing: EditObject) -> None:
    """Anchors, how far the points went, the handles, the ring."""
    editor = canvas.editor
    document = editor.opened
    pose = editor.view.pose
    if pose.has_anchors:
        anchors = editor.derived.anchors(document, editor.current)
        canvas.hollow_diamonds(_apart(canvas.on_photo(anchors)), 4)
    rests = np.array([h.point for h in thing.handles])
    starts = canvas.at(editor.derived.project(document, editor.current, rests))
    ends = canvas.at(editor.posing.positions())
    for start, end in zip(starts, ends, strict=True):
        _draw_pull(canvas, start, end)
    current = editor.posing.handle
    if current is not None and pose.has_ring and pose.mode is PoseMode.DRAG:
        draw_ring(canvas, ends[current])
    for h, end in enumerate(ends):
        is_hovered = h == editor.hover.handle
        is_selected = h in editor.posing.selected
        _draw_handle(canvas, end, thing.handles[h].is_pin, is_selected, is_hovered)
        mark_on_canvas(f"Handle {h + 1}", end, end)


def _apart(places: list[ImVec2], points: float = APART) -> list[ImVec2]:
    """As many of them as are so many points apart: a small object they would cover."""
    least = theme.pt(points)
    cells = dict[tuple[int, int], ImVec2]()  # of that size: no two of one are apart
    for at in places:
        i, j = int(at.x // least), int(at.y // least)
        if (i, j) in cells:
            continue
        near = [cells[cell] for cell in _around(i, j) if cell in cells]
        if all(math.hypot(at.x - n.x, at.y - n.y) >= least for n in near):
            cells[i, j] = at
    return list(cells.values())


def _around(i: int, j: int) -> tuple[tuple[int, int], ...]:
    return (
        (i - 1, j - 1), (i - 1, j), (i - 1, j + 1), (i, j - 1),
        (i, j + 1), (i + 1, j - 1), (i + 1, j), (i + 1, j + 1),
    )  # fmt: skip


def _draw_mirror(canvas: CanvasPainter) -> None:
    """Where the mirror plane meets the object."""
    way = canvas.editor.posing.mirroring.outline()
    if len(way) > 1:
        canvas.dashes(canvas.at(way), WHITE, is_closed=False)


def _draw_influence(canvas: CanvasPainter, handle: int) -> None:
    """How much each control point goes along: larger and warmer dots."""
    editor = canvas.editor
    shares = editor.cache.facts.influence(editor.opened, editor.current, handle)
    shown = editor.cache.facts.seen(editor.opened, editor.current) & (shares >= MOVES)
    picture = editor.derived.control_points(editor.opened, editor.current)
    shown &= ((picture >= 0) & (picture <= editor.opened.photo.size)).all(1)
    places = canvas.at(picture[shown])
    for at, share in zip(places, np.clip(shares[shown], 0, 1).tolist(), strict=True):
        r, g, b = ((1 - share) * COLD + share * HOT).tolist()
        color = imgui.color_convert_float4_to_u32(ImVec4(r, g, b, 0.85))
        radius = theme.scale * (1.2 + 3.0 * share)
        canvas.draw.add_circle_filled(at, radius + theme.scale, theme.u32(DARK, 0.4), 12)
        canvas.draw.add_circle_filled(at, radius, color, 12)


def draw_control_points(canvas: CanvasPainter) -> None:
    """The control points and their strongest links."""
    editor = canvas.editor
    links = editor.derived.links(editor.opened, editor.current, MAX_LINKED)
    is_there = ((links >= 0) & (links <= editor.opened.photo.size)).all((1, 2))
    ends = canvas.at(links[is_there].reshape(-1, 2))
    dark, white = theme.u32(DARK, 0.25), theme.u32(WHITE, 0.4)
    for start, end in zip(ends[::2], ends[1::2], strict=True):
        canvas.draw.add_line(start, end, dark, 2.5)
        canvas.draw.add_line(start, end, white, 1.0)
    places = canvas.on_photo(editor.derived.control_points(editor.opened, editor.current))
    for at in _apart(places):
        canvas.dot(at, 1.8, alpha=0.8)


def _draw_hint_points(canvas: CanvasPainter, share: float) -> None:
    """The control points, quietly, while there is no handle: here is something to drag."""
    editor = canvas.editor
    places = canvas.on_photo(editor.derived.control_points(editor.opened, editor.current))
    for at in _apart(places, HINTS_APART):
        canvas.dot(at, 1.7, alpha=0.9 * share)


def _draw_surface_point(canvas: CanvasPainter) -> None:
    """Where a click would take the surface."""
    editor = canvas.editor
    surface = editor.hover.surface
    assert surface is not None
    at = canvas.at(editor.opened.photo.camera.project(surface.world))[0]
    if editor.hover.is_pin:
        canvas.diamond(at, 7, WHITE, 0.75)
        return
    canvas.ring(at, 7, ACCENT)
    canvas.draw.add_circle_filled(at, theme.pt(1.6), theme.u32(WHITE))


def _draw_pull(canvas: CanvasPainter, start: ImVec2, end: ImVec2) -> None:
    """From where the point was in the photo to where it must be."""
    if np.hypot(end.x - start.x, end.y - start.y) < theme.pt(3):
        return
    canvas.line(start, end, WHITE)
    canvas.draw.add_circle_filled(start, theme.pt(3), theme.u32(DARK, 0.7))
    canvas.draw.add_circle_filled(start, theme.pt(2), theme.u32(WHITE))


def _draw_handle(
    canvas: CanvasPainter, at: ImVec2, is_pin: bool, is_selected: bool, is_hovered: bool
) -> None:
    if is_selected:
        canvas.ring(at, 12, ACCENT)
    grow = 1.0 if is_hovered else 0.0
    if is_pin:
        canvas.diamond(at, 8 + grow, WHITE)
    else:
        canvas.disc(at, 5.5 + grow, ACCENT)


# The ring around the current handle: how it is turned, and how far it went in depth.

SCALE = 60.0  # points that the tick goes per object diameter of depth
FARTHEST = 0.4  # diameters that the scale shows
LEAST_DEPTH = 0.015  # diameters: less shows no scale
TICK = 5.0  # points, half the tick's width


def draw_ring(canvas: CanvasPainter, at: ImVec2) -> None:
    """Around the handle at a window position."""
    editor = canvas.editor
    numbers = editor.handle_numbers.read()
    if numbers is None:
        return
    is_taken = editor.hover.part == RING_PART or bool(editor.posing.readout)
    radius = theme.pt(RING)
    canvas.draw.add_circle(at, radius, theme.u32(DARK, 0.5), 64, theme.pt(4))
    role = ACCENT if is_taken else WHITE
    canvas.draw.add_circle(at, radius, theme.u32(role, 0.9), 64, theme.pt(1.5))
    _draw_arc(canvas, at, numbers.turn)
    if abs(numbers.depth) > LEAST_DEPTH:
        _draw_depth(canvas, at, numbers.depth)
    if editor.posing.readout:
        canvas.label(editor.posing.readout, at.x, at.y - radius - theme.pt(36), side=0.5)


def _draw_arc(canvas: CanvasPainter, at: ImVec2, turn: float) -> None:
    """From the top, clockwise, as far as the handle is turned."""
    radius = theme.pt(RING)
    end = np.radians(np.clip(turn, -360, 360))
    angles = np.linspace(0, end, max(int(abs(np.degrees(end)) / 4), 1) + 1)
    xy = np.column_stack([at.x + radius * np.sin(angles), at.y - radius * np.cos(angles)])
    if abs(turn) > 0.5:
        places: list[Any] = [ImVec2(x, y) for x, y in xy.tolist()]
        canvas.draw.add_polyline(places, theme.u32(ACCENT), theme.pt(4), 0)
    knob = ImVec2(*xy[-1])
    canvas.draw.add_circle_filled(knob, theme.pt(5.5), theme.u32(DARK, 0.8))
    canvas.draw.add_circle_filled(knob, theme.pt(4), theme.u32(WHITE))


def _draw_depth(canvas: CanvasPainter, at: ImVec2, depth: float) -> None:
    """A scale at the right: up is farther away."""
    x = at.x + theme.pt(RING + 10)
    reach = theme.pt(SCALE * FARTHEST)
    canvas.line(ImVec2(x, at.y - reach), ImVec2(x, at.y + reach), WHITE, width=1.0, alpha=0.6)
    y = at.y - theme.pt(SCALE * float(np.clip(depth, -FARTHEST, FARTHEST)))
    half = theme.pt(TICK)
    rest = theme.pt(3)
    canvas.line(ImVec2(x - rest, at.y), ImVec2(x + rest, at.y), WHITE, width=1.0, alpha=0.6)
    canvas.line(ImVec2(x - half, y), ImVec2(x + half, y), ACCENT, width=2.5, alpha=1.0)


# The regions that were painted, and the brush that paints them: each kind has its own hatch.

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
    for region in canvas.editor.rigging.regions():
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
    seen = editor.cache.facts.seen(editor.opened, editor.current)
    picture = editor.derived.control_points(editor.opened, editor.current)
    xy = editor.view.canvas_from_image(picture[nodes[seen[nodes]]])
    return xy / canvas.ratio + (canvas.rect.x, canvas.rect.y)


def _draw_hatched(canvas: CanvasPainter, kind: PoseMode, nodes: I32) -> None:
    editor = canvas.editor
    spacing = editor.cache.facts.spacing(editor.opened, editor.current)
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
