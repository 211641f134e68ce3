"""Meshes out: closed, where the object is, with the photo on it; other programs read them."""

from __future__ import annotations

import io
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import trimesh

from objectmorpher.__main__ import main
from objectmorpher.cli import commands
from objectmorpher_core.base.brush import Brush, Stroke
from objectmorpher_core.base.rotations import quats_from_matrices
from objectmorpher_core.compose.light.lighting import object_texture
from objectmorpher_core.compose.paint import look, with_stroke
from objectmorpher_core.deform.puppet import puppet_of
from objectmorpher_core.document import edits
from objectmorpher_core.document.gaussians import Gaussians
from objectmorpher_core.document.model import Document, LiftSettings, Placement
from objectmorpher_core.pipeline import lift_mask
from objectmorpher_core.raster import tiles
from objectmorpher_core.raster.posed import PosedSplats
from objectmorpher_core.splat_files import SplatFileError, encode
from objectmorpher_core.splat_files.meshes.textured import surface_of, textured_glb
from tests import shapes

AXES = np.array([0.5, 0.4, 0.3])


def ellipsoid(count: int, axes: np.ndarray = AXES) -> Gaussians:
    k = np.arange(count) + 0.5
    polar, around = np.arccos(1 - 2 * k / count), np.pi * (1 + 5**0.5) * k
    unit = np.stack([np.cos(around) * np.sin(polar), np.sin(around) * np.sin(polar),
                     np.cos(polar)], 1)  # fmt: skip
    normals = unit / axes
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    right = np.cross(normals, [0.31, 0.9, 0.11])
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    quats = quats_from_matrices(np.stack([right, np.cross(normals, right), normals], axis=2))
    scales = np.tile([0.012, 0.01, 0.002], (count, 1))
    colors = np.clip(unit * 0.5 + 0.5, 0, 1)
    return Gaussians(unit * axes, quats, scales, np.ones(count), colors)


@pytest.mark.parametrize("count", [600, 8000])
def test_the_surface_is_closed_faces_outwards_and_lies_on_the_gaussians(count: int) -> None:
    vertices, triangles = surface_of(ellipsoid(count))
    mesh = trimesh.Trimesh(vertices, triangles, process=False)
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.euler_number == 2
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * AXES.prod(), rel=0.02)
    radius = np.linalg.norm(vertices / AXES, axis=1)
    assert np.abs(radius - 1).max() < (0.02 if count < 1000 else 0.003)


def test_two_things_stay_two() -> None:
    one = ellipsoid(3000, AXES / 2)
    two = Gaussians(one.means + [0.7, 0, 0], one.quats, one.scales, one.opacities, one.colors)
    names = ("means", "quats", "scales", "opacities", "colors")
    both = Gaussians(*(np.concatenate([getattr(one, n), getattr(two, n)]) for n in names))
    mesh = trimesh.Trimesh(*surface_of(both), process=False)
    assert mesh.is_watertight and mesh.body_count == 2


def test_what_is_no_surface_is_refused() -> None:
    with pytest.raises(SplatFileError, match="too few"):
        surface_of(ellipsoid(5))
    heap = ellipsoid(50)
    point = Gaussians(heap.means * 0, heap.quats, heap.scales, heap.opacities, heap.colors)
    with pytest.raises(SplatFileError, match="one point"):
        surface_of(point)


def test_convert_writes_a_mesh_in_the_colours_of_the_gaussians(tmp_path: Path) -> None:
    source, out = tmp_path / "ball.ply", tmp_path / "ball.glb"
    source.write_bytes(encode(ellipsoid(4000), source))
    assert main(["convert", str(source), str(out)]) == 0
    scene = trimesh.load(io.BytesIO(out.read_bytes()), file_type="glb")
    (mesh,) = scene.geometry.values()
    assert mesh.is_watertight and mesh.volume > 0  # not mirrored on the way to y up
    back = tmp_path / "back.ply"
    assert main(["convert", str(out), str(back), "--count", "3000"]) == 0
    from objectmorpher_core.splat_files import read

    cloud = read(back)
    unit = cloud.means / AXES
    assert np.abs(cloud.colors - np.clip(unit * 0.5 + 0.5, 0, 1)).mean() < 0.02


@cache
def _lifted() -> Document:
    """An object with invented sides, turned until they are seen."""
    scene = shapes.scene("ellipse", 2500)
    shape = LiftSettings(2500, trust=0, back="continued")
    lift = lift_mask(scene.pixels, scene.camera, scene.mask, "relief", shape)
    document = edits.set_lifted(scene.document(), 0, *lift, shape)
    return edits.set_placement(document, 0, Placement(turn=(75.0, 0.0, 0.0)))


def _splats(document: Document) -> PosedSplats:
    item = document.objects[0]
    return puppet_of(item, document.photo.camera).posed(item.pose, item.placement)


def _painted(document: Document) -> Document:
    """With a broad green stroke across what is seen of it."""
    item, camera, splats = document.objects[0], document.photo.camera, _splats(document)
    (x0, y0), (x1, y1) = np.percentile(camera.project(splats.means), (25, 75), axis=0)
    stroke = Stroke(document.photo.size, Brush(8.0, 1.0))
    stroke.move_to(float(x0), float(y0))
    stroke.move_to(float(x1), float(y1))
    assert item.matte is not None and stroke.box is not None
    left, top, right, bottom = stroke.box
    seen = look(splats, item.matte, camera, stroke.box)
    matte = with_stroke(item.matte, seen, stroke.coverage[top:bottom, left:right], GREEN)
    return document.with_object(0, replace(item, matte=matte))


GREEN = np.array([0.05, 0.9, 0.1])


@pytest.mark.parametrize("is_painted", [False, True])
def test_a_mesh_shows_its_sides_and_the_paint_on_them_as_the_program_does(is_painted: bool) -> None:
    document = _painted(_lifted()) if is_painted else _lifted()
    item, camera = document.objects[0], document.photo.camera
    glb = textured_glb(item, puppet_of(item, camera))
    parts = trimesh.load_scene(io.BytesIO(glb), file_type="glb").geometry.values()
    (textured,) = (part for part in parts if part.visual.uv is not None)
    picture = np.asarray(textured.visual.material.baseColorTexture.convert("RGB")) / 255
    corners, uv = textured.vertices[textured.faces] * (1, -1, -1), textured.visual.uv
    middle, at = corners.mean(1), uv[textured.faces].mean(1) * (1, -1) + (0, 1)
    own = picture[tuple((at[:, ::-1] * picture.shape[:2]).astype(int).clip(0).T)]
    # What is seen of it, as the program draws it.
    assert item.matte is not None
    shown = tiles.render(_splats(document), object_texture(item.matte, item.lifted), camera, camera)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    cosines = -(normals * middle).sum(1) / np.linalg.norm(normals, axis=1).clip(1e-12)
    column, row = camera.project(middle).astype(int).T
    depth = shown.depth[row, column]
    is_seen = (cosines > 0.3 * middle[:, 2]) & (np.abs(depth - middle[:, 2]) < 0.02 * depth)
    is_seen &= shown.alpha[row, column] > 0.98
    assert is_seen.sum() > 300
    apart = np.abs(own - shown.color[row, column])[is_seen].mean(1)
    assert apart.mean() < 0.04 and np.quantile(apart, 0.9) < 0.12
    is_green = (np.abs(shown.color[row, column] - GREEN).max(1) < 0.08) & is_seen
    if not is_painted:
        assert not is_green.any()
        return
    assert is_green.sum() > 40
    assert (np.abs(own - GREEN).max(1) < 0.2)[is_green].mean() > 0.9


@pytest.mark.slow
def test_a_session_becomes_a_mesh_with_the_photo_on_it(tmp_path: Path) -> None:
    """The front shows the photo where the photo shows the object, whatever was done to it."""
    photo = Path(commands.__file__).parents[3] / "assets" / "samples" / "flower.jpg"
    session, direct, out = (tmp_path / name for name in ("f.omorph", "d.glb", "f.glb"))
    told = ["--click", "310,210", "--turn", "30,0,0", "--session", str(session)]
    told += ["--save-mesh", str(direct)]
    assert main(["edit", str(photo), "-o", str(tmp_path / "f.png"), *told]) == 0
    assert main(["convert", str(session), str(out)]) == 0
    assert out.read_bytes() == direct.read_bytes()
    scene = trimesh.load(io.BytesIO(out.read_bytes()), file_type="glb")
    front, back = scene.geometry.values()
    assert len(front.faces) > len(scene.geometry) * 1000 and len(back.faces) > 1000
    picture = np.asarray(front.visual.material.baseColorTexture.convert("RGB"), np.float64)
    uv = front.visual.uv
    assert uv.min() >= 0 and uv.max() <= 1
    # The mesh is in the photo camera's frame, y up: the turn is about y, to the picture's left.
    normals = front.face_normals[front.area_faces > 0]
    mean = (normals * front.area_faces[front.area_faces > 0, None]).sum(0)
    assert mean[2] > 0 and mean[0] < 0
    height, width = picture.shape[:2]
    columns = np.clip((uv[:, 0] * width).astype(int), 0, width - 1)
    rows = np.clip(((1 - uv[:, 1]) * height).astype(int), 0, height - 1)
    red, _, blue = picture[rows, columns].mean(0)
    assert red > blue + 60  # an orange dahlia on green
