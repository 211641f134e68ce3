"""Workers: what they get, what they leave, and every way in which they fail."""

from __future__ import annotations

import json
import textwrap
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from objectmorpher_core import lift
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.progress import Cancelled, silent
from objectmorpher_core.lift import LiftError, LiftSettings, LiftSubject
from objectmorpher_core.lift.workers import external
from objectmorpher_core.lift.workers import external as worker_process
from objectmorpher_core.lift.workers.file import read_worker, worker_names
from objectmorpher_core.segment.matting.matte import build_matte
from tests import photos
from tests.tree import quick

CARD = Path(__file__).parents[4] / "packaging" / "workers" / "card"
HELP = f"import sys, os, json, time; sys.path.insert(0, {str(CARD.parent)!r})\nimport worker_job\n"
GO = "folder = __import__('pathlib').Path(sys.argv[-1])\njob = worker_job.read_job(folder)\n"
WROTE = (
    "import numpy as np\nn = 40\nm = np.random.default_rng(0).normal(0, .1, (n, 3)) + [0, 0, 2]\n"
    "worker_job.write_gaussians(job, m, np.tile([1., 0, 0, 0], (n, 1)), np.full((n, 3), .02),"
    " np.full(n, .9), np.full((n, 3), .5))\n"
)


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("OBJECTMORPHER_WORKERS", str(tmp_path / "workers"))
    monkeypatch.setenv("TMPDIR", str(tmp_path / "scratch"))
    monkeypatch.setattr("tempfile.tempdir", None)
    (tmp_path / "workers").mkdir()
    (tmp_path / "scratch").mkdir()
    yield tmp_path / "workers"
    assert list((tmp_path / "scratch").iterdir()) == [], "a worker left something behind"
    assert not (tmp_path / "alive").exists(), "a worker's child outlived it"


@pytest.fixture(scope="module")
def subject():
    pixels, camera, mask = photos.small_cup(3, 37, 30)
    return LiftSubject(pixels, camera, mask, build_matte(pixels, mask, 12))


def install(folder: Path, script: str, name: str = "mine", **more) -> None:
    (folder / f"{name}.py").write_text(HELP + GO + textwrap.dedent(script), "utf-8")
    command = more.pop("command", ["{python}", "{here}/" + f"{name}.py"])
    told = {"name": name, "command": command, **more}
    lines = [f"{key} = {json.dumps(value)}" for key, value in told.items()]
    (folder / f"{name}.toml").write_text("\n".join(lines), "utf-8")


def lifted(subject, name="mine", progress=silent):
    return lift.load(name).lift(subject, LiftSettings(count=3000), progress)


def test_the_card_is_lifted_end_to_end_and_lies_on_the_photo(folder, subject):
    (folder / "card").symlink_to(CARD)
    assert worker_names() == ("card",)
    told = []
    found = lifted(subject, "card", lambda f, note: told.append((f, note)))
    assert found.backend == "card"
    fractions = [f for f, _ in told]
    assert fractions == sorted(fractions) and fractions[-1] <= 1
    xy = subject.camera.project(found.world_points(found.body.means))
    column, row = np.floor(xy).astype(int).T
    assert subject.mask[row, column].mean() > 0.97
    assert (found.texture.visibility > 0.5).mean() > 0.9


def test_the_worker_gets_the_photo_its_cut_out_and_the_camera(folder, subject, tmp_path):
    external.write_job(tmp_path, subject, 77, 5)
    rgba = np.asarray(Image.open(tmp_path / "image.png"))
    assert np.array_equal(rgba[..., :3], subject.pixels)
    assert (rgba[..., 3][subject.mask] > 127).mean() > 0.95 and rgba[0, 0, 3] == 0
    assert np.array_equal(np.asarray(Image.open(tmp_path / "mask.png")) > 127, subject.mask)
    told = json.loads((tmp_path / "camera.json").read_text())
    assert told["focal"] == subject.camera.focal and told["seed"] == 5 and told["count"] == 77


@pytest.mark.parametrize(
    ("script", "sentence"),
    [
        ("sys.stderr.write('first\\nno CUDA here\\n'); sys.exit(3)", r"failed \(3\): no CUDA here"),
        ("print(json.dumps({'error': 'the weights are gone'})); sys.exit(1)", "weights are gone"),
        ("os.kill(os.getpid(), 9)", "ended by signal 9"),
        ("pass", "without leaving object.ply"),
        ("(folder / 'object.ply').write_bytes(b'ply\\nnonsense')", "the .ply file's header"),
        (WROTE + "p = folder / 'object.ply'; p.write_bytes(p.read_bytes()[:-9])", "cannot be used"),
        (WROTE.replace("+ [0", "* np.nan + [0"), "not numbers|can be drawn"),
        (WROTE.replace("+ [0, 0, 2]", "+ [0, 0, 2]; m[:9] = np.nan"), "9 of 40 .* not numbers"),
        (
            WROTE + "p = folder / 'object.ply';"
            "p.write_bytes(p.read_bytes().replace(b'vertex 40', b'vertex 3000000'))",
            "3,000,000 Gaussians are more than 2,000,000",
        ),
        (WROTE + "worker_job.write_seen(job, np.eye(4) * np.nan)", "camera .* no 4 x 4"),
        (WROTE + "worker_job.write_seen(job, np.diag([1., 1, -1, 1]))", "no turn, size and place"),
        (WROTE + "worker_job.write_seen(job, np.diag([-1., 1, -1, 1]))", "behind the camera"),
        (WROTE + "q = np.eye(4); q[0, 3] = 1.4; worker_job.write_seen(job, q)", "seen elsewhere"),
        (WROTE + "(folder / 'object.json').write_text('{')", "camera of the worker mine"),
        ("(folder / 'object.ply').symlink_to('/etc/hostname')", "left a link"),
    ],
)  # fmt: skip
def test_what_a_worker_does_wrong_is_one_sentence(folder, subject, script, sentence):
    install(folder, script)
    with pytest.raises(LiftError, match=sentence) as error:
        lifted(subject)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("how", quick(["timeout", "cancel", "success"], 1))
def test_the_whole_group_ends_with_the_worker(folder, subject, tmp_path, how):
    child = f"import time; time.sleep(2); open({str(tmp_path / 'alive')!r}, 'w')"
    wait = WROTE if how == "success" else "time.sleep(60)"
    start = f"import subprocess; subprocess.Popen([sys.executable, '-c', {child!r}])\n"
    install(
        folder,
        start + "worker_job.say(0.5, 'half')\n" + wait,
        timeout=1 if how == "timeout" else 60,
    )

    def progress(fraction, note):
        if how == "cancel" and note == "half":
            raise Cancelled

    folder_of_job = tmp_path / "job"
    folder_of_job.mkdir()
    external.write_job(folder_of_job, subject, 40, 0)
    begun = time.monotonic()
    expected = {"timeout": LiftError, "cancel": Cancelled, "success": None}[how]
    worker = read_worker("mine")
    if expected is None:
        worker_process.run_worker(worker, folder_of_job, progress)
    else:
        with pytest.raises(expected):
            worker_process.run_worker(worker, folder_of_job, progress)
    time.sleep(max(0.0, 3.0 - (time.monotonic() - begun)))  # the child would have written by now


@pytest.mark.slow
def test_without_a_camera_it_is_registered(folder, subject):
    install(folder, WROTE)
    found = lifted(subject)
    middle = subject.camera.project(found.world_points(found.body.means)).mean(0)
    assert np.abs(middle - [subject.camera.cx, subject.camera.cy]).max() < 30


def test_a_camera_of_another_focal_length_is_carried_to_the_photo(subject):
    rng = np.random.default_rng(3)
    points = rng.uniform(-0.5, 0.5, (300, 3))
    own = subject.camera
    other = Camera(1.3 * own.focal, own.cx, own.cy, own.width, own.height)
    pose = np.eye(4)
    pose[:3, :3] *= 0.4
    pose[2, 3] = 3.0
    found = external.WorkerView(pose, other).pose_for(own, points, "mine")
    world = [points @ m[:3, :3].T + m[:3, 3] for m in (pose, found)]
    seen = [c.project(w) for c, w in zip((other, own), world, strict=True)]
    assert np.abs(seen[0] - seen[1]).max() < 3  # px: another perspective cannot be the same


@pytest.mark.parametrize(
    ("told", "sentence"),
    [
        ("command = 'rm -rf x'", "not a list of texts"),
        ("command = []", "not a list of texts"),
        ("command = ['a']\ntimeout = -1", "timeout"),
        ("command = ['a']\nshell = true", "shell is not known"),
        ("command = ['a']\nname = 'other'", "called 'other'"),
        ("command = [", "of no use"),
        ("command = ['no-such-command-anywhere']", "not there: no-such-command"),
    ],
)
def test_a_file_of_no_use_is_one_sentence(folder, told, sentence):
    (folder / "mine.toml").write_text(told, "utf-8")
    with pytest.raises(LiftError, match=sentence):
        lift.load("mine")


def test_arguments_are_never_read_by_a_shell(folder, subject, tmp_path):
    install(folder, WROTE, command=["{python}", "{here}/mine.py", f"; touch {tmp_path / 'shell'}"])
    lifted(subject)
    assert not (tmp_path / "shell").exists()


def test_an_unknown_lifter_names_the_workers(folder):
    install(folder, "")
    with pytest.raises(LiftError, match="known are relief, trellis, cupid, triposplat, mine"):
        lift.load("other")
