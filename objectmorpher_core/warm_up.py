"""Compiles every kernel once, so that nobody's first click, drag or import waits for it.

`python -m objectmorpher_core.warm_up` runs the main job on a made picture of 96 x 96 pixels, and
then, small, whatever else compiles something. The kernels stay in numba's cache on the disk.

The first edit after an installation needs most of them, and has other things to do before it needs
the largest: `compile_beside` has those compiled meanwhile, by a process for each of `PARTS`.
"""

from __future__ import annotations

import atexit
import os
import sys
from dataclasses import replace
from subprocess import DEVNULL, Popen

import cv2
import numpy as np

from .base import installation, kernel_files
from .base.arrays import frozen
from .base.camera import Camera
from .base.progress import silent
from .base.threads import core_count
from .deform.puppet import Puppet, puppet_of
from .document.gaussians import Gaussians
from .document.model import Document, EditObject, LiftedObject, PhotoTexture, Placement
from .document.settings import DeformSettings
from .raster import tiles
from .raster.posed import PosedSplats, RestSplats
from .raster.rules import SPAN
from .raster.surface import draw_layers
from .raster.texture import build_levels

SIZE = 96  # px
NODES = 8  # unknowns of a made system
FEW_SURFELS, FEW_PIXELS = 30, 8  # with which every rotation is tried in a moment


def warm_up() -> Document:
    """The edited picture; a minute or two the first time after an installation, seconds later."""
    document = _edited()
    photo, thing = document.photo, document.objects[0]
    puppet = puppet_of(thing, photo.camera)
    _show_seldom(document, thing, puppet)
    _pose_seldom(thing, puppet)
    _register(document, thing)
    return document


def _edited() -> Document:
    """The main job."""
    from .pictures.image import Picture, encode_mask, encode_picture
    from .pipeline import run_script
    from .scripting.options import EditScript, HandleMove
    from .segment.matting.closed_form import affine, applied
    from .segment.matting.halving import halved_pixels
    from .segment.pieces.pieces import Pieces

    rgb, alpha = np.zeros((4, 4, 3), np.float32), np.zeros((4, 4), np.float32)
    applied(affine(rgb, alpha), rgb, alpha == 0, alpha)  # of large photos only
    halved_pixels(rgb.astype(np.uint16))
    Pieces(np.zeros((SIZE, SIZE, 3), np.uint8), np.ones((2, 2, 4), np.float32)).rehearse()

    rng = np.random.default_rng(0)
    pixels = cv2.GaussianBlur(rng.integers(0, 255, (SIZE, SIZE, 3), np.uint8), (0, 0), 2)
    pixels = pixels.astype(np.uint8)
    mask = np.zeros((SIZE, SIZE), np.uint8)
    cv2.circle(mask, (SIZE // 2, SIZE // 2), SIZE // 4, 1, -1)
    middle = (SIZE / 2, SIZE / 2)
    handle = HandleMove(middle, (middle[0] + 3, middle[1]))
    turn = (10.0, 0.0, 0.0)
    script = EditScript(gaussians=400, handle=(handle,), turn=turn, refine="harmonise")
    photo = encode_picture(Picture(pixels), ".png")
    return run_script(photo, "warm-up", script, encode_mask(mask.astype(bool))).document


def _show_seldom(document: Document, thing: EditObject, puppet: Puppet) -> None:
    """A photo that is large, one of 16 bits, and Gaussians that are drawn as they are in a file."""
    from .compose.composite import object_texture
    from .compose.light.grain import Grain, sketch_grain
    from .compose.light.noise import BANDS, find_noise
    from .compose.light.relight import Relit
    from .lift.relief.integration import solved
    from .pipeline import lift_mask, make_plate
    from .segment.matting.closed_form import affine

    empty = np.zeros((4, 4))
    solved(empty, empty, empty, empty, empty, empty, 1, 1.0)  # after the shape network's look
    small = np.zeros((4, 4), np.float32)
    clear = np.zeros((4, 4, 4), np.uint8)
    Relit(small, 0.0, 0.0, 1.0).lit_rgba(clear, 0.0, 0.0, 1.0)
    noisy = np.random.default_rng(0).integers(90, 160, (64, 64, 3)).astype(np.uint8)
    if (noise := find_noise(noisy)) is not None:
        even = np.ones((1, 1, BANDS), np.float32)
        grain = Grain(noise, even, 0.0, 0.0, 1.0)
        grain.grained_rgba(clear, 0.0, 0.0, 1.0)
        grain.grained(np.zeros((4, 4, 3), np.float32), small, 0, 0)
        splats = puppet.posed(thing.pose, Placement(scale=1.3))
        sketch_grain(splats, noise, 1.0, document.photo.camera)
    affine(np.zeros((4, 4, 3), np.float32), np.zeros((4, 4), np.float32))
    deep = document.photo.pixels.astype(np.uint16) * np.uint16(257)
    assert thing.mask is not None and thing.matte is not None
    make_plate(deep, thing.mask)
    lift_mask(deep, document.photo.camera, thing.mask)
    texture, camera = object_texture(thing.matte, thing.lifted), document.photo.camera
    lifted = puppet.lifted
    nowhere = replace(lifted.texture, visibility=np.zeros(len(lifted.gaussians), np.float32))
    plain = replace(lifted, splatting="classic", texture=nowhere)
    Puppet(plain, DeformSettings(), camera).draw(thing.pose, Placement(), texture, camera)


def _pose_seldom(thing: EditObject, puppet: Puppet) -> None:
    """Strain as a colour, Gaussians split, the paper as printed, thousands of control points."""
    from scipy.sparse import csr_array

    from .compose.composite import object_texture
    from .deform.response import SparseResponse

    assert thing.pose is not None and thing.matte is not None
    puppet.deformer.strain(thing.pose)
    texture, camera = object_texture(thing.matte, thing.lifted), puppet.camera
    for settings in (
        DeformSettings("laplacian", "euclidean", is_splitting=True, stretch_limit=1.5),
        DeformSettings(is_faithful=True),
    ):
        other = Puppet(puppet.lifted, settings, camera)
        solution = other.deformer.solve(thing.handles)
        other.draw(solution.pose, Placement(), texture, camera)
    SparseResponse(csr_array(np.eye(NODES))).solve(np.ones((NODES, 3)))


def _register(document: Document, thing: EditObject) -> None:
    """The object as if it came out of a file: looked for in every way it can stand, and refined."""
    from .lift.registration.imported import ImportTarget, place_import
    from .lift.registration.placement import Registrar
    from .lift.registration.search import search
    from .lift.registration.sketch import even_surfels, own_frame

    assert thing.lifted is not None and thing.mask is not None
    photo, gaussians = document.photo, thing.lifted.body
    scene = ImportTarget(photo.pixels, photo.camera, thing.mask)
    target, frame = scene.target, own_frame(gaussians)
    (few,) = even_surfels(gaussians, frame, (FEW_SURFELS,))
    search(few, target.view(FEW_PIXELS), target, (photo.camera.focal,), silent)
    registrar = Registrar(gaussians, target)
    place_import(scene, gaussians, registrar.rated(thing.lifted.world_from_object))


def compile_beside() -> bool:
    """Has the largest kernels compiled by other processes; whether there is anything to compile.

    Whoever needs one of them waits for it (`kernel_files`); asked again, the processes stay the
    same. An installer's copy does it in another way, at its first start.
    """
    if installation.is_frozen() or kernel_files.is_kept(draw_layers):
        return False
    if core_count() > 1 and not kernel_files.elsewhere:
        path = os.pathsep.join(filter(None, sys.path))
        for name, (_, modules) in PARTS.items():
            process = Popen(
                [sys.executable, "-m", __name__, name], env=os.environ | {"PYTHONPATH": path},
                stdin=DEVNULL, stdout=DEVNULL, stderr=DEVNULL,
            )  # fmt: skip
            atexit.register(process.kill)  # of an edit that ended before
            kernel_files.elsewhere |= dict.fromkeys(modules, process)
    return True


def _draw() -> None:
    """Draws nothing, so that nothing has to be projected."""
    splats, camera = _speck(), Camera.from_fov(SIZE, SIZE)
    pixels = np.ones((SIZE, SIZE), np.float32)
    texture = build_levels(np.stack([pixels] * 3, -1), pixels, 0, 0)
    nothing = frozen(np.zeros((len(splats), SPAN), np.float32))
    tiles.draw(tiles.Drawable(splats, nothing, None, camera, camera), texture)


def _project() -> None:
    camera = Camera.from_fov(SIZE, SIZE)
    tiles.prepare(_speck(), camera, camera)


def _fill() -> None:
    from .pipeline import make_plate

    pixels = np.random.default_rng(0).integers(0, 255, (SIZE, SIZE, 3), np.uint8)
    mask = np.zeros((SIZE, SIZE), bool)
    mask[SIZE // 3 : SIZE // 2, SIZE // 3 : SIZE // 2] = True
    make_plate(pixels, mask)


# What is compiled beside an edit, and the modules whose kernels that are.
PARTS = {
    "draw": (_draw, ("surface", "binning")),
    "project": (_project, ("projection",)),
    "fill": (_fill, ("patch_search", "patch_detail")),
}


def _speck() -> PosedSplats:
    """One Gaussian that shows the photo."""
    one, row = np.ones(1), np.ones((1, 3))
    gaussians = Gaussians(0 * row, np.array([[1.0, 0, 0, 0]]), 0.1 * row, one, row)  # pyright: ignore
    texture = PhotoTexture(SIZE / 2 * row[:, :2], one, one)  # pyright: ignore
    place = np.eye(4)
    place[2, 3] = 3.0
    lifted = LiftedObject(gaussians, texture, 0 * row, place, 0.1, "made")  # pyright: ignore
    return PosedSplats(RestSplats(lifted, Camera.from_fov(SIZE, SIZE)), None, np.eye(4))


if __name__ == "__main__":
    PARTS[sys.argv[1]][0]() if sys.argv[1:] else warm_up()
