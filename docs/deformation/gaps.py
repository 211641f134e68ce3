"""Links across gaps, and what comes of them when one part is dragged."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from methods import OURS, PAPERS_LINKS, Handles
from models import Gap
from panels import BLUE, RED, Dots, Lines, Panel, draw_figure, posed

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.deform.binding import bind
from objectmorpher_core.deform.deformer import Deformer
from objectmorpher_core.deform.graph import LINK_RADIUS, ControlGraph
from objectmorpher_core.deform.skinning import Skinned
from objectmorpher_core.document.model import Handle
from objectmorpher_core.document.settings import DeformSettings

DRAG = 0.2  # x diameter
PIN_DOT, LINE = 4.0, 0.6  # px
MOST_LINES = 250  # of the false links are drawn


@dataclass(frozen=True, eq=False)
class GapRow:
    """A gap under one rule."""

    name: str
    false_links: int
    links: int
    parts: int  # components of the graph
    bound: int  # vertices that follow a control point of another part most
    carried: float  # % of the drag, the farthest that another part moves


@dataclass(frozen=True, eq=False)
class Dragged:
    row: GapRow
    panel: Panel


def false_links(gap: Gap, graph: ControlGraph) -> np.ndarray:
    """(E, 2) control points of two parts, though the surface between them is long.

    Longer than the paper's own limit for a link, 0.3 diameters.
    """
    points = gap.model.lifted.control_points.astype(np.float64)
    part, way = gap.parts(points)
    links = graph.weights.tocoo()
    i, j = links.row, links.col
    is_between = (i < j) & (part[i] != part[j]) & (part[i] >= 0) & (part[j] >= 0)
    is_false = is_between & (way[i] + way[j] > LINK_RADIUS * gap.model.lifted.diameter)
    return np.column_stack([i, j])[is_false]


def gap_handles(gap: Gap) -> Handles:
    move = DRAG * gap.model.lifted.diameter * gap.way
    moved = gap.model.handles(*gap.moved, motion=lambda p: p + move)
    taken = {h.control_point for h in moved}
    pins = (h for h in gap.model.handles(*gap.pinned) if h.control_point not in taken)
    return (*moved, *pins)


def drag(gap: Gap, name: str, deformer: Deformer) -> Dragged:
    """One part is dragged, under the deformer's links."""
    model, handles = gap.model, gap_handles(gap)
    pose = deformer.solve(handles).pose
    skinned = deformer.skin_points(model.mesh.points, pose)
    part, way = gap.parts(model.mesh.points)
    own = gap.parts(np.array([h.point for h in handles if not h.is_pin]))[0]
    is_other = (part >= 0) & ~np.isin(part, own)
    if gap.is_joined_twice:  # what is near a joint is carried along by right
        is_other &= way > 0.1 * model.lifted.diameter
    moved = np.linalg.norm(skinned.points - model.mesh.points, axis=1)[is_other]
    carried = 100 * moved.max() / (DRAG * model.lifted.diameter)
    row = GapRow(name, len(false_links(gap, deformer.graph)), deformer.graph.link_count,
                 deformer.graph.component_count, bound_across(gap, deformer),
                 float(carried))  # fmt: skip
    splats = posed(model, skinned, model.mesh.normals(skinned.points))
    return Dragged(
        row, Panel(f"Dragged, {name[0].lower()}{name[1:]}", model, splats, handle_marks(handles))
    )


def bound_across(gap: Gap, deformer: Deformer) -> int:
    """How many vertices are moved most by a control point of another part.

    Where the parts join they may be: there it does no harm.
    """
    part, way = gap.parts(gap.model.mesh.points)
    nearest = bind(gap.model.mesh.points, deformer.points, deformer.graph).control_points[:, 0]
    nodes = gap.parts(deformer.points)[0][nearest]
    is_far = way > 0.1 * gap.model.lifted.diameter
    return int(((part >= 0) & (nodes >= 0) & (part != nodes) & is_far).sum())


def handle_marks(handles: Handles) -> tuple[Dots, ...]:
    """Red where something is dragged to, blue where it is pinned."""
    marks = []
    for color, is_pin in ((BLUE, True), (RED, False)):
        chosen: list[Handle] = [h for h in handles if h.is_pin == is_pin]
        if chosen:
            marks.append(Dots(np.array([h.target for h in chosen]), color, PIN_DOT))
    return tuple(marks)


def compare_gap(gap: Gap, path: Path, width: int) -> list[GapRow]:
    """Draws the three panels, and gives a row for each rule."""
    model = gap.model
    papers = PAPERS_LINKS.build(model.lifted)
    euclidean = Deformer(model.lifted, DeformSettings(links="euclidean"))
    dragged = [drag(gap, "Euclidean links", euclidean),
               drag(gap, "The paper's links", papers),
               drag(gap, "Our links", OURS.build(model.lifted))]  # fmt: skip
    rest = Skinned(model.mesh.points, np.broadcast_to(np.eye(3), (len(model.mesh.points), 3, 3)))
    links = false_links(gap, papers.graph)
    shown = np.random.default_rng(0).permutation(len(links))[:MOST_LINES]
    first, second = links[shown].T
    points: F64 = papers.points
    lines = Lines(points[first], points[second], RED, LINE)
    splats = posed(model, rest, model.mesh.normals(model.mesh.points))
    label = f"{len(shown)} of {len(links):,} false links"
    draw_figure(
        path, [Panel(label, model, splats, (lines,)), *(d.panel for d in dragged[1:])], width
    )
    return [d.row for d in dragged]
