"""The wrappers of published programs: their own code, run with stand-ins of those interfaces."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from objectmorpher_core.document.model import LiftSettings
from objectmorpher_core.lift import LiftSubject
from objectmorpher_core.lift.workers import external
from objectmorpher_core.lift.workers.file import read_worker
from objectmorpher_core.segment.matting.matte import build_matte
from objectmorpher_core.splat_files import read
from tests import photos

pytestmark = pytest.mark.slow

WORKERS = Path(__file__).parents[4] / "packaging" / "workers"
PUBLISHED = Path(__file__).parent / "published"
NAMES = sorted(at.parent.name for at in WORKERS.glob("*/worker.toml"))


@pytest.fixture(scope="module")
def subject():
    pixels, camera, mask = photos.small_cup(4, 27, 22)
    return LiftSubject(pixels, camera, mask, build_matte(pixels, mask, 12))


def ran(name: str, subject: LiftSubject, folder: Path) -> Path:
    """The job's folder after the wrapper has run in a process of its own."""
    external.write_job(folder, subject, 2000, 3)
    env = os.environ | {
        "PYTHONPATH": str(PUBLISHED), "SAM3D_ROOT": str(PUBLISHED),
        "SHARP_CHECKPOINT": str(folder / "weights.pt"),
    }  # fmt: skip
    script = WORKERS / name / "worker.py"
    done = subprocess.run(
        [sys.executable, str(script), str(folder)], env=env, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    told = [json.loads(line)["progress"] for line in done.stdout.splitlines()]
    assert told == sorted(told) and len(told) >= 2
    return folder


@pytest.mark.parametrize("name", NAMES)
def test_every_worker_has_a_file_that_is_read_and_an_environment(name, monkeypatch):
    monkeypatch.setenv("OBJECTMORPHER_WORKERS", str(WORKERS))
    worker = read_worker(name)
    assert worker.licence and worker.timeout >= 60
    files = {at.name for at in (WORKERS / name).iterdir()}
    assert name == "card" or files & {"pixi.toml", "environment.yml", "make_environment.sh"}
    if "pixi.toml" in files:
        tomllib.loads((WORKERS / name / "pixi.toml").read_text(encoding="utf-8"))


def test_sam_3d_is_placed_by_its_own_pose(subject, tmp_path):
    pytest.importorskip("torch")
    made, seen = external.read_answer(ran("sam3d", subject, tmp_path), "sam3d", 2000)
    assert seen is not None
    assert seen.camera.focal == pytest.approx(1.2 * subject.mask.shape[1], rel=1e-6)
    # By its publishers' rule: X = s p R(q) + t with row vectors, x left, y up. A quarter turn
    # about x as rows takes (x, y, z) to (x, z, -y).
    x, y, z = made.means.T
    left = 0.6 * np.column_stack([x, z, -y]) + [0.2, 0.1, 4.0]
    world = made.means @ seen.world_from_object[:3, :3].T + seen.world_from_object[:3, 3]
    assert np.allclose(world, left * [-1, -1, 1], atol=1e-5)


def test_sharp_keeps_what_the_mask_holds_where_the_photo_shows_it(subject, tmp_path):
    torch = pytest.importorskip("torch")
    torch.save({"weight": torch.zeros(2)}, tmp_path / "weights.pt")
    made, seen = external.read_answer(ran("sharp", subject, tmp_path), "sharp", 2000)
    assert seen is not None and np.array_equal(seen.world_from_object, np.eye(4))
    column, row = np.floor(subject.camera.project(made.means.astype(np.float64))).astype(int).T
    assert subject.mask[row, column].all()
    assert len(made) == pytest.approx(subject.mask.sum() / 4, rel=0.1)


def test_trellis_stands_upright(subject, tmp_path):
    folder = ran("trellis1", subject, tmp_path)
    made, seen = external.read_answer(folder, "trellis1", 2000)
    assert seen is None
    low, high = made.means.min(0), made.means.max(0)
    assert np.argmax(high - low) == 1  # its height is along our y


@pytest.mark.parametrize(
    ("name", "sides"), [("trellis2", (1.0, 1.6, 0.7)), ("triposr", (1.0, 2.0, 0.3))]
)
def test_meshes_come_upright_and_face_the_viewer(subject, tmp_path, name, sides):
    if name == "triposr":
        pytest.importorskip("torch")
    folder = ran(name, subject, tmp_path)
    points = read(folder / "object.glb", 3000).means
    assert np.allclose(np.ptp(points, axis=0), sides, atol=0.05)


def test_a_failing_program_is_told_in_its_own_words(subject, tmp_path):
    external.write_job(tmp_path, subject, LiftSettings().count, 0)
    done = subprocess.run(
        [sys.executable, str(WORKERS / "trellis1" / "worker.py"), str(tmp_path)],
        capture_output=True, text=True, env=os.environ | {"PYTHONPATH": ""},
    )  # fmt: skip
    last = json.loads(done.stdout.splitlines()[-1])
    assert done.returncode == 1 and last["error"] == "No module named 'trellis'"
