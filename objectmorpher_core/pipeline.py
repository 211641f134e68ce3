"""The main job without a window: a photo and what to do with it -> pictures and a report.

`open_photo`, `read_photo`, `lift_mask`, `make_plate` are the costly stages, with plain
arguments and answers so that a worker process can run them; `run_script` strings them together
as the command line does.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from . import compose, lift, segment
from .base.arrays import RGB, Mask, Pixels, Selection, crop, unit_pixels
from .base.camera import Camera
from .base.files import read_input
from .base.progress import Progress, part, silent
from .compose.composite import OPAQUE, Composite, composite
from .compose.order import doubt_about_front
from .compose.plate.plate import build_plate
from .deform.puppet import Puppet, puppet_of
from .document import edits
from .document.edge_edits import set_decontaminate
from .document.key_edits import with_keys
from .document.model import (
    AS_SEEN,
    Click,
    Document,
    LiftedObject,
    LiftSettings,
    Matte,
    Photo,
    Plate,
    Prompt,
)
from .document.settings import Hint
from .document.transparency import colours_of, seen
from .lift.beyond_frame import cut_out_beyond
from .lift.loose_hair import with_hair_along, with_loose_hair
from .lift.registration.imported import ImportTarget, Source, place_import, register_file
from .lift.registration.other_photo import OtherPhoto, with_photo
from .lift.relief.depth_look import look_at_all
from .pictures.image import ImageError, Picture, naming, read_coverage, read_picture, to_u8
from .raster.posed import PosedSplats
from .scripting import runner
from .scripting.background import PlateAhead
from .scripting.options import EditScript, ScriptError
from .scripting.report import Stopwatch, build_report
from .scripting.runner import RefineOptions, has_left, prompt_of, with_plate, with_refinement
from .scripting.script import ALONE, FurtherObject, Others
from .segment import UNSURE, Found, Segmenter
from .segment.mask_edit import is_selected
from .segment.matting.matte import cut_out
from .splat_files import COUNT

NO_CHOICE: dict[str, Any] = dict(click=(), not_click=(), box=None, subject=False, mask=None)


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
    """A segmenter's reading of a photo: costly once, then every click is cheap."""

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
    mixed: Mask | None = None,
    use_matte: Callable[[Matte], object] | None = None,
) -> tuple[Matte, LiftedObject]:
    """The object under `mask` (H, W), bool or soft u8, as a cut-out and as 3D Gaussians.

    `mixed` (H, W): where the edge brush has found the softness of the mask, see `build_matte`.
    `use_matte` gets the cut-out before it is lifted.
    """
    lifter = lift.load(backend)
    progress(0.0, "Cutting out the object")
    matte = cut_out_beyond(pixels, mask, mixed)
    whole = with_loose_hair(pixels, matte)
    if use_matte is not None:
        use_matte(whole)
    subject = lift.LiftSubject(pixels, camera, is_selected(mask), matte)
    lifted = lift.lift_subject(lifter, subject, settings, part(progress, 0.3, 1.0), seed)
    return whole, with_hair_along(lifted, matte, whole, camera, seed)


def cut_front(pixels: Pixels, mask: Selection, mixed: Mask | None = None) -> Matte:
    """The soft cut-out of what stays in front under `mask` (H, W), bool or soft u8.

    Where it is opaque, or short of it by less than shows, it is the photo to the last bit.
    """
    matte = cut_out(pixels, mask, mixed)
    height, width = mask.shape
    is_whole = matte.alpha >= OPAQUE
    own = unit_pixels(crop(pixels, (0, 0, width, height), matte.box))
    is_photo = is_whole & crop(np.ones((height, width), bool), (0, 0, width, height), matte.box)
    return replace(
        matte, alpha=np.where(is_whole, np.float32(1), matte.alpha),
        foreground=np.where(is_photo[..., None], own, matte.foreground),
    )  # fmt: skip


def make_plate(
    pixels: Pixels,
    covered: Mask,
    backend: str = "auto",
    progress: Progress = silent,
    seed: int = 0,
    hints: tuple[Hint, ...] = (),
) -> Plate:
    """The photo without what hides it at `covered` (H, W), as a crop."""
    return build_plate(pixels, covered, compose.load(backend, bool(hints)), progress, seed, hints)


def export(
    document: Document,
    puppets: dict[int, Puppet] | None = None,
    progress: Progress = silent,
) -> Picture:
    """The edited photo, with everything of the file that the edit does not concern."""
    result = composite(document, puppets, progress)
    return result.picture(document.photo.picture)


@dataclass(frozen=True, eq=False)
class Edited:
    """The result of `run_script` and `replay`."""

    document: Document
    composite: Composite
    picture: Picture
    puppets: dict[int, Puppet]  # by the indices of the lifted objects
    energies: dict[int, tuple[float, ...]]  # of the solves
    stopwatch: Stopwatch
    notes: tuple[str, ...] = ()  # what one should know about the result, each a sentence

    @property
    def first(self) -> int:
        """Index of the first object that is lifted."""
        return min(self.puppets)

    @property
    def puppet(self) -> Puppet:
        """Return the puppet of that object."""
        return self.puppets[self.first]

    def report(self) -> dict[str, Any]:
        """The figures that `--report` writes, up to now."""
        report = build_report(
            self.document, self.puppets, self.energies, self.composite, self.stopwatch
        )
        return report | {"notes": list(self.notes)}


def select(
    document: Document,
    script: EditScript,
    mask: bytes | None = None,
    progress: Progress = silent,
    use_confidence: Callable[[float | None], object] | None = None,
) -> Document:
    """The document with the script's object chosen; the bytes of a `mask` picture win.

    `use_confidence` gets how sure that is, see `segment.Found`; None of a mask of one's own.
    Raises SelectionError, ImageError, EditError or ScriptError.
    """
    run = _Run(document, Stopwatch())
    sure = run.choose(script, mask, progress)
    if use_confidence is not None:
        use_confidence(sure)
    return run.document


def run_script(
    data: bytes,
    name: str,
    script: EditScript,
    mask: bytes | None = None,
    progress: Progress = silent,
    needs_plate: bool = False,
    others: Others = ALONE,
) -> Edited:
    """The main job: `data` (a picture file called `name`) edited as `script` says.

    As `continue_script` does, from the file on. Raises the stages' one-sentence ValueErrors.
    """
    stopwatch = Stopwatch()
    with stopwatch.stage("load"):
        document = open_photo(data, name, script.fov, script.seed)
    return continue_script(document, script, mask, progress, needs_plate, others, stopwatch)


def lift_first(
    document: Document, script: EditScript, mask: bytes | None = None, progress: Progress = silent
) -> Document:
    """An opened photo with the script's own object chosen and lifted, ready to be edited."""
    runner.refuse_missing(script)
    run = _Run(document, Stopwatch())
    run.choose(script, mask, part(progress, 0.0, 0.5))
    run.lift(0, script, part(progress, 0.5, 1.0))
    return run.document


def continue_script(
    document: Document,
    script: EditScript,
    mask: bytes | None = None,
    progress: Progress = silent,
    needs_plate: bool = False,
    others: Others = ALONE,
    stopwatch: Stopwatch | None = None,
) -> Edited:
    """An opened photo edited as `script` says; its own object may be lifted already.

    `mask`: bytes of the script's mask picture. `needs_plate`: the plate is made even where nothing
    moved. `others`: the photo's further objects. Raises the stages' one-sentence ValueErrors.
    """
    runner.refuse_missing(script, others)
    refiner = runner.refiner_of(script, others)
    with closing(_Run(document, stopwatch or Stopwatch())) as run:
        if others == ALONE and (needs_plate or runner.leaves_a_hole(script)):
            run.begins_plate = not (script.front or script.front_mask)
        return _carried_out(run, script, mask, progress, needs_plate, others, refiner)


def _carried_out(
    run: _Run,
    script: EditScript,
    mask: bytes | None,
    progress: Progress,
    needs_plate: bool,
    others: Others,
    refiner: str | None,
) -> Edited:
    """The rest of `continue_script`; the learned `refiner`, if any, refines it all."""
    stopwatch = run.stopwatch
    wishes = runner.with_inherited((FurtherObject(script), *others.objects))
    for k, wanted in enumerate(wishes):
        step = part(progress, 0.6 * k / len(wishes), 0.6 * (k + 1) / len(wishes))
        own = replace(wanted.script, seed=script.seed, fov=script.fov, inpaint=script.inpaint)
        with runner.told_of(k + 1, others):
            if k > 0:
                mask = read_input(Path(own.mask)) if own.mask else None
            run.add(k, replace(wanted, script=own), mask, step)
    run.keep_fronts(script, progress)
    document, notes = runner.ordered(run.document, others), run.doubts()
    notes = (*notes, *runner.contradicted(document))
    if any(item.is_moved for item in document.objects) or needs_plate or script.key:
        with stopwatch.stage("inpaint"):
            step = part(progress, 0.6, 0.85)
            behind = with_plate(document, script, frozenset(run.casting), step, run.ahead)
            document, notes = behind.document, (*notes, *behind.notes)
    has_shadow = any(item.shadow.strength > 0 for item in document.objects)
    if has_shadow and document.depth is None and not script.no_depth:
        document = edits.set_depth(document, look_at_all(colours_of(document.photo.picture)))
    for k, wanted in enumerate(wishes):
        if wanted.script.refine == "harmonise":
            document = edits.harmonised(document, k).with_backend("refine", "harmonise")
    if refiner is not None and any(item.is_moved for item in document.objects):
        with stopwatch.stage("refine"):
            how = RefineOptions(refiner, script.seed, script.refine_strength)
            document = with_refinement(document, how, part(progress, 0.85, 0.95), run.puppets)
    edited = _finished(document, run.puppets, run.energies, progress, stopwatch)
    notes = (*notes, *runner.erased(document), *runner.guesses(document, run.puppets))
    if script.key:
        moments = (document, *runner.key_poses(document, 0, run.puppets[0], script))
        edited = replace(edited, document=with_keys(edited.document, moments))
    return replace(edited, notes=notes)


class _Run:
    """A script that is being carried out, object by object."""

    def __init__(self, document: Document, stopwatch: Stopwatch) -> None:
        self.document = document
        self.puppets: dict[int, Puppet] = {}
        self.energies: dict[int, tuple[float, ...]] = {}
        self.casting: set[int] = set()  # objects that take their shadow in the photo along
        self.stopwatch = stopwatch
        self.begins_plate = False  # as soon as the object that is lifted is cut out
        self.ahead: PlateAhead | None = None  # that plate
        self._readings: dict[str, Reading] = {}  # by the segmenter's name
        self._unsure: dict[int, float] = {}  # how sure a selection is that may be wrong

    def add(self, k: int, wanted: FurtherObject, mask: bytes | None, progress: Progress) -> None:
        """Object `k` as far as it can be without the plate; the document may hold it, lifted."""
        script, is_lifted = wanted.script, k < len(self.document.objects)
        if wanted.duplicate is None and not is_lifted:
            with naming(script.mask or "the mask"):
                sure = self.choose(script, mask, part(progress, 0.0, 0.5))
            if sure is not None and sure < UNSURE:
                self._unsure[k] = sure
        if wanted.stay_in_front:
            self._keep(k)
            return
        if wanted.duplicate is not None:
            self.document = runner.copied(self.document, k, wanted)
        else:
            if not is_lifted:
                self.lift(k, script, part(progress, 0.5, 0.8))
            self.document = runner.with_settings(self.document, k, script)
        puppet = self.puppets[k] = puppet_of(self.document.objects[k], self.document.photo.camera)
        step = part(progress, 0.8, 1.0)
        self.document, self.energies[k] = runner.posed(
            self.document, k, puppet, script, step, self.stopwatch
        )
        if wanted.duplicate is None:
            self.document = runner.placed(self.document, k, script)
            self.document = runner.finished(self.document, k, script)
        if script.shadow == "auto" and has_left(self.document.objects[k], self.document):
            self.casting.add(k)

    def close(self) -> None:
        """Ends what was begun and nobody wants any more."""
        if self.ahead is not None:
            self.ahead.drop()

    def lift(self, k: int, script: EditScript, progress: Progress) -> None:
        """Object `k`, which is chosen, in 3D."""

        def begin_plate(matte: Matte) -> None:
            if self.begins_plate:
                self.ahead = runner.begun_plate(self.document, k, matte, script)

        with self.stopwatch.stage("lift"):
            document = _lift(self.document, k, script, progress, begin_plate)
            if script.decontaminate > 0:
                document = set_decontaminate(document, k, script.decontaminate)
            self.document = document

    def choose(self, script: EditScript, mask: bytes | None, progress: Progress) -> float | None:
        """The next object is the one that the script means. Returns how sure that is."""
        prompt = prompt_of(script)
        if mask is None and prompt.is_empty:
            raise ScriptError("no object is chosen: use click, box, subject or mask")
        sure: float | None = None
        with self.stopwatch.stage("segment"):
            if mask is not None:
                found: Selection = read_coverage(mask, self.document.photo.size)
                backend, prompt = "mask", Prompt()
            else:
                reading = self._reading(script.segment, part(progress, 0.0, 0.6))
                wanted = edits.beside(self.document, len(self.document.objects), prompt)
                got = reading.segment(wanted, part(progress, 0.6, 1.0), script.seed)
                found, backend, sure = got.mask, got.backend, got.confidence
        k = len(self.document.objects)
        document = edits.set_mask(edits.add_object(self.document), k, found, prompt)
        self.document = document.with_backend("segment", backend)
        return sure

    def keep_fronts(self, script: EditScript, progress: Progress) -> None:
        """Keep the things of the script's `front` clicks and mask in front."""
        wishes: list[tuple[EditScript, bytes | None]] = [
            (replace(script, **NO_CHOICE | {"click": (xy,)}), None) for xy in script.front
        ]
        if script.front_mask is not None:
            wishes.append((script, read_input(Path(script.front_mask))))
        for number, (wanted, mask) in enumerate(wishes, 1):
            progress(0.6, "Cutting out what stays in front")
            k = len(self.document.objects)
            try:
                with naming(script.front_mask or "the mask"):
                    self.choose(wanted, mask, silent)
                self._keep(k)
            except ValueError as error:
                raise ScriptError(f"front {number}: {error}") from error
            self.document = edits.rename(self.document, k, f"Front {number}")

    def doubts(self) -> tuple[str, ...]:
        """Return the doubts about what is selected, and what stays in front, each a sentence."""
        found = [
            f"only {sure:.0%} sure which pixels are {self.document.objects[k].name}: --click "
            "what is missing, --not-click what is too much, or give a --box around it"
            for k, sure in self._unsure.items()
        ]
        for k, item in enumerate(self.document.objects):
            doubt = None
            if item.stays_in_front:
                doubt = doubt_about_front(self.document, k, self._posed)
            if doubt is not None:
                found.append(
                    f"what stays in front ({item.name}) {doubt}: if that is not what you mean, "
                    "click nearer to its middle, or give its outline as a mask"
                )
        return tuple(found)

    def _posed(self, k: int) -> PosedSplats:
        item = self.document.objects[k]
        return self.puppets[k].posed(item.pose, item.placement)

    def _keep(self, k: int) -> None:
        """Object `k` stays in front."""
        mask = self.document.objects[k].selection
        assert mask is not None, "it was chosen"
        matte = cut_front(colours_of(self.document.photo.picture), mask)
        self.document = edits.keep_in_front(self.document, k, matte)

    def _reading(self, backend: str, progress: Progress) -> Reading:
        if backend not in self._readings:
            shown = seen(self.document.photo)
            self._readings[backend] = read_photo(shown, segment.load(backend), progress)
        return self._readings[backend]


def _lift(
    document: Document,
    k: int,
    script: EditScript,
    progress: Progress,
    use_matte: Callable[[Matte], object],
) -> Document:
    """Object `k`, which is chosen, in 3D: lifted, or out of the script's file.

    `use_matte` gets its cut-out, where that is there before the shape is.
    """
    photo, mask = document.photo, document.objects[k].selection
    assert mask is not None, "it was chosen"
    if script.splats is not None and script.more_views:
        raise ScriptError("more_views: a shape from a file is not changed by photos")
    if script.splats is None:
        settings = runner.lift_settings(document, script)
        if script.more_views:
            return _lift_all_round(document, k, script, settings, progress)
        made = lift_mask(
            colours_of(photo.picture), photo.camera, mask, script.lift, settings, progress,
            script.seed, None, use_matte,
        )  # fmt: skip
        return edits.set_lifted(document, k, *made, settings)
    is_alone = all(item.lifted is None for i, item in enumerate(document.objects) if i != k)
    is_free = is_alone and script.fov is None and not photo.picture.focal_35mm
    scene = ImportTarget(colours_of(photo.picture), photo.camera, mask, is_free)
    source = Source(Path(script.splats), script.gaussians or COUNT, script.flip)
    found = register_file(source, scene, part(progress, 0.0, 0.8), script.seed)
    best = found.registration.best
    document = edits.set_camera(document, best.camera, k)
    rest = part(progress, 0.8, 1.0)
    made = place_import(scene, found.gaussians, best, rest, script.seed)
    return edits.set_lifted(document, k, *made)


def other_photo(
    path: Path,
    at: tuple[float, float] | None = None,
    backend: str = "auto",
    progress: Progress = silent,
    fov: float | None = None,
    seed: int = 0,
) -> OtherPhoto:
    """Another photo's file with the thing seen `at` px there, else its main subject.

    Raises InputError, ImageError, SelectionError, OSError.
    """
    with naming(path):
        opened = open_photo(read_input(path), path.name, fov, seed).photo
    prompt = Prompt((Click(*at),)) if at else Prompt(is_subject=True)
    reading = read_photo(seen(opened), segment.load(backend), part(progress, 0.0, 0.7))
    found = reading.segment(prompt, part(progress, 0.7, 1.0), seed).mask
    return OtherPhoto(path.name, colours_of(opened.picture), opened.camera, found)


def _lift_all_round(
    document: Document, k: int, script: EditScript, settings: LiftSettings, progress: Progress
) -> Document:
    """Object `k`, which is chosen, lifted from all its photos."""
    if script.lift not in ("auto", "relief"):
        raise ScriptError(f"more_views: the lifter {script.lift} makes a shape from one photo")
    photo, mask = document.photo, document.objects[k].selection
    assert mask is not None, "it was chosen"
    pixels = colours_of(photo.picture)
    matte, lifted = cut_out_beyond(pixels, mask), None
    subject = lift.LiftSubject(pixels, photo.camera, is_selected(mask), matte)
    count = len(script.more_views)
    for number, wanted in enumerate(script.more_views):
        step = part(progress, number / count, (number + 1) / count)
        path = Path(wanted.photo)
        try:
            taken = other_photo(
                path, wanted.at, script.segment, part(step, 0.0, 0.2), script.fov, script.seed
            )
            settings, lifted = with_photo(
                subject, settings, lift.load(script.lift), taken, part(step, 0.2, 1.0), script.seed
            )
        except ValueError as error:
            raise ScriptError(f"more_views {path.name}: {error}") from error
    assert lifted is not None, "there is a further photo"
    return edits.set_lifted(document, k, matte, lifted, settings)


def replay(document: Document, progress: Progress = silent) -> Edited:
    """The picture of a session, as it was when the session was saved."""
    lifted = {k: item for k, item in enumerate(document.objects) if item.lifted is not None}
    if not lifted:
        raise ScriptError("the session holds no lifted object, there is nothing to replay")
    stopwatch = Stopwatch()
    puppets = {k: puppet_of(item, document.photo.camera) for k, item in lifted.items()}
    energies: dict[int, tuple[float, ...]] = {}
    for k, item in lifted.items():
        if item.handles:
            with stopwatch.stage("deform"):
                deformer = puppets[k].deformer
                energies[k] = deformer.solve(item.handles, item.footing).energies
    return _finished(document, puppets, energies, progress, stopwatch)


def _finished(
    document: Document,
    puppets: dict[int, Puppet],
    energies: dict[int, tuple[float, ...]],
    progress: Progress,
    stopwatch: Stopwatch,
) -> Edited:
    with stopwatch.stage("render"):
        result = composite(document, puppets, part(progress, 0.85, 1.0))
    progress(1.0, "Done")
    picture = result.picture(document.photo.picture)
    return Edited(document, result, picture, puppets, energies, stopwatch)
