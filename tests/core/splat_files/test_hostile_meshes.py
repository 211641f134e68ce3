"""Damaged and malicious mesh files: one sentence each, in bounded time and memory."""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from objectmorpher_core.splat_files import SplatFileError, read
from tests.core.splat_files import mesh_files
from tests.core.splat_files.refusal import measured, refusal

Tree = dict[str, Any]


def changed(change: Callable[[Tree], Any]) -> Callable[[], bytes]:
    """A .gltf file that is whole but for `change`."""

    def make() -> bytes:
        tree = mesh_files.gltf(image=mesh_files.png(np.zeros((4, 4, 3))))
        change(tree)
        return json.dumps(tree).encode()

    return make


def glb(change: Callable[[bytes], bytes]) -> Callable[[], bytes]:
    return lambda: change(trimesh.creation.box().export(file_type="glb"))


def chain(count: int) -> Callable[[Tree], None]:
    def change(tree: Tree) -> None:
        tree["nodes"] = [{"children": [k + 1]} for k in range(count - 1)] + [{"mesh": 0}]

    return change


def many_copies(tree: Tree) -> None:
    """A million boxes: the file is small, the scene is not."""
    tree["nodes"] = [{"mesh": 0}] * 90_000
    tree["meshes"][0]["primitives"] *= 10
    tree["scenes"] = [{"nodes": list(range(90_000))}]


def png_of_size(width: int, height: int) -> bytes:
    """A picture's header, and no picture."""
    head = struct.pack(">2I5B", width, height, 8, 2, 0, 0, 0)
    chunk = b"IHDR" + head
    return (
        b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + chunk
        + struct.pack(">I", zlib.crc32(chunk)) + struct.pack(">I", 9) + b"IDAT" + bytes(13)
    )  # fmt: skip


STL = struct.pack("<80sI", b"made", 2) + bytes(100)
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"

SPOILT: dict[str, tuple[str, Callable[[], bytes], str]] = {
    "gltf empty": (".gltf", lambda: b"", "empty"),
    "gltf no JSON": (".gltf", lambda: b"hello", "damaged"),
    "gltf of another shape": (".gltf", lambda: b"[1, 2]", "damaged"),
    "gltf deep nesting": (".gltf", lambda: b"[" * 200_000, "damaged"),
    "gltf in no script": (".gltf", lambda: b"\xff\xfe\x00{}", "damaged"),
    "gltf without a version": (".gltf", changed(lambda t: t.pop("asset")), "damaged"),
    "gltf version 1": (".gltf", changed(lambda t: t.update(asset={"version": "1.0"})), "not 2"),
    "gltf needs an extension": (
        ".gltf", changed(lambda t: t.update(extensionsRequired=["KHR_draco_mesh_compression"])),
        "KHR_draco_mesh_compression, which is not supported"),
    "gltf absent buffer": (
        ".gltf", changed(lambda t: t["buffers"][0].update(uri="not_there.bin")), "missing"),
    "gltf no buffer at all": (
        ".gltf", changed(lambda t: t["buffers"][0].pop("uri")), "a buffer is missing"),
    "gltf short buffer": (
        ".gltf", changed(lambda t: t["buffers"][0].update(byteLength=10**9)), "ends early"),
    "gltf buffer of noise": (
        ".gltf", changed(lambda t: t["buffers"][0].update(uri="data:x;base64,@@@@")), "decoded"),
    "gltf buffer outside": (
        ".gltf", changed(lambda t: t["buffers"][0].update(uri="../secret.bin")),
        "outside its folder"),
    "gltf buffer from the root": (
        ".gltf", changed(lambda t: t["buffers"][0].update(uri="/etc/hostname")),
        "outside its folder"),
    "gltf buffer behind percent signs": (
        ".gltf", changed(lambda t: t["buffers"][0].update(uri="%2e%2e%2fsecret.bin")),
        "outside its folder"),
    "gltf buffer from the net": (
        ".gltf", changed(lambda t: t["buffers"][0].update(uri="https://localhost:1/a.bin")),
        "outside its folder"),
    "gltf buffer of no name": (
        ".gltf", changed(lambda t: t["buffers"][0].update(uri="a\0b")), "missing"),
    "gltf texture outside": (
        ".gltf", changed(lambda t: t["images"][0].update(uri="../secret.png")),
        "outside its folder"),
    "gltf texture over a link": (
        ".gltf", changed(lambda t: t["images"][0].update(uri="link/secret.png")),
        "outside its folder"),
    "gltf texture too large": (
        ".gltf", changed(lambda t: t["images"][0].update(
            uri=mesh_files.data_uri(png_of_size(60_000, 60_000), "image/png"))), "texture"),
    "gltf texture damaged": (
        ".gltf", changed(lambda t: t["images"][0].update(
            uri=mesh_files.data_uri(png_of_size(40, 40), "image/png"))), "texture"),
    "gltf view outside": (
        ".gltf", changed(lambda t: t["bufferViews"][0].update(byteOffset=10**6)),
        "leaves its buffer"),
    "gltf view before": (
        ".gltf", changed(lambda t: t["bufferViews"][0].update(byteOffset=-8)), "damaged"),
    "gltf view of no buffer": (
        ".gltf", changed(lambda t: t["bufferViews"][0].update(buffer=7)), "damaged"),
    "gltf accessor too long": (
        ".gltf", changed(lambda t: t["accessors"][0].update(count=25)), "leaves its view"),
    "gltf accessor of 10^12": (
        ".gltf", changed(lambda t: t["accessors"][0].update(count=10**12)), "more than"),
    "gltf accessor of 10^7 zeros": (
        ".gltf", changed(lambda t: t["accessors"].append(
            {"componentType": 5126, "type": "MAT4", "count": 10**7})), "no data"),
    "gltf accessor of less than none": (
        ".gltf", changed(lambda t: t["accessors"][0].update(count=-1)), "damaged"),
    "gltf accessor of text": (
        ".gltf", changed(lambda t: t["accessors"][0].update(count="many")), "damaged"),
    "gltf huge stride": (
        ".gltf", changed(lambda t: t["bufferViews"][0].update(byteStride=2**40)),
        "leaves its view"),
    "gltf unequal attributes": (
        ".gltf", changed(lambda t: t["accessors"][1].update(count=5)), "differ in length"),
    "gltf triangles of missing corners": (
        ".gltf", changed(lambda t: t["accessors"][0].update(count=3)
                         or t["accessors"][1].update(count=3)), "missing vertex"),
    "gltf node above itself": (
        ".gltf", changed(lambda t: t["nodes"][0].update(children=[0])), "cycle"),
    "gltf nodes in a ring": (
        ".gltf", changed(lambda t: t.update(nodes=[{"mesh": 0, "children": [1]},
                                                   {"mesh": 0, "children": [0]}])), "cycle"),
    "gltf node of two parents": (
        ".gltf", changed(lambda t: t.update(
            nodes=[{"children": [2, 2]}, {"children": [2]}, {"mesh": 0}])), "two parents"),
    "gltf nodes without end": (".gltf", changed(chain(5000)), "deep"),
    "gltf million copies": (".gltf", changed(many_copies), "more than 5,000,000 triangles"),
    "gltf nothing to see": (
        ".gltf", changed(lambda t: t["nodes"][0].pop("mesh")), "no triangles"),
    "gltf wholly transparent": (
        ".gltf", changed(lambda t: t["materials"].__setitem__(0, {
            "alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0]}})),
        "transparent"),
    "gltf flattened to nothing": (
        ".gltf", changed(lambda t: t["nodes"][0].update(scale=[0, 0, 0])), "no area"),
    "gltf placed nowhere": (
        ".gltf", changed(lambda t: t["nodes"][0].update(translation=[1e300, 0, 0])),
        "no triangles"),
    "glb empty": (".glb", lambda: b"", "empty"),
    "glb magic alone": (".glb", lambda: b"glTF", "ends early"),
    "glb of another kind": (".glb", lambda: b"PK\3\4" + bytes(40), "damaged"),
    "glb version 1": (".glb", glb(lambda d: d[:4] + struct.pack("<I", 1) + d[8:]), "version 1"),
    "glb cut": (".glb", glb(lambda d: d[:-20]), "ends early"),
    "glb cut in its text": (".glb", glb(lambda d: d[:100]), "ends early"),
    "glb chunk of 4 GiB": (
        ".glb", glb(lambda d: d[:12] + struct.pack("<I", 2**32 - 1) + d[16:]), "ends early"),
    "glb without its data": (
        ".glb", glb(lambda d: d[:8] + struct.pack("<I", 20 + struct.unpack_from("<I", d, 12)[0])
                    + d[12 : 20 + struct.unpack_from("<I", d, 12)[0]]), "buffer is missing"),
    "obj empty": (".obj", lambda: b"", "empty"),
    "obj words": (".obj", lambda: b"once upon a time\n" * 100, "no triangles"),
    "obj of noise": (".obj", lambda: bytes(range(256)) * 100, "damaged"),
    "obj points alone": (".obj", lambda: OBJ.encode(), "no triangles"),
    "obj corner 99": (".obj", lambda: (OBJ + "f 1 2 99\n").encode(), "damaged"),
    "obj corner 0": (".obj", lambda: (OBJ + "f one two three\n").encode(), "damaged"),
    "obj without area": (".obj", lambda: (OBJ + "f 1 1 1\n").encode(), "no area"),
    "obj not a number": (
        ".obj", lambda: (OBJ.replace("1 0 0", "nan inf 0") + "f 1 2 3\n").encode(), "no triangles"),
    "obj material outside": (
        ".obj", lambda: ("mtllib ../secret.mtl\n" + OBJ + "usemtl a\nf 1 2 3\n").encode(),
        "outside its folder"),
    "obj material from the net": (
        ".obj", lambda: ("mtllib http://localhost:1/a.mtl\n" + OBJ + "f 1 2 3\n").encode(),
        "outside its folder"),
    "stl empty": (".stl", lambda: b"", "empty"),
    "stl cut": (".stl", lambda: STL[:-1], "damaged"),
    "stl 4 billion triangles": (
        ".stl", lambda: STL[:80] + struct.pack("<I", 2**32 - 1) + STL[84:], "damaged"),
    "stl of points": (".stl", lambda: STL, "no area"),
    "stl of noise": (".stl", lambda: b"solid " + bytes(range(256)) * 9, "damaged"),
    "off of noise": (".off", lambda: b"OFF\n99999999999 4 0\n0 0 0\n", "damaged"),
    "ply mesh of 10^12 faces": (
        ".ply", lambda: trimesh.creation.box().export(file_type="ply").replace(
            b"face 12", b"face 999999999999"), "ends early"),
    "ply mesh cut": (
        ".ply", lambda: trimesh.creation.box().export(file_type="ply")[:-30], "damaged"),
    "ply mesh of missing corners": (
        ".ply", lambda: trimesh.creation.box().export(file_type="ply")[:-12]
        + struct.pack("<3i", 1, 2, 2**30), "missing vertex"),
}  # fmt: skip


@pytest.mark.parametrize("name", SPOILT)
def test_each_gives_one_sentence_in_bounded_time_and_memory(name, tmp_path):
    ending, make, told = SPOILT[name]
    (tmp_path / "secret.bin").write_bytes(bytes(2000))
    (tmp_path / "secret.mtl").write_bytes(b"newmtl a\nKd 1 0 0\n")
    (tmp_path / "secret.png").write_bytes(mesh_files.png(np.full((4, 4, 3), 255)))
    folder = tmp_path / "mesh"
    folder.mkdir()
    (folder / "link").symlink_to(tmp_path)
    path = folder / f"object{ending}"
    path.write_bytes(make())
    assert told in refusal(path)


def test_a_missing_texture_is_no_reason_to_refuse_the_shape(tmp_path, caplog):
    def change(tree: Tree) -> None:
        tree["images"][0]["uri"] = "skin.png"

    path = tmp_path / "a.gltf"
    path.write_bytes(changed(change)())
    assert len(read(path, 500)) > 400
    assert "skin.png is missing" in caplog.text


@pytest.mark.parametrize("ending", [".gltf", ".glb", ".obj", ".stl", ".ply"])
def test_random_damage_never_escapes_as_anything_else(ending, tmp_path):
    """A byte changed here and there, or the end cut off: read, or refused with a sentence."""
    path = Path(tmp_path / f"a{ending}")
    if ending == ".gltf":
        data = json.dumps(mesh_files.gltf()).encode()
    else:
        exported = trimesh.creation.box().export(file_type=ending[1:])
        data = exported.encode() if isinstance(exported, str) else exported
    rng = np.random.default_rng(5)
    for _ in range(60):
        spoilt = bytearray(data[: rng.integers(1, len(data)) if rng.random() < 0.3 else len(data)])
        for at in rng.integers(0, len(spoilt), 3):
            spoilt[at] = rng.integers(256)
        path.write_bytes(bytes(spoilt))
        with suppress(SplatFileError), measured():
            read(path, 100)
