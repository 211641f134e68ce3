"""The library's stable names: an edit is described step by step, then carried out.

`import objectmorpher_core as om` gives them as `om.open` and so on; docs/python.md tells how they
are used and what of them stays. An `Edit` is an `EditScript` and an opened photo, so that it gives
the bytes that `objectmorpher edit` gives for the same options.
"""

from __future__ import annotations

import io
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypedDict, Unpack

import numpy as np
from PIL import Image, ImageShow

from .base.arrays import Mask, Pixels
from .base.files import read_input, write_all
from .base.progress import Bar, Progress, as_progress
from .base.quoting import named, shown
from .document.model import Document
from .pictures.image import array_of, encode_array, encode_coverage, encode_mask, encode_pil, pil_of
from .pipeline import Edited, continue_script, lift_first, open_photo, select
from .pipeline import replay as replay_document
from .scripting.animation import Clip, frames
from .scripting.options import (
    CHOOSING,
    SHAPE,
    EditScript,
    ScriptError,
    options_of,
    said_by,
    script_from,
)
from .scripting.outputs import encode_output, output_picture
from .scripting.report import provenance
from .scripting.script import ALONE, Others, beside, parse_scripts

__all__ = ["Edit", "Result", "Shape", "open", "read_scripts", "replay"]

File = str | os.PathLike[str]
IN_MEMORY = "photo"  # name of a photo that is no file
PREVIEW = 1024  # px, longer side of the picture that a notebook shows


class Shape(TypedDict, total=False):
    """Options about an object's shape, named as those of `edit`."""

    lift: str  # backend: auto, relief, trellis, cupid, or a worker
    gaussians: int
    thickness: float  # times what the outline says
    back: str  # auto, mirrored or continued
    symmetry: str  # auto, yes or no
    floating: bool
    shape: str  # auto, free, round, flat, box or tube
    trust: float  # in the shape network, 0 to 1
    no_depth: bool
    hidden: str  # file
    more_views: list[dict[str, Any]]  # {"photo": file, "at": (x, y)}, of further photos of it
    decontaminate: float  # of the background's colour in its edge, 0 to 1
    splats: str  # file: a splat or mesh file takes the object's place
    flip: bool


def open(
    photo: File | bytes | Image.Image | np.ndarray, fov: float | None = None, seed: int = 0
) -> Edit:
    """Open a photo for an edit that does nothing yet.

    `photo` is a path, the bytes of a picture file, a Pillow image, or an array of RGB: (H, W, 3),
    also (H, W) or with alpha (H, W, 4), of uint8 or uint16. `fov` is the camera's horizontal field
    of view in degrees, which is otherwise read from EXIF, else 50. Raises ValueError for what is no
    picture, and OSError for a file that cannot be read.
    """
    data, name = _photo_file(photo)
    told = {} if fov is None else {"fov": fov}
    script = script_from({"seed": seed, **told})
    return Edit(open_photo(data, name, script.fov, script.seed), script)


def read_scripts(script: File, photo: File | None = None) -> tuple[Edit, ...]:
    """The edits in a file of `objectmorpher edit --script`, which may name several.

    `photo` is that of scripts that name none. File names in it are relative to it, and its "out"
    is not used: what is saved, and where, is yours to say.
    """
    path = Path(script)
    edits = []
    try:
        text = _read(path)[0].decode("utf-8")
    except UnicodeDecodeError:
        raise ScriptError(f"{path} is not text, so it is no script") from None
    for item in parse_scripts(text):
        placed = beside(item, path.parent)
        source = placed.photo or photo
        if source is None:
            raise ScriptError(f"{path} names no photo")
        edit = open(source, placed.script.fov, placed.script.seed)
        mask = None if placed.script.mask is None else _read(placed.script.mask)[0]
        edits.append(replace(edit, script=placed.script, others=placed.others, own_mask=mask))
    return tuple(edits)


def replay(session: File | bytes, progress: Progress | Bar | None = None) -> Result:
    """The edit of a session (.omorph), from the window or the command line, carried out again."""
    from .session.file import decode_session

    data = session if isinstance(session, bytes) else _read(session)[0]
    return Result(replay_document(decode_session(data), as_progress(progress)))


@dataclass(frozen=True, eq=False, repr=False)
class Edit:
    """A photo and the edit that is to be made. Every method returns a new edit; this one stays.

    Points are px of the upright photo, x to the right and y down, from its corner. What makes no
    sense raises a ValueError of one sentence: at once where it can be told, else by `render`.
    """

    document: Document  # the opened photo; after `lift` with the object
    script: EditScript
    others: Others = ALONE
    own_mask: bytes | None = None  # picture file
    needs_plate: bool = False

    # ---- choosing the object -----------------------------------------------------------------

    def click(self, x: float, y: float) -> Edit:
        """The object is seen at this point. Several clicks add up."""
        return self.options(click=[*self.script.click, (x, y)])

    def not_click(self, x: float, y: float) -> Edit:
        """Exclude the thing seen at this point from the object."""
        return self.options(not_click=[*self.script.not_click, (x, y)])

    def box(self, x0: float, y0: float, x1: float, y1: float) -> Edit:
        """The object is inside this box."""
        return self.options(box=(x0, y0, x1, y1))

    def subject(self) -> Edit:
        """The object is the photo's main subject."""
        return self.options(subject=True)

    def mask(self, mask: File | np.ndarray) -> Edit:
        """The object is what a mask picture, or an array (H, W), covers: bool, or soft u8."""
        if not isinstance(mask, np.ndarray):
            return replace(self._unlifted, own_mask=_read(mask)[0])
        if mask.dtype not in (np.bool_, np.uint8) or mask.ndim != 2:
            raise ValueError(f"a mask is (H, W) of bool or uint8, not {mask.shape} of {mask.dtype}")
        is_hard = mask.dtype == np.bool_ or mask.max(initial=0) <= 1  # 0 and 1 say no and yes
        own = encode_mask(mask > 0) if is_hard else encode_coverage(mask)
        return replace(self._unlifted, own_mask=own)

    @cached_property
    def selection(self) -> Mask:
        """(H, W) bool: the object as it was chosen, found when it is first asked for."""
        document = self.document
        if not document.objects:
            document = select(document, self.script, self.own_mask)
        mask = document.objects[0].mask
        assert mask is not None, "it was chosen"
        return mask

    # ---- its shape, its pose and its place ---------------------------------------------------

    def lift(self, progress: Progress | Bar | None = None, **shape: Unpack[Shape]) -> Edit:
        """Choose the object and lift it to 3D now, so that it is done only once.

        Without it `render` does so, each time. What is said later about which object is meant, or
        about its shape, undoes it. `progress` is as in `render`.
        """
        edit = self._with(shape)._unlifted
        told = as_progress(progress)
        lifted = lift_first(edit.document, edit.script, edit.own_mask, told)
        told(1.0, "Lifted")
        return replace(edit, document=lifted)

    def pin(self, x: float, y: float) -> Edit:
        """The point of the object that is seen there stays where it is."""
        return self.options(pin=[*self.script.pin, (x, y)])

    def drag(self, at: tuple[float, float], to: tuple[float, float], dz: float = 0.0) -> Edit:
        """The point of the object seen at `at` is to be seen at `to`, `dz` diameters farther."""
        moves = [{"at": m.at, "to": m.to, "dz": m.dz} for m in self.script.handle]
        return self.options(handle=[*moves, {"at": at, "to": to, "dz": dz}])

    def move(self, dx: float, dy: float, dz: float = 0.0) -> Edit:
        """The whole object moves: px to the right, px down, diameters away from the camera."""
        return self.options(move=(dx, dy, dz))

    def turn(self, yaw: float = 0.0, pitch: float = 0.0, roll: float = 0.0) -> Edit:
        """The whole object turns by so many degrees, about the camera's axes."""
        return self.options(turn=(yaw, pitch, roll))

    def spin(self, degrees: float) -> Edit:
        """The whole object turns where it stands, about its own upright axis, before `turn`.

        A positive angle turns its front to the left.
        """
        return self.options(spin=degrees)

    def scale(self, factor: float) -> Edit:
        """The whole object is so many times as large."""
        return self.options(scale=factor)

    def key(self, **pose: Any) -> Edit:
        """Add a key pose, through which a video of the kind keys goes after the edit's own pose.

        `pose` has pin, handle, move, turn, spin and scale as a script has them; what it does not
        say is at rest. An edit has at most eleven of them.
        """
        return self.options(key=[*self.script.key, pose])

    def remove(self) -> Edit:
        """The object is gone, and what is behind it is seen."""
        return self.options(remove=True)

    # ---- putting it back ---------------------------------------------------------------------

    def plate(self, inpaint: str = "auto") -> Edit:
        """Fill in the background with this backend, even where nothing moves."""
        return replace(self.options(inpaint=inpaint), needs_plate=True)

    def harmonise(self) -> Edit:
        """The object takes on light, grain and focus of where it is now."""
        return self.options(refine="harmonise")

    def options(self, **options: Any) -> Edit:
        """Any options of `objectmorpher edit` by their long names, with _ for -.

        Their values are those of a script file; one that was said before is replaced.
        """
        return self._with(options)

    def render(self, progress: Progress | Bar | None = None) -> Result:
        """Carry the edit out.

        `progress` is a function of a fraction in [0, 1] and a text, which may raise `Cancelled` to
        stop the work; or a bar such as `tqdm()`.
        """
        told = as_progress(progress)
        done = continue_script(
            self.document, self.script, self.own_mask, told, self.needs_plate, self.others
        )
        return Result(done)

    def __repr__(self) -> str:
        width, height = self.document.photo.size
        said = [f"{name}={_brief(value)}" for name, value in said_by(self.script).items()]
        said += ["mask"] if self.own_mask is not None else []
        said += ["lifted"] if self.document.objects else []
        about = "; ".join([f"{width} x {height} px", *([", ".join(said)] if said else [])])
        return f"<Edit of {named(self.document.photo.name)}: {about}>"

    def _with(self, options: Mapping[str, Any]) -> Edit:
        said = {name.replace("-", "_") for name in options}
        script = self.script.merged(script_from(options), said)
        edit = replace(self, script=script)
        if {"fov", "seed"} & said:
            photo = self.document.photo
            fresh = open_photo(photo.source, photo.name, script.fov, script.seed)
            edit = replace(edit, document=fresh)
        elif options_of(CHOOSING, SHAPE) & said:
            edit = edit._unlifted
        if "mask" in said and script.mask is not None:
            return edit.mask(script.mask)
        return edit

    @property
    def _unlifted(self) -> Edit:
        photo, script = self.document.photo, self.script
        if not self.document.objects:
            return self
        return replace(self, document=open_photo(photo.source, photo.name, script.fov, script.seed))


@dataclass(frozen=True, eq=False, repr=False)
class Result:
    """An edit that was carried out. A notebook shows it as its picture, at most PREVIEW px long."""

    edited: Edited

    @property
    def pixels(self) -> Pixels:
        """(H, W, 3) the edited photo, upright RGB, u8 or u16 as the photo's."""
        return self.edited.picture.pixels

    @property
    def report(self) -> dict[str, Any]:
        """Return the contents of `--report`: seconds, handles, footprint and more."""
        return self.edited.report()

    def to_numpy(self, what: str = "photo") -> np.ndarray:
        """A picture of the result as an array of its own.

        photo and plate: (H, W, 3) RGB, or (H, W, 4) where the photo has alpha; object: (H, W, 4),
        straight alpha; u8 or u16 as the photo's. mask: (H, W) bool. depth: (H, W) u16, the nearest
        is 65535. Raises ValueError for another `what`, and for a plate that was not made.
        """
        pixels = array_of(output_picture(what, self.edited))
        if what == "mask":
            return pixels[..., 0] > 0
        return pixels[..., 0] if what == "depth" else pixels

    def to_pil(self, what: str = "photo") -> Image.Image:
        """A picture of the result as Pillow's image, with the photo's profile and EXIF.

        `what` is as in `to_numpy`. Pillow holds colours of 8 bits: those of 16 are rounded.
        """
        return pil_of(output_picture(what, self.edited))

    def frames(
        self, video: str = "morph", seconds: float = 4.0, rate: float = 25.0
    ) -> Iterator[np.ndarray]:
        """The pictures (h, w, 3) u8 of a video, one after the other; see `save`.

        They are (h, w, 4) where the photo has an alpha channel. Raises ValueError where nothing
        moves.
        """
        clip = Clip(video, seconds, rate)
        return frames(self.edited.document, clip)

    def show(self, what: str = "photo") -> None:
        """Open a picture of the result in the system's viewer.

        `what` is as in `to_numpy`. Raises RuntimeError where there is no viewer.
        """
        if not ImageShow.show(self.to_pil(what), what):
            raise RuntimeError("no program that shows pictures was found; save the result instead")

    def _repr_png_(self) -> bytes:
        image = self.to_pil()
        image.thumbnail((PREVIEW, PREVIEW))
        out = io.BytesIO()
        image.save(out, "PNG")
        return out.getvalue()

    def __repr__(self) -> str:
        photo = self.edited.document.photo
        size = f"{photo.size[0]} x {photo.size[1]} px"
        return f"<Result of {named(photo.name)}: {size}; {provenance(self.edited.composite)}>"

    def encode(
        self, ending: str = ".png", what: str = "photo", video: str = "morph", seconds: float = 4.0
    ) -> bytes:
        """The bytes of a file with that ending, with or without its dot; see `save`."""
        path = Path(f"{IN_MEMORY}.{ending.removeprefix('.')}")
        return encode_output(what, self.edited, path, Clip(video, seconds))

    def save(
        self, path: File, what: str = "photo", video: str = "morph", seconds: float = 4.0
    ) -> None:
        """Writes a file, whole or not at all; an existing one is replaced.

        `what`: photo, mask, plate, object, depth, layers, splats, mesh, session or video; of a
        video `video` says what is seen (morph, sway, turn or keys), and `seconds` how long. Raises
        ValueError where the file's ending cannot hold it, and OSError where it cannot be written.
        """
        target = Path(path)
        write_all({target: encode_output(what, self.edited, target, Clip(video, seconds))})


def _brief(value: Any) -> str:
    """A value of a script in one short piece: whole numbers without their point."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{k}: {_brief(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list | tuple):
        return named("(" + ", ".join(map(_brief, value)) + ")")
    return f"{value:g}" if isinstance(value, float) else shown(value)


def _photo_file(photo: File | bytes | Image.Image | np.ndarray) -> tuple[bytes, str]:
    """The bytes of a picture file, and its name. Raises TypeError for what is none of these."""
    if isinstance(photo, bytes | bytearray | memoryview):
        return bytes(photo), IN_MEMORY
    if isinstance(photo, np.ndarray):
        return encode_array(photo), IN_MEMORY
    if isinstance(photo, Image.Image):
        return encode_pil(photo), IN_MEMORY
    if isinstance(photo, str | os.PathLike):
        return _read(photo)
    raise TypeError(
        f"a photo is a path, bytes, a Pillow image or an array, not {type(photo).__name__}"
    )


def _read(file: File) -> tuple[bytes, str]:
    """The bytes of a file and its name without folder. Raises OSError, InputError: one sentence."""
    path = Path(file)
    try:
        return read_input(path), path.name
    except FileNotFoundError:
        raise FileNotFoundError(f"{path} does not exist") from None
    except IsADirectoryError:
        raise IsADirectoryError(f"{path} is a folder, not a file") from None
    except PermissionError:
        raise PermissionError(f"{path} cannot be read") from None
