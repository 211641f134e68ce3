"""The command line: what it promises, and one sentence for every failure."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile
from PIL import Image, ImageSequence

from objectmorpher.cli import parser as cli
from objectmorpher_core.compose import BACKENDS
from objectmorpher_core.pictures.image import read_picture
from objectmorpher_core.scripting.options import EditScript
from objectmorpher_core.splat_files.splats.ply import decode_ply
from tests import shapes
from tests.tree import PYTHONPATH, over

pytestmark = pytest.mark.usefixtures("lifted_once")

ROOT = Path(__file__).parents[2]
MASK = shapes.mask("ellipse")
PIXELS = shapes.picture(MASK)
QUICK = ["--gaussians", "300", "--trust", "0", "--inpaint", "telea"]
TURN = ["--turn", "20,0,0"]


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """A working directory with a photo, its mask, and some files that are no use."""
    monkeypatch.chdir(tmp_path)
    Path("photo.png").write_bytes(shapes.png(PIXELS))
    Path("mask.png").write_bytes(shapes.mask_png(MASK))
    Path("empty.png").write_bytes(shapes.mask_png(np.zeros_like(MASK)))
    Path("full.png").write_bytes(shapes.mask_png(np.ones_like(MASK)))
    Path("large.png").write_bytes(shapes.mask_png(shapes.mask("disc", 200, 150)))
    Path("text.jpg").write_text("not a photo")
    Path("cut.jpg").write_bytes(shapes.jpeg(PIXELS)[:900])
    Path("nothing.jpg").write_bytes(b"")
    return tmp_path


def _edit(
    *more: str, photo: str = "photo.png", out: str = "out.png", mask: str = "mask.png"
) -> int:
    return cli.main(["edit", photo, "-o", out, "--mask", mask, *QUICK, *more])


def _pixels(name: str) -> np.ndarray:
    return read_picture(Path(name).read_bytes()).pixels


def _files() -> dict[str, bytes]:
    return {str(p): p.read_bytes() for p in Path().rglob("*") if p.is_file()}


# ---- what works -----------------------------------------------------------------------------


def test_the_quick_inpainter_of_these_tests_exists():
    assert "telea" in BACKENDS


def test_an_edit_writes_the_photo_and_nothing_else(folder, capsys):
    before = set(_files())
    assert _edit(*TURN) == 0
    assert set(_files()) == before | {"out.png"}
    assert _pixels("out.png").shape == PIXELS.shape
    said = capsys.readouterr()
    assert said.err == ""
    line = r"wrote out\.png in \d+\.\d s: \d+% of the photo changed \(.*%.*\)\n"
    assert re.fullmatch(line, said.out)


def test_a_turn_of_one_number_is_a_yaw(folder):
    assert _edit("--turn", "20") == 0
    alone = Path("out.png").read_bytes()
    assert _edit("--turn", "20,0,0") == 0
    assert Path("out.png").read_bytes() == alone


def test_key_poses_of_the_command_line_are_those_of_a_script(folder):
    said = ["--key", "turn=-20 scale=0.9 spin=5", "--key", "handle=78,45:90,45 pin=78,80"]
    said += ["--key", ""]
    video = ["--video", "keys", "--seconds", "0.4", "--save-video"]
    assert _edit("--turn", "20", *said, *video, "said.webp", "--session", "e.omorph") == 0
    poses = [
        {"turn": [-20], "scale": 0.9, "spin": 5},
        {"handle": [{"at": [78, 45], "to": [90, 45]}], "pin": [[78, 80]]}, {},
    ]  # fmt: skip
    Path("keys.json").write_text(json.dumps({"turn": [20], "key": poses}))
    assert _edit("--script", "keys.json", *video, "read.webp") == 0
    assert Path("said.webp").read_bytes() == Path("read.webp").read_bytes()
    with Image.open("said.webp") as film:
        assert film.n_frames == 10
    assert cli.main(["replay", "e.omorph", "-o", "again.png", *video, "again.webp"]) == 0
    assert Path("again.webp").read_bytes() == Path("said.webp").read_bytes()
    assert cli.main(["replay", "e.omorph", "-o", "again.png", *video, "frames"]) == 0
    assert len(list(Path("frames").glob("*.png"))) == 10
    assert cli.main(["replay", "e.omorph", "-o", "x.png", *video, "none/frames"]) == 1


def test_a_folder_of_frames_holds_one_film(folder, capsys):
    """What is left of a longer one would seem to go on."""
    video = ["--turn", "20", "--save-video", "frames", "--seconds"]
    assert _edit(*video, "0.4") == 0
    Path("out.png").unlink()
    before = {path: path.read_bytes() for path in Path("frames").iterdir()}
    assert _edit(*video, "0.2") == cli.FAILED
    assert "photo-0005.png is of a longer video" in capsys.readouterr().err
    assert {path: path.read_bytes() for path in Path("frames").iterdir()} == before
    assert not Path("out.png").exists()
    assert _edit(*video, "0.4") == 0


@pytest.mark.parametrize("way", ["option", "script"])
def test_a_program_of_the_users_lifts_by_its_name(folder, monkeypatch, capsys, way):
    monkeypatch.setenv("OBJECTMORPHER_WORKERS", str(ROOT / "packaging" / "workers"))
    Path("edit.json").write_text('{"lift": "card"}')
    wish = ["--lift", "card"] if way == "option" else ["--script", "edit.json"]
    assert _edit(*wish, "--move", "20,0", "--report", "report.json") == 0, capsys.readouterr().err
    assert json.loads(Path("report.json").read_text())["backends"]["lift"] == "card"
    assert (_pixels("out.png") != PIXELS).any()
    capsys.readouterr()
    assert _edit("--lift", "magic") == 1 and "known are relief" in (err := capsys.readouterr().err)
    assert "card" in err


def test_nothing_to_do_gives_the_photo_back(folder):
    assert _edit() == 0
    assert np.array_equal(_pixels("out.png"), PIXELS)


def _photo_of(kind: str) -> np.ndarray:
    """The photo as OpenCV writes it: grey, BGR or BGRA; of 16 bits all are in use."""
    color, bits = kind.split()
    rng = np.random.default_rng(1)
    pixels = PIXELS[..., ::-1].astype(np.uint16)
    if color == "grey":
        pixels = pixels[..., 1]
    if color == "alpha":
        pixels = np.dstack([pixels, rng.integers(0, 256, MASK.shape)]).astype(np.uint16)
    if bits == "8":
        return pixels.astype(np.uint8)
    return pixels * 257 ^ rng.integers(0, 128, pixels.shape).astype(np.uint16)


KINDS = [f"{color} {bits}" for color in ("grey", "color", "alpha") for bits in ("8", "16")]


@over("kind", KINDS)
def test_with_nothing_to_do_every_png_comes_back_to_the_last_bit(folder, kind):
    photo = _photo_of(kind)
    cv2.imwrite("any.png", photo)
    assert _edit(photo="any.png") == 0
    back = cv2.imread("out.png", cv2.IMREAD_UNCHANGED)
    assert back.dtype == photo.dtype
    assert np.array_equal(back, photo)


@over("kind", KINDS)
def test_with_nothing_to_do_every_tiff_comes_back_to_the_last_bit(folder, kind):
    photo = _photo_of(kind)
    is_grey, has_alpha = photo.ndim == 2, photo.shape[2:] == (4,)
    if not is_grey:  # the same photo as the .png
        photo = photo[..., [2, 1, 0, 3][: photo.shape[2]]]
    tifffile.imwrite(
        "any.tif", photo, photometric="minisblack" if is_grey else "rgb",
        extrasamples=["unassalpha"] if has_alpha else None,
    )  # fmt: skip
    assert _edit(photo="any.tif", out="out.tif") == 0
    back = tifffile.imread("out.tif")
    assert back.dtype == photo.dtype
    assert np.array_equal(back, photo)


@over("kind", [kind for kind in KINDS if "16" in kind])
def test_an_edit_leaves_what_is_far_from_it_to_the_last_bit(folder, kind):
    photo = _photo_of(kind)
    cv2.imwrite("any.png", photo)
    assert _edit("--move", "6,0", photo="any.png") == 0
    back = cv2.imread("out.png", cv2.IMREAD_UNCHANGED)
    assert back.dtype == photo.dtype
    # In an alpha of noise, clear ground is everywhere, and a fringe beside it is the object's.
    far = 40 if kind.startswith("alpha") else 20
    away = cv2.distanceTransform((~MASK).astype(np.uint8), cv2.DIST_L2, 5) > far
    assert away.any() and np.array_equal(back[away], photo[away])
    assert not np.array_equal(back[MASK], photo[MASK])


def test_two_runs_with_the_same_seed_give_the_same_bytes(folder):
    wishes = ["--handle", "110,62:120,40", *TURN, "--seed", "4"]
    _edit(*wishes, "--report", "a.json", out="a.png")
    _edit(*wishes, out="b.png")
    assert Path("a.png").read_bytes() == Path("b.png").read_bytes()


def test_every_further_output_is_written(folder):
    assert _edit(
        "--move", "10,5", "--save-mask", "m.png", "--save-plate", "p.png", "--save-object",
        "o.png", "--save-splats", "s.ply", "--save-layers", "l.ora", "--save-depth",
        "d.png", "--report", "r.json",
    ) == 0  # fmt: skip
    mask = cv2.imread("m.png", cv2.IMREAD_UNCHANGED)
    assert mask.dtype == np.uint8
    assert np.array_equal(mask, MASK * np.uint8(255))
    plate = _pixels("p.png")
    assert plate.shape == PIXELS.shape
    assert plate.dtype == PIXELS.dtype
    assert np.array_equal(plate[:10], PIXELS[:10])
    assert cv2.imread("o.png", cv2.IMREAD_UNCHANGED).shape == (120, 160, 4)
    told = json.loads(Path("r.json").read_text())["object"]
    assert len(decode_ply(Path("s.ply").read_bytes())) == told["gaussians"] > 0
    assert told["edge_gaussians"] > 0
    depth = cv2.imread("d.png", cv2.IMREAD_UNCHANGED)
    assert depth.dtype == np.uint16 and depth.shape == (120, 160)
    assert depth.max() == 65535 and 0.2 < (depth > 0).sum() / MASK.sum() < 2
    with zipfile.ZipFile("l.ora") as archive:
        merged = cv2.imdecode(np.frombuffer(archive.read("mergedimage.png"), np.uint8), 1)
    assert np.array_equal(merged[..., ::-1], _pixels("out.png"))
    assert json.loads(Path("r.json").read_text())["version"] == 1


def test_a_video_of_the_edit(folder, capsys):
    wish = ["--save-video", "v.gif", "--seconds", "0.4"]
    assert _edit(*TURN, *wish) == 0
    with Image.open("v.gif") as video:
        assert video.size == (160, 120)
        assert sum(frame.info["duration"] for frame in ImageSequence.Iterator(video)) == 400  # ms
    assert _edit("--video", "sway", *wish) == 0
    Path("v.gif").unlink()
    for wrong, sentence in (
        ([], "nothing was moved"),
        (["--video", "jump"], "one of morph, sway, turn"),
        (["--seconds", "-1"], "a clip needs a length"),
    ):
        _expect_failure([*EDIT, *wish, *wrong], capsys, sentence)
    assert not Path("v.gif").exists()


def test_the_plate_can_be_had_without_an_edit(folder):
    assert _edit("--save-plate", "p.png") == 0
    assert not np.array_equal(_pixels("p.png")[MASK], PIXELS[MASK])
    assert np.array_equal(_pixels("out.png"), PIXELS)


def test_sixteen_bits_stay_sixteen_bits(folder):
    Path("deep.png").write_bytes(shapes.png(PIXELS.astype(np.uint16) * 257))
    assert _edit(*TURN, "--save-plate", "p.png", photo="deep.png") == 0
    assert _pixels("out.png").dtype == np.uint16
    assert _pixels("p.png").dtype == np.uint16


def test_handles_reach_their_targets(folder):
    assert _edit(
        "--handle", "110,62:130,40,0.2", "--handle", "45,62:-20,-30", "--pin", "78,62",
        "--report", "r.json",
    ) == 0  # fmt: skip
    handles = json.loads(Path("r.json").read_text())["handles"]
    assert len(handles) == 3
    assert all(handle["error_px"] <= 1 for handle in handles)


@over("wishes", [
    ["--turn", "-20,0,-5"], ["--handle", "110,62:-5,40,-.2"], ["--move", "-1e1,4,-0.1"],
])  # fmt: skip
def test_values_may_begin_with_a_minus_sign(folder, wishes):
    assert _edit(*wishes) == 0
    assert not np.array_equal(_pixels("out.png"), PIXELS)


def test_a_value_with_a_space_is_the_value_with_an_equals_sign(folder):
    _edit("--move", "-10,4", out="a.png")
    _edit("--move=-10,4", out="b.png")
    assert Path("a.png").read_bytes() == Path("b.png").read_bytes()


def test_selecting_writes_the_mask_and_says_what_it_is(folder, capsys):
    assert cli.main(["select", "photo.png", "-o", "s.png", "--click", "78,62",
                     "--segment", "grabcut"]) == 0  # fmt: skip
    said = capsys.readouterr()
    assert said.err == ""
    assert re.fullmatch(r"wrote s\.png in \d+\.\d s: \d+% of the photo selected\n", said.out)
    found = cv2.imread("s.png", cv2.IMREAD_UNCHANGED)
    assert set(np.unique(found)) == {0, 255}
    overlap = ((found > 0) & MASK).sum() / ((found > 0) | MASK).sum()
    assert overlap > 0.8


def test_selecting_with_a_mask_gives_the_mask(folder):
    assert cli.main(["select", "photo.png", "-o", "s.png", "--mask", "mask.png"]) == 0
    assert Path("s.png").read_bytes() == Path("mask.png").read_bytes()


def test_an_existing_output_is_replaced(folder):
    Path("out.png").write_bytes(b"old")
    assert _edit(*TURN) == 0
    assert _pixels("out.png").shape == PIXELS.shape


def test_a_photo_can_be_written_as_jpeg(folder):
    assert _edit(*TURN, out="out.jpg") == 0
    assert Path("out.jpg").read_bytes()[:2] == b"\xff\xd8"


# ---- scripts --------------------------------------------------------------------------------


def test_a_script_says_the_same_as_the_options(folder):
    options = ["--handle", "110,62:120,40,0.1", "--pin", "50,62", "--turn", "10,-5,0",
               "--move", "3,4", "--scale", "0.9", "--seed", "3"]  # fmt: skip
    script = {
        "handle": [{"at": [110, 62], "to": [120, 40], "dz": 0.1}], "pin": [[50, 62]],
        "turn": [10, -5, 0], "move": [3, 4], "scale": 0.9, "seed": 3, "mask": "mask.png",
        "gaussians": 300, "trust": 0, "inpaint": "telea",
    }  # fmt: skip
    Path("edit.json").write_text(json.dumps(script))
    assert _edit(*options, out="a.png") == 0
    assert cli.main(["edit", "photo.png", "-o", "b.png", "--script", "edit.json"]) == 0
    assert Path("a.png").read_bytes() == Path("b.png").read_bytes()


def test_the_command_line_wins_over_the_script_even_with_a_default(folder):
    Path("edit.json").write_text('{"turn": [45, 0, 0], "seed": 9}')
    _edit("--script", "edit.json", *TURN, "--seed", "0", out="a.png")
    _edit(*TURN, out="b.png")
    assert Path("a.png").read_bytes() == Path("b.png").read_bytes()


def test_files_of_a_script_lie_beside_it(folder):
    inner = folder / "inner"
    inner.mkdir()
    (inner / "edit.json").write_text(
        '{"photo": "../photo.png", "out": "out.png", "mask": "../mask.png", "gaussians": 300}'
    )
    assert cli.main(["edit", "--script", "inner/edit.json"]) == 0
    assert (inner / "out.png").exists()


def test_a_batch_edits_every_photo(folder):
    Path("other.png").write_bytes(shapes.png(PIXELS[::-1].copy()))
    common = {
        "mask": "mask.png",
        "gaussians": 300,
        "trust": 0,
        "inpaint": "telea",
        "turn": [20, 0, 0],
    }
    Path("batch.json").write_text(json.dumps([
        {"photo": "photo.png", "out": "a.png"} | common,
        {"photo": "other.png", "out": "b.png"} | common,
    ]))  # fmt: skip
    assert cli.main(["edit", "--script", "batch.json"]) == 0
    assert _edit(*TURN, out="c.png") == 0
    assert Path("a.png").read_bytes() == Path("c.png").read_bytes()
    assert Path("b.png").exists()


def test_a_batch_of_which_one_fails_writes_none(folder, capsys):
    common = {"mask": "mask.png", "gaussians": 300, "trust": 0}
    Path("batch.json").write_text(json.dumps([
        {"photo": "photo.png", "out": "a.png"} | common,
        {"photo": "text.jpg", "out": "b.png"} | common,
    ]))  # fmt: skip
    assert cli.main(["edit", "--script", "batch.json"]) != 0
    assert not Path("a.png").exists()


# ---- sessions -------------------------------------------------------------------------------


def test_replaying_a_session_gives_the_same_bytes(folder, capsys):
    wishes = ["--handle", "110,62:120,40", *TURN, "--seed", "4"]
    assert _edit(*wishes, "--session", "s.omorph", "--report", "a.json") == 0
    capsys.readouterr()
    assert cli.main(["replay", "s.omorph", "-o", "again.png", "--report", "b.json"]) == 0
    line = r"wrote again\.png, b\.json in \d+\.\d s: \d+% of the photo changed \(.*%.*\)\n"
    assert re.fullmatch(line, capsys.readouterr().out)
    for command in (["convert", "s.omorph", "o.ply"], ["share", "s.omorph", "-o", "o.html"]):
        assert cli.main(command) == 0
        line = rf"wrote {re.escape(command[-1])} in \d+\.\d s\n"
        assert re.fullmatch(line, capsys.readouterr().out)
    assert Path("again.png").read_bytes() == Path("out.png").read_bytes()
    a, b = (json.loads(Path(name).read_text()) for name in ("a.json", "b.json"))
    assert a["handles"] == b["handles"]
    assert a["pixels"] == b["pixels"]
    capsys.readouterr()
    one_name = ["--save-handles", "h.json", "--report", "../" + folder.name + "/h.json"]
    assert cli.main(["replay", "s.omorph", "-o", "third.png", *one_name]) == cli.FAILED
    assert "two outputs have the same name" in capsys.readouterr().err
    assert not Path("h.json").exists() and not Path("third.png").exists()
    assert cli.main(["info", "s.omorph", "--json"]) == 0
    info = json.loads(capsys.readouterr().out)
    assert info["photo"] == {"name": "photo.png", "width": 160, "height": 120, "bits": 8}
    assert info["seed"] == 4
    assert info["objects"][0]["handles"] == 1
    assert info["objects"][0]["turn"] == [20, 0, 0]
    assert info["objects"][0]["role"] == "edited"
    assert cli.main(["info", "s.omorph"]) == 0
    said = capsys.readouterr().out
    assert "photo: name photo.png, width 160, height 120, bits 8\n" in said
    assert re.search(r"^- Object 1: .*\bmoved: yes\b.*\bturn: 20 0 0\b", said, re.M)
    assert not re.search(r"True|False|None|[][{}_]", said)


def test_a_photo_whose_name_is_not_utf_8_has_a_session(folder):
    name = os.fsdecode(b"caf\xe9")
    try:
        Path("photo.png").rename(f"{name}.png")
    except OSError as error:
        pytest.skip(f"no such names here: {error}")
    assert _edit(*TURN, "--session", f"{name}.omorph", photo=f"{name}.png") == 0
    assert cli.main(["replay", f"{name}.omorph", "-o", "again.png"]) == 0
    assert Path("again.png").read_bytes() == Path("out.png").read_bytes()
    assert cli.main(["share", f"{name}.omorph", "-o", "page.html"]) == 0


def test_a_session_of_an_object_cut_by_the_frame_gives_the_same_bytes(folder):
    inside = shapes.mask("frame")
    Path("photo.png").write_bytes(shapes.png(shapes.picture(inside)))
    Path("mask.png").write_bytes(shapes.mask_png(inside))
    assert _edit("--handle", "120,80:100,60", "--session", "s.omorph") == 0
    assert cli.main(["replay", "s.omorph", "-o", "again.png"]) == 0
    assert Path("again.png").read_bytes() == Path("out.png").read_bytes()


def test_a_session_that_is_none_is_refused(folder, capsys):
    _expect_failure(["replay", "photo.png", "-o", "out.png"], capsys, "photo.png: the session")
    _expect_failure(["info", "text.jpg"], capsys, "text.jpg: the session")


# ---- what fails, fails in one sentence and changes nothing ----------------------------------


def _expect_failure(arguments: list[str], capsys, words: str) -> None:
    """Non-zero, one line on stderr that holds `words`, and no file created or changed."""
    before = _files()
    capsys.readouterr()
    try:
        code = cli.main(arguments)
    except SystemExit as caught:
        code = caught.code
    told = capsys.readouterr()
    assert code not in (0, None)
    assert told.out == ""
    lines = told.err.strip().splitlines()
    assert len(lines) == 1, told.err
    assert lines[0].startswith("objectmorpher: ")
    assert re.search(words, lines[0]), lines[0]
    assert "Traceback" not in told.err
    assert _files() == before


EDIT = ["edit", "photo.png", "-o", "out.png", "--mask", "mask.png", *QUICK]
FAILURES = {
    "not an image": (["edit", "text.jpg", *EDIT[2:]], "not an image"),
    "truncated JPEG": (["edit", "cut.jpg", *EDIT[2:]], "cannot be read"),
    "empty file": (["edit", "nothing.jpg", *EDIT[2:]], "empty"),
    "missing photo": (["edit", "none.png", *EDIT[2:]], "none.png does not exist"),
    "photo is a folder": (["edit", ".", *EDIT[2:]], "folder"),
    "no photo": (["edit", "-o", "out.png"], "which photo"),
    "no output": (["edit", "photo.png", "--mask", "mask.png"], "where to"),
    "no object": (["edit", "photo.png", "-o", "out.png"], "no object is chosen"),
    "click outside": ([*EDIT[:4], "--click", "900,20", "--segment", "grabcut"], "outside|900"),
    "box outside": ([*EDIT[:4], "--box", "500,500,600,600", "--segment", "grabcut"], ""),
    "empty mask": ([*EDIT[:5], "empty.png"], "nothing is selected|empty"),
    "full mask": ([*EDIT[:5], "full.png"], "covers the whole photo"),
    "mask of other size": ([*EDIT[:5], "large.png"], "200.*150|150.*200"),
    "missing mask": ([*EDIT[:5], "none.png"], "none.png does not exist"),
    "mask that is no image": ([*EDIT[:5], "text.jpg"], "text.jpg: .*image"),
    "hidden part that is no image": ([*EDIT, "--hidden", "text.jpg"], "text.jpg: .*image"),
    "front that is no image": ([*EDIT, "--front-mask", "text.jpg"], "text.jpg: .*image"),
    "fill from outside": ([*EDIT, *TURN, "--fill-from", "500,5:9,9"], "fill-from 500,5 is outside"),
    "fill outside": ([*EDIT, *TURN, "--fill-from", "9,9:-4,9"], "fill-from -4,9 is outside"),
    "too many key poses": ([*EDIT, *["--key", "turn=5"] * 12], "key: there are 12 poses.* 11"),
    "handle beside the object": ([*EDIT, "--handle", "5,5:9,9"], "5,5 misses the object"),
    "handle outside the photo": ([*EDIT, "--handle", "500,5:9,9"], "500,5 is outside the photo"),
    "pin beside the object": ([*EDIT, "--pin", "5,5"], "5,5 misses the object"),
    "two places for one point": (
        [*EDIT, "--handle", "78,62:90,62", "--handle", "78,62:60,62"], "different places"),
    "behind the camera": ([*EDIT, "--move", "0,0,-90"], "behind the camera"),
    "scale of nothing": ([*EDIT, "--scale", "0"], "scale of 0"),
    "missing folder": ([*EDIT[:2], "-o", "none/out.png", *EDIT[4:]], "none.*does not exist"),
    "unknown ending": ([*EDIT[:2], "-o", "out.xyz", *EDIT[4:]], "ending"),
    "no ending": ([*EDIT[:2], "-o", "out", *EDIT[4:]], "ending"),
    "output is the input": ([*EDIT[:2], "-o", "photo.png", *EDIT[4:]], "is an input"),
    "output is the mask": ([*EDIT[:2], "-o", "mask.png", *EDIT[4:]], "is an input"),
    "output is the input, written otherwise": (
        [*EDIT[:2], "-o", "../{folder}/photo.png", *EDIT[4:]], "is an input"),
    "two outputs of one name": ([*EDIT, "--save-plate", "out.png"], "same name"),
    "report of unknown ending": ([*EDIT, "--report", "r.txt"], "r.txt.*ending.*json"),
    "report in a missing folder": ([*EDIT, "--report", "none/r.json"], "none"),
    "unknown segmenter": (
        [*EDIT[:4], "--click", "78,62", "--segment", "magic"], "'magic'"),
    "unknown segmenter, not needed": ([*EDIT, "--segment", "magic"], "'magic'"),
    "unknown lifter": ([*EDIT, "--lift", "magic"], "'magic'"),
    "unknown inpainter": ([*EDIT, "--inpaint", "magic", *TURN], "'magic'"),
    "unknown inpainter, not needed": ([*EDIT, "--inpaint", "magic"], "'magic'"),
    "unknown refiner": ([*EDIT, "--refine", "magic"], "'magic'"),
    "no such object": ([*EDIT, "--splats", "x.pdf"], "x.pdf has none of the endings"),
    "unknown deformation": ([*EDIT, "--deform", "jelly"], "jelly"),
    "unknown links": ([*EDIT, "--links", "magic"], "magic"),
    "unknown shadow": ([*EDIT, "--shadow", "dark"], "dark"),
    "too few gaussians": ([*EDIT, "--gaussians", "5"], "gaussians: 5"),
    "field of view": ([*EDIT, "--fov", "200"], "field of view of 200"),
    "unknown option": ([*EDIT, "--magic"], "--magic"),
    "not a point": ([*EDIT, "--click", "abc"], "'abc'"),
    "not a handle": ([*EDIT, "--handle", "1,2"], "'1,2'"),
    "three numbers for a point": ([*EDIT, "--pin", "1,2,3"], "'1,2,3'"),
    "not finite": ([*EDIT, "--move", "nan,3"], "nan"),
    "no command": ([], "command"),
    "unknown command": (["paint"], "paint"),
    "select without a choice": (["select", "photo.png", "-o", "s.png"], "no object is chosen"),
    "select to its mask": (
        ["select", "photo.png", "-o", "mask.png", "--mask", "mask.png"], "is an input"),
    "select to a photo": (
        ["select", "photo.png", "-o", "s.jpg", "--mask", "mask.png"], "ending"),
}  # fmt: skip


@over("case", FAILURES)
def test_a_failure_is_one_sentence_and_leaves_no_file(folder, capsys, case):
    arguments, words = FAILURES[case]
    arguments = [word.replace("{folder}", folder.name) for word in arguments]
    _expect_failure(arguments, capsys, words)


SCRIPTS = {
    "not JSON": ("{", "not JSON"),
    "not an object": ("3", "not a JSON object"),
    "a key pose with another option": ('{"key": [{"refine": "none"}]}', "a pose has no 'refine'"),
    "a key pose beside the object": ('{"key": [{"pin": [[1, 1]]}]}', "key 1: pin 1,1 misses"),
    "an output": ('{"report": "r.json"}', "'report' .*command line"),
    "unknown key": ('{"magic": 1}', "no option 'magic'"),
    "wrong value": ('{"turn": [1, 2, 3, 4]}', "turn"),
    "empty batch": ("[]", "empty"),
    "batch without photos": ('[{"turn": [1, 2, 3]}, {"turn": [1, 2, 3]}]', "batch"),
    "batch of one name": (
        '[{"photo": "photo.png", "out": "x.png", "mask": "mask.png", "gaussians": 300, "trust": 0},'
        ' {"photo": "photo.png", "out": "x.png", "mask": "mask.png", "gaussians": 300}]',
        "same name"),
}  # fmt: skip


@over("case", SCRIPTS)
def test_a_bad_script_is_refused_in_one_sentence(folder, capsys, case):
    text, words = SCRIPTS[case]
    Path("edit.json").write_text(text)
    arguments = ["edit", "--script", "edit.json"]
    _expect_failure(arguments if "batch" in case else [*EDIT, *arguments[1:]], capsys, words)


def test_a_missing_script_is_refused(folder, capsys):
    _expect_failure([*EDIT, "--script", "none.json"], capsys, "none.json does not exist")


def test_a_script_that_is_no_text_is_refused(folder, capsys):
    Path("edit.json").write_bytes(shapes.png(PIXELS))
    _expect_failure([*EDIT, "--script", "edit.json"], capsys, "")


def test_a_failure_leaves_an_existing_output_as_it_was(folder, capsys):
    Path("out.png").write_bytes(b"precious")
    for case in ("not an image", "handle beside the object", "empty mask", "unknown refiner"):
        _expect_failure(FAILURES[case][0], capsys, FAILURES[case][1])
    assert Path("out.png").read_bytes() == b"precious"


def test_an_output_that_is_a_folder_is_refused(folder, capsys):
    Path("out.png").mkdir()
    _expect_failure(EDIT, capsys, "folder")


@pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere"
)
def test_an_unwritable_folder_is_refused(folder, capsys):
    Path("locked").mkdir()
    Path("locked").chmod(0o500)
    try:
        _expect_failure([*EDIT[:2], "-o", "locked/out.png", *EDIT[4:]], capsys, "cannot be written")
    finally:
        Path("locked").chmod(0o700)


def test_where_one_output_cannot_be_written_none_is(folder, capsys):
    Path("r.json").mkdir()
    _expect_failure([*EDIT, "--report", "r.json"], capsys, "r.json is a folder")


# ---- help -----------------------------------------------------------------------------------

DESIGN_OPTIONS = {
    "--click", "--not-click", "--box", "--subject", "--mask", "--segment", "--lift", "--inpaint",
    "--refine", "--splats", "--pin", "--handle", "--move", "--turn", "--scale", "--deform",
    "--links", "--faithful", "--nodes", "--stiffness", "--stretch-limit", "--split",
    "--script", "--session", "--save-mask",
    "--save-plate", "--save-object", "--save-splats", "--save-layers", "--save-depth",
    "--save-video", "--video",
    "--seconds", "--report", "--seed", "--fov", "--shadow",
}  # fmt: skip


def _help(*command: str, capsys) -> str:
    with pytest.raises(SystemExit) as caught:
        cli.main([*command, "--help"])
    assert caught.value.code == 0
    return capsys.readouterr().out


def test_the_help_of_edit_lists_every_option_of_the_design(capsys):
    told = _help("edit", capsys=capsys)
    assert set(re.findall(r"--[a-z][a-z-]*", told)) >= DESIGN_OPTIONS


def test_every_option_of_a_script_is_one_of_the_command_line(capsys):
    told = set(re.findall(r"--[a-z][a-z-]*", _help("edit", capsys=capsys)))
    names = {"--" + name.replace("_", "-") for name in EditScript.__dataclass_fields__}
    assert names <= told


def test_the_help_lists_the_subcommands(capsys):
    told = _help(capsys=capsys)
    assert all(command in told for command in cli.COMMANDS)


def test_the_bench_reports_what_the_design_names(folder):
    assert cli.main(["bench", "deform", "--quick", "--json", "b.json"]) == 0
    report = json.loads(Path("b.json").read_text())
    assert set(report["machine"]) == {"cpu", "cores", "gl_renderer"}
    rows = {row["mode"]: row for row in report["rows"]}
    for mode in ("faithful", "default"):
        row = rows[mode]
        assert set(row) == {
            "mode", "nodes", "links", "handles", "solve_ms", "solve_p99_ms", "set_handles_ms",
            "energy_gap", "skin_ms", "gaussians",
        }  # fmt: skip
        assert row["nodes"] == 512
        assert row["energy_gap"] > -1e-6, "no frame is better than the minimum"
        assert 0 < row["solve_ms"] <= row["solve_p99_ms"]
    assert rows["default"]["energy_gap"] < rows["faithful"]["energy_gap"]


def test_the_version_is_told(capsys):
    from objectmorpher import __version__

    with pytest.raises(SystemExit):
        cli.main(["--version"])
    assert __version__ in capsys.readouterr().out


def test_the_parser_is_built_without_heavy_imports():
    """`--help` answers at once: no numpy, numba, OpenCV or scipy is imported for it."""
    code = (
        "import sys; from objectmorpher.cli.parser import build_parser; build_parser();"
        "print([m for m in ('numpy', 'numba', 'cv2', 'scipy', 'PIL') if m in sys.modules])"
    )
    told = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert told.stdout.strip() == "[]"


def test_the_program_runs_as_a_module(folder):
    told = subprocess.run(
        [sys.executable, "-m", "objectmorpher", *EDIT, *TURN], cwd=folder, capture_output=True,
        text=True,
        env=os.environ | {"PYTHONPATH": PYTHONPATH}, check=False,
    )  # fmt: skip
    assert (told.returncode, told.stderr) == (0, "")
    assert Path("out.png").exists()


def test_a_failing_program_exits_with_a_code_and_a_sentence(folder):
    told = subprocess.run(
        [sys.executable, "-m", "objectmorpher", "edit", "none.png", *EDIT[2:]], cwd=folder,
        capture_output=True, text=True, env=os.environ | {"PYTHONPATH": PYTHONPATH}, check=False,
    )  # fmt: skip
    assert told.returncode == cli.FAILED
    assert told.stderr == "objectmorpher: none.png does not exist\n"
