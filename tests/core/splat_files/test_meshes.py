"""Meshes become Gaussians on their surface: place, side, colour and shape are the mesh's."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from objectmorpher_core.base.rotations import matrices_from_quats
from objectmorpher_core.document.gaussians import Gaussians
from objectmorpher_core.splat_files import COUNT, read, read_object
from objectmorpher_core.splat_files.meshes.surface import linear_from_srgb, srgb_from_linear
from tests.core.splat_files import mesh_files

COLORS = np.array(
    [[230, 40, 30], [30, 200, 60], [40, 60, 220], [240, 220, 40], [200, 60, 200], [60, 210, 220]]
)
# Faces of the cube, +x -x +y -y +z -z of a file with y up, as our axes (y down, z back) see them
NORMALS = np.array([[1, 0, 0], [-1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]])
SAMPLES = 4000
F32 = 1e-6
COLOR = 3 / 255  # a level of the texture, 8 bits and the rounding of linear light


@pytest.fixture(scope="module")
def picture() -> np.ndarray:
    return np.repeat(np.repeat(COLORS[None], 96, axis=0), 32, axis=1).astype(np.uint8)


@pytest.fixture
def cube(picture, tmp_path) -> Gaussians:
    tree = mesh_files.gltf(image=mesh_files.png(picture))
    return read(mesh_files.written(tree, tmp_path / "cube.gltf"), SAMPLES)


def faces_of(cloud: Gaussians) -> np.ndarray:
    """(N,) which face of the unit cube each lies on."""
    return (cloud.means @ NORMALS.T).argmax(1)


def see_through(cloud: Gaussians, points: np.ndarray, near: int = 30) -> np.ndarray:
    """(M,) what is seen through the surface at points on it, straight down its normal."""
    found = cKDTree(cloud.means).query(points, k=near)[1]
    offset = points[:, None] - cloud.means[found]
    axes = matrices_from_quats(cloud.quats.astype(np.float64))[found]
    along = np.einsum("mka,mkab->mkb", offset, axes) / cloud.scales[found]
    alpha = cloud.opacities[found] * np.exp(-0.5 * (along**2).sum(-1))
    return np.prod(1 - np.minimum(alpha, 0.99), axis=1)


def test_every_gaussian_lies_on_the_surface(cube):
    assert np.abs(np.abs(cube.means).max(1) - 0.5).max() < F32
    assert np.abs(cube.means).max() <= 0.5 + F32


def test_normals_point_outwards_and_are_the_thinnest_axis(cube):
    np.testing.assert_allclose(cube.normals, NORMALS[faces_of(cube)], atol=1e-5)
    assert (cube.scales.argmin(1) == 2).all()


def test_each_face_has_its_colour_up_to_the_edges_of_the_texture(cube):
    expected = COLORS[faces_of(cube)] / 255
    assert np.abs(cube.colors - expected).max() < COLOR


def test_up_is_up_and_the_front_faces_the_viewer(cube):
    """glTF's +y is up and its +z the asset's front: ours are -y and -z."""
    top, front = COLORS[2] / 255, COLORS[4] / 255
    assert np.abs(cube.colors[cube.means[:, 1] < -0.4999] - top).max() < COLOR
    assert np.abs(cube.colors[cube.means[:, 2] < -0.4999] - front).max() < COLOR


def test_a_picture_on_the_front_is_not_mirrored(tmp_path, picture):
    """Left half dark, right half light, as the viewer sees the front; the bottom row below."""
    drawn = picture.copy()
    drawn[:, 128:144], drawn[:, 144:160] = 0, 255
    drawn[80:, 128:160] = [255, 0, 0]
    tree = mesh_files.gltf(image=mesh_files.png(drawn))
    cloud = read(mesh_files.written(tree, tmp_path / "a.gltf"), SAMPLES)
    front = cloud.select((cloud.means[:, 2] < -0.4999) & (np.abs(cloud.means[:, 0]) > 0.05))
    upper = front.select(front.means[:, 1] < 0.2)
    assert (upper.colors[upper.means[:, 0] < 0] < 0.1).all()
    assert (upper.colors[upper.means[:, 0] > 0] > 0.9).all()
    lower = front.select(front.means[:, 1] > 0.4)
    assert (lower.colors[:, 0] > 0.9).all() and (lower.colors[:, 1] < 0.1).all()


@pytest.mark.parametrize("count", [500, 4000, COUNT])
def test_about_as_many_as_asked_for_spread_evenly(count, tmp_path):
    tree = mesh_files.gltf()
    cloud = read(mesh_files.written(tree, tmp_path / "a.gltf"), count)
    assert abs(len(cloud) - count) < 0.05 * count
    spacing = np.sqrt(6 / len(cloud))
    gaps = cKDTree(cloud.means).query(cloud.means, k=2)[0][:, 1]
    assert np.quantile(gaps, 0.01) > 0.45 * spacing, "no clumps"
    on_faces = np.bincount(faces_of(cloud), minlength=6) / len(cloud)
    assert np.abs(on_faces - 1 / 6).max() < 0.02, "as many a unit of area everywhere"


def test_the_surface_is_covered_without_holes(cube):
    rng = np.random.default_rng(3)
    points = rng.uniform(-0.5, 0.5, (3000, 3))
    face = rng.integers(6, size=3000)
    points = points - NORMALS[face] * ((points * NORMALS[face]).sum(1) - 0.5)[:, None]
    left = see_through(cube, points)
    assert left.mean() < 0.02
    assert np.quantile(left, 0.99) < 0.06


def test_detail_finer_than_the_sampling_becomes_its_mean_in_light(tmp_path):
    """A checkerboard of single pixels is even grey, as bright as it is from afar."""
    checks = (np.indices((256, 1536)).sum(0) % 2 * 255).astype(np.uint8)
    tree = mesh_files.gltf(image=mesh_files.png(np.stack([checks] * 3, axis=2)))
    cloud = read(mesh_files.written(tree, tmp_path / "a.gltf"), 2000)
    assert np.abs(cloud.colors - srgb_from_linear(np.float64(0.5))).max() < 0.03


def test_seams_of_the_layout_do_not_bleed(tmp_path, picture):
    """Between the faces' places the picture is black; no Gaussian is darker for it."""
    drawn = np.zeros((96, 192, 3), np.uint8)
    for k in range(6):
        drawn[:, 32 * k : 32 * k + 32] = COLORS[k]
        drawn[:, [32 * k, 32 * k + 31]] = 0
    corners, uv, faces = mesh_files.cube_arrays()
    uv = uv.copy()
    uv[:, 0] = (np.floor(uv[:, 0] * 6) + 0.1 + 0.8 * (uv[:, 0] * 6 % 1)) / 6
    tree = mesh_files.gltf((corners, uv, faces), mesh_files.png(drawn))
    cloud = read(mesh_files.written(tree, tmp_path / "a.gltf"), SAMPLES)
    assert np.abs(cloud.colors - COLORS[faces_of(cloud)] / 255).max() < COLOR


def test_factors_and_vertex_colours_are_linear_light_in_gltf(tmp_path):
    colors = np.tile([[0.5, 0.25, 1.0]], (24, 1))
    material = {"pbrMetallicRoughness": {"baseColorFactor": [0.5, 1.0, 0.2, 1.0]}}
    tree = mesh_files.gltf(material=material, colors=colors)
    cloud = read(mesh_files.written(tree, tmp_path / "a.gltf"), 500)
    expected = srgb_from_linear(np.array([0.25, 0.25, 0.2]))
    np.testing.assert_allclose(cloud.colors, np.tile(expected, (len(cloud), 1)), atol=COLOR)


def test_a_cut_out_leaves_nothing_where_it_is_cut(tmp_path, picture):
    drawn = np.dstack([picture, np.full(picture.shape[:2], 255, np.uint8)])
    drawn[:48, 128:160, 3] = 0  # the upper half of the front
    tree = mesh_files.gltf(image=mesh_files.png(drawn), material={"alphaMode": "MASK"})
    tree["materials"][0]["pbrMetallicRoughness"] = {"baseColorTexture": {"index": 0}}
    cloud = read(mesh_files.written(tree, tmp_path / "a.gltf"), SAMPLES)
    front = cloud.select(cloud.means[:, 2] < -0.4999)
    assert front.means[:, 1].min() > -0.04
    assert len(front) > 200
    assert cloud.opacities.min() > 0.5


def test_a_transparent_material_has_transparent_gaussians(tmp_path):
    material = {"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 0.4]}}
    cloud = read(mesh_files.written(mesh_files.gltf(material=material), tmp_path / "a.gltf"), 500)
    np.testing.assert_allclose(cloud.opacities, 0.4, atol=0.01)
    assert (cloud.colors[:, 0] > 0.99).all()


def test_alpha_means_nothing_in_an_opaque_material(tmp_path, picture):
    drawn = np.dstack([picture, np.full(picture.shape[:2], 10, np.uint8)])
    tree = mesh_files.gltf(image=mesh_files.png(drawn))
    cloud = read(mesh_files.written(tree, tmp_path / "a.gltf"), SAMPLES)
    assert (cloud.opacities == 1).all()
    assert np.abs(cloud.colors - COLORS[faces_of(cloud)] / 255).max() < 0.03
    drawn[:, ::2, 3] = 0  # nor does it where there is none
    tree = mesh_files.gltf(image=mesh_files.png(drawn))
    other = read(mesh_files.written(tree, tmp_path / "b.gltf"), SAMPLES)
    np.testing.assert_array_equal(cloud.colors, other.colors)


def test_nodes_move_turn_scale_and_mirror_their_meshes(tmp_path):
    """A mirrored node turns triangles inside out; their normals stay outward."""
    node = {"translation": [5, 2, 0], "scale": [-2, 1, 1]}
    cloud = read(mesh_files.written(mesh_files.gltf(node=node), tmp_path / "a.gltf"), SAMPLES)
    np.testing.assert_allclose(cloud.means.min(0), [4, -2.5, -0.5], atol=0.03)
    np.testing.assert_allclose(cloud.means.max(0), [6, -1.5, 0.5], atol=0.03)
    outward = ((cloud.means - [5, -2, 0]) * cloud.normals).sum(1)
    assert (outward > 0).all()


@pytest.mark.parametrize("ending", [".glb", ".obj", ".ply", ".stl", ".off"])
def test_every_format_of_meshes_is_read(ending, tmp_path):
    path = tmp_path / f"box{ending}"
    trimesh.creation.box([1.0, 2.0, 3.0]).export(path)
    cloud = read(path, 2000)
    tall, deep = (3.0, 2.0) if ending == ".stl" else (2.0, 3.0)  # .stl has z up
    np.testing.assert_allclose(np.ptp(cloud.means, axis=0), [1, tall, deep], atol=0.05)
    assert ((cloud.means * cloud.normals).sum(1) > 0).all()


def test_the_top_of_an_stl_is_up(tmp_path):
    cone = trimesh.creation.cone(radius=1.0, height=2.0)  # its tip at z = 2
    cone.export(tmp_path / "cone.stl")
    cloud = read(tmp_path / "cone.stl", 2000)
    assert cloud.means[:, 1].min() < -1.8
    assert np.abs(cloud.means[cloud.means[:, 1] < -1.8, 0]).max() < 0.2


def test_an_obj_has_its_texture_and_the_same_side_up(tmp_path, picture):
    corners, uv, faces = mesh_files.cube_arrays()
    (tmp_path / "t.png").write_bytes(mesh_files.png(picture))
    (tmp_path / "m.mtl").write_text("newmtl skin\nKd 0 0 0\nmap_Kd C:\\somewhere\\t.png\n")
    lines = ["mtllib m.mtl", "usemtl skin"]
    lines += ["v {} {} {}".format(*c) for c in corners]
    lines += [f"vt {u} {1 - v}" for u, v in uv]
    lines += ["f " + " ".join(f"{i + 1}/{i + 1}" for i in face) for face in faces]
    (tmp_path / "a.obj").write_text("\n".join(lines))
    cloud = read(tmp_path / "a.obj", SAMPLES)
    assert np.abs(cloud.colors - COLORS[faces_of(cloud)] / 255).max() < COLOR


def test_colours_of_vertices_and_of_faces(tmp_path):
    box = trimesh.creation.box()
    box.visual.face_colors = np.tile([10, 200, 90, 255], (12, 1))
    box.export(tmp_path / "faces.ply")
    cloud = read(tmp_path / "faces.ply", 500)
    np.testing.assert_allclose(cloud.colors, np.tile([10, 200, 90], (len(cloud), 1)) / 255,
                               atol=COLOR)  # fmt: skip
    box = trimesh.creation.box()
    shade = np.where(box.vertices[:, :1] > 0, [[255, 0, 0, 255]], [[0, 0, 0, 255]])
    box.visual.vertex_colors = shade.astype(np.uint8)
    box.export(tmp_path / "vertices.ply")
    cloud = read(tmp_path / "vertices.ply", 3000)
    light = linear_from_srgb(cloud.colors[:, 0].astype(np.float64))
    np.testing.assert_allclose(light, cloud.means[:, 0] + 0.5, atol=0.04)


def test_a_closed_mesh_wound_inside_out_is_turned(tmp_path):
    ball = trimesh.creation.icosphere(3)
    ball.invert()
    ball.export(tmp_path / "a.ply")
    cloud = read(tmp_path / "a.ply", 2000)
    assert ((cloud.means * cloud.normals).sum(1) > 0).all()


def test_a_soup_of_triangles_with_a_hole_faces_outwards(tmp_path):
    """No connectivity, every second triangle wound the wrong way, one in twenty missing."""
    ball = trimesh.creation.icosphere(3)
    faces = ball.faces.copy()
    faces[::2] = faces[::2, ::-1]
    faces = np.delete(faces, np.arange(0, len(faces), 20), axis=0)
    soup = trimesh.Trimesh(ball.vertices[faces].reshape(-1, 3), np.arange(3 * len(faces)
                           ).reshape(-1, 3), process=False)  # fmt: skip
    soup.export(tmp_path / "a.ply")
    cloud = read(tmp_path / "a.ply", 4000)
    outward = (cloud.means * cloud.normals).sum(1)
    assert (outward > 0).mean() > 0.98


def test_an_open_sheet_is_seen_from_both_sides(tmp_path):
    sheet = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    sheet.export(tmp_path / "a.ply")
    cloud = read(tmp_path / "a.ply", 2000)
    assert abs(len(cloud) - 2000) < 200
    front = cloud.normals[:, 2] < 0
    assert abs(front.mean() - 0.5) < 0.02
    assert cloud.means[front, 2].mean() < cloud.means[~front, 2].mean(), "each on its own side"


def test_the_two_faces_of_a_thin_plate_keep_their_colours(tmp_path, picture):
    """Closer together than the samples of each: neither shows the other's colour."""
    corners, uv, faces = mesh_files.cube_arrays()
    tree = mesh_files.gltf((corners * [1, 1, 0.002], uv, faces), mesh_files.png(picture))
    cloud = read(mesh_files.written(tree, tmp_path / "a.gltf"), 2000)
    inner = cloud.select(np.abs(cloud.means[:, :2]).max(1) < 0.45)
    side = np.where(inner.normals[:, 2] < 0, 4, 5)
    np.testing.assert_allclose(inner.normals, NORMALS[side], atol=1e-5)
    assert np.abs(inner.colors - COLORS[side] / 255).max() < COLOR


def test_a_thin_wire_stays_thin(tmp_path):
    """Thinner than the spacing of the samples: no Gaussian swells beyond a few wire widths."""
    wire = trimesh.creation.cylinder(radius=0.002, height=2.0, sections=6)
    slab = trimesh.creation.box([1.0, 1.0, 1.0])
    slab.apply_translation([2.0, 0, 0])
    trimesh.util.concatenate([wire, slab]).export(tmp_path / "a.ply")
    cloud = read(tmp_path / "a.ply", 3000)
    wires = cloud.select(np.abs(cloud.means[:, 0]) < 0.1)
    assert len(wires) >= 20
    assert np.median(wires.scales[:, 1]) < 0.7 * np.median(wires.scales[:, 0])


def test_every_reading_gives_the_same_gaussians(tmp_path, picture):
    """Also of a mesh of two parts, whose nodes trimesh names by lot."""
    tree = mesh_files.gltf(image=mesh_files.png(picture))
    (part,) = tree["meshes"][0]["primitives"]
    plain = {k: place for k, place in part["attributes"].items() if k != "TEXCOORD_0"}
    tree["meshes"][0]["primitives"].append({**part, "attributes": plain})
    path = mesh_files.written(tree, tmp_path / "a.gltf")
    one, others = read(path, 1000), [read(path, 1000) for _ in range(8)]
    for name in ("means", "quats", "scales", "opacities", "colors"):
        for other in others:
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_a_binary_gltf_is_the_same_scene(tmp_path, picture):
    tree = mesh_files.gltf(image=mesh_files.png(picture))
    cloud = read(mesh_files.as_glb(tree, tmp_path / "a.glb"), SAMPLES)
    assert np.abs(cloud.colors - COLORS[faces_of(cloud)] / 255).max() < COLOR


def test_of_a_mesh_nothing_floats(tmp_path):
    """A long mast on a small hull is no floater, and the sides of a thin plate stay as they are."""
    hull = trimesh.creation.box([0.3, 0.1, 0.3])
    mast = trimesh.creation.cylinder(radius=0.004, height=3.0)
    mast.apply_translation([0, 0, 1.6])
    trimesh.util.concatenate([hull, mast]).export(tmp_path / "a.stl")
    cloud = read_object(tmp_path / "a.stl", 3000)
    assert np.ptp(cloud.means[:, 1]) == pytest.approx(1)
    assert (cloud.means[:, 1] < 0).sum() > 50
    trimesh.creation.box([1, 1, 0.002]).export(tmp_path / "plate.ply")
    plate = read_object(tmp_path / "plate.ply", 2000)
    inner = plate.select(np.abs(plate.means[:, :2]).max(1) < 0.45)
    assert (inner.means[:, 2] * inner.normals[:, 2] > 0).all()


def test_an_object_is_centred_and_one_unit_large(tmp_path):
    box = trimesh.creation.box([20.0, 40.0, 10.0])
    box.apply_translation([300, 0, 0])
    box.export(tmp_path / "a.obj")
    cloud = read_object(tmp_path / "a.obj", 2000)
    low, high = cloud.means.min(0), cloud.means.max(0)
    np.testing.assert_allclose(low + high, 0, atol=1e-5)
    assert (high - low).max() == pytest.approx(1)
    assert ((cloud.means * cloud.normals).sum(1) > 0).all()
