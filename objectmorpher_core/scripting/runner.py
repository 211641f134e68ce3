"""The runner: carries out a script on a document, step by step."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from .. import compose, lift, segment
from ..base.files import read_input
from ..base.progress import Progress, part, silent
from ..compose import refine
from ..compose.composite import CarriedTexture, composite
from ..compose.order import holes, reordered
from ..compose.plate.plate import erased_beside, plate_cover
from ..compose.refine import refinement
from ..compose.refine.refinement import CoarseEdit
from ..deform.puppet import Puppet, puppet_of
from ..document import edits
from ..document.model import (
    GAUSSIANS,
    Click,
    Document,
    EditObject,
    LiftSettings,
    Matte,
    Placement,
    Prompt,
)
from ..document.placement import grown, is_in_place, set_seen_from, spun
from ..document.settings import DeformSettings, Hint, Shadow
from ..document.transparency import continued, with_opacity
from ..lift.workers.file import worker_names
from ..pictures.image import naming, read_mask
from ..raster import tiles
from ..raster.trust import SIGNS, trust_in
from .background import LIGHT, LIGHT_LIFTERS, PlateAhead, PlateTask, ShadowCaster
from .options import FINISH, EditScript, ScriptError, options_of, said_by
from .report import Stopwatch
from .script import ALONE, FurtherObject, Others

# What a script says about an object that is lifted: handles, pose, place, light, copies, order.


def refuse_missing(script: EditScript, others: Others = ALONE) -> None:
    """Raises ScriptError where the script needs a backend that is not there."""
    for number, own in enumerate((script, *(o.script for o in others.objects)), 1):
        with told_of(number, others):
            _refuse_missing(own)


def _refuse_missing(script: EditScript) -> None:
    chosen = (
        ("segmenter", script.segment, segment.BACKENDS),
        ("lifter", script.lift, (*lift.BACKENDS, *worker_names())),
        ("inpainter", script.inpaint, compose.BACKENDS),
    )
    for kind, name, known in chosen:  # also where the stage will not run
        is_sam = known is segment.BACKENDS and segment.is_known(name)  # or one SAM by its id
        if name != "auto" and name not in known and not is_sam:
            raise ScriptError(f"there is no {kind} {name!r}; known are {', '.join(known)}")
    known = (*compose.REFINERS, *refine.BACKENDS)
    if script.refine not in ("auto", *known):
        raise ScriptError(f"there is no refiner {script.refine!r}; known are {', '.join(known)}")
    if script.refine in refine.BACKENDS and (reason := refine.missing(script.refine)) is not None:
        raise ScriptError(f"refine {script.refine}: {reason}")


def refiner_of(script: EditScript, others: Others = ALONE) -> str | None:
    """The learned refiner that is asked for; it refines the whole edit. Raises ScriptError."""
    asked = {own.refine for own in (script, *(o.script for o in others.objects))}
    found = sorted(asked & set(refine.BACKENDS))
    if len(found) > 1:
        raise ScriptError(f"an edit is refined by one refiner, not by {' and '.join(found)}")
    return found[0] if found else None


@contextmanager
def told_of(number: int, others: Others) -> Iterator[None]:
    """An error inside says which object it is about, where there are several."""
    try:
        yield
    except ValueError as error:
        if not others.objects:
            raise
        raise ScriptError(f"object {number}: {error}") from error


def with_inherited(wishes: tuple[FurtherObject, ...]) -> list[FurtherObject]:
    """Give copies their originals' shadow and light unless they have their own."""
    result: list[FurtherObject] = []
    for wanted in wishes:
        if wanted.duplicate is not None:
            of = result[wanted.duplicate - 1].script
            kept = {name: getattr(of, name) for name in {"shadow", "refine"} - wanted.said}
            wanted = replace(wanted, script=replace(wanted.script, **kept))
        result.append(wanted)
    return result


def prompt_of(script: EditScript) -> Prompt:
    """Return the script's prompt for the object."""
    clicks = [Click(x, y) for x, y in script.click]
    clicks += [Click(x, y, is_foreground=False) for x, y in script.not_click]
    return Prompt(tuple(clicks), script.box, script.subject)


def lift_settings(document: Document, script: EditScript) -> LiftSettings:
    """Return the script's settings of the object's shape. Raises ImageError."""
    hidden = None
    if script.hidden is not None:
        with naming(script.hidden):
            hidden = read_mask(read_input(Path(script.hidden)), document.photo.size)
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
        kind=script.shape,
    )


def with_settings(document: Document, k: int, script: EditScript) -> Document:
    """Object `k` with the control points and the way of deforming that the script asks for."""
    if script.nodes is not None:
        document = edits.resample(document, k, script.nodes)
    settings = DeformSettings(
        script.deform,
        script.links,
        script.faithful,
        script.stiffness,
        script.stretch_limit,
        script.split,
    )
    return edits.set_deform(document, k, settings)


def copied(document: Document, k: int, wanted: FurtherObject) -> Document:
    """Return object `k` as a copy of another; options that it does not state are the original's."""
    assert wanted.duplicate is not None
    if document.objects[wanted.duplicate - 1].stays_in_front:
        raise ScriptError(f"object {wanted.duplicate} stays in front and cannot be copied")
    document = edits.duplicate(document, wanted.duplicate - 1)
    item = document.objects[k]
    script, said = wanted.script, wanted.said
    place = grown(item.placement, 1.0, item, document)  # from where its own scale grows it
    if {"handle", "pin"} & said:
        document = edits.reset_pose(document, k)
    asked = _placement(script)
    place = Placement(
        asked.move if "move" in said else place.move,
        asked.depth if "move" in said else place.depth,
        asked.turn if "turn" in said else place.turn,
        asked.scale if "scale" in said else item.placement.scale,
    )
    document = edits.set_visible(_put(document, k, place, script), k, True)
    document = finished(document, k, script, said)
    if script.shadow == "none":
        document = edits.set_shadow(document, k, Shadow())
    return document


def posed(
    document: Document,
    k: int,
    puppet: Puppet,
    script: EditScript,
    progress: Progress,
    stopwatch: Stopwatch,
) -> tuple[Document, tuple[float, ...]]:
    """Handles and pins of the script, and the pose they give; the energies of the solve."""
    energies: tuple[float, ...] = (0.0,)
    document = _with_handles(document, k, puppet, script)
    item = document.objects[k]
    if any(not handle.is_pin for handle in item.handles):
        progress(0.5, "Linking control points")
        with stopwatch.stage("graph"):
            deformer = puppet.deformer
        progress(0.55, "Deforming")
        with stopwatch.stage("deform"):
            solution = deformer.solve(item.handles, item.footing)
        energies = solution.energies
        document = edits.set_pose(document, k, solution.pose)
    return document, energies


def key_poses(document: Document, k: int, puppet: Puppet, script: EditScript) -> list[Document]:
    """The document with object `k` in each further key pose; what one does not say is at rest."""
    found = []
    for number, key in enumerate(script.key, 1):
        rest = edits.set_placement(edits.reset_pose(document, k), k, Placement())
        try:
            keyed, _ = posed(rest, k, puppet, key, silent, Stopwatch())
        except ValueError as error:
            raise ScriptError(f"key {number}: {error}") from error
        found.append(placed(keyed, k, key))
    return found


def placed(document: Document, k: int, script: EditScript) -> Document:
    """Object `k` where the script wants it, or gone."""
    document = _put(document, k, _placement(script), script)
    return edits.set_visible(document, k, False) if script.remove else document


SAID = {SIGNS[1]: "one should look closely", SIGNS[2]: "it is guesswork"}
LIKE = 0.3  # likeness, below which a thing does not look like what it was said to be
SOLIDS = {"round": "something round", "box": "a box"}


def contradicted(document: Document) -> tuple[str, ...]:
    """What does not look like the kind that it was said to be, each a sentence."""
    return tuple(
        f"{item.name} does not look like {SOLIDS[item.lifted.kind]}: without saying so"
        " its shape may come out better"
        for item in document.objects
        if item.lifted is not None and item.lifted.kind in SOLIDS and item.lifted.likeness < LIKE
    )


def erased(document: Document) -> tuple[str, ...]:
    """What the edit takes off the photo though it looks like part of an object, a sentence each."""
    found = []
    for piece in erased_beside(document, holes(document)):
        item, (x, y) = document.objects[piece.owner], piece.place
        if item.is_visible and piece.like_px:
            found.append(
                f"{piece.like_px:,} px beside {item.name} look like part of it and are erased: "
                f"to keep them, choose them, too (about {x},{y})"
            )
    return tuple(found)


def guesses(document: Document, puppets: dict[int, Puppet]) -> tuple[str, ...]:
    """What is more guessed than known of the edit, each a sentence."""
    found = []
    for k, puppet in puppets.items():
        item = document.objects[k]
        if item.is_moved and item.is_visible:
            splats = puppet.posed(item.pose, item.placement)
            trust = trust_in(splats)
            if not _is_in_photo(splats.means, document):
                found.append(f"{item.name} is beside the photo now, where nobody sees it")
            elif trust.sign != SIGNS[0]:
                is_moved_only = item.pose is None and not any(item.placement.turn)
                way = "moved" if is_moved_only else "turned"
                share = f"the photo does not show {trust.invented:.0%} of what is seen of it now"
                found.append(f"{item.name} is {way} so far that {SAID[trust.sign]}: {share}")
    return tuple(found)


def _is_in_photo(points: np.ndarray, document: Document) -> bool:
    """Whether any of `points` (N, 3) world are seen in the photo."""
    seen = document.photo.camera.project(points[points[:, 2] > 0])
    return bool(((seen >= 0) & (seen < document.photo.size)).all(1).any())


def finished(
    document: Document, k: int, script: EditScript, said: frozenset[str] = options_of(FINISH)
) -> Document:
    """Object `k` as opaque and coloured as the script has `said`."""
    changes = {name: getattr(script, name) for name in options_of(FINISH) & said}
    return edits.set_finish(document, k, replace(document.objects[k].finish, **changes))


def _placement(script: EditScript) -> Placement:
    """Where the script wants an object, but for its spin."""
    move, turn = script.move or (0.0, 0.0, 0.0), script.turn or (0.0, 0.0, 0.0)
    scale = 1.0 if script.scale is None else script.scale
    return Placement((move[0], move[1]), move[2], turn, scale)


def _put(document: Document, k: int, placement: Placement, script: EditScript) -> Document:
    """Object `k` at a `placement`, before that spun as the script says, and grown on its foot."""
    if script.seen_from is not None:
        document = set_seen_from(document, k, script.seen_from)
    item, scale = document.objects[k], placement.scale
    placement = replace(placement, scale=1.0)
    if script.spin:
        placement = spun(placement, script.spin, item, document)
    return edits.set_placement(document, k, grown(placement, scale, item, document))


def _with_handles(document: Document, k: int, puppet: Puppet, script: EditScript) -> Document:
    if not script.pin and not script.handle:
        return document
    lifted, camera = puppet.lifted, document.photo.camera
    matte = document.objects[k].matte
    assert matte is not None
    drawable = tiles.prepare(puppet.posed(None, Placement()), camera, camera)
    texture = CarriedTexture(matte, lifted, drawable)

    def pick(xy: tuple[float, float], option: str) -> Any:
        _check_within(document.photo.size, xy, option)
        x, y = int(xy[0]), int(xy[1])
        seen = texture.seen_in((x - 1, y - 1, x + 2, y + 2))
        point = puppet.pick_in(drawable, seen, xy, None, Placement())
        if point is None:
            raise ScriptError(f"{option} {xy[0]:g},{xy[1]:g} misses the object")
        return point

    for xy in script.pin:
        document = edits.add_handle(document, k, pick(xy, "pin").rest, is_pin=True)
    for handle in script.handle:
        point = pick(handle.at, "handle")
        depth = point.depth + handle.dz * lifted.diameter * lifted.scale
        if depth <= 0:
            raise ScriptError(f"handle: a depth of {handle.dz:g} is behind the camera")
        target = lifted.object_points(camera.unproject(np.array(handle.to), depth))
        document = edits.add_handle(document, k, point.rest, target)
    return document


def _check_within(size: tuple[int, int], xy: tuple[float, float], option: str) -> None:
    width, height = size
    if not (0 <= xy[0] < width and 0 <= xy[1] < height):
        raise ScriptError(
            f"{option} {xy[0]:g},{xy[1]:g} is outside the photo of {width} x {height} px"
        )


def ordered(document: Document, others: Others) -> Document:
    """The document with layers in the script's `order`; what stays in front is before them all.

    Unless the order names it, too.
    """
    order = [number - 1 for number in others.order]
    if len(order) > 1:
        camera = document.photo.camera

        def posed_of(k: int) -> Any:
            item = document.objects[k]
            return puppet_of(item, camera).posed(item.pose, item.placement)

        document = reordered(document, order[0], order, posed_of)
    top = max(item.layer for item in document.objects)
    objects = tuple(
        replace(item, layer=top) if item.stays_in_front and k not in order else item
        for k, item in enumerate(document.objects)
    )
    return replace(document, objects=objects)


# What a script's objects leave behind: the plate of all, and their old shadows.

USUAL_HINT = 0.03  # x the photo's diagonal, radius of a hint that says none


@dataclass(frozen=True, eq=False)
class LeftBehind:
    """A document with its plate, and what of the photo was taken along or off the ground."""

    document: Document
    notes: tuple[str, ...]  # a sentence for each


def with_plate(
    document: Document,
    script: EditScript,
    casting: frozenset[int],
    progress: Progress,
    ahead: PlateAhead | None = None,
) -> LeftBehind:
    """The document with what is behind all its objects, filled in as the script's hints say.

    Those of the numbers in `casting` take their own shadow along. `ahead` may have begun it.

    An object that has left its place takes its shadow off the ground, where that is sure. It, and
    every copy of it that is elsewhere, throws one like it.
    """
    document = edits.set_hints(document, _hints(script, document.photo.size))
    task = plate_task(document, script, casting)
    found = task.run(progress) if ahead is None else ahead.answer(task, progress)
    notes: list[str] = []
    for caster, old in zip(task.casters, found.shadows, strict=True):
        if old is None:
            continue
        alike = [k for k in casting if document.objects[k].matte is caster.matte]
        for k in alike:
            if document.objects[k].is_visible:
                document = edits.set_shadow(document, k, old.shadow)
        notes.append(_note(document.objects[alike[0]], caster.has_gone))
    return LeftBehind(edits.set_plate(document, found.plate), tuple(notes))


def plate_task(document: Document, script: EditScript, casting: frozenset[int]) -> PlateTask:
    """What there is to be done for the plate of a document; see `with_plate`."""
    casters = []
    for matte in _distinct(document, casting):
        alike = [o for o in document.objects if o.matte is matte]
        has_gone = all(has_left(o, document) for o in alike)
        said = (o.seen_from for o in alike if o.seen_from is not None)
        casters.append(ShadowCaster(matte, has_gone, next(said, None)))
    covered = plate_cover(document)
    return PlateTask(
        continued(document.photo.picture, covered), covered, tuple(casters), document.hints,
        script.inpaint, script.seed,
    )  # fmt: skip


def begun_plate(
    document: Document, k: int, matte: Matte, script: EditScript
) -> PlateAhead | None:  # fmt: skip
    """The plate of a document whose object `k` has just been cut out, and is still to be lifted.

    None where that would need much memory beside the lift.
    """
    if script.lift not in LIGHT_LIFTERS:
        return None
    try:
        is_light = compose.load(script.inpaint, bool(script.fill_from)).name in LIGHT
    except ValueError:  # which is said when the plate's turn comes
        return None
    if not is_light:
        return None
    matte = with_opacity(matte, document.photo.picture, document.objects[k].mask)
    item = replace(document.objects[k], matte=matte, is_visible=not script.remove)
    item = replace(item, placement=_placement(script), seen_from=script.seen_from)
    document = edits.set_hints(document, _hints(script, document.photo.size))
    document = document.with_object(k, item)
    casts = script.shadow == "auto" and has_left(item, document)
    return PlateAhead(plate_task(document, script, frozenset({k} if casts else ())))


def leaves_a_hole(script: EditScript) -> bool:
    """Whether an edit shows the background behind its object, as far as the script says."""
    changed = said_by(script).keys() & ({"handle", "key", "spin", "remove"} | options_of(FINISH))
    return bool(changed) or not _placement(script).is_identity


def _note(item: EditObject, has_gone: bool) -> str:
    """What becomes of an object's shadow in the photo, and how to refuse."""
    goes = "goes along with it" if item.is_visible else "is removed with it"
    goes = goes if has_gone else "is thrown by its copies, too"
    refuse = "shadow none leaves the ground as it is in the photo"
    return f"the shadow found beside {item.name} {goes}; {refuse}"


def has_left(item: EditObject, document: Document) -> bool:
    """Whether it is not where its shadow in the photo is.

    Turned, spun and bent it still stands there: its true shadow is then nearer to the one in the
    photo than to any that can be made.
    """
    return not (item.is_visible and is_in_place(item, document))


def _hints(script: EditScript, size: tuple[int, int]) -> tuple[Hint, ...]:
    """From where the script has the background filled in, of a photo of `size` (w, h) px.

    Raises ScriptError for a place outside it.
    """
    for fill in script.fill_from:
        for xy in (fill.source, fill.to):
            _check_within(size, xy, "fill-from")
    usual = USUAL_HINT * float(np.hypot(*size))
    return tuple(
        Hint(fill.source, fill.to, usual if fill.radius is None else fill.radius)
        for fill in script.fill_from
    )


def _distinct(document: Document, casting: frozenset[int]) -> list[Matte]:
    """Their mattes, each once: copies share theirs."""
    found: dict[int, Matte] = {}
    for k in sorted(casting):
        if (matte := document.objects[k].matte) is not None:
            found.setdefault(id(matte), matte)
    return list(found.values())


# An edit refined by a network: the composite made, what is to be seen of it cut out, handed over.


@dataclass(frozen=True)
class RefineOptions:
    """The options of a refinement."""

    backend: str
    seed: int = 0
    strength: float = 1.0  # in [0, 1]


def coarse_edit(
    document: Document, progress: Progress = silent, puppets: dict[int, Puppet] | None = None
) -> CoarseEdit:
    """Return the part of the edit for a refiner. Raises RefineError where nothing was edited."""
    bare = replace(document, refined=None)
    result = composite(bare, puppets, progress, keeps_weights=True)
    return refinement.cut_edit(document.photo.picture, result)


def with_refinement(
    document: Document, how: RefineOptions, progress: Progress, puppets: dict[int, Puppet]
) -> Document:
    """`document` refined. Raises RefineError or ModelError."""
    refiner = refine.load(how.backend)
    edit = coarse_edit(document, part(progress, 0.0, 0.05), puppets)
    rest = part(progress, 0.05, 1.0)
    made = refinement.refine(edit, refiner, rest, how.seed, how.strength)
    return edits.set_refined(document, made)
