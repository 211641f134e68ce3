"""A pair of pictures becomes a triplet (paper 3.3): B, the coarse edit of A, and A, the truth.

The object is lifted out of B, put where A shows it, and drawn with B's texture over A without its
own: what an edit looks like before it is composed, with the photo that it should become.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from objectmorpher_core import compose, lift, segment
from objectmorpher_core.base.arrays import F32, F64, RGB, U8, Mask, unit_pixels
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.masks import dilated
from objectmorpher_core.base.progress import Progress, part, silent
from objectmorpher_core.compose import InpaintError
from objectmorpher_core.compose.light.lighting import object_texture
from objectmorpher_core.compose.plate.plate import plate_crop
from objectmorpher_core.document.model import GAUSSIANS, LiftSettings, Matte, Prompt
from objectmorpher_core.lift import LiftError, LiftSubject
from objectmorpher_core.lift.registration.placement import Hints, Proposal, Registrar, register
from objectmorpher_core.lift.registration.view import Target
from objectmorpher_core.pictures.image import ImageError, at_most, read_mask, to_u8
from objectmorpher_core.pipeline import cut_front, lift_mask, make_plate, read_photo
from objectmorpher_core.raster import tiles
from objectmorpher_core.raster.posed import PosedSplats, RestSplats
from objectmorpher_core.raster.reference import Picture3D
from objectmorpher_core.segment import SelectionError

from . import TrainingError, pose_sources
from .pictures import PictureSource
from .pose_sources import Two, carried, matched
from .sources import SourcePair

VERSION = 1  # of what is written of a triplet
COVER = 0.006  # x the picture's diagonal: the background is invented this far around A's object


class Rejected(ValueError):
    """The pair makes no triplet: one sentence. `facts`: what was found out until then."""

    def __init__(self, sentence: str, facts: dict[str, Any] | None = None) -> None:
        super().__init__(sentence)
        self.facts = facts or {}


@dataclass(frozen=True)
class TripletLimits:
    """The requirements on a triplet."""

    least_area: float = 0.01  # x the picture, of the object in each
    most_area: float = 0.7
    least_iou: float = 0.75  # of A's mask and of what is drawn
    most_colour_error: float = 0.25  # RMS sRGB, where they overlap, light taken out
    least_seen: float = 0.3  # share of what is drawn that B shows: the rest is a guess

    def facts(self) -> dict[str, float]:
        """Plain values."""
        return dict(vars(self))


@dataclass(frozen=True)
class TripletPlan:
    """The making of triplets."""

    segmenter: str = "auto"
    lifter: str = "auto"
    inpainter: str = "auto"
    poses: str = "own"
    gaussians: int = GAUSSIANS
    longest: int = 1024  # px, longer side of the pictures that are written
    seed: int = 0
    limits: TripletLimits = TripletLimits()

    def check(self) -> None:
        """Raises TrainingError, or the stage's own one-sentence error, where one cannot run."""
        pose_sources.load(self.poses)
        for load, name in (
            (lift.load, self.lifter), (compose.load, self.inpainter), (segment.load, self.segmenter)
        ):  # fmt: skip
            if (sentence := load(name).missing()) is not None:
                raise TrainingError(sentence)


def how_from(told: dict[str, Any]) -> TripletPlan:
    """Build one from `asdict(how)`."""
    values: dict[str, Any] = {**told, "limits": TripletLimits(**told["limits"])}
    return TripletPlan(**values)


@dataclass(frozen=True, eq=False)
class Triplet:
    """A triplet to train on."""

    b: RGB  # (H', W', 3)
    coarse: RGB  # (H, W, 3)
    a: RGB  # (H, W, 3)
    alpha: U8  # (H, W) 255 where the object is drawn
    facts: dict[str, Any]


def make_triplet(pair: SourcePair, how: TripletPlan, progress: Progress = silent) -> Triplet:
    """Make a triplet; the same pair gives the same one. Raises Rejected."""
    start, facts = time.perf_counter(), {"item": pair.item, "limits": how.limits.facts()}
    if pair.problem:
        raise Rejected(pair.problem, facts)
    try:
        return _made(pair, how, facts, start, progress)
    except (TrainingError, SelectionError, LiftError, InpaintError, ImageError) as error:
        raise Rejected(str(error), facts) from error
    except Rejected as error:
        raise Rejected(str(error), facts | {"seconds": _since(start)}) from error


def _made(
    pair: SourcePair, how: TripletPlan, facts: dict[str, Any], start: float, progress: Progress
) -> Triplet:
    progress(0.0, "Selecting the object")
    b, a = (_side(pair, letter, how) for letter in "ba")
    facts["area"] = {"b": float(b.mask.mean()), "a": float(a.mask.mean())}
    _check_area(facts["area"], how.limits)
    settings = LiftSettings(how.gaussians)
    matte, lifted = lift_mask(
        b.pixels, b.camera, b.mask, how.lifter, settings, part(progress, 0.1, 0.3), how.seed
    )
    if how.poses != "own":  # others look at A's cut-out
        a = replace(a, matte=cut_front(a.pixels, a.mask))
    two = Two(replace(b, matte=matte), a, lifted)
    proposals, ambiguity = registered(two, how, part(progress, 0.3, 0.8))
    found, proposal, motion, drawn = max(
        (_drawn(two, proposal) for proposal in proposals), key=lambda one: one[0]
    )
    facts |= {
        "a_from_b": motion.tolist(), "iou": found, "colour_error": proposal.colour_error,
        "registered_iou": proposal.iou, "ambiguous": ambiguity, "seen": _seen(drawn),
        "turn": _degrees(motion), "camera_a": vars(proposal.camera), "camera_b": vars(b.camera),
        "backends": {"lift": lifted.backend, "poses": how.poses},
    }  # fmt: skip
    _check(facts, how.limits)
    progress(0.8, "Filling in the background")
    plate = make_plate(
        a.pixels, _covered(a.mask), how.inpainter, part(progress, 0.8, 1.0), how.seed
    )
    facts["backends"]["inpaint"] = plate.backend
    height, width = a.mask.shape
    behind = unit_pixels(plate_crop(a.pixels, plate, (0, 0, width, height)))
    alpha = np.clip(drawn.alpha, 0, 1)
    coarse = np.clip(drawn.color + (1 - alpha[..., None]) * behind, 0, 1)
    facts["seconds"] = _since(start)
    return Triplet(
        to_u8(b.pixels), np.rint(255 * coarse).astype(np.uint8), to_u8(a.pixels),
        np.rint(255 * alpha).astype(np.uint8), facts,
    )  # fmt: skip


def _side(pair: SourcePair, letter: str, how: TripletPlan) -> LiftSubject:
    """One of the two, with its object's mask; a matte that says nothing yet."""
    picture: PictureSource = getattr(pair, letter)
    own: str = getattr(pair, f"mask_{letter}")
    whole = picture.read()
    pixels = np.ascontiguousarray(at_most(whole, how.longest))
    height, width = pixels.shape[:2]
    mask = _mask_in(own, whole, how.longest) if own else _subject(pixels, how)
    nothing = Matte(0, 0, np.zeros((1, 1), np.float32), np.zeros((1, 1, 3), np.float32))
    return LiftSubject(pixels, Camera.from_fov(width, height), mask, nothing)


def _mask_in(path: str, whole: RGB, longest: int) -> Mask:
    """The mask in a file, which has the size of the picture before it is made smaller."""
    height, width = whole.shape[:2]
    try:
        mask = read_mask(Path(path).read_bytes(), (width, height))
        return at_most(mask.astype(np.uint8) * 255, longest) > 127
    except OSError as error:
        raise TrainingError(f"{path} cannot be read: {error.strerror or error}") from error


def _subject(pixels: RGB, how: TripletPlan) -> Mask:
    found = read_photo(pixels, _segmenter(how.segmenter))
    return found.segment(Prompt(is_subject=True), seed=how.seed).mask


@cache
def _segmenter(name: str) -> segment.Segmenter:
    return segment.load(name)


def registered(
    two: Two, how: TripletPlan, progress: Progress = silent
) -> tuple[tuple[Proposal, ...], str]:
    """Return where the object may stand in A, and whether it looks the same there in another pose.

    A pose that is known comes as it is, and as the registration would have it. Raises LiftError.
    """
    source, lifted = pose_sources.load(how.poses), two.lifted
    motion = source.motion(two, part(progress, 0.0, 0.5), how.seed)
    target = Target(two.a.pixels, two.a.mask, two.a.camera)
    rest = part(progress, 0.5, 1.0)
    matches = matched(two, drawn_in(two, np.eye(4), two.b.camera).depth)
    if motion is None:
        hints = Hints(start=carried(two) @ lifted.world_from_object, matches=matches)
        found = register(lifted.body, target, hints, rest, how.seed)
        return (found.best,), found.reason
    rest(0.0, "Fitting the object")
    registrar = Registrar(lifted.body, target, how.seed, matches)
    known = registrar.rated(motion @ lifted.world_from_object)
    return (known, registrar.improved(known)), ""


def _drawn(two: Two, proposal: Proposal) -> tuple[float, Proposal, F64, Picture3D]:
    """How far a proposal agrees with A's mask at A's own size, it, its motion and its picture."""
    motion = proposal.world_from_object @ np.linalg.inv(two.lifted.world_from_object)
    drawn = drawn_in(two, motion, proposal.camera)
    return _agreement(drawn, two.a.mask), proposal, motion, drawn


def drawn_in(two: Two, motion: F64, camera: Camera) -> Picture3D:
    """The object out of B, moved from B's world to A's (4, 4), as A's `camera` sees it."""
    rest = RestSplats(two.lifted, two.b.camera)
    splats = PosedSplats(rest, None, motion)
    return tiles.render(splats, object_texture(two.b.matte, two.lifted), camera, two.b.camera)


def _check_area(area: dict[str, float], limits: TripletLimits) -> None:
    for letter, share in area.items():
        if not limits.least_area <= share <= limits.most_area:
            raise Rejected(
                f"the object covers {share:.1%} of picture {letter.upper()}, not"
                f" {limits.least_area:.0%} to {limits.most_area:.0%}"
            )


def _check(facts: dict[str, Any], limits: TripletLimits) -> None:
    if facts["iou"] < limits.least_iou:
        raise Rejected(
            f"registered, the outlines agree by {facts['iou']:.0%}, not {limits.least_iou:.0%}"
        )
    if facts["colour_error"] > limits.most_colour_error:
        raise Rejected(
            f"registered, the colours are off by {facts['colour_error']:.2f}, above"
            f" {limits.most_colour_error:.2f}"
        )
    if facts["seen"] < limits.least_seen:
        raise Rejected(
            f"B shows only {facts['seen']:.0%} of what is seen in A, not {limits.least_seen:.0%}"
        )


def _agreement(drawn: Picture3D, mask: Mask) -> float:
    """IoU of what is drawn with the mask (h, w)."""
    own = drawn.alpha > 0.5
    return float((own & mask).sum() / max(int((own | mask).sum()), 1))


def _seen(drawn: Picture3D) -> float:
    alpha: F32 = np.clip(drawn.alpha, 0, 1)
    return float(drawn.from_photo.sum() / max(float(alpha.sum()), 1e-9))


def _degrees(motion: F64) -> float:
    """By which the object is turned."""
    linear = motion[:3, :3] / np.cbrt(np.linalg.det(motion[:3, :3]))
    return float(np.degrees(np.arccos(np.clip((np.trace(linear) - 1) / 2, -1, 1))))


def _covered(mask: Mask) -> Mask:
    """A's mask with the soft edge around it."""
    radius = max(1, round(COVER * float(np.hypot(*mask.shape))))
    return dilated(mask, radius)


def _since(start: float) -> float:
    return round(time.perf_counter() - start, 6)
