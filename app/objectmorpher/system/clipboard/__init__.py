"""The system's clipboard: a photo out of it, a picture into it.

On X11 by `x11.py`, on Wayland by wl-clipboard (where that is not installed, by XWayland's), on
Windows and macOS by what each offers.
"""

from __future__ import annotations

import io
import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from . import x11

# The clipboards of Windows and macOS.

DIB, MOVABLE = 8, 0x0002  # Windows: a picture without a file's header; memory that is given away
BITMAP_HEADER = 14  # bytes of a BMP file before its DIB


def grabbed() -> tuple[str, bytes] | None:
    """Kind and bytes of a picture or of a list of files, as Pillow finds them."""
    from PIL import ImageGrab

    found = ImageGrab.grabclipboard()
    if isinstance(found, list):
        return "text/uri-list", "\n".join(Path(name).as_uri() for name in found).encode()
    if found is None:
        return None
    out = io.BytesIO()
    found.save(out, "PNG")
    return "image/png", out.getvalue()


def copy_on_windows(png: bytes) -> None:
    """Offer the picture as PNG, which keeps its transparency, and as DIB. Raises OSError."""
    assert sys.platform == "win32"
    import ctypes

    user, kernel = ctypes.WinDLL("user32"), ctypes.WinDLL("kernel32")
    kernel.GlobalAlloc.restype = kernel.GlobalLock.restype = ctypes.c_void_p
    kernel.GlobalLock.argtypes = kernel.GlobalUnlock.argtypes = [ctypes.c_void_p]
    user.SetClipboardData.argtypes = [ctypes.c_uint, ctypes.c_void_p]
    if not user.OpenClipboard(None):
        raise OSError("another program holds the clipboard")
    try:
        user.EmptyClipboard()
        _set(user, kernel, user.RegisterClipboardFormatW("PNG"), png)
        _set(user, kernel, DIB, _dib(png))
    finally:
        user.CloseClipboard()


def _set(user: Any, kernel: Any, kind: int, data: bytes) -> None:
    """Give Windows a copy of the bytes."""
    import ctypes

    block = kernel.GlobalAlloc(MOVABLE, len(data))
    if not block:
        raise OSError("there is not enough memory")
    ctypes.memmove(kernel.GlobalLock(block), data, len(data))
    kernel.GlobalUnlock(block)
    if not user.SetClipboardData(kind, block):
        raise OSError("Windows does not take the picture")


def _dib(png: bytes) -> bytes:
    """The picture on white, as a BMP file without its first header."""
    from PIL import Image

    picture = Image.open(io.BytesIO(png)).convert("RGBA")
    ground = Image.new("RGBA", picture.size, "white")
    out = io.BytesIO()
    Image.alpha_composite(ground, picture).convert("RGB").save(out, "BMP")
    return out.getvalue()[BITMAP_HEADER:]


def copy_on_mac(png: bytes) -> None:
    """Offer the picture through AppleScript. Raises OSError and SubprocessError."""
    with tempfile.NamedTemporaryFile(suffix=".png") as file:
        file.write(png)
        file.flush()
        script = f'set the clipboard to (read (POSIX file "{file.name}") as «class PNGf»)'
        subprocess.run(["osascript", "-e", script], check=True, capture_output=True)


PATIENCE = 30.0  # s that reading may take
BEGIN = 10.0  # s until the clipboard is ours
PNG, FILES = "image/png", "text/uri-list"


class ClipboardError(ValueError):
    """There is no photo to paste, or nothing can be copied here; one sentence."""


@dataclass(frozen=True)
class Pasted:
    """What was in the clipboard: the bytes of a picture file, or where one is."""

    name: str
    data: bytes = b""
    path: Path | None = None


def paste() -> Pasted:
    """Return the photo in the clipboard, or the first of the files in it. Raises ClipboardError."""
    found = grabbed() if sys.platform in ("win32", "darwin") else _offered()
    if found is None:
        raise ClipboardError("there is no photo in the clipboard")
    kind, data = found
    if kind != FILES:
        return Pasted(f"pasted.{kind.partition('/')[2].replace('jpeg', 'jpg')}", data)
    for line in data.decode("utf-8", "replace").splitlines():
        parts = urlsplit(line.strip()) if not line.startswith("#") else None
        if parts is not None and parts.scheme == "file" and "\0" not in unquote(parts.path):
            path = Path(unquote(parts.path))
            return Pasted(path.name, path=path)
    raise ClipboardError("there is no photo in the clipboard")


def holds(png: bytes) -> bool:
    """Whether this picture is in the clipboard; some systems write its file anew."""
    from PIL import Image

    try:
        found = paste().data
        if found == png:
            return True
        one, other = (Image.open(io.BytesIO(data)).convert("RGBA") for data in (found, png))
    except (OSError, ValueError):  # nothing, or no picture that is known here
        return False
    return one.size == other.size and one.tobytes() == other.tobytes()


def copy(png: bytes) -> None:
    """Put a picture into the clipboard, as a PNG file. Raises ClipboardError."""
    try:
        if sys.platform == "win32":
            copy_on_windows(png)
        elif sys.platform == "darwin":
            copy_on_mac(png)
        else:
            _offer(png)
    except (OSError, subprocess.SubprocessError) as error:
        raise ClipboardError(f"the picture cannot be copied: {error}") from error


def _offered() -> tuple[str, bytes] | None:
    """Kind and bytes of what another program offers on Linux."""
    try:
        if _has_wayland_tools():
            return _from_wayland()
        done = subprocess.run(_x11("read"), capture_output=True, timeout=PATIENCE)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ClipboardError("the clipboard cannot be read: nothing answers") from error
    kind, _, data = done.stdout.partition(b"\n")
    return (kind.decode("ascii", "replace"), data) if done.returncode == 0 and data else None


def _from_wayland() -> tuple[str, bytes] | None:
    listed = subprocess.run(["wl-paste", "-l"], capture_output=True, timeout=PATIENCE)
    offered = listed.stdout.decode(errors="replace").split()
    for kind in x11.WANTED:
        if kind in offered:
            command = ["wl-paste", "-n", "-t", kind]
            data = subprocess.run(command, capture_output=True, timeout=PATIENCE).stdout
            return (kind, data) if data else None
    return None


def _offer(png: bytes) -> None:
    """Leave a process behind that offers the picture, also when this program has ended."""
    if _has_wayland_tools():
        subprocess.run(["wl-copy", "-t", PNG], input=png, timeout=BEGIN, check=True)
        return
    process = subprocess.Popen(
        _x11("own", PNG), stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL, start_new_session=True,
    )  # fmt: skip
    assert process.stdin is not None and process.stdout is not None
    process.stdin.write(png)
    process.stdin.close()
    if process.stdout.readline() != b"owned\n":
        raise OSError("there is no X11 display and no wl-clipboard")


def _x11(*arguments: str) -> list[str]:
    return [sys.executable, "-P", x11.__file__, *arguments]


def _has_wayland_tools() -> bool:
    return bool(os.environ.get("WAYLAND_DISPLAY")) and shutil.which("wl-copy") is not None
