"""Every change of the document, as a pure function Document -> Document."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from ..base.arrays import F32, Mask, Selection, frozen
from ..base.camera import Camera
from .edge_edits import decontaminated
from .model import (
    SELECTED,
    BesidePrompt,
    DeformSettings,
    Document,
    EditObject,
    Handle,
    LiftedObject,
    LiftSettings,
    Matte,
    Placement,
    Plate,
    Pose,
    Prompt,
)
from .pose import Base
from .rig import Rig, Seam
from .settings import (
    LEAST_FEATHER,
    MOST_FEATHER,
    USUAL_SHARES,
    Finish,
    Hint,
    Refined,
    Shadow,
    Share,
)
from .transparency import with_opacity, within

SAME_THING = 0.15  # IoU of two masks, below which they are of two things
COPY = re.compile(r" copy( \d+)?$")  # at the end of a copy's name
SAME_PLACE = 1e-6  # object units: two targets closer than this are one


class EditError(ValueError):
    """The change makes no sense; one sentence."""


def add_object(document: Document) -> Document:
    """A new, empty object at the end of the list."""
    count = len(document.objects)
    return document.with_object(count, EditObject(f"Object {count + 1}"))


def remove_object(document: Document, k: int) -> Document:
    """Without object `k`. The plate, which filled its hole, goes too, unless a copy stays."""
    gone, objects = document.objects[k], (*document.objects[:k], *document.objects[k + 1 :])
    is_copy = gone.mask is not None and any(other.mask is gone.mask for other in objects)
    plate = document.plate if is_copy or not gone.hides_background else None
    refined = document.refined if gone.matte is None else None
    return replace(document, objects=objects, plate=plate, refined=refined)


def set_mask(document: Document, k: int, mask: Selection | None, prompt: Prompt) -> Document:
    """The mask (H, W) of object `k`, bool or soft u8, and what the user said to get it.

    A lifted object whose mask is only refined keeps all that was done to it; its shape is to be
    refitted. Another mask is a new selection, see `is_refinement`.
    """
    return _with_mask(document, k, mask, prompt)


def change_mask(document: Document, k: int, mask: Selection) -> Document:
    """The mask (H, W) of object `k`, bool or soft u8, changed by hand; see `set_mask`.

    What it was is kept beside it for `answer_prompt`, and for `set_plate`: what was taken away.
    """
    item = document.objects[k]
    found = item.mask if item.found is None else item.found
    return _with_mask(document, k, mask, item.prompt, found)


def beside(document: Document, k: int, prompt: Prompt) -> Prompt:
    """Return the prompt for object `k`: what the others cover is background.

    Another object that a positive click is on is not: what is clicked is meant.
    """
    width, height = document.photo.size
    wanted = [
        (int(c.y), int(c.x))
        for c in prompt.clicks
        if c.is_foreground and 0 <= c.x < width and 0 <= c.y < height  # others are refused later
    ]
    masks = [o.mask for j, o in enumerate(document.objects) if j != k and o.mask is not None]
    masks = [mask for mask in masks if not any(mask[place] for place in wanted)]
    if not masks:
        return prompt
    taken = masks[0] if len(masks) == 1 else np.logical_or.reduce(masks)
    return BesidePrompt(prompt.clicks, prompt.box, prompt.is_subject, prompt.level, frozen(taken))


def answer_prompt(document: Document, k: int, found: Mask, prompt: Prompt) -> Document:
    """The mask (H, W) that was `found` for the prompt of object `k`; see `set_mask`.

    What was changed by hand since the last answer stays as it is, except where a new click says
    the contrary: the latest word counts.
    """
    from ..segment.mask_edit import corrected

    item = document.objects[k]
    if item.found is None or item.mask is None:
        return set_mask(document, k, found, prompt)
    mask, without = corrected(item, found, prompt)
    return _with_mask(document, k, mask, prompt, without)


def is_refinement(item: EditObject, selection: Selection | None) -> bool:
    """Whether a selection (H, W) is of the thing that was lifted, or of another one."""
    if item.lifted is None or item.mask is None or selection is None:
        return False
    if selection.shape != item.mask.shape:
        return False
    mask = selection if selection.dtype == np.bool_ else selection >= SELECTED
    shared = np.count_nonzero(mask & item.mask)
    return shared > SAME_THING * (mask.sum() + item.mask.sum() - shared)


def _with_mask(
    document: Document, k: int, mask: Selection | None, prompt: Prompt, found: Mask | None = None
) -> Document:
    item, mask = document.objects[k], within(mask, document.photo.picture)
    is_refined = is_refinement(item, mask)
    if mask is None or not is_refined:
        changed = item.with_mask(mask, prompt, found)
    else:
        changed = item.with_refined_mask(mask, prompt, found)
    if changed.mask is not None:
        width, height = document.photo.size
        if changed.mask.shape != (height, width):
            raise EditError(f"the mask is {changed.mask.shape}, the photo is {(height, width)}")
        if not changed.mask.any():
            raise EditError("nothing is selected")
        if changed.mask.all():
            raise EditError("the object covers the whole photo, there is no background left")
    if not is_refined:
        return document.with_object(k, changed)
    # The plate and the refinement stay, too, until the shape is refitted; copies stay copies.
    outline = {name: getattr(changed, name) for name in ("mask", "coverage", "shaped", "mixed")}
    objects = (replace(o, **outline) if _is_copy(o, item) else o for o in document.objects)
    kept = tuple(changed if i == k else other for i, other in enumerate(objects))
    return replace(document, objects=kept)


def _is_copy(other: EditObject, item: EditObject) -> bool:
    return other.mask is item.mask and other.lifted is item.lifted


def refit(
    document: Document, k: int, matte: Matte, lifted: LiftedObject, plate: Plate | None
) -> Document:
    """Object `k` and its copies in the shape that was refitted to their refined mask.

    Handles, pose, rig and placement go over to it. `plate`: the background that goes with it.
    """
    from ..lift.refitting import refitted

    item, photo = document.objects[k], document.photo
    matte = with_opacity(matte, photo.picture, item.mask)
    fitted = (
        refitted(each, matte, lifted, photo.camera) if _is_copy(each, item) else each
        for each in document.objects
    )
    objects = tuple(decontaminated(photo, each) for each in fitted)
    return set_plate(replace(document, objects=objects), plate)


def set_lifted(
    document: Document, k: int, matte: Matte, lifted: LiftedObject,
    shape: LiftSettings | None = None,
) -> Document:  # fmt: skip
    """The 3D shape of object `k`, made as `shape` says; its handles and pose are gone."""
    matte = with_opacity(matte, document.photo.picture, document.objects[k].mask)
    item = decontaminated(document.photo, document.objects[k].with_lifted(matte, lifted, shape))
    return document.with_object(k, item).with_backend("lift", lifted.backend)


def reshape(
    document: Document, k: int, matte: Matte, lifted: LiftedObject, shape: LiftSettings
) -> Document:
    """Another 3D shape of object `k`, made as `shape` says; handles and rig go over, no pose."""
    from ..lift.refitting import carried_over

    matte = with_opacity(matte, document.photo.picture, document.objects[k].mask)
    item = carried_over(document.objects[k], matte, lifted, shape)
    changed = decontaminated(document.photo, item)
    return document.with_object(k, changed).with_backend("lift", lifted.backend)


def set_thickness(document: Document, k: int, thickness: float) -> Document:
    """Object `k` as thick as `thickness` times what its silhouette says; no pose."""
    from ..lift.relief.thickness import with_thickness

    item = document.objects[k]
    if item.lifted is None or item.matte is None:
        raise EditError("lift the object before changing its thickness")
    shape = replace(item.shape, thickness=thickness)
    factor = thickness / item.shape.thickness
    lifted = with_thickness(item.lifted, document.photo.camera, factor)
    return reshape(document, k, item.matte, lifted, shape)


def set_shape(document: Document, k: int, shape: LiftSettings) -> Document:
    """Set how object `k`, which is not lifted yet, is to be lifted."""
    return document.with_object(k, replace(document.objects[k], shape=shape))


def set_camera(document: Document, camera: Camera, k: int) -> Document:
    """The photo was taken by `camera`: its focal length became known from object `k`.

    Further photos are forgotten: where they were taken from was found with the old one.
    Raises EditError where other objects were lifted with another one.
    """
    if camera == document.photo.camera:
        return document
    if any(item.lifted is not None for i, item in enumerate(document.objects) if i != k):
        raise EditError("the camera cannot change under objects that are lifted already")
    objects = tuple(
        replace(item, shape=replace(item.shape, views=())) if item.shape.views else item
        for item in document.objects
    )
    return replace(document, photo=replace(document.photo, camera=camera), objects=objects)


def nearest_control_point(lifted: LiftedObject, point: np.ndarray) -> int:
    """Index of the control point nearest to a rest surface point (3,), object frame."""
    return int(((lifted.control_points - point) ** 2).sum(1).argmin())


def add_handle(
    document: Document,
    k: int,
    point: np.ndarray,
    target: np.ndarray | None = None,
    is_pin: bool = False,
) -> Document:
    """A handle on the rest surface `point` (3,) of object `k`; it stays until it is dragged.

    A pin is held as it is turned, too: about points of its front alone a body would roll.
    Raises EditError where another handle has the same control point and another displacement.
    """
    item = document.objects[k]
    if item.lifted is None:
        raise EditError("lift the object before adding points to it")
    target = np.asarray(point if target is None else target, dtype=np.float64)
    index = nearest_control_point(item.lifted, point)
    for other in item.handles:
        if other.control_point == index:
            moves = target - point, other.target - other.point
            if np.linalg.norm(moves[0] - moves[1]) > SAME_PLACE:
                raise EditError("two points take the same control point to different places")
            return document
    handle = Handle(index, np.asarray(point, dtype=np.float64), target).pinned(is_pin, item.pose)
    return document.with_object(k, replace(item, handles=(*item.handles, handle)))


def move_handle(document: Document, k: int, h: int, target: np.ndarray) -> Document:
    """Handle `h` of object `k` must be at `target` (3,), object frame."""
    handle = document.objects[k].handles[h]
    target = np.asarray(target, dtype=np.float64)
    return _with_handle(document, k, h, replace(handle, target=target))


def remove_handle(document: Document, k: int, h: int) -> Document:
    """Without handle `h` of object `k`."""
    item = document.objects[k]
    handles = tuple(other for i, other in enumerate(item.handles) if i != h)
    return document.with_object(k, replace(item, handles=handles))


def turn_handle(document: Document, k: int, h: int, turn: np.ndarray | None) -> Document:
    """Handle `h` of object `k` is turned by `turn` (3,), a rotation vector; None: as it comes."""
    return _with_handle(document, k, h, replace(document.objects[k].handles[h], turn=turn))


def set_pin(document: Document, k: int, h: int, is_pin: bool) -> Document:
    """Whether handle `h` of object `k` is there to hold, or to be dragged and to turn freely."""
    item = document.objects[k]
    return _with_handle(document, k, h, item.handles[h].pinned(is_pin, item.pose))


def soften_handle(document: Document, k: int, h: int, softness: float) -> Document:
    """Set how much handle `h` of object `k` gives way; 0 is not at all."""
    if not 0 <= softness < np.inf:
        raise EditError(f"a softness of {softness:g} is not 0 or more")
    handle = document.objects[k].handles[h]
    return _with_handle(document, k, h, replace(handle, softness=float(softness)))


def _with_handle(document: Document, k: int, h: int, handle: Handle) -> Document:
    item = document.objects[k]
    handles = tuple(handle if i == h else other for i, other in enumerate(item.handles))
    return document.with_object(k, replace(item, handles=handles))


def reset_pose(document: Document, k: int) -> Document:
    """Object `k` in the shape of the photo, without handles; what is frozen is so at rest."""
    item = document.objects[k]
    rig = item.rig if item.rig.shifts is None else replace(item.rig, shifts=None)
    return document.with_object(k, replace(item, handles=(), rig=rig, pose=None, base=Base()))


def forget_base(document: Document, k: int) -> Document:
    """Object `k` is moved from rest again; what stays by itself is as it was."""
    item = document.objects[k]
    return document.with_object(k, replace(item, base=item.base.at_rest))


def resample(document: Document, k: int, count: int) -> Document:
    """Object `k` with `count` control points. Handles and rig go to the new ones; no pose.

    Raises EditError for a count outside 4 to 4,096, and where two handles would have to share a
    control point.
    """
    from scipy.spatial import KDTree  # heavy, and the window imports this module at its start

    from ..deform.control_points import sample_control_points

    item = document.objects[k]
    if item.lifted is None:
        raise EditError("lift the object before choosing its control points")
    gaussians, old = item.lifted.body, item.lifted.control_points
    try:
        points = sample_control_points(gaussians.means, gaussians.opacities, count)
    except ValueError as error:
        raise EditError(str(error)) from error
    lifted = replace(item.lifted, control_points=points)
    handles = tuple(
        replace(h, control_point=nearest_control_point(lifted, h.point)) for h in item.handles
    )
    if len({h.control_point for h in handles}) < len(handles):
        raise EditError(f"{count} control points are too few to tell the handles apart")
    rig = item.rig.moved_to(np.asarray(KDTree(old).query(points)[1]))
    changed = replace(item, lifted=lifted, handles=handles, rig=rig, pose=None, base=Base())
    return document.with_object(k, replace(changed, keys=()))


def set_pose(document: Document, k: int, pose: Pose | None) -> Document:
    """Set the places of the control points of object `k`; None puts it back to rest."""
    return document.with_object(k, replace(document.objects[k], pose=pose))


def set_placement(document: Document, k: int, placement: Placement) -> Document:
    """Set the placement of object `k`. Raises EditError behind the camera or for scale <= 0."""
    item = document.objects[k]
    if not placement.scale > 0:
        raise EditError(f"a scale of {placement.scale:g} is not above 0")
    if item.lifted is not None:
        try:
            placement.matrix(item.lifted, document.photo.camera)
        except ValueError as error:
            raise EditError(str(error)) from error
    return document.with_object(k, replace(item, placement=placement))


def set_grounded(document: Document, k: int, is_grounded: bool) -> Document:
    """Whether moving object `k` slides it over the ground."""
    return document.with_object(k, replace(document.objects[k], is_grounded=is_grounded))


def set_deform(document: Document, k: int, settings: DeformSettings) -> Document:
    """Set how object `k` deforms; its pose, solved with the old settings, is dropped."""
    item = document.objects[k]
    return document.with_object(
        k, replace(item, deform=settings, pose=None, base=item.base.at_rest)
    )


def set_visible(document: Document, k: int, is_visible: bool) -> Document:
    """Hides object `k` (its background shows) or shows it."""
    return document.with_object(k, replace(document.objects[k], is_visible=is_visible))


def set_plate(document: Document, plate: Plate | None) -> Document:
    """The photo without its objects; what the artist took out of a selection stays in it."""
    changed = replace(document, plate=_with_refused(document, plate), refined=None)
    return changed if plate is None else changed.with_backend("inpaint", plate.backend)


def _with_refused(document: Document, plate: Plate | None) -> Plate | None:
    if plate is None or not any(o.found is not None or o.prompt.clicks for o in document.objects):
        return plate
    from ..compose.plate.plate import SEAM, hole_margin  # heavy
    from ..compose.plate.residue import with_refused

    return with_refused(plate, document, SEAM * hole_margin(*document.photo.size))


def set_hints(document: Document, hints: tuple[Hint, ...]) -> Document:
    """Set the sources from which the background is filled in next time."""
    return replace(document, hints=hints)


def set_horizon(document: Document, horizon: float) -> Document:
    """The horizon is in this row of the photo, px; it may be outside."""
    if not np.isfinite(horizon):
        raise EditError(f"a horizon at {horizon:g} px is no row of the photo")
    return replace(document, horizon=float(horizon), refined=None)


def set_depth(document: Document, depth: F32 | None) -> Document:
    """How near what the photo shows is, see `Document.depth`: shadows fall on it."""
    if depth is not None and (depth.ndim != 2 or not depth.size or not np.isfinite(depth).all()):
        raise EditError("a depth map is a number for each of its pixels")
    kept = None if depth is None else frozen(depth, np.float32)
    return replace(document, depth=kept, refined=None)


def rename(document: Document, k: int, name: str) -> Document:
    """Object `k` under another name."""
    name = name.strip()
    if not name:
        raise EditError("an object needs a name")
    return document.with_object(k, replace(document.objects[k], name=name))


def duplicate(document: Document, k: int) -> Document:
    """A copy of object `k` after all others, where it is, without key poses; the plate stays."""
    item = document.objects[k]
    if item.lifted is None:
        raise EditError("lift the object before making a copy of it")
    name, taken = f"{COPY.sub('', item.name)} copy", {o.name for o in document.objects}
    copy = replace(item, keys=(), name=free_name(name, taken) if name in taken else name)
    return replace(document, objects=(*document.objects, copy), refined=None)


def free_name(name: str, taken: set[str]) -> str:
    """ "Cat 2", or the next number that nobody has."""
    stem, _, last = name.rpartition(" ")
    stem = stem if stem and last.isdigit() else name
    numbers = (n for n in range(2, len(taken) + 3) if f"{stem} {n}" not in taken)
    return f"{stem} {next(numbers)}"


def set_shadow(document: Document, k: int, shadow: Shadow) -> Document:
    """The shadow that object `k` casts once it has moved. Raises EditError for nonsense."""
    return _with_settings(document, k, "shadow", shadow)


def set_share(document: Document, k: int, name: Share, share: float) -> Document:
    """Set how far, in [0, 1], object `k` fits into its new place in one respect.

    "harmony": it takes on the light there; "relight": the light stays in place while the object
    turns; "grain": it is given the grain that it lost; "defocus": it is as blurred as the photo
    is at its new depth.
    """
    if not 0 <= share <= 1:
        what = "relighting" if name == "relight" else name
        raise EditError(f"a {what} of {share:g} is not between 0 and 1")
    return document.with_object(k, replace(document.objects[k], **{name: float(share)}))


def set_finish(document: Document, k: int, finish: Finish) -> Document:
    """Set how object `k` looks otherwise than in the photo. Raises EditError for nonsense."""
    return _with_settings(document, k, "finish", finish)


def _with_settings(document: Document, k: int, name: str, settings: Shadow | Finish) -> Document:
    try:
        settings.check()
    except ValueError as error:
        raise EditError(str(error)) from error
    return document.with_object(k, replace(document.objects[k], **{name: settings}))


def harmonised(document: Document, k: int, is_harmonised: bool = True) -> Document:
    """Object `k` in the light, grain and focus of its new place, or as it was in the photo."""
    share = 1.0 if is_harmonised else 0.0
    for name, usual in USUAL_SHARES.items():
        document = set_share(document, k, name, share * usual)
    return document


def set_feather(document: Document, feather: float) -> Document:
    """Over how wide an edge the edit is blended into the photo, x the usual."""
    if not LEAST_FEATHER <= feather <= MOST_FEATHER:
        raise EditError(f"a blend of {feather:g} x is not {LEAST_FEATHER:g} to {MOST_FEATHER:g}")
    return replace(document, feather=float(feather), refined=None)


# Changes of what stays in front of the edited objects, as it stands in the photo.


def keep_in_front(document: Document, k: int, matte: Matte | None = None) -> Document:
    """Keep object `k` unedited in front of what is edited, by its `matte`, as it is in the photo.

    The matte may come later. Raises EditError where nothing is selected, or it was moved.
    """
    item = document.objects[k]
    if item.mask is None:
        raise EditError("nothing is selected that could stay in front")
    if item.is_moved:
        raise EditError("what was moved cannot stay where it is")
    if matte is None:
        matte = item.found_matte
    else:
        matte = with_opacity(matte, document.photo.picture, item.mask)
    kept = replace(item, matte=matte, contaminated=None, stays_in_front=True)
    return document.with_object(k, kept)


def stop_keeping_in_front(document: Document, k: int) -> Document:
    """Let object `k` be edited again instead of staying in front."""
    item = replace(document.objects[k], stays_in_front=False)
    return document.with_object(k, item if item.lifted else replace(item, matte=None))


# What is changed about the refinement of an edit, as pure functions Document -> Document.


def set_refined(document: Document, refined: Refined | None) -> Document:
    """The edit as a refiner made it look; None: as it was put together."""
    changed = replace(document, refined=refined)
    if refined is not None:
        return changed.with_backend("refine", refined.backend)
    others = tuple((stage, name) for stage, name in document.backends if stage != "refine")
    return replace(changed, backends=others)


def set_strength(document: Document, strength: float) -> Document:
    """Set how much of the refinement is shown, in [0, 1]."""
    if not 0 <= strength <= 1:
        raise EditError(f"a strength of {strength:g} is not between 0 and 1")
    if document.refined is None:
        raise EditError("the edit is not refined")
    return replace(document, refined=replace(document.refined, strength=float(strength)))


# Changes of how an object's regions move, as pure functions Document -> Document.


def set_rig(document: Document, k: int, rig: Rig) -> Document:
    """Set how the regions of object `k` move; its pose, solved with the old rig, is dropped."""
    item = document.objects[k]
    if item.lifted is None:
        raise EditError("lift the object before saying how its parts move")
    try:
        rig.check(len(item.lifted.control_points))
    except ValueError as error:
        raise EditError(str(error)) from error
    return document.with_object(k, replace(item, rig=rig, pose=None, base=item.base.at_rest))


def cut(document: Document, k: int, first: np.ndarray, second: np.ndarray) -> Document:
    """Control points `first` and `second` of object `k` do not move each other directly."""
    rig = document.objects[k].rig
    return set_rig(document, k, replace(rig, seams=(*rig.seams, Seam(first, second))))


def glue(document: Document, k: int, first: np.ndarray, second: np.ndarray) -> Document:
    """Control points `first` and `second` of object `k` hang together as neighbours do."""
    rig = document.objects[k].rig
    return set_rig(document, k, replace(rig, seams=(*rig.seams, Seam(first, second, True))))


def make_body(document: Document, k: int, nodes: np.ndarray) -> Document:
    """Control points of object `k` move as one rigid body. They leave the bodies they were in."""
    rig = document.objects[k].rig
    others = (np.setdiff1d(body, nodes) for body in rig.bodies)
    bodies = (*(body for body in others if len(body) > 1), np.unique(nodes))
    return set_rig(document, k, replace(rig, bodies=bodies))


def freeze(document: Document, k: int, nodes: np.ndarray) -> Document:
    """Control points `nodes` of object `k` stay where they are now, whatever is dragged."""
    item = document.objects[k]
    if item.lifted is None:
        raise EditError("lift the object before saying how its parts move")
    rig, rest = item.rig, item.lifted.control_points.astype(np.float64)
    places = rig.held_at(rest)
    places[nodes] = rest[nodes] if item.pose is None else item.pose.points[nodes]
    old = np.empty(0, np.int32) if rig.held is None else rig.held
    return set_rig(document, k, _with_held(rig, np.union1d(old, nodes), places - rest))


def thaw(document: Document, k: int, nodes: np.ndarray) -> Document:
    """Control points `nodes` of object `k` are frozen no more."""
    item = document.objects[k]
    if item.lifted is None or item.rig.held is None:
        return document
    left = np.setdiff1d(item.rig.held, nodes)
    rest = item.lifted.control_points.astype(np.float64)
    return set_rig(document, k, _with_held(item.rig, left, item.rig.held_at(rest) - rest))


def _with_held(rig: Rig, held: np.ndarray, shifts: np.ndarray) -> Rig:
    """The rig with these frozen control points; `shifts` (M, 3) of all from rest."""
    own = shifts[held]
    return replace(rig, held=held if len(held) else None, shifts=own if own.any() else None)
