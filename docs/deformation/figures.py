"""The pictures that stand for themselves: one handle alone, splitting, strain."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from methods import OURS, PAPER, THREE, Handles, Method, strain_of
from models import CAMERA, LENGTH, RADIUS, Model, limb_axis, limb_handles
from panels import (
    BLUE,
    GREY,
    QUALITY,
    RED,
    Dots,
    Panel,
    draw_figure,
    posed,
    write,
)
from PIL import Image, ImageDraw

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.deform.binding import bind
from objectmorpher_core.deform.deformer import Deformer
from objectmorpher_core.deform.resampling import split_stretched
from objectmorpher_core.deform.skinning import Skinned
from objectmorpher_core.document.gaussians import Gaussians
from objectmorpher_core.document.model import PhotoTexture

PULL = 2.5  # x the limb's length at rest
AROUND = ((1, 0, 0), (-1, 0, 0), (0, 0, 1), (0, 0, -1), (0, -1, 0))
HOTTEST = 0.10  # of the strain energy, at the end of the colour scale
SCALE = np.array([(0.86, 0.88, 0.90), (0.98, 0.85, 0.35), (0.90, 0.30, 0.12), (0.35, 0.02, 0.15)])
LEGEND = 46  # px


def at_rest(model: Model) -> Skinned:
    count = len(model.mesh.points)
    return Skinned(model.mesh.points, np.broadcast_to(np.eye(3), (count, 3, 3)))


def draw_one_handle(model: Model, path: Path, width: int) -> int:
    """A bar dragged at one end, and what holds still by itself; how many control points do."""
    deformer = OURS.build(model.lifted)
    handles: Handles = (model.handle((0.5, 0, 0), (-0.1, -0.35, 0)),)
    held = deformer.anchors(handles)
    skinned = deformer.skin_points(model.mesh.points, deformer.solve(handles).pose)
    anchors = Dots(deformer.points[held], BLUE, 2.2)
    start = Dots(np.array([handles[0].point]), GREY, 5)
    end = Dots(np.array([handles[0].target]), RED, 5)
    rest = at_rest(model)
    normals = [model.mesh.normals(s.points) for s in (rest, skinned)]
    panels = [
        Panel("At rest", model, posed(model, rest, normals[0]), (anchors, start)),
        Panel("One handle dragged", model, posed(model, skinned, normals[1]),
              (anchors, start, end)),
    ]  # fmt: skip
    draw_figure(path, panels, width)
    return len(held)


# ---- splitting ------------------------------------------------------------------------------


def draw_split(model: Model, path: Path, width: int) -> tuple[int, int]:
    """A limb pulled long, close up; how many Gaussians there are before and after the split."""
    axis, inner = limb_axis(0), 0.18
    way = (PULL - 1) * (LENGTH - inner) * axis
    tip = (LENGTH - RADIUS) * axis
    ring = [tuple(tip + RADIUS * np.array(side)) for side in AROUND]
    moved = model.handles(*ring, motion=lambda p: p + way)
    handles = moved + limb_handles(model, lambda p: p)[2:]
    deformer = OURS.build(model.lifted)
    pose = deformer.solve(handles).pose
    skinned = deformer.skin_gaussians(pose)
    split = split_stretched(model.lifted.gaussians, skinned.linear)
    whole = posed(model, skinned, _turned(model.lifted.gaussians.normals, skinned.linear))
    parts = _split_model(model, split.gaussians, split.parents)
    there = deformer.skin_points(split.gaussians.means.astype(np.float64), pose)
    pieces = posed(parts, there, _turned(split.gaussians.normals, there.linear))
    corners = np.array([0.5 * axis + [-RADIUS, 0, 0], 0.68 * axis + [RADIUS, 0, 0]])
    seen = CAMERA.project(model.lifted.world_points(corners))
    box = np.concatenate([seen.min(0), seen.max(0)])
    before, after = len(model.lifted.gaussians), len(split.gaussians)
    panels = [Panel("As they are", model, whole, has_outlines=True),
              Panel("Split", parts, pieces, has_outlines=True)]  # fmt: skip
    draw_figure(path, panels, width, box=box)
    return before, after


def _turned(normals: np.ndarray, linear: F64) -> F64:
    """Unit normals (N, 3) after the motion whose Jacobian is `linear` (N, 3, 3)."""
    turned = (np.linalg.inv(linear).transpose(0, 2, 1) @ normals[:, :, None])[:, :, 0]
    return turned / np.linalg.norm(turned, axis=1, keepdims=True)


def _split_model(model: Model, gaussians: Gaussians, parents: np.ndarray) -> Model:
    """The model with other Gaussians, each from one of the old."""
    old = model.lifted.texture
    texture = PhotoTexture(old.u0[parents], old.visibility[parents], old.solidity[parents])
    split = replace(model)
    split.__dict__["lifted"] = replace(model.lifted, gaussians=gaussians, texture=texture)
    return split


# ---- strain ---------------------------------------------------------------------------------


def draw_strain(model: Model, handles: Handles, path: Path, width: int) -> None:
    """The strain energy of a pose under three methods, as colours, with a legend."""
    panels = [_heat(method, model, handles) for method in (OURS, THREE, PAPER)]
    draw_figure(path, panels, width)
    picture = Image.open(path).convert("RGB")
    sheet = Image.new("RGB", (picture.width, picture.height + LEGEND), "white")
    sheet.paste(picture, (0, 0))
    draw = ImageDraw.Draw(sheet)
    left, right, top = picture.width // 4, 3 * picture.width // 4, picture.height + 14
    for x in range(left, right):
        color = heat_color(np.array([HOTTEST * (x - left) / (right - left)]))[0]
        draw.line([x, top, x, top + 18], tuple(int(255 * c) for c in color))
    write(draw, (left - 70, top + 9), "energy  0", 140)
    write(draw, (right + 70, top + 9), f"{HOTTEST:g} or more", 140)
    sheet.save(path, quality=QUALITY, optimize=True)


def _heat(method: Method, model: Model, handles: Handles) -> Panel:
    deformer: Deformer = method.build(model.lifted)
    pose = method.solve(deformer, handles)
    skinned = method.skin(deformer, model.mesh.points, pose)
    own = OURS.build(model.lifted)
    energies = strain_of(model.lifted, pose).energy
    binding = bind(model.mesh.points, own.points, own.graph)
    of_vertices = (binding.weights * energies[binding.control_points]).sum(1)
    splats = posed(model, skinned, model.mesh.normals(skinned.points), heat_color(of_vertices))
    return Panel(method.name, model, splats)


def heat_color(energies: F64) -> F64:
    """(N, 3) sRGB of energies (N,)."""
    share = np.clip(energies / HOTTEST, 0, 1) ** 0.5
    stops = np.linspace(0, 1, len(SCALE))
    return np.stack([np.interp(share, stops, SCALE[:, c]) for c in range(3)], axis=1)
