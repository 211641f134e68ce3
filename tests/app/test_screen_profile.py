"""The screen's profile: found on the display, or chosen, and what is shown by it."""

from __future__ import annotations

import ctypes
import ctypes.util
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import ImageCms

from objectmorpher.editor.editor import Editor
from objectmorpher.editor.settings import AS_THEY_ARE, AUTO, Settings
from objectmorpher.system.desktop import read_profile, system_profile
from objectmorpher_core.document.model import Document

PROFILE = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
REPLACE, BYTES = 0, 8


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
