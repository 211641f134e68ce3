"""The export dialog's choices, and the files that come of them."""

from __future__ import annotations

import io
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

from editor_steps import CENTRE, HEIGHT, WIDTH, wait_for_jobs, wait_until
from objectmorpher.commands import run
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.export_plan import FORMATS, Format, VideoMotion, What
from objectmorpher.editor.settings import Settings
from objectmorpher.gui.window.status import job_text
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Placement
from objectmorpher_core.pictures.image import read_picture
from objectmorpher_core.scripting.outputs import Export, unmoved_cutout


@pytest.fixture
def moved(editor: Editor, ball: Document, tmp_path: Path) -> Editor:
    """The ball is lifted and moved; nothing was exported before."""
    editor.settings = Settings(gaussians=3000)
    editor.start(ball)
    editor.tab.source = tmp_path / "ball.png"
    editor.apply("Move object", edits.set_placement(ball, 0, Placement(move=(25.0, -4.0))))
    return editor


def export(editor: Editor, what: What, format: Format) -> Path:
    exporting = editor.exporting
    exporting.open()
    exporting.choose_what(what)
    exporting.choose_format(format)
    path = exporting.path
    assert exporting.problem is None
    exporting.confirm()
    wait_for_jobs(editor)
    assert editor.message is not None and not editor.message.is_error, editor.message
    return path


def test_two_steps_export_the_photo(moved: Editor, tmp_path: Path) -> None:
    run(moved, "export")
    assert moved.exporting.label == "Export ball-edited.png"
    moved.exporting.confirm()
    assert moved.exporting.draft is None
    wait_for_jobs(moved)
    assert Image.open(tmp_path / "ball-edited.png").size == (WIDTH, HEIGHT)


@pytest.mark.parametrize("format", FORMATS[What.PHOTO])
def test_the_photo_in_every_format(moved: Editor, format: Format) -> None:
    path = export(moved, What.PHOTO, format)
    picture = read_picture(path.read_bytes())
    assert picture.pixels.shape == (HEIGHT, WIDTH, 3)
    if format is not Format.JXL:  # which Pillow does not know
        assert Image.open(path).format == format.value.upper()


def test_the_cut_out_is_the_object_alone_where_it_is_now(moved: Editor) -> None:
    path = export(moved, What.CUTOUT, Format.PNG)
    cutout = np.asarray(Image.open(path))
    assert cutout.shape == (HEIGHT, WIDTH, 4)
    alpha, (x, y) = cutout[..., 3], (round(CENTRE[0]), round(CENTRE[1]))
    assert alpha[y - 4, x + 25] == 255
    assert alpha[y, x - 30] == 0  # the ball was there
    assert (alpha[:, :20] == 0).all()


def test_an_object_that_was_not_moved_is_cut_out_of_the_photo(
    editor: Editor, ball: Document
) -> None:
    editor.settings = Settings()
    editor.start(ball)
    editor.tab.source = None
    editor.exporting.open()
    editor.exporting.choose_what(What.CUTOUT)
    assert ball.objects[0].mask is not None
    editor.exporting.close()
    cutout = unmoved_cutout(ball, ball.objects[0])
    inside = cutout[..., 3] == 255
    assert (inside & ~ball.objects[0].mask).mean() < 0.01
    difference = cutout[..., :3][inside].astype(int) - ball.photo.pixels[inside]
    assert np.abs(difference).max() <= 1  # 8-bit rounding


def test_mask_and_background(moved: Editor, ball: Document) -> None:
    mask = np.asarray(Image.open(export(moved, What.MASK, Format.PNG)))
    np.testing.assert_array_equal(mask > 127, ball.objects[0].mask)
    background = np.asarray(Image.open(export(moved, What.BACKGROUND, Format.PNG)))
    x, y = (round(v) for v in CENTRE)
    assert ball.plate is not None
    assert background[y, x, 0] < background[y, x, 2]  # the wall, not the red ball


def test_layers_over_each_other_are_the_photo(moved: Editor) -> None:
    folder = export(moved, What.LAYERS, Format.PNG)
    names = sorted(path.name for path in folder.iterdir())
    assert names == [
        "ball-0-photo.png", "ball-1-background.png", "ball-2-object-1.png", "ball-3-composite.png",
    ]  # fmt: skip
    bottom, *layers, whole = (np.asarray(Image.open(folder / n)).astype(float) for n in names)
    stacked = bottom
    for layer in layers:
        alpha = layer[..., 3:] / 255
        stacked = stacked * (1 - alpha) + layer[..., :3] * alpha
    assert np.abs(stacked - whole).max() <= 2


def test_a_layers_file_name_says_how_it_is_mixed(moved: Editor) -> None:
    item = moved.document.objects[0]
    document = moved.document.with_object(
        0, replace(item, finish=replace(item.finish, blend_mode="soft light"))
    )
    names = [path.name for path in Export(document).files("layers", Path("folder"))]
    assert "ball-2-object-1-soft-light.png" in names


def test_layers_of_a_png_photo_are_one_file_until_a_folder_is_chosen(
    moved: Editor, tmp_path: Path
) -> None:
    exporting = moved.exporting

    def proposed() -> Path:
        exporting.open()
        exporting.choose_what(What.LAYERS)
        path = exporting.path
        exporting.close()
        return path

    assert moved.document is not None and moved.document.photo.name == "ball.png"
    assert proposed() == tmp_path / "ball-layers.ora"
    export(moved, What.PHOTO, Format.WEBP)
    assert proposed() == tmp_path / "ball-layers.ora", "what photos are written as is no matter"
    for format, name in ((Format.PSD, "ball-layers.psd"), (Format.PNG, "ball-layers")):
        export(moved, What.LAYERS, format)
        assert proposed() == tmp_path / name, "as they were written last"
        exporting.open()
        assert exporting.path == tmp_path / "ball-edited.webp", "the photo as it was written last"
        exporting.close()


def test_layers_in_one_file(moved: Editor, tmp_path: Path) -> None:
    path = export(moved, What.LAYERS, Format.OPENRASTER)
    assert path.name == "ball-layers.ora"
    with zipfile.ZipFile(path) as archive:
        assert archive.read("mimetype") == b"image/openraster"
        whole = np.asarray(Image.open(io.BytesIO(archive.read("mergedimage.png"))))
    assert whole.shape == (HEIGHT, WIDTH, 3)
    moved.exporting.open()
    moved.exporting.choose_what(What.LAYERS)
    moved.exporting.choose_format(Format.PNG)  # a folder again
    assert moved.exporting.path == tmp_path / "ball-layers"
    moved.exporting.close()
    moved.exporting.export_to(tmp_path / "dropped.ora")
    wait_for_jobs(moved)
    assert (tmp_path / "dropped.ora").read_bytes() == path.read_bytes()


def test_depth_is_grey_and_sixteen_bits_deep(moved: Editor) -> None:
    near = np.asarray(Image.open(export(moved, What.DEPTH, Format.PNG)))
    assert near.dtype.itemsize >= 2 and near.shape == (HEIGHT, WIDTH)
    x, y = (round(v) for v in CENTRE)
    assert near[y - 4, x + 25] > 0.9 * 65535  # the ball bulges towards the camera
    assert near[4, 4] == 0


def test_a_video_shows_what_is_wanted(moved: Editor, ball: Document) -> None:
    exporting = moved.exporting
    exporting.open()
    exporting.choose_what(What.VIDEO)
    exporting.choose_format(Format.GIF)
    assert exporting.path.name == "ball-video.gif" and not exporting.has_quality
    exporting.choose_seconds(1.0)
    path = exporting.path
    exporting.confirm()
    wait_for_jobs(moved)
    with Image.open(path) as video:
        assert video.size == (WIDTH, HEIGHT)
        assert sum(frame.info["duration"] for frame in ImageSequence.Iterator(video)) == 1000  # ms
    moved.apply("Move object", edits.set_placement(ball, 0, Placement()))
    exporting.open()  # a video as it was last, but for what cannot be shown
    exporting.choose_what(What.VIDEO)
    assert exporting.draft is not None
    assert exporting.draft.motion is VideoMotion.SWAY and exporting.draft.seconds == 1.0
    exporting.choose_motion(VideoMotion.MORPH)
    assert exporting.problem == "Move or pose an object first"
    exporting.close()
    exporting.export_to(path.with_suffix(".mp4"))  # a photo is no film
    assert moved.message is not None and moved.message.is_error


def test_a_video_is_a_film_until_pictures_are_wanted(moved: Editor, tmp_path: Path) -> None:
    """Also of a PNG file, and after one was written; each of both remembers its own format."""
    exporting = moved.exporting

    def begun() -> Format:
        exporting.open()
        exporting.choose_what(What.VIDEO)
        assert exporting.draft is not None and not exporting.has_bits
        return exporting.draft.format

    assert moved.source == tmp_path / "ball.png"
    assert begun() is FORMATS[What.VIDEO][0] and not exporting.is_folder
    export(moved, What.PHOTO, Format.PNG)
    export(moved, What.PHOTO, Format.WEBP)
    assert begun() is FORMATS[What.VIDEO][0]
    exporting.choose_what(What.PHOTO)
    exporting.choose_what(What.VIDEO)
    for chosen in (Format.PNG, Format.GIF):
        exporting.choose_format(chosen)
        exporting.choose_seconds(1.0)
        assert exporting.is_folder == (chosen is Format.PNG) and not exporting.has_bits
        exporting.confirm()
        assert begun() is chosen
    exporting.choose_what(What.PHOTO)
    exporting.close()
    exporting.open()
    assert exporting.draft is not None and exporting.draft.format is Format.WEBP
    exporting.close()
    wait_for_jobs(moved)


def film(editor: Editor, folder: Path) -> Path:
    """A film that is being written."""
    editor.settings = replace(editor.settings, export_folder=str(folder))
    editor.exporting.open()
    editor.exporting.choose_what(What.VIDEO)
    editor.exporting.choose_format(Format.GIF)
    editor.exporting.choose_seconds(1.0)
    path = editor.exporting.path
    assert path.parent == folder
    editor.exporting.confirm()
    return path


@pytest.mark.parametrize("what", ["film", "photo"])
def test_quitting_waits_for_a_file_unless_it_is_stopped(
    moved: Editor, ball: Document, tmp_path: Path, what: str
) -> None:
    def begin() -> Path:
        moved.start(edits.set_placement(ball, 0, Placement(move=(25.0, -4.0))))
        if what == "film":
            return film(moved, tmp_path)
        path = tmp_path / "copy.png"
        moved.exporting.export_to(path)
        return path

    path = begin()
    run(moved, "quit")
    assert not moved.is_over and moved.filing.writing == (path.name,)
    moved.filing.answer_stop()
    wait_until(moved, lambda: moved.is_over)
    assert not path.exists()
    moved.is_over = False
    assert begin() == path
    run(moved, "quit")
    moved.filing.answer_stay()
    wait_for_jobs(moved)
    assert path.exists() and not moved.is_over
    path.unlink()
    assert begin() == path
    run(moved, "quit")
    wait_until(moved, lambda: moved.is_over)
    assert path.exists()
    moved.is_over = False


def test_an_export_that_is_stopped_says_so(moved: Editor, tmp_path: Path) -> None:
    path = film(moved, tmp_path)
    moved.jobs.cancel()
    wait_for_jobs(moved)
    assert moved.message is not None and moved.message.text == f"{path.name} was not written"
    assert not path.exists()


def test_what_waits_for_a_film_is_told_beside_it(moved: Editor, tmp_path: Path) -> None:
    """Another object is lifted while a film is written, on which that may take minutes."""
    thing = moved.chosen
    assert thing.mask is not None and moved.document is not None
    other = edits.add_object(moved.document)
    moved.apply("Select", edits.set_mask(other, 1, thing.mask, thing.prompt))
    path = film(moved, tmp_path)
    moved.current = 1
    run(moved, "lift")
    job = moved.jobs.shown
    assert job is not None and job.title == f"Exporting {path.name}"
    told = job_text(job, moved.jobs.held_up)
    assert told.endswith(" · waiting: Lifting the object"), told
    wait_until(moved, lambda: moved.is_lifted)
    assert path.exists() and moved.jobs.held_up == ()
    wait_for_jobs(moved)


def test_a_file_that_cannot_be_written_ends_the_waiting(moved: Editor, ball: Document) -> None:
    moved.start(ball)
    moved.exporting.export_to(Path("/nowhere/copy.png"))
    run(moved, "quit")
    wait_until(moved, lambda: moved.filing.leaving is None)
    assert not moved.is_over and moved.message is not None and moved.message.is_error


def test_a_film_is_written_to_its_end_after_its_tab_is_closed(
    moved: Editor, tmp_path: Path
) -> None:
    path = film(moved, tmp_path)
    run(moved, "close")
    moved.filing.answer_discard()
    wait_for_jobs(moved)
    assert moved.document is None and path.exists()


def test_bit_depth_is_the_photos_own_until_another_is_chosen(moved: Editor) -> None:
    exporting = moved.exporting
    exporting.open()
    assert exporting.bits == 8
    exporting.choose_bits(16)
    path = exporting.path
    exporting.confirm()
    wait_for_jobs(moved)
    wide = read_picture(path.read_bytes()).pixels
    assert wide.dtype == np.uint16
    narrow = read_picture(export(moved, What.PHOTO, Format.WEBP).read_bytes()).pixels
    np.testing.assert_array_equal(wide, narrow.astype(np.uint16) * 257)


def test_quality_makes_files_smaller(moved: Editor) -> None:
    sizes = []
    for quality in (100, 60):
        moved.exporting.open()
        moved.exporting.choose_format(Format.WEBP)
        moved.exporting.choose_quality(quality)
        moved.exporting.set_name(f"{quality}.webp")
        path = moved.exporting.path
        moved.exporting.confirm()
        wait_for_jobs(moved)
        sizes.append(path.stat().st_size)
    assert sizes[1] < sizes[0]
    assert (moved.settings.webp_quality, moved.settings.quality) == (60, 95)


def test_name_and_format_follow_each_other(moved: Editor, tmp_path: Path) -> None:
    exporting = moved.exporting
    exporting.open()
    exporting.choose_format(Format.JPEG)
    assert exporting.path == tmp_path / "ball-edited.jpg"
    exporting.set_name("other.tif")
    assert exporting.draft is not None and exporting.draft.format is Format.TIFF
    exporting.set_name("no ending")
    assert exporting.path == tmp_path / "no ending.tif"
    exporting.set_name(str(tmp_path / "folder" / "x.png"))
    assert exporting.problem is not None  # no such folder
    exporting.set_name("x.gif")
    assert exporting.problem is not None and "gif" in exporting.problem
    exporting.set_name("x.xyz")
    assert exporting.path.name == "x.xyz.png" and exporting.path.name in exporting.renaming
    exporting.set_name("x.psd")
    assert exporting.draft.what is What.LAYERS and exporting.problem is None
    assert not exporting.renaming
    exporting.set_name("x.png")
    assert exporting.draft.what is What.PHOTO and exporting.path == tmp_path / "x.png"
    exporting.set_name("  ")
    assert exporting.problem == "Type a file name"
    exporting.choose_what(What.MASK)
    assert exporting.path.name == "ball-mask.png"
    exporting.set_name("my ball, 1.5")
    for what, name in (
        (What.PHOTO, "my ball, 1.5.png"), (What.VIDEO, "my ball, 1.5.webm"),
        (What.CUTOUT, "my ball, 1.5.png"),
    ):  # fmt: skip
        exporting.choose_what(what)
        assert exporting.path.name == name, "what was typed stays"
    exporting.choose_format(Format.WEBP)
    assert exporting.path.name == "my ball, 1.5.webp"


def test_a_file_that_exists_is_replaced_only_after_asking(moved: Editor, tmp_path: Path) -> None:
    there = tmp_path / "ball-edited.png"
    there.write_bytes(b"mine")
    exporting = moved.exporting
    exporting.open()
    exporting.confirm()
    assert exporting.label == "Replace ball-edited.png"
    assert there.read_bytes() == b"mine"
    exporting.set_name("ball-edite.png")
    assert not exporting.is_replacing
    exporting.set_name("ball-edited.png")
    exporting.confirm()
    exporting.confirm()
    wait_for_jobs(moved)
    assert there.read_bytes() != b"mine"


def test_the_opened_photo_is_no_target(moved: Editor, tmp_path: Path) -> None:
    moved.exporting.open()
    moved.exporting.set_name("ball.png")
    assert moved.exporting.problem is not None
    link = tmp_path / "link.png"
    link.symlink_to(tmp_path / "ball.png")
    moved.exporting.set_name("link.png")
    assert moved.exporting.problem is not None


def test_the_last_choice_is_remembered(moved: Editor) -> None:
    """The photo comes first each time, as the command says; a format only if it was chosen."""
    exporting = moved.exporting
    export(moved, What.CUTOUT, Format.WEBP)
    exporting.open()
    assert exporting.draft is not None
    assert (exporting.draft.what, exporting.draft.format) == (What.PHOTO, Format.WEBP)
    exporting.choose_format(Format.JPEG)
    exporting.confirm()
    exporting.open()
    exporting.choose_what(What.CUTOUT)  # which is no JPEG
    assert exporting.draft.format is Format.PNG
    exporting.confirm()
    exporting.open()
    assert exporting.draft.format is Format.JPEG
    moved.settings = replace(moved.settings, export_format="GIF")
    exporting.open()
    assert (exporting.draft.what, exporting.draft.format) == (What.PHOTO, Format.PNG)
    exporting.close()
    wait_for_jobs(moved)


def test_the_format_of_another_photo_is_not_offered_where_it_would_lose_something(
    moved: Editor, ball: Document
) -> None:
    moved.settings = replace(moved.settings, export_format="JPEG")
    moved.exporting.open()
    assert moved.exporting.draft is not None
    assert moved.exporting.draft.format is Format.JPEG
    picture = ball.photo.picture
    clear = replace(picture, alpha=np.full(picture.pixels.shape[:2], 99, np.uint8))
    deep = replace(picture, pixels=picture.pixels.astype(np.uint16) * 257)
    for kept, wrong in ((clear, "JPEG"), (deep, "JPEG"), (deep, "WebP")):
        moved.start(Document(replace(ball.photo, picture=kept)))
        moved.settings = replace(moved.settings, export_format=wrong)
        moved.exporting.open()
        assert moved.exporting.draft.format is Format.PNG, "its own"
    moved.exporting.close()


@pytest.mark.parametrize("name", ["/", "..", "~", "~nobody/x", "x" * 300, "a/b", ".", "\0"])
def test_no_name_that_is_typed_breaks_anything(editor: Editor, name: str) -> None:
    exporting = editor.exporting
    exporting.open()
    for what in (What.PHOTO, What.LAYERS):
        exporting.choose_what(what)
        exporting.set_name(name)
        assert exporting.label
        assert exporting.problem is None or "\n" not in exporting.problem
        exporting.choose_format(exporting.formats[-1])
        assert exporting.draft is not None
    exporting.close()


def test_what_is_not_there_cannot_be_chosen(editor: Editor) -> None:
    editor.exporting.open()
    assert editor.exporting.why_not(What.PHOTO) is None
    for what in (What.CUTOUT, What.MASK, What.BACKGROUND, What.LAYERS, What.VIDEO, What.DEPTH):
        assert editor.exporting.why_not(what)
    editor.exporting.close()


def test_key_poses_are_steps_and_become_a_film(moved: Editor) -> None:
    exporting, keying = moved.exporting, moved.keying
    exporting.open()
    assert exporting.why_no_motion(VideoMotion.KEYS) == "Keep two key poses first, in Pose"
    exporting.close()
    run(moved, "add_key")
    assert keying.count == 1 and keying.shown == 0
    there = edits.set_placement(committed(moved), 0, Placement(move=(-20.0, 6.0)))
    moved.apply("Move object", there)
    run(moved, "add_key")
    moved.apply("Move object", edits.set_placement(committed(moved), 0, Placement()))
    assert keying.shown is None and keying.last == 1
    run(moved, "replace_key")
    assert keying.shown == 1 and committed(moved).objects[0].keys[1].placement.is_identity
    moved.undo()
    assert committed(moved).objects[0].keys[1].placement.move == (-20.0, 6.0)
    run(moved, "next_key")
    assert committed(moved).objects[0].placement.move == (25.0, -4.0)
    run(moved, "next_key")
    assert keying.shown == 1

    exporting.open()
    exporting.choose_what(What.VIDEO)
    assert exporting.draft is not None and exporting.draft.motion is VideoMotion.KEYS
    exporting.choose_seconds(1.0)
    exporting.choose_format(Format.PNG)
    assert exporting.problem is None and exporting.is_folder
    path = exporting.path
    exporting.confirm()
    wait_for_jobs(moved)
    frames = [np.asarray(Image.open(file)) for file in sorted(path.iterdir())]
    assert len(frames) == 25
    first, between, last, back = (frames[n] for n in (0, 6, 12, 13))
    assert np.array_equal(last, back), "the way back is the way there"
    assert (first != between).any() and (between != last).any()
    run(moved, "remove_key")
    assert keying.count == 1


def test_another_document_begins_with_its_first_key_pose(moved: Editor) -> None:
    run(moved, "add_key")
    run(moved, "add_key")
    moved.apply("Move object", edits.set_placement(committed(moved), 0, Placement()))
    run(moved, "add_key")
    assert moved.keying.last == 2
    moved.start(edits.set_placement(committed(moved), 0, Placement(move=(7.0, 0.0))))
    assert moved.keying.shown is None and moved.keying.last == 0


def committed(editor: Editor) -> Document:
    document = editor.committed
    assert document is not None
    return document
