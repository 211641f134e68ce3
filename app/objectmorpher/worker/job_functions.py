"""Job functions of the worker process: plain values in, plain values out.

The heavy modules are imported inside, so that the window, which only names these functions,
starts without them.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core.base.arrays import F32, RGB, U8, Mask, Pixels, Selection
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.progress import Progress, part
from objectmorpher_core.document.model import (
    Document,
    LiftedObject,
    LiftSettings,
    Matte,
    Plate,
    Prompt,
)
from objectmorpher_core.document.settings import Hint

from ..canvas.layer import ExactPicture, Rendered
from ..canvas.layers import render
from ..canvas.shape import rehearse_lift
from ..editor.export_plan import ExportPlan

if TYPE_CHECKING:
    from objectmorpher_core.compose.plate.repair import PlatePatch
    from objectmorpher_core.compose.refine.refinement import CoarseEdit
    from objectmorpher_core.doctor import StageReport
    from objectmorpher_core.document.gaussians import Gaussians
    from objectmorpher_core.document.settings import Refined, Shadow
    from objectmorpher_core.lift.refitting import Background, Lifted, Refitted
    from objectmorpher_core.lift.registration.imported import Import, ImportTarget
    from objectmorpher_core.lift.registration.other_photo import OtherPhoto
    from objectmorpher_core.lift.registration.placement import Proposal
    from objectmorpher_core.models import Added
    from objectmorpher_core.pipeline import Reading
    from objectmorpher_core.scripting.outputs import Export
    from objectmorpher_core.scripting.runner import RefineOptions
    from objectmorpher_core.segment import Found, Segmenter
    from objectmorpher_core.segment.matting.repair import EdgeStroke

WARM = ("objectmorpher_core.pipeline",)  # what the worker imports before the first request


@dataclass(frozen=True)
class BackendChoice:
    """Which backend does a stage, its random seed, and what the user has said about a fill."""

    backend: str
    seed: int = 0
    hints: tuple[Hint, ...] = ()


@dataclass(frozen=True, eq=False)
class Cut:
    """A photo and what of it is meant."""

    pixels: Pixels
    camera: Camera
    mask: Selection
    mixed: Mask | None = None  # (H, W) where the edge brush has found the mask's softness


class PhotoMemory:
    """A segmenter, and what it has made of the last photo."""

    def __init__(self) -> None:
        self._backend = ""
        self._segmenter: Segmenter | None = None
        self._reading: Reading | None = None

    def forget(self) -> None:
        self._backend, self._segmenter, self._reading = "", None, None

    def reading(self, pixels: Pixels, backend: str, progress: Progress) -> Reading:
        """The photo as the segmenter sees it; at once where it is the last one."""
        from objectmorpher_core import segment
        from objectmorpher_core.pipeline import read_photo

        if self._segmenter is None or backend != self._backend:
            self._backend, self._segmenter = backend, segment.load(backend)
            self._reading = None
        if self._reading is None or not _is_same(self._reading.pixels, pixels):
            self._reading = None  # not two photos at a time
            self._reading = read_photo(pixels, self._segmenter, progress)
        return self._reading


_memory = PhotoMemory()  # this process's


def remember(memory: PhotoMemory) -> None:
    """The next jobs go on with another memory, where one process is to remember several photos."""
    global _memory
    _memory = memory


def _is_same(a: Pixels, b: Pixels) -> bool:
    return a is b or (a.dtype == b.dtype and np.array_equal(a, b))


def read_photo(pixels: Pixels, backend: str, progress: Progress) -> None:
    """Prepares for clicks on a photo that was just opened."""
    _memory.reading(pixels, backend, progress)


def add_model(id: str, path: Path, progress: Progress) -> Added:
    """A user's file tried and kept among the models."""
    from objectmorpher_core import models

    progress(0.1, "trying it")
    return models.add(id, path)


def use_model_folder(id: str, folder: Path, progress: Progress) -> Path:
    """A folder of the user's looked at, and used as a model of several files; the folder."""
    from objectmorpher_core import models

    progress(0.1, "trying it")
    return models.use_folder(id, folder).path


def forget_segmenter(progress: Progress) -> None:
    """The next photo or click chooses the backend anew: a model was added."""
    _memory.forget()


def segment(pixels: Pixels, prompt: Prompt, choice: BackendChoice, progress: Progress) -> Found:
    """Return the mask that the prompt means, the backend that found it, and its confidence.

    At a glance, where the backend can tell better by a `closer_look`.
    """
    from objectmorpher_core.segment import Quick

    reading = _memory.reading(pixels, choice.backend, part(progress, 0.0, 0.6))
    rest, segmenter = part(progress, 0.6, 1.0), reading.segmenter
    if isinstance(segmenter, Quick):
        return segmenter.glance(reading.rgb, prompt, reading.embedding, rest)
    return reading.segment(prompt, rest, choice.seed)


def closer_look(pixels: Pixels, prompt: Prompt, choice: BackendChoice, progress: Progress) -> Found:
    """Segment like `segment`, however long it takes."""
    reading = _memory.reading(pixels, choice.backend, part(progress, 0.0, 0.6))
    return reading.segment(prompt, part(progress, 0.6, 1.0), choice.seed)


def lift(
    cut: Cut, choice: BackendChoice, shape: LiftSettings, progress: Progress
) -> tuple[Matte, LiftedObject]:
    """The masked object's soft cut-out and its 3D Gaussians."""
    from objectmorpher_core.pipeline import lift_mask

    stage = part(progress, 0.0, 0.95)
    matte, lifted = lift_mask(
        cut.pixels, cut.camera, cut.mask, choice.backend, shape, stage, choice.seed, cut.mixed
    )
    progress(0.95, "getting ready to pose")
    rehearse_lift(matte, lifted, cut.camera)  # seconds, once
    return matte, lifted


def lift_with_photo(
    cut: Cut, other: Path | OtherPhoto, chosen: tuple[str, BackendChoice], shape: LiftSettings,
    progress: Progress,
) -> tuple[LiftSettings, Matte, LiftedObject]:  # fmt: skip
    """The masked object lifted with another photo of it, too, and the settings that say so.

    Of a file it is the main subject. `chosen`: the segmenter, and the lifter.
    """
    from objectmorpher_core.lift import LiftSubject, load
    from objectmorpher_core.lift.beyond_frame import cut_out_beyond
    from objectmorpher_core.lift.registration.other_photo import with_photo
    from objectmorpher_core.pictures.image import ImageError
    from objectmorpher_core.pipeline import other_photo
    from objectmorpher_core.segment.mask_edit import is_selected

    segmenter, choice = chosen
    if isinstance(other, Path):
        try:
            other = other_photo(other, None, segmenter, part(progress, 0.0, 0.2), None, choice.seed)
        except OSError as error:
            raise ImageError(f"{other.name} cannot be opened: {error.strerror or error}") from error
    matte = cut_out_beyond(cut.pixels, cut.mask, cut.mixed)
    subject = LiftSubject(cut.pixels, cut.camera, is_selected(cut.mask), matte)
    settings, lifted = with_photo(
        subject, shape, load(choice.backend), other, part(progress, 0.2, 0.95), choice.seed
    )
    rehearse_lift(matte, lifted, cut.camera)
    return settings, matte, lifted


def refit(
    was: Lifted, scene: ImportTarget, behind: Background | None, seed: int, progress: Progress
) -> Refitted:
    """A lifted object whose selection was refined, in its new shape."""
    from objectmorpher_core.lift.refitting import refit

    return refit(was, scene, behind, progress, seed)


def cut_front(
    pixels: Pixels, mask: Selection, mixed: Mask | None, progress: Progress
) -> Matte:  # fmt: skip
    """The soft cut-out of what stays in front of the edit."""
    from objectmorpher_core.pipeline import cut_front

    return cut_front(pixels, mask, mixed)


def brush_edge(stroke: EdgeStroke, is_erasing: bool, progress: Progress) -> tuple[U8, Mask]:
    """The coverage and the places of the edge brush after a stroke of it."""
    from objectmorpher_core.segment.matting import repair

    return repair.unbrush_edge(stroke) if is_erasing else repair.brush_edge(stroke)


def import_object(
    path: Path, scene: ImportTarget, seed: int, progress: Progress
) -> tuple[Import, Matte, LiftedObject]:
    """An object's file registered to the photo, and in the best pose textured with it."""
    from objectmorpher_core.lift.registration.imported import Source, place_import, register_file

    try:
        found = register_file(Source(path), scene, part(progress, 0.0, 0.8), seed)
    except OSError as error:
        from objectmorpher_core.splat_files import SplatFileError

        reason = error.strerror or str(error)
        raise SplatFileError(f"{path.name} cannot be opened: {reason}") from error
    best, rest = found.registration.best, part(progress, 0.8, 1.0)
    return found, *place_import(scene, found.gaussians, best, rest, seed)


def place_object(
    scene: ImportTarget, gaussians: Gaussians, proposal: Proposal, seed: int, progress: Progress
) -> tuple[Matte, LiftedObject]:
    """An object's Gaussians in a proposed pose, textured with the photo."""
    from objectmorpher_core.lift.registration.imported import place_import

    return place_import(scene, gaussians, proposal, progress, seed)


def fit_object(
    scene: ImportTarget, gaussians: Gaussians, start: np.ndarray, seed: int, progress: Progress
) -> tuple[Import, Matte, LiftedObject]:
    """The best pose near `start` (4, 4 world from object), textured with the photo."""
    from objectmorpher_core.lift.registration.imported import fit_near, place_import

    found = fit_near(scene, gaussians, start, part(progress, 0.0, 0.5), seed)
    rest = part(progress, 0.5, 1.0)
    return found, *place_import(scene, gaussians, found.registration.best, rest, seed)


def candidate(
    pixels: Pixels, prompt: Prompt, choice: BackendChoice, progress: Progress
) -> Found | str:
    """Segment like `segment`; where nothing can be selected, return the sentence that says so."""
    from objectmorpher_core.segment import SelectionError

    try:
        return segment(pixels, prompt, choice, progress)
    except SelectionError as error:
        return str(error)


def change_mask(
    selection: Selection, change: Callable[[Selection], Selection], progress: Progress
) -> Selection:
    """The selection, its edge moved, smoothed or softened."""
    return change(selection)


def read_coverage(path: Path, size: tuple[int, int], progress: Progress) -> U8:
    """The soft mask in a picture file, for a photo of `size` (width, height) px."""
    from objectmorpher_core.pictures import image

    try:
        data = path.read_bytes()
    except OSError as error:
        sentence = f"{path.name} cannot be opened: {error.strerror or error}"
        raise image.ImageError(sentence) from error
    return image.read_coverage(data, size)


def write_coverage(selection: Selection, path: Path, progress: Progress) -> None:
    """Writes a mask as an 8-bit grey PNG file."""
    from objectmorpher_core.base.files import write_all
    from objectmorpher_core.pictures.image import encode_coverage
    from objectmorpher_core.segment.mask_edit import as_coverage

    write_all({path: encode_coverage(as_coverage(selection))})


def render_exact(request: ExactPicture, progress: Progress) -> Rendered:
    """A layer of the view."""
    return render(request)


def inpaint(pixels: Pixels, covered: Mask, choice: BackendChoice, progress: Progress) -> Plate:
    """The photo without its objects."""
    from objectmorpher_core.pipeline import make_plate

    return make_plate(pixels, covered, choice.backend, progress, choice.seed, choice.hints)


@dataclass(frozen=True, eq=False)
class Variant:
    """A background among others to choose from."""

    plate: Plate
    thumb: RGB  # (h, w, 3) a small picture of what is filled in, and around it


def fill_variants(
    pixels: Pixels, covered: Mask, choice: BackendChoice, count: int, progress: Progress
) -> tuple[Variant, ...]:
    """The photo without its objects, `count` times, each with another seed."""
    from objectmorpher_core.compose.plate.repair import thumbnail
    from objectmorpher_core.pipeline import make_plate

    found = []
    for n in range(count):
        step = part(progress, n / count, (n + 1) / count)
        seed = choice.seed + n
        plate = make_plate(pixels, covered, choice.backend, step, seed, choice.hints)
        found.append(Variant(plate, thumbnail(pixels, plate)))
    return tuple(found)


def repair(
    patch: PlatePatch, margin: float, choice: BackendChoice, progress: Progress
) -> tuple[PlatePatch, str]:
    """A part of the background filled in anew where it is painted, and by which backend."""
    from objectmorpher_core import compose
    from objectmorpher_core.compose.plate.repair import fill_patch

    inpainter = compose.load(choice.backend)
    return fill_patch(patch, margin, inpainter, progress, choice.seed), inpainter.name


@dataclass(frozen=True, eq=False)
class Cutout:
    """An object in its photo, and all that hides the background (H, W)."""

    pixels: Pixels
    matte: Matte
    covered: Mask
    ground: float | None  # degrees above it from which one looks, where that is known
    is_asked: bool = True  # by the artist: less may speak for a shadow than where nobody asked


def take_shadow(
    cutout: Cutout, choice: BackendChoice, progress: Progress
) -> tuple[Shadow, Plate] | None:
    """A shadow like the object's in the photo, and the background without it.

    None where none is sure.
    """
    from objectmorpher_core import compose
    from objectmorpher_core.compose.shadow.old_shadow import traceless_plate
    from objectmorpher_core.compose.shadow.shadow_fit import LIKELY, SURE, find_old_shadow

    progress(0.0, "")
    margin = LIKELY if cutout.is_asked else SURE
    old = find_old_shadow(cutout.pixels, cutout.matte, cutout.covered, cutout.ground, margin)
    if old is None:
        return None
    inpainter = compose.load(choice.backend, bool(choice.hints))
    step = part(progress, 0.1, 1.0)
    plate = traceless_plate(
        cutout.pixels, cutout.covered, [old], inpainter, step, choice.seed, choice.hints
    )
    return old.shadow, plate


def look_at_depth(pixels: Pixels, progress: Progress) -> F32 | None:
    """The photo's inverse depth, see `Document.depth`; None where no network is installed."""
    from objectmorpher_core.lift.relief.depth_look import look_at_all

    progress(0.0, "")
    return look_at_all(pixels)


def cut_edit(document: Document, progress: Progress) -> CoarseEdit:
    """Return the part of the edit that a network is to see."""
    from objectmorpher_core.scripting.runner import coarse_edit

    return coarse_edit(document, progress)


def refine(edit: CoarseEdit, how: RefineOptions, progress: Progress) -> Refined:
    """The edit as a network makes it look."""
    from objectmorpher_core.compose import refine
    from objectmorpher_core.compose.refine import refinement

    refiner = refine.load(how.backend)
    return refinement.refine(edit, refiner, progress, how.seed, how.strength)


def write_session(document: Document, path: Path, progress: Progress) -> None:
    """Saves the document as an .omorph file."""
    from objectmorpher_core.session.file import save_session

    progress(0.1, "packing")
    save_session(document, path)


def look_at_stages(progress: Progress) -> tuple[StageReport, ...]:
    """Return what each stage's backends can do here; may load PyTorch to ask for a GPU."""
    from objectmorpher_core import doctor

    return doctor.look_at_stages()


def write_export(document: Document, plan: ExportPlan, progress: Progress) -> None:
    """Renders what the plan asks for and writes it. Raises OutputError, ImageError."""
    from objectmorpher_core.base.files import make_folder, write_all

    export = _export(document, plan, progress)
    if not plan.is_folder:
        data = export.encode(plan.what.key, plan.path)
        progress(0.95, "writing")
        write_all({plan.path: data})
        return
    outputs = export.files(plan.what.key, plan.path)
    is_new = not plan.path.exists()
    try:
        make_folder(plan.path)
        write_all(outputs)
    except OSError:
        if is_new:
            with suppress(OSError):  # what the disk keeps, it keeps
                plan.path.rmdir()
        raise


def encode_export(document: Document, plan: ExportPlan, progress: Progress) -> bytes:
    """Return the file that `write_export` would write."""
    return _export(document, plan, progress).encode(plan.what.key, plan.path)


def _export(document: Document, plan: ExportPlan, progress: Progress) -> Export:
    from objectmorpher_core.scripting.animation import Clip
    from objectmorpher_core.scripting.outputs import Export

    progress(0.02, "drawing")
    clip = Clip(plan.motion.name.lower(), plan.seconds, object=plan.object)
    return Export(
        document, object=plan.object, bits=plan.bits, quality=plan.quality,
        webp_quality=plan.quality, clip=clip, progress=progress,
    )  # fmt: skip
