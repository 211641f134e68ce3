"""An object from a file instead of a lifted one: read, registered to the photo, textured."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ...base.arrays import F64, Mask, Pixels, Selection
from ...base.camera import Camera
from ...base.progress import Progress, part, silent
from ...document.gaussians import Gaussians
from ...document.model import LiftedObject, Matte
from ...segment.mask_edit import is_selected
from ...segment.matting.matte import cut_out
from ...splat_files import COUNT, read_object
from .imported import lift_imported
from .placement import Hints, Proposal, Registrar, Registration, register
from .view import Target

UP = (0.0, -1.0, 0.0)  # of the object frame: y is down


@dataclass(frozen=True, eq=False)
class ImportTarget:
    """The target of an import: a photo, and the mask that the object stands for."""

    pixels: Pixels  # (H, W, 3)
    camera: Camera
    mask: Selection  # (H, W) bool, or soft u8
    is_focal_free: bool = False  # whether the camera's focal length is only a guess
    mixed: Mask | None = None  # (H, W) where the edge brush has found the mask's softness

    @property
    def target(self) -> Target:
        return Target(self.pixels, is_selected(self.mask), self.camera)


@dataclass(frozen=True, eq=False)
class Import:
    """A file's Gaussians, and the poses in which they look like the photo."""

    gaussians: Gaussians
    registration: Registration


@dataclass(frozen=True)
class Source:
    """An object's file, and how it is read."""

    path: Path
    count: int = COUNT  # Gaussians of a mesh
    is_flipped: bool = False  # stands on its head in the file


def register_file(
    source: Source, scene: ImportTarget, progress: Progress = silent, seed: int = 0
) -> Import:
    """Reads an object and finds out where it stands in the photo.

    Raises SplatFileError, LiftError.
    """
    progress(0.0, "Reading the object")
    gaussians = read_object(source.path, source.count, source.is_flipped)
    hints = Hints(is_focal_free=scene.is_focal_free, up=UP)
    found = register(gaussians, scene.target, hints, part(progress, 0.1, 1.0), seed)
    return Import(gaussians, found)


def fit_near(
    scene: ImportTarget,
    gaussians: Gaussians,
    start: F64,
    progress: Progress = silent,
    seed: int = 0,
) -> Import:
    """The best pose near `start` (4, 4 world from object); that one where none is better."""
    progress(0.0, "Fitting the object")
    registrar = Registrar(gaussians, scene.target, seed)
    best = registrar.improved(registrar.rated(start), scene.is_focal_free)
    return Import(gaussians, Registration((best,), False, ""))


def place_import(
    scene: ImportTarget,
    gaussians: Gaussians,
    proposal: Proposal,
    progress: Progress = silent,
    seed: int = 0,
) -> tuple[Matte, LiftedObject]:
    """The object in a proposed pose, with the photo on what the photo shows of it.

    The document's camera must become `proposal.camera`. Raises LiftError.
    """
    progress(0.0, "Cutting out the object")
    matte = cut_out(scene.pixels, scene.mask, scene.mixed)
    rest = part(progress, 0.4, 1.0)
    return matte, lift_imported(gaussians, proposal, matte, progress=rest, seed=seed)
