"""`import objectmorpher_core as om`: the bytes of the command line, one sentence for failures."""

from __future__ import annotations

import io
import json
import re
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image, ImageCms, ImageShow
from scipy import ndimage

import objectmorpher_core as om
from objectmorpher import __version__
from objectmorpher.cli import parser as cli
from objectmorpher_core.pictures.image import read_picture
from tests import shapes
from tests.tree import over

pytestmark = pytest.mark.usefixtures("lifted_once")

ROOT = Path(__file__).parents[2]
MASK = shapes.mask("ellipse")
PIXELS = shapes.picture(MASK)
QUICK = {"gaussians": 300, "inpaint": "telea"}
QUICK_SAID = ["--gaussians", "300", "--inpaint", "telea"]
TOP, BELOW = (78, 45), (78, 80)  # px, on the object


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """A working directory with a photo and its mask."""
    monkeypatch.chdir(tmp_path)
    Path("photo.png").write_bytes(shapes.png(PIXELS))
    Path("mask.png").write_bytes(shapes.mask_png(MASK))
    return tmp_path


def _edit() -> om.Edit:
    return om.open("photo.png").mask("mask.png").options(**QUICK)


def _cli(*more: str) -> bytes:
    said = ["edit", "photo.png", "-o", "cli.png", "--mask", "mask.png", *QUICK_SAID, *more]
    assert cli.main(said) == 0
    return Path("cli.png").read_bytes()


EDITS = {
    "turned": (lambda e: e.turn(20, 5, 0), ["--turn", "20,5,0"]),
    "dragged": (
        lambda e: e.pin(*BELOW).drag(TOP, (86, 45), 0.1).harmonise(),
        ["--pin", "78,80", "--handle", "78,45:86,45,0.1", "--refine", "harmonise"],
    ),
    "moved": (
        lambda e: e.move(9, -4).scale(0.9).options(shadow="none", stiffness=2.0),
        ["--move", "9,-4", "--scale", "0.9", "--shadow", "none", "--stiffness", "2"],
    ),
    "gone": (lambda e: e.remove(), ["--remove"]),
    "thin": (
        lambda e: e.options(thickness=0.4).turn(30), ["--thickness", "0.4", "--turn", "30,0,0"],
    ),
}  # fmt: skip


@over("name", EDITS)
def test_the_command_line_gives_the_same_bytes(folder, name):
    edited, said = EDITS[name]
    edited(_edit()).render().save("api.png")
    assert Path("api.png").read_bytes() == _cli(*said)


@over("name", EDITS)
def test_lifting_first_changes_nothing(folder, name):
    edited, _ = EDITS[name]
    assert edited(_edit().lift()).render().encode() == edited(_edit()).render().encode()


def test_every_further_output_is_that_of_the_command_line(folder):
    kinds = {
        "mask": "mask-of.png", "plate": "plate.png", "object": "object.png", "depth": "depth.png",
        "layers": "layers.ora", "splats": "splats.ply",
    }  # fmt: skip
    said = [w for k, name in kinds.items() for w in (f"--save-{k}", f"cli-{name}")]
    _cli("--turn", "20,0,0", *said, "--session", "cli.omorph")
    result = _edit().turn(20).plate("telea").render()
    for what, name in kinds.items():
        result.save(name, what)
        assert Path(name).read_bytes() == Path(f"cli-{name}").read_bytes(), what
    result.save("api.omorph", "session")
    assert Path("api.omorph").read_bytes() == Path("cli.omorph").read_bytes()
    assert om.replay("api.omorph").encode() == result.encode()


def test_a_script_file_is_the_command_lines(folder):
    script = {
        "photo": "photo.png", "out": "cli.png", "mask": "mask.png", "turn": [10, 0, 0], **QUICK,
        "objects": [{"duplicate": 1, "move": [30, 0]}],
    }  # fmt: skip
    (folder / "scripts").mkdir()
    Path("edit.json").write_text(json.dumps(script))
    assert cli.main(["edit", "--script", "edit.json"]) == 0
    (edit,) = om.read_scripts("edit.json")
    assert edit.render().encode() == Path("cli.png").read_bytes()


def test_a_photo_may_be_a_path_bytes_an_array_or_an_image_of_pillow(folder, networks):
    wide = PIXELS.astype(np.uint16) * 257
    alpha = np.where(MASK, 255, 60).astype(np.uint8)
    image = Image.open(folder / "photo.png")
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    turned = image.transpose(Image.Transpose.ROTATE_90)  # as a camera on its side stores it
    turned.info["icc_profile"] = profile
    turned.getexif()[0x0112] = 6
    photos = (
        "photo.png", folder / "photo.png", shapes.png(PIXELS), PIXELS, wide, image, turned,
        image.convert("P"), image.convert("CMYK"), np.dstack([PIXELS, alpha]), PIXELS[..., 1],
        image.convert("L"), Image.fromarray(wide[..., 1]),
    )  # fmt: skip
    opened = [om.open(photo).document.photo for photo in photos]
    for photo in opened[:4] + opened[5:7] + opened[9:10]:
        assert np.array_equal(photo.pixels, PIXELS)
    assert opened[4].pixels.dtype == np.uint16 and np.array_equal(opened[4].pixels, wide)
    assert opened[6].picture.icc == profile
    assert opened[8].pixels.shape == PIXELS.shape
    assert (opened[9].picture.alpha == alpha).all()
    for photo in opened[10:]:
        assert photo.picture.is_grey and photo.pixels.shape == PIXELS.shape
    assert opened[12].pixels.dtype == np.uint16
    result = om.open(photos[9]).mask(MASK).options(**QUICK).turn(20).render()
    found, beside = result.to_numpy()[..., 3], ndimage.distance_transform_edt(~MASK)
    assert np.array_equal(found[beside > 20], alpha[beside > 20])
    assert (found[ndimage.binary_erosion(MASK, iterations=12)] == 255).all()
    assert result.to_pil().mode == "RGBA"
    om.replay(result.encode(".omorph", "session"))  # what was opened can be kept


def test_a_result_is_an_array_an_image_and_a_picture_in_a_notebook(folder):
    result = _edit().turn(20).plate("telea").render()
    pixels = result.to_numpy()
    assert np.array_equal(pixels, result.pixels) and pixels.flags.writeable
    pixels[:] = 0
    assert result.pixels.any()
    assert np.array_equal(np.asarray(result.to_pil()), result.pixels)
    preview = read_picture(result._repr_png_()).pixels
    assert np.array_equal(preview, result.pixels), "it is small enough to be shown whole"
    assert np.array_equal(result.to_numpy("mask"), MASK)
    for what, ending in (("plate", ".png"), ("object", ".png"), ("depth", ".png")):
        saved = Image.open(io.BytesIO(result.encode(ending, what)))
        assert np.array_equal(np.asarray(saved), result.to_numpy(what)), what
        assert np.array_equal(np.asarray(result.to_pil(what)), result.to_numpy(what)), what


def test_a_result_is_shown_by_the_systems_viewer(folder, monkeypatch):
    monkeypatch.setattr(ImageShow, "_viewers", [])
    result = _edit().turn(20).render()
    with pytest.raises(RuntimeError, match="save the result"):
        result.show()
    seen = []

    class Viewer(ImageShow.Viewer):
        format = "PNG"  # as those of every system

        def show_file(self, path, **options):
            seen.append(np.asarray(Image.open(path)))
            return 1

    ImageShow.register(Viewer())
    result.show("object")
    assert np.array_equal(seen[0], result.to_numpy("object"))


def test_progress_is_a_function_or_a_bar(folder):
    lifting: list[tuple[float, str]] = []
    rendering: list[tuple[float, str]] = []
    lifted = _edit().lift(lambda *step: lifting.append(step))
    lifted.turn(20).render(lambda *step: rendering.append(step))
    for told in (lifting, rendering):
        assert told[-1][0] == 1 and len(told) > 2
        assert all(0 <= fraction <= 1 and note for fraction, note in told)
    tqdm = pytest.importorskip("tqdm")
    for total in (None, 1.0, 7):
        with tqdm.tqdm(total=total, file=io.StringIO()) as bar:
            lifted.turn(20).render(bar)
            assert bar.n == bar.total and rendering[-1][1] in bar.desc


def test_an_edit_and_a_result_are_one_line(folder):
    edit = _edit().lift().turn(20).drag(TOP, (86, 45))
    assert repr(edit) == (
        "<Edit of photo.png: 160 x 120 px; inpaint='telea', gaussians=300, "
        "handle=({at: (78, 45), to: (86, 45), dz: 0}), turn=(20, 0, 0), mask, lifted>"
    )
    result = repr(edit.render())
    assert re.fullmatch(
        r"<Result of photo.png: 160 x 120 px; \d+% of the photo changed \(.*own.*\)>", result
    )
    assert repr(_edit().render()).endswith("nothing changed>")
    long = om.open(PIXELS).options(click=[(n, n) for n in range(100)])
    assert len(repr(long)) < 200


def test_an_edit_stays_as_it_was(folder):
    edit = _edit()
    before = edit.script, edit.document
    lifted = edit.lift()
    lifted.turn(20).pin(*BELOW).render()
    assert (edit.script, edit.document) == before
    assert not edit.document.objects and not lifted.script.pin
    assert np.array_equal(read_picture(edit.render().encode()).pixels, PIXELS)


def test_what_is_told_of_the_object_after_lifting_lifts_it_anew(folder):
    lifted = _edit().lift().turn(30)
    assert lifted.document.objects
    thin = lifted.options(thickness=0.3)
    assert not thin.document.objects
    assert thin.render().encode() == _edit().options(thickness=0.3).turn(30).render().encode()
    other = np.roll(MASK, 3, axis=1)
    assert np.array_equal(lifted.mask(other).selection, other)


def test_the_selection_is_what_is_edited(folder):
    assert np.array_equal(_edit().selection, MASK)
    assert np.array_equal(_edit().lift().selection, MASK)
    assert np.array_equal(om.open(shapes.png(PIXELS)).mask(MASK).selection, MASK)
    beside = om.open("photo.png").options(fov=60, mask="mask.png")
    assert np.array_equal(beside.selection, MASK)
    clicked = om.open("photo.png").options(segment="grabcut").click(78, 62).selection
    assert (clicked & MASK).sum() / (clicked | MASK).sum() > 0.8


def test_a_soft_mask_keeps_its_edge() -> None:
    soft = cv2.GaussianBlur(np.where(MASK, np.uint8(255), np.uint8(0)), (0, 0), 4)
    edit = om.open(shapes.png(PIXELS)).mask(soft)
    assert np.array_equal(edit.selection, soft >= 128)
    matte = edit.lift(gaussians=300).document.objects[0].matte
    assert matte is not None
    x0, y0, x1, y1 = matte.box
    off = np.abs(matte.alpha - soft[y0:y1, x0:x1] / 255)
    assert off.max() < 0.02
    numbers = MASK.astype(np.uint8)  # 0 and 1
    assert np.array_equal(om.open(shapes.png(PIXELS)).mask(numbers).selection, MASK)


def test_figures_and_pixels_are_plain(folder):
    result = _edit().turn(20).render()
    assert json.loads(json.dumps(result.report))["object"]["gaussians"] > 0
    assert np.array_equal(result.pixels, read_picture(result.encode()).pixels)
    assert (result.pixels != PIXELS).any()
    assert result.encode("png") == result.encode(".png")


WRONG = {
    "no file": lambda: om.open("nothing.jpg"),
    "a folder": lambda: om.open("."),
    "no picture": lambda: om.open(b"text"),
    "a field of view": lambda: om.open("photo.png", fov=400),
    "an option": lambda: _edit().options(nose=1),
    "a value": lambda: _edit().scale("large"),  # type: ignore[arg-type]
    "a scale of nothing": lambda: _edit().scale(0),
    "a mask of numbers": lambda: _edit().mask(np.zeros(MASK.shape)),
    "a mask of another size": lambda: _edit().mask(MASK[:9]).render(),
    "an empty mask": lambda: _edit().mask(np.zeros_like(MASK)).lift(),
    "nothing chosen": lambda: om.open("photo.png").render(),
    "a backend": lambda: _edit().options(lift="magic").lift(),
    "a point beside it": lambda: _edit().drag((1, 1), (9, 9)).render(),
    "an ending": lambda: _edit().render().save("out.gif"),
    "an output": lambda: _edit().render().save("out.png", "everything"),
    "no background": lambda: _edit().render().save("out.png", "plate"),
    "no such folder": lambda: _edit().render().save("nowhere/out.png"),
    "an array of fractions": lambda: om.open(PIXELS / 255),
    "an array of two axes more": lambda: om.open(PIXELS[None, None]),
    "an empty array": lambda: om.open(PIXELS[:0]),
    "an image of numbers": lambda: om.open(Image.fromarray(PIXELS[..., 0]).convert("F")),
    "an output in memory": lambda: _edit().render().to_pil("layers"),
    "no background in memory": lambda: _edit().render().to_numpy("plate"),
    "a pin beside it": lambda: _edit().turn(9).pin(1, 1).render(),
    "a script": lambda: om.read_scripts("photo.png"),
    "a session": lambda: om.replay("photo.png"),
}


@over("name", WRONG)
def test_a_failure_is_one_sentence_and_writes_nothing(folder, name):
    before = sorted(folder.iterdir())
    with pytest.raises((ValueError, OSError)) as caught:
        WRONG[name]()
    told = str(caught.value)
    assert told and "\n" not in told and "Errno" not in told and "codec" not in told
    assert "--" not in told, "that is the command line's"
    assert len(told) < 200
    assert sorted(folder.iterdir()) == before


def test_what_is_no_photo_at_all_is_a_type_error():
    with pytest.raises(TypeError, match="not NoneType"):
        om.open(None)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="did you mean thickness"):
        om.open(PIXELS).options(thicknes=2)


def test_importing_it_imports_nothing_else():
    code = (
        "import sys; before = set(sys.modules); import objectmorpher_core as om; "
        "new = {m.split('.')[0] for m in set(sys.modules) - before}; "
        "print(*sorted(new - set(sys.stdlib_module_names))); dir(om); om.__version__; "
        "assert 'numpy' not in sys.modules; om.open; assert 'numpy' in sys.modules; "
        "assert not {'torch', 'onnxruntime', 'trimesh', 'objectmorpher', 'moderngl'} "
        "& set(sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["objectmorpher_core"]


def test_the_stable_names_are_there_and_told_of():
    page = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    for name in om.__all__:
        assert getattr(om, name) is not None
        assert f"om.{name}" in page
    for kind in (om.Edit, om.Result):
        for name in vars(kind):
            is_told = f"`{name}" in page or f"`{kind.__name__}.{name}" in page
            assert name.startswith("_") or is_told, f"{kind.__name__}.{name}"
    with pytest.raises(AttributeError):
        om.nothing  # noqa: B018


def test_there_is_one_version():
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert f'version = "{__version__}"' in project
    assert om.__version__ == __version__
