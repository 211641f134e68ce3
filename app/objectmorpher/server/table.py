"""The fixed table of the served job functions, and of the types that they take and give.

A name on the wire is looked up here and nowhere else. The arguments' shapes are compared before
a function sees them: compiled kernels trust that a mask is as large as its photo.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from objectmorpher_core.base.arrays import Mask, Pixels
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.limits import ASKED_GAUSSIANS as MOST_GAUSSIANS
from objectmorpher_core.document import model as documents
from objectmorpher_core.document.gaussians import Gaussians
from objectmorpher_core.document.model import LiftedObject, LiftSettings, Matte, Plate, Prompt
from objectmorpher_core.document.settings import Hint, Refined, Shadow
from objectmorpher_core.document.sides import FurtherView, Sides
from objectmorpher_core.scripting.runner import RefineOptions

from ..editor.settings import AUTO
from ..worker import job_functions
from ..worker.job_functions import BackendChoice, Cut, Cutout, Variant
from .fitting import fits, is_photo, is_sound
from .message import MessageError, name_of

MOST_VARIANTS = 12


@dataclass(frozen=True)
class Served:
    """A job function that may run on a server."""

    function: Callable[..., Any]
    stage: str  # of STAGES
    takes: tuple[Any, ...]  # types of its arguments
    gives: Any  # type of its answer
    check: Callable[..., None] = lambda *arguments: None  # raises MessageError

    def at_hand(self, arguments: tuple[Any, ...], blobs: Mapping[str, bytes]) -> str:
        """What a process answers sooner that has it from before, of arguments that were checked.

        For a click that is the photo, which it has read; else the backend, which it has loaded.
        """
        if self.stage == "segment":
            return name_of(arguments[0], blobs)
        chosen = [a.backend for a in arguments if isinstance(a, BackendChoice | RefineOptions)]
        named = [a for a in arguments if isinstance(a, str)]  # where nothing but the name is chosen
        return next(iter((*chosen, *named)), AUTO)

    def checked(self, arguments: Any) -> tuple[Any, ...]:
        """The arguments, if they are what the function takes; raises MessageError."""
        if not isinstance(arguments, tuple) or len(arguments) != len(self.takes):
            raise MessageError(f"{self.function.__name__} takes {len(self.takes)} arguments")
        for k, (value, wanted) in enumerate(zip(arguments, self.takes, strict=True)):
            if not fits(value, wanted):
                raise MessageError(f"argument {k + 1} is of another type")
        self.check(*arguments)
        return arguments


Table = Mapping[str, Served]


@cache
def table() -> Table:
    """Name -> job function."""
    from objectmorpher_core.compose.plate.repair import PlatePatch
    from objectmorpher_core.compose.refine.refinement import CoarseEdit
    from objectmorpher_core.segment import Found

    asking = (Pixels, Prompt | documents.BesidePrompt, BackendChoice)
    rows = (
        Served(job_functions.read_photo, "segment", (Pixels, str), None, _check_photo),
        Served(job_functions.segment, "segment", asking, Found, _check_asking),
        Served(job_functions.closer_look, "segment", asking, Found, _check_asking),
        Served(job_functions.candidate, "segment", asking, Found | str, _check_asking),
        Served(
            job_functions.lift, "lift", (Cut, BackendChoice, LiftSettings),
            tuple[Matte, LiftedObject], _check_lift,
        ),
        Served(job_functions.inpaint, "inpaint", (Pixels, Mask, BackendChoice), Plate, _check_fill),
        Served(
            job_functions.fill_variants, "inpaint", (Pixels, Mask, BackendChoice, int),
            tuple[Variant, ...], _check_variants,
        ),
        Served(
            job_functions.repair, "inpaint", (PlatePatch, float, BackendChoice),
            tuple[PlatePatch, str], _check_repair,
        ),
        Served(
            job_functions.take_shadow, "inpaint", (Cutout, BackendChoice),
            tuple[Shadow | None, Plate] | None, _check_shadow,
        ),
        Served(job_functions.refine, "refine", (CoarseEdit, RefineOptions), Refined, _check_refine),
    )  # fmt: skip
    return {row.function.__name__: row for row in rows}


@cache
def types() -> Mapping[str, type]:
    """Name -> dataclass that a message may hold."""
    from objectmorpher_core.compose.plate.repair import PlatePatch
    from objectmorpher_core.compose.refine.refinement import CoarseEdit
    from objectmorpher_core.segment import Found

    kinds = (
        documents.BesidePrompt, Camera, BackendChoice, documents.Click, CoarseEdit, Cut, Cutout,
        Found, Gaussians, Hint, LiftedObject, LiftSettings, Matte, PlatePatch,
        documents.PhotoTexture, Plate, Prompt, Refined, RefineOptions, Shadow, Sides,
        Variant, FurtherView,
    )  # fmt: skip
    return {kind.__name__: kind for kind in kinds}


def _require(is_right: bool, sentence: str) -> None:
    if not is_right:
        raise MessageError(sentence)


def _check_photo(pixels: Any, *_: Any) -> None:
    _require(is_photo(pixels), f"a photo is of the shape {pixels.shape}")


def _check_asking(pixels: Any, prompt: Any, *_: Any) -> None:
    _check_photo(pixels)
    if isinstance(prompt, documents.BesidePrompt) and prompt.taken is not None:
        _check_mask(prompt.taken, pixels, "mask of other objects")


def _check_mask(mask: Any, pixels: Any, what: str) -> None:
    _require(
        mask.shape == pixels.shape[:2] and mask.dtype.name in ("bool", "uint8"),
        f"the {what} is {mask.shape} of {mask.dtype}, the photo {pixels.shape[:2]}",
    )


def _check_lift(cut: Cut, choice: BackendChoice, shape: LiftSettings) -> None:
    _check_photo(cut.pixels)
    _check_mask(cut.mask, cut.pixels, "mask")
    if cut.mixed is not None:
        _check_mask(cut.mixed, cut.pixels, "mask of the edge brush")
    height, width = cut.mask.shape
    _require((cut.camera.width, cut.camera.height) == (width, height), "the camera is another's")
    _require(0 < shape.count <= MOST_GAUSSIANS, f"{shape.count} Gaussians are asked for")
    if shape.hidden is not None:
        _check_mask(shape.hidden, cut.pixels, "mask of what is hidden")
    if shape.nearness is not None:
        _require(shape.nearness.ndim == 2 and shape.nearness.size > 0, "nearness is no map")


def _check_fill(pixels: Any, covered: Any, *_: Any) -> None:
    _check_photo(pixels)
    _check_mask(covered, pixels, "mask")


def _check_variants(pixels: Any, covered: Any, choice: BackendChoice, count: int) -> None:
    _check_fill(pixels, covered)
    _require(0 < count <= MOST_VARIANTS, f"{count} backgrounds are asked for")


def _check_repair(patch: Any, margin: float, choice: BackendChoice) -> None:
    _check_photo(patch.pixels)
    shape = patch.coverage.shape
    _require(shape == patch.pixels.shape[:2], "what is painted is of another size than its pixels")


def _check_shadow(cutout: Cutout, choice: BackendChoice) -> None:
    _check_fill(cutout.pixels, cutout.covered)
    is_right = is_sound(cutout.matte, ())
    _require(is_right, "a cut-out's alpha and colours are of different sizes")


def _check_refine(edit: Any, how: RefineOptions) -> None:
    _check_photo(edit.pixels)
    shape = edit.pixels.shape
    is_right = edit.coarse.shape == shape and edit.alpha.shape == shape[:2]
    _require(is_right, "an edit's photo, picture and alpha are of different sizes")
    _require(edit.alpha.min() >= 0 and edit.alpha.max() <= 1, "an edit's alpha is no share")
    _require(0 <= how.strength <= 1, f"a strength of {how.strength} is asked for")
