"""Readers of 3D objects: splat files, meshes with what lies beside them, answers of workers."""

from __future__ import annotations

import json
import zipfile
from contextlib import suppress
from io import BytesIO
from pathlib import Path

import numpy as np
import trimesh

from objectmorpher_core.lift import LiftError
from objectmorpher_core.lift.workers.external import read_answer
from objectmorpher_core.splat_files import FORMATS, SplatFileError, read, read_object
from tests.core.splat_files import mesh_files
from tests.core.splat_files.clouds import gaussians

from .checks import Reader, Refused, check_gaussians, refusing
from .zips import BROKEN_ZIP, zipped

COUNT = 400  # Gaussians that a mesh is sampled to
ASCII = (
    b"ply\nformat ascii 1.0\ncomment made\nelement vertex 3\nproperty float x\nproperty float y\n"
    b"property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
    b"end_header\n0 0 0 255 0 0\n1 0 0 0 255 0\n0 1 0.5 0 0 255\n"
)
MESH_PLY = (
    b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
    b"property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
    b"0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
)


def _encoded(ending: str) -> bytes:
    return FORMATS[ending].encode(gaussians(40))


def _file_reader(name: str, ending: str, seeds) -> Reader:
    """A file of one ending, alone in its folder."""

    def read_it(data: bytes, folder: Path) -> None:
        path = folder / f"object{ending}"
        path.write_bytes(data)
        with refusing(SplatFileError):
            found = read(path, COUNT)
        check_gaussians(found)
        with suppress(Refused), refusing(SplatFileError):
            found = read_object(path, COUNT)
            check_gaussians(found)
            assert len(found)

    return Reader(name, seeds, read_it)


def _beside(files: dict[str, bytes]) -> bytes:
    return zipped(list(files.items()))


def read_folder(data: bytes, folder: Path) -> None:
    """A mesh with its material, buffers and textures, as a zip file of a folder."""
    main = unpacked(data, folder)
    if main is None:
        raise Refused("no mesh")
    with refusing(SplatFileError):
        check_gaussians(read(main, COUNT))


def unpacked(data: bytes, folder: Path) -> Path | None:
    """The members, as far as they have names that a folder takes; the first one."""
    first = None
    with suppress(*BROKEN_ZIP), zipfile.ZipFile(BytesIO(data)) as archive:
        for info in archive.infolist():
            at = folder / Path(info.filename).name
            if info.file_size > 1 << 22 or at.name in ("", "..") or "\0" in at.name:
                continue
            with suppress(*BROKEN_ZIP):
                at.write_bytes(archive.read(info))
                first = first or at
    return first


def _mesh_folders() -> list[bytes]:
    picture = mesh_files.png(np.arange(48).reshape(4, 4, 3))
    tree = mesh_files.gltf(image=picture)
    import base64

    uri = tree["buffers"][0]["uri"]
    body = base64.b64decode(uri.partition(",")[2])
    tree["buffers"][0]["uri"] = "a.bin"
    obj = (b"mtllib a.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n"
           b"f 1/1 2/2 3/3\n")  # fmt: skip
    material = b"newmtl m\nKd 0.5 0.2 0.1\nmap_Kd a.png\n"
    return [
        _beside({"a.gltf": json.dumps(tree).encode(), "a.bin": body, "a.png": picture}),
        _beside({"a.obj": obj, "a.mtl": material, "a.png": picture}),
    ]


def _glb() -> list[bytes]:
    box = trimesh.creation.box()
    painted = trimesh.creation.icosphere(subdivisions=1)
    painted.visual.vertex_colors = np.random.default_rng(1).integers(0, 255, (42, 4), np.uint8)
    return [box.export(file_type="glb"), painted.export(file_type="glb")]


def _gltf() -> list[bytes]:
    return [
        json.dumps(mesh_files.gltf(image=mesh_files.png(np.zeros((4, 4, 3))))).encode(),
        json.dumps(mesh_files.gltf(node={"scale": [1, 2, -3]})).encode(),
    ]


def _exported(kind: str) -> list[bytes]:
    made = trimesh.creation.box().export(file_type=kind)
    return [made if isinstance(made, bytes) else made.encode()]


def answer_seeds() -> list[bytes]:
    """What a worker leaves."""
    seen = {
        "version": 1, "world_from_object": np.eye(4).tolist(), "focal": 100.0, "cx": 50.0,
        "cy": 40.0, "width": 100, "height": 80,
    }  # fmt: skip
    seen["world_from_object"][2][3] = 3.0
    text = json.dumps(seen).encode()
    glb = trimesh.creation.box().export(file_type="glb")
    return [
        _beside({"object.ply": _encoded(".ply"), "object.json": text}),
        _beside({"object.splat": _encoded(".splat"), "object.json": text}),
        _beside({"object.glb": glb, "object.json": text}), _beside({"object.ply": MESH_PLY}),
    ]  # fmt: skip


def read_worker_answer(data: bytes, folder: Path) -> None:
    """The worker's folder, with whatever is in it."""
    unpacked(data, folder)
    with refusing(LiftError):
        made, seen = read_answer(folder, "w", COUNT)
    check_gaussians(made)
    if seen is not None:
        from objectmorpher_core.base.camera import Camera

        with refusing(LiftError):
            matrix = seen.pose_for(Camera.from_fov(100, 80), made.means.astype(np.float64), "w")
        assert np.isfinite(matrix).all()


def _other_spz() -> list[bytes]:
    """Of the other versions, by a header of ours over zeros."""
    import gzip
    import struct

    rows = {1: 3 * 6 + 3 + 9 + 9 + 9, 2: 3 * 9 + 3 + 9 + 9 + 9}
    return [
        gzip.compress(struct.pack("<4sIIBBBB", b"NGSP", version, 3, 0, 12, 0, 0) + bytes(size))
        for version, size in rows.items()
    ]


READERS = [
    _file_reader("ply", ".ply", lambda: [_encoded(".ply"), ASCII, MESH_PLY, *_exported("ply")]),
    _file_reader("compressed-ply", ".compressed.ply", lambda: [_encoded(".compressed.ply")]),
    _file_reader("splat", ".splat", lambda: [_encoded(".splat")]),
    _file_reader("spz", ".spz", lambda: [_encoded(".spz"), *_other_spz()]),
    _file_reader("glb", ".glb", _glb),
    _file_reader("gltf", ".gltf", _gltf),
    _file_reader("obj", ".obj", lambda: _exported("obj")),
    _file_reader("stl", ".stl", lambda: [*_exported("stl"), *_exported("stl_ascii")]),
    _file_reader("off", ".off", lambda: _exported("off")),
    Reader("mesh-folder", _mesh_folders, read_folder),
    Reader("worker-answer", answer_seeds, read_worker_answer, share=0.5),
]
