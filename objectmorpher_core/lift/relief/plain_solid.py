"""The hidden sides of a body that is a box: points on the box itself, and in line along its edges.

Sheets over the photo's cells know a side that is seen edge-on to a cell or two, and have holes
there; the box knows it exactly. An edge that becomes the outline when the object turns is a line
only where points lie in line along it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from ...base.arrays import F64, I64, Mask
from ...base.camera import Camera

SHARP = 0.75  # cosine of two faces' normals, below which the edge between them is one
OBLIQUE = 0.1  # cosine to the ray, up to which the photo shows nothing of a face
GRAZING = 0.35  # likewise, up to which an outline's place in the photo is no place on the face
INSET = 0.6  # x mean spacing: so far beyond its outermost points a surface is drawn
IN_LINE = 0.85  # x mean spacing: how far points along an edge, or an outline, are apart
EDGE_PARTS = 256  # of an edge, over which its length in relief coordinates is summed
OUTLINE_STEP = 0.5  # px, between places at which heights of the outline are known
BEVEL = 0.1  # x mean spacing: so far within lie points on an edge, which would stick out


class _Edge(NamedTuple):
    ends: F64  # (2, 3)
    faces: tuple[int, int]  # beside it


@dataclass(frozen=True, eq=False)
class PlainSolid:
    """A convex mesh with flat sides, in camera axes; a px of the photo is one at the focal length.

    A body is nothing but it in its `own` cells.
    """

    vertices: F64  # (V, 3)
    faces: I64  # (F, 3)
    camera: Camera
    own: Mask  # (h, w)

    @cached_property
    def normals(self) -> F64:
        """(F, 3) outward, unit."""
        away = self.vertices[self.faces[:, 0]] - self.vertices.mean(0)
        outward = np.sign((away * self._cross).sum(1, keepdims=True))
        return np.asarray(outward * self._cross / (2 * self._areas[:, None]), np.float64)

    @cached_property
    def is_seen(self) -> Mask:
        """(F,) which faces look towards the camera."""
        return self._facing < 0

    @cached_property
    def is_hidden(self) -> Mask:
        """(F,) of which faces the photo shows nothing, or a line at most."""
        return self._facing > -OBLIQUE

    @cached_property
    def is_grazing(self) -> Mask:
        """(F,) which faces the photo shows, but for a sliver."""
        return self.is_seen & (self._facing > -GRAZING)

    @property
    def hidden_area(self) -> float:
        """px^2"""
        return float(self._areas[self.is_hidden].sum())

    def scattered(self, density: float, rng: np.random.Generator) -> tuple[F64, I64]:
        """Places (n, 3) on hidden faces, `density` to a px^2, and their faces (n,)."""
        areas = np.where(self.is_hidden, self._areas, 0.0)
        face = np.repeat(np.arange(len(self.faces)), rng.poisson(density * areas))
        u, v = np.sqrt(rng.random(len(face))), rng.random(len(face))
        weights = np.column_stack([1 - u, u * (1 - v), u * v])
        return (self.vertices[self.faces[face]] * weights[:, :, None]).sum(1), face

    def along_edges(self, spacing: float) -> tuple[F64, I64]:
        """Places (n, 3) in line along both sides of edges, and the faces (n,) they lie on.

        They lie so far inside a face that what is drawn of them ends at its edge. What the photo
        shows well beside the outline is left out: there the outline says more.
        """
        places, faces = [np.zeros((0, 3))], [np.zeros(0, np.int64)]
        for edge in self._edges:
            on_edge = self._along(edge, spacing, INSET * spacing)
            way = edge.ends[1] - edge.ends[0]
            for face, other in (edge.faces, edge.faces[::-1]):
                is_outline = self.is_seen[face] and not self.is_seen[other]
                if is_outline and not self.is_grazing[face]:
                    continue
                across = np.cross(self.normals[face], way / np.linalg.norm(way))
                inner = self.vertices[self.faces[face]].mean(0) - edge.ends[0]
                places.append(on_edge + INSET * spacing * np.sign(across @ inner) * across)
                faces.append(np.full(len(on_edge), face))
        return np.concatenate(places), np.concatenate(faces)

    def along_outline(self, spacing: float) -> tuple[F64, F64]:
        """Places (n, 3) in line along the outline that the camera sees, and unit normals there."""
        places, normals = [np.zeros((0, 3))], [np.zeros((0, 3))]
        for edge in self._edges:
            one, other = edge.faces
            if self.is_seen[one] != self.is_seen[other]:
                normal = self.normals[one] + self.normals[other]
                normal /= np.linalg.norm(normal)
                places.append(self._along(edge, spacing, 0.0) - BEVEL * spacing * normal)
                normals.append(np.broadcast_to(normal, places[-1].shape))
        return np.concatenate(places), np.concatenate(normals)

    def met(self, xy: F64) -> tuple[F64, I64, Mask]:
        """Heights (n,) px where rays through photo px (n, 2) enter it, the faces (n,), whether so.

        One that passes by has the height of the outline beside it, and the last of the faces that
        look at us whose plane it crosses.
        """
        rays = self.places(xy, np.full(len(xy), self.camera.focal - 1.0))
        beyond = (self.normals * self.vertices[self.faces[:, 0]]).sum(1)
        towards = rays @ self.normals.T
        away = beyond / np.where(np.abs(towards) < 1e-12, 1e-12, towards)
        into = np.where(towards < 0, away, -np.inf)
        face = into.argmax(1)
        enters = into[np.arange(len(xy)), face]
        leaves = np.where(towards < 0, np.inf, away).min(1)
        is_met = enters <= leaves
        return np.where(is_met, self.camera.focal - enters, self.beside(xy)), face, is_met

    def beside(self, xy: F64) -> F64:
        """Heights (n,) px of the outline that the camera sees, where photo px (n, 2) are beside."""
        at, height = self.relief(self.along_outline(OUTLINE_STEP)[0])
        return np.asarray(height[KDTree(at).query(xy)[1]], np.float64)

    def inset(self, places: F64, face: I64) -> F64:
        """(n,) px from places (n, 3) on `face` (n,) to the nearest edge with rows beside it."""
        cosine = (self.normals @ self.normals.T)[face]
        beyond = (self.normals * self.vertices[self.faces[:, 0]]).sum(1)
        away = (beyond - places @ self.normals.T) / np.sqrt(np.maximum(1 - cosine**2, 1e-9))
        is_edge = (cosine < SHARP) & (self.is_seen | self.is_grazing[face][:, None])
        return np.asarray(np.where(is_edge, away, np.inf).min(1), np.float64)

    def _along(self, edge: _Edge, spacing: float, margin: float) -> F64:
        """Places (n, 3) on an edge, as far as `margin` from its ends.

        They are evenly apart in relief coordinates, in which points are thinned.
        """
        way = edge.ends[1] - edge.ends[0]
        length = float(np.linalg.norm(way))
        if length < 2 * margin:
            return np.zeros((0, 3))
        share = np.linspace(margin / length, 1 - margin / length, EDGE_PARTS)
        xy, height = self.relief(edge.ends[0] + share[:, None] * way)
        steps = np.hypot(np.linalg.norm(np.diff(xy, axis=0), axis=1), np.diff(height))
        along = np.r_[0.0, np.cumsum(steps)]
        count = max(int(along[-1] / (IN_LINE * spacing)), 1)
        at = np.interp(np.linspace(0, along[-1], count + 1), along, share)
        return np.asarray(edge.ends[0] + at[:, None] * way, np.float64)

    def relief(self, places: F64) -> tuple[F64, F64]:
        """Photo px (n, 2) and heights (n,) px of places (n, 3)."""
        return self.camera.project(places), self.camera.focal - places[:, 2]

    def places(self, xy: F64, height: F64) -> F64:
        """(n, 3) of photo px (n, 2) and heights (n,) px."""
        depth = self.camera.focal - height[:, None]
        px = [self.camera.cx, self.camera.cy]
        return np.hstack([(xy - px) * depth / self.camera.focal, depth])

    def relief_normals(self, places: F64, normals: F64) -> F64:
        """(n, 3) unit, in relief coordinates, of unit normals (n, 3) at places (n, 3)."""
        depth = places[:, 2:]
        across = normals[:, :2] * depth / self.camera.focal
        along = -(normals * places).sum(1, keepdims=True) / depth
        own = np.hstack([across, along])
        return np.asarray(own / np.linalg.norm(own, axis=1, keepdims=True), np.float64)

    @cached_property
    def _facing(self) -> F64:
        """(F,) cosines between normals and rays."""
        middles = self.vertices[self.faces].mean(1)
        return np.asarray((self.normals * middles).sum(1) / np.linalg.norm(middles, axis=1))

    @cached_property
    def _cross(self) -> F64:
        """(F, 3) across each face, twice as long as its area."""
        a, b, c = np.moveaxis(self.vertices[self.faces], 1, 0)
        return np.asarray(np.cross(b - a, c - a), np.float64)

    @cached_property
    def _areas(self) -> F64:
        """(F,) px^2"""
        return np.asarray(0.5 * np.linalg.norm(self._cross, axis=1), np.float64)

    @cached_property
    def _edges(self) -> list[_Edge]:
        found, beside = [], dict[tuple[int, int], int]()
        for face, corners in enumerate(self.faces.tolist()):
            for k in range(3):
                ends = [corners[k - 1], corners[k]]
                other = beside.setdefault((min(ends), max(ends)), face)
                if other != face and self.normals[face] @ self.normals[other] < SHARP:
                    found.append(_Edge(self.vertices[ends], (other, face)))
        return found
