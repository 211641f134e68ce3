"""The clipboards of Windows and macOS."""

from __future__ import annotations

import io
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from PIL import Image

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
