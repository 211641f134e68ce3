"""The screen's profile: found on the display, or chosen, and what is shown by it."""

from __future__ import annotations

import ctypes
import ctypes.util
import io
import os
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageCms

from objectmorpher.commands import run
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.filing import Dialog
from objectmorpher.editor.settings import AS_THEY_ARE, AUTO, Settings
from objectmorpher.system.desktop import read_profile, system_profile
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Document, Placement
from objectmorpher_core.pictures.screen_colours import GRID, profile_name, screen_table
from objectmorpher_core.scripting.animation import Clip
from objectmorpher_core.scripting.outputs import Export
from tests.shapes import scene

PROFILE = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
REPLACE, BYTES = 0, 8


def dull(profile: bytes, share: float = 0.5) -> bytes:
    """A profile with the same white, each of whose primaries is nearer to grey."""
    count = struct.unpack_from(">I", profile, 128)[0]
    entries = (struct.unpack_from(">4sII", profile, 132 + 12 * k) for k in range(count))
    at = {name: offset + 8 for name, offset, _ in entries}
    columns = [at[name] for name in (b"rXYZ", b"gXYZ", b"bXYZ")]
    colours = np.array([struct.unpack_from(">3i", profile, place) for place in columns])
    mixed = np.rint((1 - share) * colours + share * colours.mean(0)).astype(int)
    changed = bytearray(profile)
    for place, colour in zip(columns, mixed.tolist(), strict=True):
        struct.pack_into(">3i", changed, place, *colour)
    return bytes(changed)


def test_x11_tells_it(display: str, monkeypatch: pytest.MonkeyPatch) -> None:
    name = ctypes.util.find_library("X11")
    if name is None:
        pytest.skip("libX11 is not installed")
    monkeypatch.setenv("DISPLAY", display)
    assert system_profile() is None
    x11 = ctypes.CDLL(name)
    x11.XOpenDisplay.restype = ctypes.c_void_p
    x11.XInternAtom.restype = x11.XDefaultRootWindow.restype = ctypes.c_ulong
    server = ctypes.c_void_p(x11.XOpenDisplay(None))
    atom, kind = (
        ctypes.c_ulong(x11.XInternAtom(server, word, 0)) for word in (b"_ICC_PROFILE", b"CARDINAL")
    )
    root = ctypes.c_ulong(x11.XDefaultRootWindow(server))
    x11.XChangeProperty(server, root, atom, kind, BYTES, REPLACE, PROFILE, len(PROFILE))
    x11.XSync(server, 0)
    assert system_profile() == PROFILE
    x11.XDeleteProperty(server, root, atom)
    x11.XCloseDisplay(server)
    assert system_profile() is None
    monkeypatch.setenv("DISPLAY", ":9999")
    assert system_profile() is None


def test_a_file_can_be_chosen_and_what_is_none_is_one_sentence(
    editor: Editor, ball: Document, tmp_path: Path
) -> None:
    """A photo of wide colours is shown otherwise than as it is, on a screen of sRGB, too."""
    swapped = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    swapped = swapped.replace(b"rXYZ", b"TEMP").replace(b"gXYZ", b"rXYZ").replace(b"TEMP", b"gXYZ")
    editor.settings = replace(Settings(), screen_profile=AS_THEY_ARE)
    picture = replace(ball.photo.picture, icc=swapped)
    wide = replace(ball, photo=replace(ball.photo, picture=picture))
    editor.start(wide)
    assert editor.looking.screen_table() is None
    good, bad = tmp_path / "screen.icc", tmp_path / "bad.icc"
    good.write_bytes(PROFILE)
    bad.write_bytes(b"nonsense")
    editor.looking.use_profile(bad)
    assert editor.message is not None and "no colour profile" in editor.message.text
    assert editor.settings.screen_profile == AS_THEY_ARE
    editor.looking.use_profile(good)
    table = editor.looking.screen_table()
    assert table is not None and table is editor.looking.screen_table()
    np.testing.assert_array_equal(np.abs(table[0, 0, -1].astype(int) - (0, 255, 0)) < 30, True)
    editor.start(ball)  # its colours are those of the screen
    assert editor.looking.screen_table() is None
    good.unlink()
    assert read_profile(good) is None
    editor.settings = replace(editor.settings, screen_profile=AUTO)


def profiles_of_inks() -> list[Path]:
    """Those of four inks that the system has; in Debian they come with `libgs-common`."""
    folders = os.environ.get("XDG_DATA_DIRS") or "/usr/local/share:/usr/share"
    found = [p for folder in folders.split(":") for p in Path(folder, "color/icc").rglob("*.icc")]
    return sorted(path for path in found if path.read_bytes()[16:20] == b"CMYK")


def test_a_proof_by_inks_shows_no_colour_that_they_cannot_print() -> None:
    inks = profiles_of_inks()
    if not inks:
        pytest.skip("the system has no profile of inks")
    for path in inks:
        profile = path.read_bytes()
        assert profile_name(profile) is None and profile_name(profile, is_proof=True), path.name
        table = screen_table(None, None, profile)
        assert table is not None, path.name
        levels = np.arange(GRID)
        greys = table[levels, levels, levels].astype(int)
        assert np.ptp(greys, axis=1).max() <= 24 and (np.diff(greys.sum(1)) >= -3).all()
        assert greys[-1].min() > 240 and greys[0].max() < 60
        again = screen_table(None, None, profile)
        assert again is not None and np.array_equal(again, table)
    press = [screen_table(None, None, p.read_bytes()) for p in inks if p.stat().st_size > 100_000]
    for table in press:  # measured ones: the blue of a screen is beyond every press
        assert table is not None and table[-1, 0, 0, 2] < 200


def test_a_proof_shows_what_another_device_can_show(
    editor: Editor, ball: Document, tmp_path: Path
) -> None:
    editor.settings = replace(Settings(), screen_profile=AS_THEY_ARE)
    editor.start(ball)
    run(editor, "proof")  # by which profile is asked first
    assert editor.filing.wanted is Dialog.PROOF_OPEN and not editor.view.is_proof
    printer, bad = tmp_path / "printer.icc", tmp_path / "bad.icc"
    printer.write_bytes(dull(PROFILE))
    bad.write_bytes(b"nonsense")
    editor.looking.proof_by(bad)
    assert editor.message is not None and "no colour profile" in editor.message.text
    assert editor.looking.screen_table() is None
    document = editor.committed
    editor.looking.proof_by(printer)
    table = editor.looking.screen_table()
    assert table is not None and "printer" in editor.looking.badge
    red = table[0, 0, -1].astype(int)  # outside of what it can show
    assert red[0] > 150 and red[1:].min() > 60
    greys = table[np.arange(GRID), np.arange(GRID), np.arange(GRID)].astype(int)
    assert np.abs(greys - np.linspace(0, 255, GRID).astype(int)[:, None]).max() <= 3
    assert editor.committed is document
    run(editor, "proof")
    assert editor.looking.screen_table() is None and editor.looking.badge == ""
    editor.settings = replace(editor.settings, proof_profile=str(tmp_path / "gone.icc"))
    run(editor, "proof")
    assert editor.message is not None and "not there any more" in editor.message.text
    assert not editor.view.is_proof


def test_a_film_has_the_colours_of_srgb_and_its_frames_as_files_the_profile(tmp_path: Path) -> None:
    own, document = dull(PROFILE), scene("ellipse").document()
    photo = replace(document.photo, picture=replace(document.photo.picture, icc=own))
    document = edits.set_placement(
        replace(document, photo=photo), 0, Placement(move=(14.0, -6.0), turn=(20.0, 0, 0))
    )
    export = Export(document, clip=Clip(seconds=0.4, rate=10))
    wanted = np.asarray(
        ImageCms.profileToProfile(
            Image.fromarray(photo.pixels),
            ImageCms.ImageCmsProfile(io.BytesIO(own)),
            ImageCms.ImageCmsProfile(io.BytesIO(PROFILE)),
            ImageCms.Intent.RELATIVE_COLORIMETRIC,
        )
    ).astype(int)
    data = export.encode("video", Path("film.webp"))
    with Image.open(io.BytesIO(data)) as image:
        found = np.asarray(image.convert("RGB"))
    off = [np.abs(found - picture).mean() for picture in (wanted, photo.pixels.astype(int))]
    assert off[0] < 0.7 * off[1], off
    first = export.files("video", tmp_path)[tmp_path / f"{Path(photo.name).stem}-0000.png"]
    with Image.open(io.BytesIO(first)) as image:
        assert image.info["icc_profile"] == own
        assert np.array_equal(np.asarray(image.convert("RGB")), photo.pixels)
