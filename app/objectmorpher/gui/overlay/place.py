"""The gizmo of the whole object: frame, rings, arrow, and the ground's horizon."""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2, imgui

from objectmorpher_core.base.rotations import turn_matrix, vector_from_matrix
from objectmorpher_core.document.model import Placement

from ...editor.intents.placing import Placing
from ...system.texts import t
from ...tools.gizmo import TURNS, Arrow, Gizmo, Ring, ghost, gizmo
from ..widgets.theme import theme
from ..window.landmarks import mark_on_canvas
from .canvas import ACCENT, DARK, WHITE, CanvasPainter
from .select import draw_other

MARKED = {"yaw": 3.8, "pitch": -0.9, "roll": 3.9}  # rad, on the front of each ring, off the others
PIECES = 96  # of a ring
COLOURS = {"yaw": "#70A020", "pitch": "#F08080", "roll": WHITE}
SHAFT = 5.0  # points, half the arrow's width at its near end
HEAD = 11.0  # points, length of the arrow's heads
BESIDE = (18.0, 14.0)  # points from the pointer to the value
BELOW = 22.0  # points from there to how far the object is to be believed
TRUST = {"fine": "#70A020", "look closely": "#E0A030", "guesswork": "#E05040"}


def draw_frame(canvas: CanvasPainter) -> None:
    """Draw the Place tool's frame; a locked or hidden object has none."""
    editor = canvas.editor
    shown = gizmo(editor)
    if shown is None or editor.object is None:
        return
    part = editor.hover.part
    draw_other(canvas)
    if editor.object.is_locked or not editor.object.is_visible:
        return
    for line in ghost(editor):
        canvas.dashes(canvas.at(line), WHITE)
    if shown.horizon is not None:
        _draw_horizon(canvas, shown.horizon, part == "horizon")
    corners = canvas.on_canvas(shown.corners)
    canvas.polyline(corners, WHITE, width=1.0, alpha=0.5)
    names = [name for name in TURNS if part == name or not editor.hand.is_busy]
    for is_front in (False, True):
        for name in names:
            _draw_ring(canvas, shown, name, ACCENT if part == name else COLOURS[name], is_front)
    if part == "depth" or not editor.hand.is_busy:  # what is not dragged is out of the way
        _draw_arrow(canvas, shown.arrow, ACCENT if part == "depth" else WHITE)
    for corner in corners:
        canvas.square(corner, 5, ACCENT if part == "scale" else WHITE)
    _draw_centre(canvas, shown)
    for name, ring in shown.rings.items():
        at = canvas.on_canvas(ring.seen(np.array([MARKED[name]])))[0]
        mark_on_canvas(f"Ring: {name}", at, at)
    _draw_value(canvas, part)


def _runs(ring: Ring, is_wanted: bool) -> list[np.ndarray]:
    """The angles of those parts of a ring that are in front, or of those that are not."""
    angles = np.linspace(0, 2 * np.pi, PIECES + 1)
    middles = (angles[1:] + angles[:-1]) / 2
    chosen = ring.is_front(middles) == is_wanted
    if chosen.all():
        return [angles]
    first = int(np.flatnonzero(chosen & ~np.roll(chosen, 1))[0]) if chosen.any() else 0
    count = int(chosen.sum())
    return [angles[first] + (angles[1] - angles[0]) * np.arange(count + 1)] if count else []


def _draw_ring(canvas: CanvasPainter, shown: Gizmo, name: str, color: str, is_front: bool) -> None:
    """Its front, or the thinner back."""
    width, alpha = (2.0, 1.0) if is_front else (1.0, 0.5)
    for angles in _runs(shown.rings[name], is_front):
        for points in _around(shown, shown.rings[name].seen(angles)):
            canvas.polyline(canvas.on_canvas(points), color, width, is_closed=False, alpha=alpha)


def _around(shown: Gizmo, points: np.ndarray) -> list[np.ndarray]:
    """The pieces of a line (N, 2) canvas px that do not run over a small object."""
    is_outside = np.linalg.norm(points - shown.centre, axis=1) >= shown.hole
    ends = np.flatnonzero(np.diff(is_outside)) + 1
    pieces = zip(np.split(points, ends), np.split(is_outside, ends), strict=True)
    return [piece for piece, outside in pieces if outside[0] and len(piece) > 1]


def _draw_arrow(canvas: CanvasPainter, arrow: Arrow, color: str) -> None:
    """Its sides run towards the centre, as those of a road to where it vanishes."""
    scale = canvas.editor.view.scale
    slope, head = SHAFT * scale / arrow.near, HEAD * scale
    near, far = arrow.near - head, arrow.far + head

    def across(distance: float, share: float) -> np.ndarray:
        return arrow.at(distance) + np.array([share * slope * distance, 0.0])

    pieces = (
        [across(near, -0.5), across(near, 0.5), across(far, 0.5), across(far, -0.5)],
        [across(near, -1.6), across(near, 1.6), arrow.at(arrow.near)],
        [across(far, -1.6), arrow.at(arrow.far), across(far, 1.6)],
    )
    closed = int(imgui.ImDrawFlags_.closed)
    shapes = [canvas.on_canvas(np.array(piece)) for piece in pieces]
    for shape in shapes:
        canvas.draw.add_polyline(shape, theme.u32(DARK, 0.75), theme.pt(3), closed)
    for shape in shapes:
        canvas.draw.add_convex_poly_filled(shape, theme.u32(color))


def _draw_horizon(canvas: CanvasPainter, row: float, is_hovered: bool) -> None:
    """A dashed line from edge to edge, with its name and a grip."""
    width = float(canvas.editor.view.width)
    start, end = canvas.on_canvas(np.array([[0.0, row], [width, row]]))
    color = ACCENT if is_hovered else WHITE
    canvas.dashes([start, end], color, is_closed=False, on=9.0)
    canvas.disc(ImVec2(end.x - theme.pt(24), end.y), 5, color)
    canvas.label(t("Horizon"), start.x + theme.pt(12), start.y + theme.pt(6))


def _draw_centre(canvas: CanvasPainter, shown: Gizmo) -> None:
    centre, arm = canvas.on_canvas(shown.centre)[0], theme.pt(6)
    for dx, dy in ((arm, 0.0), (0.0, arm)):
        a, b = ImVec2(centre.x - dx, centre.y - dy), ImVec2(centre.x + dx, centre.y + dy)
        canvas.line(a, b, WHITE, alpha=1.0)


def _draw_value(canvas: CanvasPainter, part: str | None) -> None:
    """Beside the pointer: what a drag has come to, or what a ring turns."""
    editor = canvas.editor
    placement, pointer = editor.placing.placement, editor.pointer
    if placement is None or pointer is None or part is None:
        return
    if editor.hand.is_busy:
        text = _value(part, placement, editor.placing)
        before = editor.committed
        if part == "ball" and before is not None and editor.current < len(before.objects):
            text = f"{_angle(before.objects[editor.current].placement, placement):.0f}°"
    else:
        text = {"yaw": t("Yaw"), "pitch": t("Pitch"), "roll": t("Roll")}.get(part, "")
    if text:
        at, rect = canvas.on_canvas(pointer.xy)[0], canvas.rect
        is_turned = editor.hand.is_busy and part in (*TURNS, "turn", "ball")
        lines = BELOW * (2 if is_turned else 1)
        y = min(at.y + theme.pt(BESIDE[1]), rect.y + rect.height - theme.pt(lines + 2))
        canvas.label(text, at.x + theme.pt(BESIDE[0]), y)
        if is_turned:
            _draw_trust(canvas, at.x + theme.pt(BESIDE[0]), max(y, rect.y) + theme.pt(BELOW))


def _draw_trust(canvas: CanvasPainter, x: float, y: float) -> None:
    """Below the value, at a window position: how far the turned object is to be believed."""
    from objectmorpher_core.raster.trust import trust_in

    editor = canvas.editor
    sign = trust_in(editor.derived.draft(editor.opened, editor.current)).sign
    words = {"fine": t("Fine"), "look closely": t("Look closely"), "guesswork": t("Guesswork")}
    canvas.label(words[sign], x, y, dot=TRUST[sign])


def _value(part: str, placement: Placement, placing: Placing) -> str:
    yaw, pitch, roll = placing.angles
    away = t("{away} away", away=f"{placement.depth:+.2f} ×")
    values = {
        "move": f"{round(placement.move[0]):+d}, {round(placement.move[1]):+d} px",
        "depth": away,
        "scale": f"{100 * placement.scale:.0f} %",
        "yaw": f"{t('Yaw')} {yaw:.1f}°",
        "pitch": f"{t('Pitch')} {pitch:.1f}°",
        "roll": f"{t('Roll')} {roll:.1f}°",
        "ball": "",
        "turn": f"{t('Yaw')} {yaw:.0f}°  {t('Pitch')} {pitch:.0f}°",
        "horizon": f"{placing.horizon:.0f} px",
    }
    is_deeper = part == "move" and placement.depth != 0
    return f"{values[part]}  ·  {away}" if is_deeper else values[part]


def _angle(before: Placement, now: Placement) -> float:
    """Degrees by which an object was turned, about whatever axis."""
    both = turn_matrix(*now.turn) @ turn_matrix(*before.turn).T
    return float(np.degrees(np.linalg.norm(vector_from_matrix(both))))
