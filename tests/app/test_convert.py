"""`objectmorpher convert`, and the edited object in every format."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

from objectmorpher.cli import parser as cli
from objectmorpher_core.splat_files import SPLAT_ENDINGS, encode, read
from tests.core.splat_files.clouds import gaussians, matched

ENDINGS = pytest.mark.parametrize("ending", SPLAT_ENDINGS)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a file of Gaussians, a mesh, and a photo with a mask."""
    monkeypatch.chdir(tmp_path)
    Path("cat.ply").write_bytes(encode(gaussians(400), Path("cat.ply")))
    trimesh.creation.cone(radius=0.5, height=2.0).export("cone.stl")
    rng = np.random.default_rng(0)
    photo = cv2.GaussianBlur(rng.integers(0, 256, (120, 160, 3), np.uint8), (0, 0), 3)
    mask = cv2.circle(np.zeros((120, 160), np.uint8), (80, 40), 25, 255, -1)
    cv2.imwrite("photo.png", photo)
    cv2.imwrite("mask.png", mask)
    return tmp_path


def refused(arguments: list[str], told: str, capsys) -> None:
    assert cli.main(["convert", *arguments]) != 0
    sentence = capsys.readouterr().err
    assert told in sentence
    assert sentence.count("\n") == 1


@ENDINGS
def test_a_file_becomes_another(ending, folder):
    assert cli.main(["convert", "cat.ply", f"out{ending}"]) == 0
    back = matched(read(Path(f"out{ending}")), gaussians(400))
    assert np.abs(back.means - gaussians(400).means).max() < 0.005


def test_a_mesh_becomes_as_many_gaussians_as_asked_for(folder):
    assert cli.main(["convert", "cone.stl", "cone.spz", "--count", "1500"]) == 0
    assert abs(len(read(Path("cone.spz"))) - 1500) < 80


def test_the_flip_turns_the_object_upside_down(folder):
    assert cli.main(["convert", "cone.stl", "up.ply"]) == 0
    assert cli.main(["convert", "cone.stl", "down.ply", "--flip"]) == 0
    up, down = read(Path("up.ply")), read(Path("down.ply"))
    np.testing.assert_allclose(up.means * [1, -1, -1], down.means, atol=1e-6)


def test_two_runs_give_the_same_bytes(folder):
    for name in ("a.splat", "b.splat"):
        assert cli.main(["convert", "cone.stl", name, "--count", "500"]) == 0
    assert Path("a.splat").read_bytes() == Path("b.splat").read_bytes()


def test_what_is_refused_writes_nothing(folder, capsys):
    Path("broken.spz").write_bytes(b"\x1f\x8b broken")
    Path("out.ply").write_bytes(b"old")
    before = sorted(Path().iterdir())
    refused(["broken.spz", "out.ply"], "broken.spz: the .spz file", capsys)
    refused(["none.ply", "out.ply"], "none.ply does not exist", capsys)
    refused(["cat.ply", "cat.ply"], "is an input", capsys)
    refused(["cat.ply", "out.obj"], "the ending must be", capsys)
    refused(["photo.png", "out.ply"], "photo.png has none of the endings", capsys)
    refused(["cat.ply", "no/out.ply"], "does not exist", capsys)
    refused(["cone.stl", "out.ply", "--count", "3"], "--count", capsys)
    refused(["cat.ply", "out.ply", "--count", "500"], "only a mesh gets new Gaussians", capsys)
    refused([".", "out.ply"], "endings", capsys)
    assert sorted(Path().iterdir()) == before
    assert Path("out.ply").read_bytes() == b"old"


def test_a_folder_named_like_a_file_is_told(folder, capsys):
    Path("folder.ply").mkdir()
    refused(["folder.ply", "out.ply"], "is a folder", capsys)


@ENDINGS
def test_the_edited_object_is_saved_right_side_up(ending, folder):
    """The object stands above the photo's middle: y down, its middle is negative."""
    edit = ["edit", "photo.png", "-o", "out.png", "--mask", "mask.png", "--move", "0,0",
            "--gaussians", "500", "--save-splats", f"cat{ending}.x{ending}"]  # fmt: skip
    assert cli.main(edit) == 0
    cloud = read(Path(f"cat{ending}.x{ending}"))
    assert len(cloud) > 200
    assert np.median(cloud.means[:, 1]) < 0, "above the middle, y down"
    assert (cloud.means[:, 2] > 0).all(), "in front of the camera"
