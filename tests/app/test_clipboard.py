"""The clipboard of X11: whole pictures both ways, and other programs that misbehave."""

from __future__ import annotations

import io
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from editor_steps import HEIGHT, WIDTH
from hands import Hands, opened, x_display
from objectmorpher.system import clipboard
from objectmorpher.system.clipboard import ClipboardError, x11
from objectmorpher_core.pictures.image import ImageError, read_picture

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="X11")


@pytest.fixture
def display(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    if shutil.which("Xvfb") is None:
        pytest.skip("Xvfb is not installed")
    with x_display(320, 240) as name:
        if name is None:
            pytest.skip("no display is free")
        monkeypatch.setenv("DISPLAY", name)
        monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
        yield name


def png(height: int, width: int) -> bytes:
    """A picture of noise, which does not pack: of more than 256 KiB it travels in pieces."""
    out = io.BytesIO()
    noise = np.random.default_rng(3).integers(0, 256, (height, width, 4), np.uint8)
    Image.fromarray(noise).save(out, "PNG")
    return out.getvalue()


def offered(kind: str, data: bytes) -> subprocess.Popen[bytes]:
    """Another program that has this in the clipboard."""
    command = [sys.executable, "-P", x11.__file__, "own", kind]
    program = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert program.stdin is not None and program.stdout is not None
    program.stdin.write(data)
    program.stdin.close()
    assert program.stdout.readline() == b"owned\n"
    return program


@pytest.mark.parametrize("size", [(9, 7), (900, 700)])
def test_a_copied_picture_is_pasted_byte_for_byte(display: str, size: tuple[int, int]) -> None:
    data = png(*size)
    clipboard.copy(data)
    pasted = clipboard.paste()
    assert (pasted.name, pasted.data) == ("pasted.png", data)
    if shutil.which("xclip") is not None:  # it speaks the protocol as other programs do
        ask = ["xclip", "-selection", "clipboard", "-t", "image/png"]
        assert subprocess.run([*ask, "-o"], capture_output=True, check=True).stdout == data
        other = png(size[1], size[0])
        subprocess.run([*ask, "-i"], input=other, check=True)
        assert clipboard.paste().data == other


def test_a_file_that_was_copied_in_a_file_manager_is_named(display: str, tmp_path: Path) -> None:
    photo = tmp_path / "a photo, ü.png"
    program = offered("text/uri-list", f"# copied\r\n{photo.as_uri()}\r\n".encode())
    assert clipboard.paste().path == photo
    program.kill()


def test_other_programs_cannot_break_it(display: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ClipboardError, match="no photo"):
        clipboard.paste()  # nobody has ever copied anything
    for kind, data in (
        ("UTF8_STRING", b"only words"), ("image/png", b""), ("text/uri-list", b"http://x/y.png"),
        ("text/uri-list", b"file:///a%00b"), ("text/uri-list", b"\xff\xfe\x00"),
    ):  # fmt: skip
        program = offered(kind, data)
        with pytest.raises(ClipboardError, match="no photo"):
            clipboard.paste()
        program.kill()
    program = offered("image/png", b"\x89PNG\r\n\x1a\n" + os.urandom(400_000))
    with pytest.raises(ImageError):
        read_picture(clipboard.paste().data)
    program.send_signal(signal.SIGSTOP)  # it has the clipboard and does not answer
    monkeypatch.setattr(clipboard, "PATIENCE", 1.0)
    began = time.monotonic()
    with pytest.raises(ClipboardError, match="nothing answers"):
        clipboard.paste()
    assert time.monotonic() - began < 30
    program.kill()


@pytest.mark.slow
@pytest.mark.window
def test_the_window_copies_and_pastes(
    without_networks: dict[str, str], photo_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DISPLAY", without_networks["DISPLAY"])
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with opened(without_networks, photo_path) as hands:
        hands.place("Photo")
        clipboard.copy(png(30, 40))  # what is not ours yet
        hands.press("ctrl+c")
        hands.wait(lambda: is_copied((HEIGHT, WIDTH)), "copying")
        shown = read_picture(clipboard.paste().data)
        np.testing.assert_array_equal(shown.pixels, read_picture(photo_path.read_bytes()).pixels)
        clipboard.copy(png(30, 40))
        hands.press("ctrl+v")
        hands.wait(lambda: "pasted.png" in hands.title(), "pasting")
        says_so_and_stays(hands)


def is_copied(size: tuple[int, int]) -> bool:
    return read_picture(clipboard.paste().data).pixels.shape[:2] == size


def says_so_and_stays(hands: Hands) -> None:
    """A clipboard full of nonsense changes nothing."""
    program = offered("image/png", b"no picture at all")
    hands.press("ctrl+v")
    hands.settle()
    assert "pasted.png" in hands.title()
    program.kill()
