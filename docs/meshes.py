"""Meshes of the package pybullet (zlib licence), for docs/lifting and docs/registration.

They are fetched into the user's cache and never kept with the project.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import platformdirs

WHEEL = "pybullet==3.2.7"
# of all members, one after the other
SHA256 = "94dfb74fdbca4c814bccf64d87f2fb571992341c212a2b473fdb0b598455680c"
FOLDER = "pybullet_data/"
MEMBERS = (
    "duck.obj", "duck.mtl", "duckCM.png", "bunny.obj", "teddy2_VHACD_CHs.obj", "objects/mug.obj",
    "laikago/chassis.obj", "laikago/chassis.mtl", "laikago/laikago_tex.jpg",
    "a1/meshes/trunk.obj", "a1/meshes/trunk.mtl", "a1/meshes/trunk_A1.png",
    "franka_panda/meshes/collision/hand.obj", "random_urdfs/782/782.obj",
    "tray/tray_textured.obj", "tray/tray_textured.mtl", "tray/tray.jpg",
    "domino/domino.obj", "domino/domino.mtl", "domino/domino.jpg",
    "jenga/jenga.obj", "jenga/jenga.mtl", "jenga/jenga.png",
    "racecar/meshes/cone.obj", "racecar/meshes/cone.mtl", "lego/lego.obj",
    "torus/torus_textured.obj", "soccerball.obj", "cube.png",
)  # fmt: skip


def fetched() -> Path:
    """The folder of the meshes in the user's cache, downloaded by pip when it is not there."""
    base = os.environ.get("OBJECTMORPHER_CACHE")
    cache = Path(base) if base else platformdirs.user_cache_path("objectmorpher")
    root = cache / "evidence"
    if not all((root / FOLDER / member).exists() for member in MEMBERS):
        root.mkdir(parents=True, exist_ok=True)
        command = [sys.executable, "-m", "pip", "download", "--no-deps", "--only-binary=:all:"]
        subprocess.run([*command, "--dest", str(root), WHEEL], check=True)
        wheel = next(root.glob("pybullet-*.whl"))
        with zipfile.ZipFile(wheel) as archive:
            for member in MEMBERS:
                archive.extract(FOLDER + member, root)
        wheel.unlink()
    digest = hashlib.sha256()
    for member in MEMBERS:
        digest.update((root / FOLDER / member).read_bytes())
    if digest.hexdigest() != SHA256:
        raise SystemExit(f"the meshes in {root} are not those of {WHEEL}: {digest.hexdigest()}")
    return root / FOLDER
