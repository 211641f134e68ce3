"""Moving pictures in files: WebM and MP4 by OpenCV's encoders, GIF and animated WebP by Pillow.

WebM and MP4 hold VP9, which every browser plays; an H.264 encoder of a free licence comes with no
package. GIF has 256 colours.
"""

from __future__ import annotations

import io
import tempfile
from collections.abc import Callable, Iterable, Iterator
from itertools import chain
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from ..base.arrays import RGB, U8
from ..base.library_output import logged_output
from .image import at_most

CODECS = {".webm": "VP90", ".mp4": "vp09"}
PICTURES = (".gif", ".webp")
ENDINGS = (*CODECS, *PICTURES)
# px, the shortest and the longest side: films lose an odd row, and a WebP counts in 14 bits.
SIDES = {".webm": (2, 65535), ".mp4": (2, 65535), ".webp": (1, 16383)}
GIF_LONGEST = 640  # px
GIF_TICK = 10  # ms, of which a GIF's frames last whole numbers
WEBP_QUALITY = 85
CLEAR = 255  # the colour of a GIF that is none
MOST_FRAMES = 3000


class VideoError(ValueError):
    """The frames cannot become such a file, or be read from one; one sentence."""


def frame_rate(path: Path) -> tuple[float, int]:
    """Frames a second, and how many there are, as the file says. Raises VideoError."""
    video = _opened(path)
    rate, count = video.get(cv2.CAP_PROP_FPS), int(video.get(cv2.CAP_PROP_FRAME_COUNT))
    video.release()
    if not rate > 0 or count < 1:
        raise VideoError(f"{path.name} does not say how many frames it has")
    return rate, count


def read_frames(path: Path, numbers: tuple[int, ...]) -> list[RGB]:
    """The frames (h, w, 3) of these numbers, from 0. Raises VideoError."""
    video, found = _opened(path), []
    try:
        for number in numbers:
            video.set(cv2.CAP_PROP_POS_FRAMES, number)
            is_there, frame = video.read()
            if not is_there:
                raise VideoError(f"{path.name} has no frame {number}, or it is damaged")
            found.append(np.asarray(cv2.cvtColor(frame, cv2.COLOR_BGR2RGB), np.uint8))
    finally:
        video.release()
    return found


def _opened(path: Path) -> cv2.VideoCapture:
    if not path.is_file():
        raise VideoError(f"there is no video {path}")
    with logged_output("a video"):
        video = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    if not video.isOpened():
        raise VideoError(f"{path.name} is no video that can be read here")
    return video


def encode_video(
    frames: Iterable[U8], rate: float, ending: str, further: Iterable[U8] = ()
) -> bytes:
    """The file of `frames` (h, w, 3 or 4), all of one size, shown `rate` a second, for ever.

    A format of few colours has those of the first frame and of `further` pictures (h, w, 3 or 4),
    for all, so that nothing flickers. Of their alpha WebP keeps all, GIF whether a pixel is there;
    films have none, and an even number of rows and columns: the last one is left out.

    Raises VideoError for an unknown ending, no frames, frames of a size that the format does not
    have, and where the encoder is not there.
    """
    ending = ending.lower()
    if ending not in ENDINGS:
        raise VideoError(f"a video cannot be written as {ending}, only as {', '.join(ENDINGS)}")
    coming = iter(frames)
    first = next(coming, None)
    if first is None:
        raise VideoError("a video needs a frame")
    _check_size(first, ending)
    everything = chain([first], coming)
    if ending in CODECS:
        return _filmed(everything, first.shape, rate, ending)
    return _pictured(everything, rate, ending, first.shape[2] == 4, further)


def _check_size(frame: U8, ending: str) -> None:
    """Raises VideoError where a format has no frames of that size; those of GIF are made small."""
    height, width = frame.shape[:2]
    least, most = SIDES.get(ending, (1, max(width, height)))
    if min(width, height) < least or max(width, height) > most:
        raise VideoError(
            f"a video of {width} x {height} px cannot be written as {ending}, "
            f"whose sides have {least} to {most} px"
        )


def _filmed(frames: Iterable[U8], shape: tuple[int, ...], rate: float, ending: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:  # OpenCV writes to names only
        path, count = Path(folder) / f"video{ending}", 0
        height, width = (side - side % 2 for side in shape[:2])  # colours have half of them
        code, size = cv2.VideoWriter.fourcc(*CODECS[ending]), (width, height)
        with logged_output("a video"):  # FFmpeg's words about its tags, and about a full disk
            writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, code, rate, size)
            if not writer.isOpened():
                raise VideoError(f"OpenCV has no encoder for {ending} here; choose .webp or .gif")
            for frame in frames:
                writer.write(cv2.cvtColor(frame[:height, :width, :3], cv2.COLOR_RGB2BGR))
                count += 1
            writer.release()
        if _frames_in(path) != count:  # the encoder itself says nothing of what fails
            raise VideoError(f"the video cannot be written: is the disk full that holds {folder}?")
        return path.read_bytes()


def _frames_in(path: Path) -> int:
    """How many frames of a video can be read; 0 where it cannot be opened."""
    try:
        video = _opened(path)
    except VideoError:
        return 0
    count = 0
    with logged_output("a video"):
        while video.grab():
            count += 1
    video.release()
    return count


def _pictured(
    frames: Iterable[U8], rate: float, ending: str, has_alpha: bool, further: Iterable[U8]
) -> bytes:
    out = io.BytesIO()
    if ending == ".webp":
        images: Iterator[Image.Image] = map(Image.fromarray, frames)
        first = next(images)
        first.save(out, "WEBP", save_all=True, append_images=images, loop=0,
                   duration=_lasting(rate, 1), quality=WEBP_QUALITY, method=2)  # fmt: skip
        return out.getvalue()
    images = map(_palettes(has_alpha, further), frames)
    first = next(images)
    clear = {"transparency": CLEAR, "disposal": 2} if has_alpha else {}
    first.save(
        out, "GIF", save_all=True, append_images=images, loop=0,
        duration=_lasting(rate, GIF_TICK), **clear,
    )  # fmt: skip
    return out.getvalue()


def _lasting(rate: float, tick: int) -> list[int]:
    """How long each frame is shown, in whole ticks of `tick` ms: what is left over adds up.

    Browsers slow a GIF down whose frames last less than two.
    """
    ends = np.rint(np.arange(MOST_FRAMES + 1) * (1000 / rate / tick))
    return [int(tick * max(ticks, 2 if tick > 1 else 1)) for ticks in np.diff(ends)]


def _below_half(level: int) -> int:
    return 255 if level < 128 else 0


def _small(frame: U8) -> tuple[Image.Image, Image.Image | None]:
    """A frame (h, w, 3 or 4) as a GIF has it, and 255 where it is clear; None where it is not."""
    if frame.shape[2] == 3:
        return Image.fromarray(at_most(frame, GIF_LONGEST)), None
    image = Image.fromarray(frame)  # its alpha is heeded as it is made smaller
    image.thumbnail((GIF_LONGEST, GIF_LONGEST), Image.Resampling.BOX)
    return image.convert("RGB"), image.getchannel("A").point(_below_half)


def _shown_colours(image: Image.Image, clear: Image.Image | None) -> RGB:
    """(n, 3) of the pixels that are not clear."""
    pixels = np.asarray(image)
    there = np.ones(pixels.shape[:2], bool) if clear is None else np.asarray(clear) == 0
    return np.asarray(pixels[there], np.uint8)


def _palettes(has_alpha: bool, further: Iterable[U8]) -> Callable[[U8], Image.Image]:
    """Makes pictures of 256 colours: those of the first one and of `further` ones, for all.

    What nobody sees takes none of them.
    """
    palette: list[Image.Image] = []
    count = CLEAR if has_alpha else 256

    def reduced(frame: U8) -> Image.Image:
        image, clear = _small(frame)
        if not palette:
            several = [_shown_colours(image, clear)]
            several += [_shown_colours(*_small(each)) for each in further]
            shown = np.concatenate(several)
            shown = shown if len(shown) else np.zeros((1, 3), np.uint8)
            palette.append(Image.fromarray(shown[None]).quantize(count, Image.Quantize.MEDIANCUT))
        made = image.quantize(palette=palette[0], dither=Image.Dither.FLOYDSTEINBERG)
        if clear is not None:
            made.paste(CLEAR, mask=clear)
        return made

    return reduced
