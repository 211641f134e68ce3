"""The main job without a window: a photo and what to do with it -> pictures and a report.

`open_photo`, `read_photo`, `lift_mask`, `make_plate` are the costly stages, with plain
arguments and answers so that a worker process can run them; `run_script` strings them together
as the command line does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from . import compose, edits, lift, segment
from .arrays import RGB, Mask, Pixels, Selection
from .camera import Camera
from .compose.composite import Composite, composite, object_texture
from .compose.old_shadow import OldShadow, shadowless_plate
from .compose.plate import build_plate, plate_cover
from .compose.shadow_fit import find_old_shadow
from .document import (
    AS_SEEN,
    GAUSSIANS,
    Click,
    DeformSettings,
    Document,
    LiftedObject,
    LiftSettings,
    Matte,
    Photo,
    Placement,
    Plate,
    Prompt,
)
from .image import ImageError, Picture, read_mask, read_picture, to_u8
from .importing import Scene, Source, place_import, register_file
from .progress import Progress, part, silent
from .puppet import Puppet, puppet_of
from .report import Stopwatch, build_report
from .script import EditScript, ScriptError
from .segment import Found, Segmenter
from .segment.mask_edit import is_selected
from .segment.matte import band_width, build_matte
from .splat_files import COUNT

MATTE_MARGIN = 4.0  # x the matte's band, kept around the object in the crop


def open_photo(data: bytes, name: str, fov: float | None = None, seed: int = 0) -> Document:
    """A fresh document from the bytes of a picture file.

    The camera comes from `fov` (degrees, horizontal), else from EXIF's 35-mm focal length, else
    it is 50 degrees. Raises ImageError.
    """
    picture = read_picture(data)
    height, width = picture.pixels.shape[:2]
    if fov is not None:
        try:
            camera = Camera.from_fov(width, height, fov)
        except ValueError as error:
            raise ImageError(str(error)) from error
    elif picture.focal_35mm:
        camera = Camera.from_focal_35mm(width, height, picture.focal_35mm)
    else:
        camera = Camera.from_fov(width, height)
    return Document(Photo(picture, camera, data, name), seed=seed)


@dataclass(frozen=True, eq=False)
class Reading:
    """What a segmenter has made of a photo: costly once, then every click is cheap."""

    pixels: Pixels  # the photo's
    segmenter: Segmenter
    rgb: RGB
    embedding: Any  # the segmenter's own

    def segment(self, prompt: Prompt, progress: Progress = silent, seed: int = 0) -> Found:
        """The mask (H, W) that `prompt` means, and how sure that is."""
        mask = self.segmenter.segment(self.rgb, prompt, self.embedding, progress, seed)
        sure = self.segmenter.confidence(self.rgb, prompt, self.embedding)  # of the same answer
        return Found(mask, self.segmenter.name, sure)


def read_photo(pixels: Pixels, segmenter: Segmenter, progress: Progress = silent) -> Reading:
    """The photo as a segmenter sees it. Raises SelectionError where it cannot run."""
    rgb = to_u8(pixels)
    return Reading(pixels, segmenter, rgb, segmenter.encode(rgb, progress))


def lift_mask(
    pixels: Pixels,
    camera: Camera,
    mask: Selection,
    backend: str = "auto",
    settings: LiftSettings = AS_SEEN,
    progress: Progress = silent,
    seed: int = 0,
) -> tuple[Matte, LiftedObject]:
    """The object under `mask` (H, W), bool or soft u8, as a cut-out and as 3D Gaussians."""
    lifter = lift.load(backend)
    progress(0.0, "Cutting out the object")
    margin = int(np.ceil(MATTE_MARGIN * band_width(camera.width, camera.height))) + 8
    matte = build_matte(pixels, mask, margin)
    subject = lift.Subject(pixels, camera, is_selected(mask), matte)
    return matte, lifter.lift(subject, settings, part(progress, 0.3, 1.0), seed)


def make_plate(
    pixels: Pixels,
    covered: Mask,
    backend: str = "auto",
    progress: Progress = silent,
    seed: int = 0,
) -> Plate:
    """The photo without what hides it at `covered` (H, W), as a crop."""  # fmt: skip
    return build_plate(pixels, covered, compose.load(backend), progress, seed)


def export(
    document: Document,
    puppets: dict[int, Puppet] | None = None,
    progress: Progress = silent,
) -> Picture:
    """The edited photo, with everything of the file that the edit does not concern."""
    return _picture(document, composite(document, puppets, progress))


def _picture(document: Document, result: Composite) -> Picture:
    return replace(document.photo.picture, pixels=result.pixels)


@dataclass(frozen=True, eq=False)
class Edited:
    """What `run_script` and `replay` make."""

    document: Document
    composite: Composite
    picture: Picture
    puppet: Puppet
    energies: tuple[float, ...]
    stopwatch: Stopwatch

    def report(self) -> dict[str, Any]:
        """The figures of DESIGN section 6, up to now."""
        return build_report(
            self.document, self.puppet, self.energies, self.composite, self.stopwatch
        )


def prompt_of(script: EditScript) -> Prompt:
    """What the script says about which object is meant."""
    clicks = [Click(x, y) for x, y in script.click]
    clicks += [Click(x, y, is_foreground=False) for x, y in script.not_click]
    return Prompt(tuple(clicks), script.box, script.subject)


def select(
    document: Document,
    script: EditScript,
    mask: bytes | None = None,
    progress: Progress = silent,
    stopwatch: Stopwatch | None = None,
) -> Document:
    """The document with the script's object chosen; the bytes of a `mask` picture win.

    Raises SelectionError, ImageError, EditError or ScriptError.
    """
    prompt = prompt_of(script)
    if mask is None and prompt.is_empty:
        raise ScriptError("no object is chosen: use --click, --box, --subject or --mask")
    with (stopwatch or Stopwatch()).stage("segment"):
        if mask is not None:
            found, backend = read_mask(mask, document.photo.size), "mask"
        else:
            pixels = document.photo.pixels
            segmenter = segment.load(script.segment)
            reading = read_photo(pixels, segmenter, part(progress, 0.0, 0.6))
            answer = reading.segment(prompt, part(progress, 0.6, 1.0), script.seed)
            found, backend = answer.mask, answer.backend
    document = edits.set_mask(edits.add_object(document), 0, found, prompt)
    return document.with_backend("segment", backend)


def run_script(
    data: bytes,
    name: str,
    script: EditScript,
    mask: bytes | None = None,
    progress: Progress = silent,
    needs_plate: bool = False,
) -> Edited:
    """The main job: `data` (a picture file called `name`) edited as `script` says.

    `mask` is the bytes of the script's mask picture. `needs_plate` makes the plate even where
    nothing moved. Raises the one-sentence errors of the stages, all of them ValueErrors.
    """
    refuse_missing(script)
    stopwatch = Stopwatch()
    with stopwatch.stage("load"):
        document = open_photo(data, name, script.fov, script.seed)
    document = select(document, script, mask, part(progress, 0.0, 0.3), stopwatch)
    with stopwatch.stage("lift"):
        document = _lift(document, script, part(progress, 0.3, 0.5))
    if script.nodes is not None:
        document = edits.resample(document, 0, script.nodes)
    settings = DeformSettings(
        script.deform,
        script.links,
        script.faithful,
        script.stiffness,
        script.stretch_limit,
        script.split,
    )
    document = edits.set_deform(document, 0, settings)
    puppet = puppet_of(document.objects[0], document.photo.camera)
    document, energies = _pose(document, puppet, script, progress, stopwatch)
    if document.objects[0].is_moved or needs_plate:
        with stopwatch.stage("inpaint"):
            covered, pixels = plate_cover(document), document.photo.pixels
            step = part(progress, 0.6, 0.85)
            old = _old_shadow(document, script, covered)
            if old is None:
                plate = make_plate(pixels, covered, script.inpaint, step, script.seed)
            else:
                inpainter = compose.load(script.inpaint)
                plate = shadowless_plate(pixels, covered, old, inpainter, step, script.seed)
                document = edits.set_shadow(document, 0, old.shadow)
            document = edits.set_plate(document, plate)
    if script.refine == "harmonise":
        document = edits.harmonised(document, 0).with_backend("refine", script.refine)
    return _finished(document, puppet, energies, progress, stopwatch)


def _old_shadow(document: Document, script: EditScript, covered: Mask) -> OldShadow | None:
    """The shadow that an object leaves behind, and takes along; None where it stays there."""
    item = document.objects[0]
    place = item.placement
    stays = place.move == (0, 0) and place.depth == 0 and place.scale == 1
    if script.shadow == "none" or stays or item.matte is None:
        return None
    return find_old_shadow(document.photo.pixels, item.matte, covered)


def lift_settings(document: Document, script: EditScript) -> LiftSettings:
    """What the script says about the object's shape. Raises ImageError."""
    hidden = None
    if script.hidden is not None:
        hidden = read_mask(Path(script.hidden).read_bytes(), document.photo.size)
    return LiftSettings(
        count=script.gaussians or GAUSSIANS,
        thickness=script.thickness,
        is_standing=not script.floating,
        is_symmetric={"auto": None, "yes": True, "no": False}[script.symmetry],
        back=script.back,
        hidden=hidden,
        horizon=document.horizon,
        uses_depth=not script.no_depth,
        trust=script.trust,
    )


def _lift(document: Document, script: EditScript, progress: Progress) -> Document:
    """The chosen object in 3D: lifted, or out of the script's file."""
    photo, mask = document.photo, document.objects[0].selection
    assert mask is not None, "select() has chosen it"
    if script.splats is None:
        settings = lift_settings(document, script)
        made = lift_mask(
            photo.pixels, photo.camera, mask, script.lift, settings, progress, script.seed
        )
        return edits.set_lifted(document, 0, *made, settings)
    is_free = script.fov is None and not photo.picture.focal_35mm
    scene = Scene(photo.pixels, photo.camera, mask, is_free)
    source = Source(Path(script.splats), script.gaussians or COUNT, script.flip)
    found = register_file(source, scene, part(progress, 0.0, 0.8), script.seed)
    best = found.registration.best
    document = edits.set_camera(document, best.camera, 0)
    rest = part(progress, 0.8, 1.0)
    made = place_import(scene, found.gaussians, best, rest, script.seed)
    return edits.set_lifted(document, 0, *made)


def replay(document: Document, progress: Progress = silent) -> Edited:
    """The picture of a session, as it was when the session was saved."""
    if not document.objects or document.objects[0].lifted is None:
        raise ScriptError("the session holds no lifted object, there is nothing to replay")
    stopwatch = Stopwatch()
    item = document.objects[0]
    puppet = puppet_of(item, document.photo.camera)
    energies = (0.0,)
    if item.handles:
        with stopwatch.stage("deform"):
            energies = puppet.deformer.solve(item.handles, item.has_auto_anchors).energies
    return _finished(document, puppet, energies, progress, stopwatch)


def refuse_missing(script: EditScript) -> None:
    """Raises ScriptError where the script needs a backend that is not there."""
    chosen = (
        ("segmenter", script.segment, segment.BACKENDS),
        ("lifter", script.lift, lift.BACKENDS),
        ("inpainter", script.inpaint, compose.BACKENDS),
    )
    for kind, name, known in chosen:  # also where the stage will not run
        is_sam = known is segment.BACKENDS and segment.is_known(name)  # or one SAM by its id
        if name != "auto" and name not in known and not is_sam:
            raise ScriptError(f"there is no {kind} {name!r}; known are {', '.join(known)}")
    if script.refine not in ("auto", *compose.REFINERS):
        known = ", ".join(compose.REFINERS)
        raise ScriptError(f"the refiner {script.refine!r} is not installed; installed: {known}")


def _pose(
    document: Document,
    puppet: Puppet,
    script: EditScript,
    progress: Progress,
    stopwatch: Stopwatch,
) -> tuple[Document, tuple[float, ...]]:
    """Handles, pins and placement of the script; the energies of the solve."""  # fmt: skip
    energies: tuple[float, ...] = (0.0,)
    document = _with_handles(document, puppet, script)
    item = document.objects[0]
    if any(not handle.is_pin for handle in item.handles):
        progress(0.5, "Linking control points")
        with stopwatch.stage("graph"):
            deformer = puppet.deformer
        progress(0.55, "Deforming")
        with stopwatch.stage("deform"):
            solution = deformer.solve(item.handles, item.has_auto_anchors)
        energies = solution.energies
        document = edits.set_pose(document, 0, solution.pose)
    move, turn = script.move or (0.0, 0.0, 0.0), script.turn or (0.0, 0.0, 0.0)
    scale = 1.0 if script.scale is None else script.scale
    placement = Placement((move[0], move[1]), move[2], turn, scale)
    return edits.set_placement(document, 0, placement), energies


def _with_handles(document: Document, puppet: Puppet, script: EditScript) -> Document:
    lifted, camera = puppet.lifted, document.photo.camera
    matte = document.objects[0].matte
    assert matte is not None
    texture = object_texture(matte)

    def pick(xy: tuple[float, float], option: str) -> Any:
        width, height = document.photo.size
        if not (0 <= xy[0] < width and 0 <= xy[1] < height):
            raise ScriptError(
                f"{option} {xy[0]:g},{xy[1]:g} is outside the photo of {width} x {height} px"
            )
        point = puppet.pick(xy, None, Placement(), texture)
        if point is None:
            raise ScriptError(f"{option} {xy[0]:g},{xy[1]:g} misses the object")
        return point

    for xy in script.pin:
        document = edits.add_handle(document, 0, pick(xy, "--pin").rest, is_pin=True)
    for handle in script.handle:
        point = pick(handle.at, "--handle")
        depth = point.depth + handle.dz * lifted.diameter * lifted.scale
        if depth <= 0:
            raise ScriptError(f"--handle: a depth of {handle.dz:g} is behind the camera")
        target = lifted.object_points(camera.unproject(np.array(handle.to), depth))
        document = edits.add_handle(document, 0, point.rest, target)
    return document


def _finished(
    document: Document,
    puppet: Puppet,
    energies: tuple[float, ...],
    progress: Progress,
    stopwatch: Stopwatch,
) -> Edited:
    with stopwatch.stage("render"):
        result = composite(document, {0: puppet}, part(progress, 0.85, 1.0))
    progress(1.0, "Done")
    return Edited(document, result, _picture(document, result), puppet, energies, stopwatch)
