"""The artist's marks on regions of the object: frozen, stiff, rigid, cut, glued."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from objectmorpher_core.base.arrays import F64, I32, Mask
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document
from objectmorpher_core.document.rig import Rig
from objectmorpher_core.document.settings import Rigidity, with_rigidity

from ...system.texts import t
from ..view import PoseMode

if TYPE_CHECKING:
    from ..state import EditorState


USUAL = 1.0  # stiffness of what was not painted
NEAREST = 1.5  # x spacing: a small brush between control points takes the nearest within this
TOGETHER = 2.0  # x the straight distance: parts that are nearer along the surface hang together


@dataclass(frozen=True, eq=False)
class MovedPart:
    """A part of the object that moves in a way of its own."""

    kind: PoseMode
    nodes: I32  # control points
    value: float = USUAL  # stiffness
    seam: int = -1  # of cuts and glue: which
    body: int = -1


class Rigging:
    """The current object's rig. The handles stay, and the pose is solved anew with it."""

    def __init__(self, editor: EditorState) -> None:
        self._editor = editor
        self.painted: I32 = np.empty(0, np.int32)  # by the stroke in progress
        self.drawn: F64 = np.empty((0, 2))  # image px, its way

    # What there is

    @property
    def rig(self) -> Rig:
        thing = self._editor.object
        return Rig() if thing is None else thing.rig

    def regions(self) -> tuple[MovedPart, ...]:
        """Return all marks in the order of the panel."""
        rig, found = self.rig, []
        if rig.held is not None:
            found.append(MovedPart(PoseMode.FREEZE, rig.held))
        if rig.stiffness is not None:
            for value in np.unique(rig.stiffness[rig.stiffness != USUAL]):
                nodes = np.flatnonzero(rig.stiffness == value).astype(np.int32)
                found.append(MovedPart(PoseMode.STIFFEN, nodes, float(value)))
        for b, body in enumerate(rig.bodies):
            found.append(MovedPart(PoseMode.BODY, body, body=b))
        for s, seam in enumerate(rig.seams):
            kind = PoseMode.GLUE if seam.is_glued else PoseMode.CUT
            both = np.concatenate([seam.first, seam.second])
            found.append(MovedPart(kind, both, seam=s))
        return tuple(found)

    def near(self, way: F64) -> I32:
        """The control points on the seen side under the brush along `way` (S, 2) image px."""
        editor = self._editor
        picture = editor.derived.control_points(editor.opened, editor.current)
        seen = editor.cache.facts.seen(editor.opened, editor.current)
        gaps = gaps_to_way(picture, way)
        under = np.flatnonzero(seen & (gaps <= editor.view.brush.radius))
        if len(under) == 0 and seen.any():
            nearest = int(np.where(seen, gaps, np.inf).argmin())
            reach = NEAREST * editor.cache.facts.spacing(editor.opened, editor.current)
            under = np.array([nearest] if gaps[nearest] <= reach else [])
        return under.astype(np.int32)

    # Strokes end in one of these; each is one step

    def paint(self, kind: PoseMode, nodes: I32, is_erasing: bool) -> None:
        """Freezes, stiffens or groups control points; or takes that back."""
        if len(nodes) == 0:
            return
        if kind is PoseMode.FREEZE:
            edit = edits.thaw if is_erasing else edits.freeze
            self._hold(t("Erase") if is_erasing else t("Freeze"), edit, nodes)
        elif is_erasing:
            self._set(t("Erase"), _erased(self.rig, kind, nodes, self._count))
        elif kind is PoseMode.STIFFEN:
            value = self._editor.view.pose.stiffness
            self._set(t("Stiffen"), _stiffened(self.rig, nodes, value, self._count))
        else:
            self._group(nodes)

    def _hold(self, label: str, edit: Callable[..., Document], nodes: I32) -> None:
        """Freezes or thaws; the object stays as it is seen."""
        self._apply(label, edit, nodes, is_held=True)

    def _group(self, nodes: I32) -> None:
        """A group of its own, or more of the group that the stroke began on."""
        own = [body for body in self.rig.bodies if nodes[0] in body]
        whole = np.unique(np.concatenate([nodes, *own]))
        if len(whole) < 2:
            self._editor.say(t("A rigid group needs a larger stroke"))
            return
        self._apply(t("Rigid group"), edits.make_body, whole)

    def cut(self, way: F64) -> None:
        """Parts what is left of a line (S, 2), image px, from what is right of it."""

        editor = self._editor
        photo, thing = editor.opened.photo, editor.chosen
        links = editor.derived.shape(photo, thing).puppet.deformer.graph.weights.tocoo()
        pairs = np.column_stack([links.row, links.col])
        picture = editor.derived.control_points(editor.opened, editor.current)
        first, second = sides_of_cut(pairs, picture, way)
        if len(first) == 0 or len(second) == 0:
            editor.say(t("Draw the cut across the object"))
            return
        self._apply(t("Cut"), edits.cut, first, second)

    def glue(self, way: F64) -> None:
        """Joins what is under the brush at the beginning of a line to what is at its end."""
        editor = self._editor
        first, second = self.near(way[:1]), self.near(way[-1:])
        second = np.setdiff1d(second, first).astype(np.int32)
        if len(first) == 0 or len(second) == 0:
            editor.say(t("Drag from one part of the object to another"))
            return
        deformer = editor.derived.shape(editor.opened.photo, editor.chosen).puppet.deformer
        along = deformer.graph.distances_from(int(first[0]))[second].min()
        straight = np.linalg.norm(deformer.points[second] - deformer.points[first[0]], axis=1)
        if along < TOGETHER * straight.min():
            editor.say(t("These parts hang together already"))
            return
        self._apply(t("Glue"), edits.glue, first, second)

    def unseam(self, kind: PoseMode, nodes: I32) -> None:
        """Takes back the cuts, or the glue, that these control points are part of."""
        is_glued = kind is PoseMode.GLUE
        kept = tuple(
            s for s in self.rig.seams
            if s.is_glued is not is_glued
            or not np.isin(nodes, np.concatenate([s.first, s.second])).any()
        )  # fmt: skip
        if len(kept) < len(self.rig.seams):
            self._set(t("Erase"), replace(self.rig, seams=kept))

    def remove(self, region: MovedPart) -> None:
        """Takes back what was said about a region."""
        rig = self.rig
        if region.kind is PoseMode.FREEZE:
            self._hold(t("Remove region"), edits.thaw, region.nodes)
            return
        if region.seam >= 0:
            seams = tuple(s for i, s in enumerate(rig.seams) if i != region.seam)
            rig = replace(rig, seams=seams)
        elif region.body >= 0:
            rig = replace(
                rig, bodies=tuple(b for i, b in enumerate(rig.bodies) if i != region.body)
            )
        else:
            rig = _erased(rig, region.kind, region.nodes, self._count)
        self._set(t("Remove region"), rig)

    def set_rigidity(self, rigidity: Rigidity) -> None:
        """Set the material of the whole object."""
        editor = self._editor
        if editor.object is None:
            return
        settings = with_rigidity(editor.object.deform, rigidity)
        self._apply(t("Rigidity"), edits.set_deform, settings)

    @property
    def _count(self) -> int:
        thing = self._editor.chosen
        assert thing.lifted is not None
        return len(thing.lifted.control_points)

    def _set(self, label: str, rig: Rig) -> None:
        self._apply(label, edits.set_rig, rig)

    def _apply(
        self, label: str, edit: Callable[..., Document], *arguments: Any, is_held: bool = False
    ) -> None:
        """One step by an edit of the object, with the same handles at the same places.

        What was posed and let go of has nothing else that holds it: it stays as it is, too.
        """
        editor, k = self._editor, self._editor.current
        if editor.document is None:
            return
        try:
            changed = edit(editor.document, k, *arguments)
        except edits.EditError as error:
            editor.complain(str(error))
            return
        before, after = editor.document.objects[k], changed.objects[k]
        is_held = is_held or (before.base.pose is not None and not after.rig.bodies)
        if before.pose is None or not is_held:
            editor.apply(label, editor.derived.solved(changed, k, None))
            return
        editor.apply(label, editor.derived.held(edits.set_pose(changed, k, before.pose), k))


def gaps_to_way(points: F64, way: F64) -> F64:
    """(N,) px from points (N, 2) to a line (S, 2) through places; S >= 1."""
    gaps = np.linalg.norm(points - way[0], axis=1)
    for start, end in pairwise(way):
        along = end - start
        share = np.clip((points - start) @ along / max(float(along @ along), 1e-12), 0, 1)
        gaps = np.minimum(gaps, np.linalg.norm(points - start - share[:, None] * along, axis=1))
    return gaps


def _is_in(nodes: I32, count: int) -> Mask:
    """(M,) which of `count` control points these are."""
    chosen = np.zeros(count, bool)
    chosen[nodes] = True
    return chosen


def _stiffened(rig: Rig, nodes: I32, value: float, count: int) -> Rig:
    """Control points with a stiffness; none that differs is none at all."""
    stiffness = np.full(count, USUAL) if rig.stiffness is None else rig.stiffness.copy()
    stiffness[nodes] = value
    return replace(rig, stiffness=stiffness if (stiffness != USUAL).any() else None)


def _erased(rig: Rig, kind: PoseMode, nodes: I32, count: int) -> Rig:
    """Without what was painted on these control points."""
    if kind is PoseMode.STIFFEN:
        return _stiffened(rig, nodes, USUAL, count)
    gone = _is_in(nodes, count)
    bodies = (body[~gone[body]] for body in rig.bodies)
    return replace(rig, bodies=tuple(body for body in bodies if len(body) > 1))


# The two sides of a cut that is drawn across an object's picture.


def sides_of_cut(pairs: np.ndarray, picture: F64, stroke: F64) -> tuple[I32, I32]:
    """The control points left and right of a cut; both empty where it crosses no link.

    `pairs` (L, 2) are the links, `picture` (M, 2) px where the control points are seen, `stroke`
    (S, 2) px the line that was drawn. The cut goes right through the object: every link whose
    picture crosses the line is cut, on its near side and on its far side.
    """
    votes = np.zeros(len(picture))
    a, b = picture[pairs[:, 0]], picture[pairs[:, 1]]
    for start, end in pairwise(stroke):
        along = end - start
        if not along.any():
            continue
        side_a, side_b = _cross(along, a - start), _cross(along, b - start)
        link = b - a
        apart = _cross(link, start - a) * _cross(link, end - a) < 0
        crossed = apart & (side_a * side_b < 0)
        np.add.at(votes, pairs[crossed, 0], np.sign(side_a[crossed]))
        np.add.at(votes, pairs[crossed, 1], np.sign(side_b[crossed]))
    return np.flatnonzero(votes < 0).astype(np.int32), np.flatnonzero(votes > 0).astype(np.int32)


def _cross(a: np.ndarray, b: np.ndarray) -> F64:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
