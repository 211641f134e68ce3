"""The exporter of window, command line and library: what can be saved of an edit, as bytes."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..base.arrays import F32, U8, crop, pixels_from_unit
from ..base.progress import Progress, part, silent
from ..base.quoting import shown
from ..compose.composite import lit_cutout, object_texture, straight_cutout
from ..compose.layers import Layer, layers
from ..compose.plate.plate import overlap, plate_alpha, plate_picture
from ..deform.puppet import Puppet, puppet_of
from ..document.bounds import NORMAL
from ..document.model import Document, EditObject
from ..pictures.formats import NEED_PLATE, WRITTEN, Format, endings_of, format_of
from ..pictures.image import LOSSLESS, Picture, encode_array, encode_picture, to_u8
from ..pictures.openraster import encode_openraster
from ..pictures.psd import encode_psd
from ..pictures.screen_colours import in_srgb
from ..pictures.video import encode_video
from ..pipeline import Edited, export
from ..raster import tiles
from ..splat_files import encode as encode_splats
from .animation import Clip, frames
from .options import ScriptError

# The distance of the lifted objects as a picture for other programs.

SOLID = 0.5  # alpha from which on a pixel shows an object
TOP = 65535
SAMPLED = 8  # frames, as far apart as they can be, whose colours a film of few colours has


def depth_map(
    document: Document, puppets: dict[int, Puppet] | None = None, progress: Progress = silent
) -> F32:
    """(H, W) world units along the view, of the nearest object; infinite where there is none.

    Of the visible lifted objects, where they are now. `puppets` by index save making them again.
    """
    camera = document.photo.camera
    nearest = np.full((camera.height, camera.width), np.inf, np.float32)
    for k, item in enumerate(document.objects):
        progress(k / len(document.objects), "drawing")
        if item.lifted is None or item.matte is None or not item.is_visible:
            continue
        puppet = (puppets or {}).get(k) or puppet_of(item, camera)
        drawable = tiles.prepare(puppet.posed(item.pose, item.placement), camera, camera)
        whole = drawable.box()
        box = None if whole is None else overlap(whole, (0, 0, camera.width, camera.height))
        if box is None:
            continue
        picture = tiles.draw(drawable, object_texture(item.matte, item.lifted), box)
        depth = np.where(picture.alpha > SOLID, picture.depth, np.float32(np.inf))
        part = nearest[box[1] : box[3], box[0] : box[2]]
        np.minimum(part, depth, out=part)
    return nearest


def depth_picture(
    document: Document, puppets: dict[int, Puppet] | None = None, progress: Progress = silent
) -> Picture:
    """The `nearness` of the objects, 16-bit grey."""
    near = nearness(depth_map(document, puppets, progress))
    return Picture(np.repeat(near[..., None], 3, axis=2), is_grey=True)


def nearness(depth: F32) -> np.ndarray:
    """(H, W) u16 of a depth map: the nearest point is 65535, twice as far half of that.

    0 is where there is no object. The depth is the nearest one's x 65535 / value.
    """
    finite = depth[np.isfinite(depth)]
    least = float(finite.min()) if len(finite) else 1.0
    return np.rint(TOP * least / depth.astype(np.float64)).astype(np.uint16)


OUTPUTS = {what: endings_of(formats) for what, formats in WRITTEN.items()}
PICTURES = ("photo", "mask", "plate", "object", "depth")  # those that are one picture
U8_MIN, U8_MAX = np.uint8(0), np.uint8(255)
USUAL_CLIP = Clip()


def encode_output(what: str, edited: Edited, path: Path, clip: Clip = USUAL_CLIP) -> bytes:
    """The bytes of a file called `path` that holds `what`, one of OUTPUTS; `clip` is a video's.

    Raises the one-sentence ValueErrors of what encodes it; ScriptError for an unknown `what`, and
    where a background is needed that was not made.
    """
    _check_possible(what, edited, tuple(OUTPUTS))
    if not path.name.lower().endswith(OUTPUTS[what]):
        raise ScriptError(f"{path}: the ending must be {' or '.join(OUTPUTS[what])}")
    return Export(edited.document, edited, clip=clip).encode(what, path)


def output_picture(what: str, edited: Edited) -> Picture:
    """Return the picture of one of PICTURES, of the photo's size. Raises ScriptError as above."""
    _check_possible(what, edited, PICTURES)
    return Export(edited.document, edited).picture(what)


def _check_possible(what: str, edited: Edited, known: tuple[str, ...]) -> None:
    if what not in known:
        raise ScriptError(f"there is no output {shown(what)}; known are {', '.join(known)}")
    if what in NEED_PLATE and edited.document.plate is None:
        raise ScriptError("there is no background: nothing was moved, and none was asked for")


@dataclass(frozen=True, eq=False)
class Export:
    """A document, how it is to be saved, and what of it was computed already."""

    document: Document
    edited: Edited | None = None  # None: all is computed from the document
    object: int | None = None  # index of the one that is meant; None: the first, or all of them
    bits: int = 0  # 8 or 16 a channel; 0: the photo's own
    quality: int = 95  # of JPEG and AVIF
    webp_quality: int = LOSSLESS  # of WebP and JPEG XL
    clip: Clip = USUAL_CLIP
    progress: Progress = silent

    def encode(self, what: str, path: Path) -> bytes:
        """Return the file that holds `what`, in the format that the name of `path` says."""
        if what == "session":
            from ..session.file import encode_session

            return encode_session(self.document)
        if what == "layers":
            merged, pile = self.layers(part(self.progress, 0.05, 0.7))
            write = encode_psd if format_of(path.name) is Format.PSD else encode_openraster
            return write(pile, merged)
        if what == "video":
            icc = self.document.photo.picture.icc
            film = in_srgb(self._film(), icc)  # players know no other colours
            further = in_srgb(self._shown_in(path.suffix), icc)
            return encode_video(film, self.clip.rate, path.suffix, further)
        if what in ("splats", "mesh"):
            return self._solid(what, path)
        return self._encoded(self.picture(what), path.suffix)

    def picture(self, what: str) -> Picture:
        """Return the flat picture that is asked for, one of PICTURES."""
        draw = part(self.progress, 0.05, 0.6)
        if what == "photo":
            return self.edited.picture if self.edited else export(self.document, progress=draw)
        if what == "mask":
            return self._mask()
        if what == "object":
            return self._cutout(draw)
        if what == "depth":
            return depth_picture(self.document, self.edited and self.edited.puppets, draw)
        photo = self.document.photo
        pixels = photo.pixels if self.document.plate is None else plate_picture(self.document)
        return replace(photo.picture, pixels=pixels, alpha=plate_alpha(self.document))

    def _film(self) -> Iterator[U8]:
        return frames(self.document, self.clip, part(self.progress, 0.02, 0.95))

    def _shown_in(self, ending: str) -> Iterator[U8]:
        """The edit and some of the film's frames, for a format that has few colours; else nothing.

        What shows only midway has its colours, too.
        """
        if ending.lower() == ".gif":
            picture = self.picture("photo")
            layers = [picture.pixels] if picture.alpha is None else [picture.pixels, picture.alpha]
            yield to_u8(np.dstack(layers))
            yield from frames(self.document, replace(self.clip, seconds=SAMPLED, rate=1.0))

    def files(self, what: str, folder: Path) -> dict[Path, bytes]:
        """Return the frames of a video, or the layers, as the PNG files in a folder.

        Raises ScriptError where frames of a longer video lie there, which would seem to go on.
        """
        if what == "layers":
            return self._layer_files(folder)
        stem = Path(self.document.photo.name).stem
        if (old := _frames_beyond(folder, stem, self.clip.count)) is not None:
            raise ScriptError(f"{old} is of a longer video; choose another folder, or empty it")
        return {
            folder / f"{stem}-{n:04d}.png": encode_array(frame, self.document.photo.picture.icc)
            for n, frame in enumerate(self._film())
        }

    def _layer_files(self, folder: Path) -> dict[Path, bytes]:
        """As large as the photo, numbered from below, and all together.

        A name ends with how the layer is mixed with those below, where that is not as usual.
        """
        merged, pile = self.layers(part(self.progress, 0.05, 0.7))
        pile = [layer for layer in pile if layer.is_shown]
        height, width = merged.pixels.shape[:2]
        stem = Path(self.document.photo.name).stem
        outputs = {}
        for k, layer in enumerate(pile):
            self.progress(0.7 + 0.25 * k / len(pile), "encoding")
            samples = layer.pixels
            alpha = None
            if samples.shape[2] == 4:
                samples = crop(samples, layer.box, (0, 0, width, height))
                alpha = samples[..., 3]
            said = layer.name if layer.mode == NORMAL else f"{layer.name} {layer.mode}"
            name = re.sub(r"[^\w-]+", "-", said).strip("-").lower() or "object"
            data = encode_picture(Picture(samples[..., :3], alpha, icc=merged.icc), ".png")
            outputs[folder / f"{stem}-{k}-{name}.png"] = data
        outputs[folder / f"{stem}-{len(pile)}-composite.png"] = encode_picture(merged, ".png")
        return outputs

    def layers(self, progress: Progress) -> tuple[Picture, list[Layer]]:
        """Return the edited photo and its layers from below, with the bits that are wanted."""
        result, pile = layers(self.document, progress)
        merged = result.picture(self.document.photo.picture)
        deep = [replace(layer, pixels=_sampled(layer.pixels, self.bits)) for layer in pile]
        return self._with_bits(merged), deep

    def _mask(self) -> Picture:
        mask = self.document.objects[self.object or 0].mask
        if mask is None:
            raise ScriptError("the first object has no mask")
        return Picture(np.repeat(np.where(mask, U8_MAX, U8_MIN)[..., None], 3, 2), is_grey=True)

    def _encoded(self, picture: Picture, ending: str) -> bytes:
        self.progress(0.6, "encoding")
        return encode_picture(self._with_bits(picture), ending, self.quality, self.webp_quality)

    def _with_bits(self, picture: Picture) -> Picture:
        alpha = None if picture.alpha is None else _sampled(picture.alpha, self.bits)
        return replace(picture, pixels=_sampled(picture.pixels, self.bits), alpha=alpha)

    def _cutout(self, progress: Progress) -> Picture:
        """One object, or all that were edited, where they are now; straight colour and alpha."""
        photo = self.document.photo
        if self.edited is not None and self.object is None:
            samples = straight_cutout(self.edited.composite, photo.pixels.dtype, photo.size)
        else:
            k = self.object or 0
            thing = self.document.objects[k]
            if thing.is_moved:
                there = self.document.with_object(k, replace(thing, is_visible=True))
                samples = lit_cutout(there, k, progress)
            else:
                samples = unmoved_cutout(self.document, thing)
        return Picture(samples[..., :3], samples[..., 3], icc=photo.picture.icc)

    def _solid(self, what: str, path: Path) -> bytes:
        """The posed object in 3D, as Gaussians or as a mesh."""
        index, puppet = self._posed_object()
        thing = self.document.objects[index]
        if what == "splats" and format_of(path.name) is not Format.GLB:
            return encode_splats(puppet.posed_gaussians(thing.pose, thing.placement), path)
        from ..splat_files.meshes.textured import textured_glb

        self.progress(0.2, "drawing")
        return textured_glb(thing, puppet)

    def _posed_object(self) -> tuple[int, Puppet]:
        if self.edited is not None and self.object is None:
            return self.edited.first, self.edited.puppet
        lifted = [k for k, item in enumerate(self.document.objects) if item.lifted is not None]
        index = lifted[0] if self.object is None and lifted else self.object
        if index is None or index not in lifted:
            raise ScriptError("the object has no shape yet")
        return index, puppet_of(self.document.objects[index], self.document.photo.camera)


def unmoved_cutout(document: Document, thing: EditObject) -> np.ndarray:
    """(H, W, 4) an object as it is in the photo: by its matte, else by its mask."""
    pixels = document.photo.pixels
    height, width = pixels.shape[:2]
    if thing.matte is None:
        assert thing.mask is not None, "it is asked for first"
        own = document.photo.picture.alpha
        most = np.array(np.iinfo(pixels.dtype).max, pixels.dtype)
        return np.dstack([pixels, thing.mask * (most if own is None else own)])
    matte = thing.matte
    box = (max(matte.left, 0), max(matte.top, 0), min(matte.box[2], width),
           min(matte.box[3], height))  # fmt: skip
    soft = np.dstack([crop(matte.foreground, matte.box, box), crop(matte.alpha, matte.box, box)])
    soft[soft[..., 3] <= 0] = 0
    samples = np.zeros((height, width, 4), pixels.dtype)
    samples[box[1] : box[3], box[0] : box[2]] = pixels_from_unit(soft, pixels.dtype)
    return samples


def _frames_beyond(folder: Path, stem: str, count: int) -> Path | None:
    """A frame of a video of more than `count` frames of the same photo in a folder, or None."""
    frame = re.compile(re.escape(stem) + r"-(\d{4,})\.png")
    there = sorted(folder.iterdir()) if folder.is_dir() else []
    found = ((path, frame.fullmatch(path.name)) for path in there)
    return next((path for path, match in found if match and int(match[1]) >= count), None)


def _sampled(samples: np.ndarray, bits: int) -> np.ndarray:
    """Samples of any shape with so many bits; 0 leaves them."""
    if bits == 8:
        return to_u8(samples)
    is_narrow = bits == 16 and samples.dtype == np.uint8
    return samples.astype(np.uint16) * np.uint16(257) if is_narrow else samples  # 255 -> 65535
