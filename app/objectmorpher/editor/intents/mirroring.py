"""Handles that have a mirrored partner: what is done to one is done to the other."""

from __future__ import annotations

import weakref
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core.base.arrays import F64, Mask
from objectmorpher_core.base.rotations import turned_by
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, EditObject, Handle

if TYPE_CHECKING:
    from objectmorpher_core.deform.symmetry import MirrorPlane

    from ..state import EditorState

ON_PLANE = 0.04  # x diameter: a handle so near to the plane is its own partner, and free
PIECES = 16  # of the line that shows the plane
PARTNER = 0.06  # x diameter: a handle so near to the mirrored point is the partner


class MirrorIntents:
    """The mirror plane of the current object, while it is dragged with symmetry."""

    def __init__(self, editor: EditorState) -> None:
        self._editor = editor

    @property
    def is_on(self) -> bool:
        """Whether the current object is; another one need not be."""
        own = self._editor.mask
        return own is not None and self._has(own)

    def _has(self, mask: Mask | None) -> bool:
        return mask is not None and any(one() is mask for one in self._editor.tab.mirrored)

    def toggle(self) -> None:
        own, tab, is_on = self._editor.mask, self._editor.tab, self.is_on
        tab.mirrored = [mask for mask in tab.mirrored if mask() is not own]
        if own is not None and not is_on:
            tab.mirrored.append(weakref.ref(own))

    def carry(self, before: Document, after: Document) -> None:
        """Masks of `before` are other ones in `after`: they stay as they are mirrored, or not."""
        for one, other in zip(before.objects, after.objects, strict=False):
            if other.mask is not None and self._has(one.mask) and not self._has(other.mask):
                self._editor.tab.mirrored.append(weakref.ref(other.mask))

    @property
    def plane(self) -> MirrorPlane | None:
        """Object frame; None while symmetry is off."""
        editor = self._editor
        if editor.document is None or not editor.is_lifted or not self.is_on:
            return None
        return editor.cache.facts.mirror(editor.document, editor.current)

    def is_found(self) -> bool:
        """Whether the object has a mirror plane, and it is not just an upright one."""
        plane = self.plane
        return plane is not None and bool(np.isfinite(plane.gap))

    def outline(self) -> F64:
        """Return the line (N, 2), image px, in which the plane meets the posed object's front."""
        editor, plane = self._editor, self.plane
        document, thing = editor.document, editor.object
        if plane is None or document is None or thing is None or thing.lifted is None:
            return np.empty((0, 2))
        k = editor.current
        rest = thing.lifted.control_points.astype(np.float64)
        away = rest @ plane.normal - plane.offset
        deformer = editor.derived.shape(document.photo, thing).puppet.deformer
        near = np.abs(away) < deformer.graph.mean_spacing
        near &= editor.cache.facts.seen(document, k)
        if near.sum() < 2:
            return np.empty((0, 2))
        on_plane = rest[near] - away[near, None] * plane.normal
        up = np.linalg.svd(on_plane - on_plane.mean(0), full_matrices=False)[2][0]
        if thing.pose is not None:
            on_plane = deformer.skin_points(on_plane, thing.pose).points
        order = np.argsort((rest[near] - rest[near].mean(0)) @ up, kind="stable")
        pieces = np.array_split(on_plane[order], min(PIECES, len(order)))
        return editor.derived.project(document, k, np.array([p.mean(0) for p in pieces]))

    def followed(self, document: Document, moved: tuple[int, ...]) -> Document:
        """`document` with the partners of its handles `moved` where these take them.

        Each goes from where it was when the handles were last chosen, the mirrored way.
        """
        plane = self.plane
        if plane is None:
            return document
        k = self._editor.current
        for h in moved:
            thing = document.objects[k]
            assert thing.lifted is not None
            handle = thing.handles[h]
            if plane.distance(handle.point) < ON_PLANE * thing.lifted.diameter:
                continue
            document, partner = self._with_partner(document, handle, plane)
            if partner is None or partner in moved:
                continue
            document = self._with_partner_moved(document, (h, partner), plane)
        return document

    def _with_partner_moved(
        self, document: Document, pair: tuple[int, int], plane: MirrorPlane
    ) -> Document:
        k, (h, partner) = self._editor.current, pair
        thing = document.objects[k]
        handle, other = thing.handles[h], thing.handles[partner]
        document = edits.set_pin(document, k, partner, handle.is_pin)
        start, begun = (self._began(thing, one) for one in (handle, other))
        way = handle.target - start.target
        document = edits.move_handle(
            document, k, partner, begun.target + plane.mirrored_vector(way)
        )
        turn = None
        if handle.turn is not None:
            turned = turned_by(-start.turned, handle.turn)
            turn = turned_by(begun.turned, plane.mirrored_turn(turned))
        return edits.turn_handle(document, k, partner, turn)

    def _began(self, thing: EditObject, handle: Handle) -> Handle:
        """The handle as it was when the handles were last chosen; a new one begins as it is now."""
        if thing.base.pose is None:
            turn = None if handle.turn is None else np.zeros(3)
            return replace(handle, target=handle.point, turn=turn)
        known = (h for h in thing.base.handles if h.control_point == handle.control_point)
        return next(known, handle)

    def _with_partner(
        self, document: Document, handle: Handle, plane: MirrorPlane
    ) -> tuple[Document, int | None]:
        """The document in which the handle has a partner, and its index."""
        k = self._editor.current
        thing = document.objects[k]
        assert thing.lifted is not None
        tree = self._editor.cache.facts.surface(document, k).tree
        point = np.asarray(tree.data)[tree.query(plane.mirrored(handle.point))[1]]
        node = edits.nearest_control_point(thing.lifted, point)
        if node == handle.control_point or thing.rig.is_held(node):
            return document, None
        found = _handle_near(thing, point, node, handle)
        if found is None:
            place = point
            if thing.pose is not None:
                deformer = self._editor.derived.deformer(document, k)
                place = deformer.skin_points(point, thing.pose).points[0]
            document = edits.add_handle(document, k, point, place, handle.is_pin)
            found = len(document.objects[k].handles) - 1
        return document, found


def _handle_near(thing: EditObject, point: F64, node: int, but: Handle) -> int | None:
    """The handle of a control point, or the nearest to a rest point (3,) within reach."""
    assert thing.lifted is not None
    gaps = {}
    for h, other in enumerate(thing.handles):
        if other is but:
            continue
        if other.control_point == node:
            return h
        gaps[h] = float(np.linalg.norm(other.point - point))
    nearest = min(gaps, key=lambda h: gaps[h], default=None)
    if nearest is None or gaps[nearest] > PARTNER * thing.lifted.diameter:
        return None
    return nearest
