"""A photographed thing whose shape is known: the motorcycle of the Middlebury 2014 stereo pair.

The left photo is lifted and seen from the right camera. (Scharstein et al. 2014; scikit-image
fetches the pair, of which nothing is kept with the project.)
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from skimage.metrics import structural_similarity

from objectmorpher_core.base.arrays import F32, F64, crop
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.progress import silent
from objectmorpher_core.compose.composite import object_texture
from objectmorpher_core.deform.puppet import Puppet
from objectmorpher_core.document.model import LiftedObject, LiftSettings, Matte, Placement
from objectmorpher_core.document.settings import DeformSettings
from objectmorpher_core.lift import LiftSubject
from objectmorpher_core.lift.relief.body import ReliefBody
from objectmorpher_core.lift.relief.depth_prior import NetworkDepth
from objectmorpher_core.lift.relief.lifter import ReliefLifter
from objectmorpher_core.lift.relief.mirror import MirrorAxis
from objectmorpher_core.lift.relief.silhouette import ReliefSilhouette
from objectmorpher_core.lift.relief.standing import FLAT
from objectmorpher_core.lift.relief.thickness import Thickness
from objectmorpher_core.pipeline import lift_mask
from objectmorpher_core.raster import tiles
from objectmorpher_research.evaluation.truth.stereo import FOCAL, OFFSET, StereoPair, read_pair


@dataclass(frozen=True)
class Result:
    name: str
    psnr: float  # dB, inside the motorcycle
    ssim: float
    disparity_error: float  # px, RMS over what the left photo shows


def results() -> list[Result]:
    pair = read_pair()
    height, width = pair.mask.shape
    camera = Camera(FOCAL, width / 2, height / 2, width, height)
    alone = LiftSettings(uses_depth=False, trust=0)
    matte, lifted = lift_mask(pair.left, camera, pair.mask, settings=alone)
    _, learned = lift_mask(pair.left, camera, pair.mask, settings=replace(alone, trust=1.0))
    seen = NetworkDepth(_filled(pair.disparity), (0, 0, width, height))
    subject = LiftSubject(pair.left, camera, pair.mask, matte)
    _, inflated = lift_mask(
        pair.left, camera, pair.mask, settings=replace(alone, is_standing=False)
    )
    deep = ReliefLifter(lambda pixels, mask: seen).lift(subject, LiftSettings(trust=0), silent)
    board = ReliefLifter(shape=_slab).lift(subject, alone, silent)
    known = pair.disparity[pair.mask & (pair.disparity > 0)]
    card = float(np.median(known))
    slab = _card_shot(matte, card, (height, width))
    color, error = _relief_shot(pair, matte, lifted, camera)
    seen_color, seen_error = _relief_shot(pair, matte, learned, camera)
    plain_color, plain_error = _relief_shot(pair, matte, inflated, camera)
    deep_color, deep_error = _relief_shot(pair, matte, deep, camera)
    board_color, board_error = _relief_shot(pair, matte, board, camera)
    flat = float(np.sqrt(((known - card) ** 2).mean()))
    return [
        Result("network", *_compared(pair, seen_color), seen_error),
        Result("relief", *_compared(pair, color), error),
        Result("inflation", *_compared(pair, plain_color), plain_error),
        Result("relief with true depth", *_compared(pair, deep_color), deep_error),
        Result("constant thickness", *_compared(pair, board_color), board_error),
        Result("card at the median disparity", *_compared(pair, slab), flat),
    ]


def _slab(
    silhouette: ReliefSilhouette, camera: Camera, settings: LiftSettings, axis: MirrorAxis | None
) -> ReliefBody:
    """As thick everywhere as the relief is on average, and facing the camera."""
    inflated = Thickness.of(silhouette)
    half, _ = inflated.sample(silhouette.cells[silhouette.inside], silhouette.cell)
    even = np.full(silhouette.shape, float(half.mean()))
    side = inflated.mixed(even, np.ones(silhouette.shape))
    return ReliefBody(silhouette, FLAT, np.zeros(silhouette.shape), side, side)


def _filled(disparity: F64) -> F32:
    """(h, w) with the disparities around it where none is known."""
    top = disparity.max()
    known = np.rint(disparity / top * 65535).astype(np.uint16)
    blank = (disparity <= 0).astype(np.uint8)
    filled = cv2.inpaint(known, blank, 3, cv2.INPAINT_NS)
    return np.asarray(cv2.GaussianBlur(filled.astype(np.float32), (0, 0), 2.0), np.float32)


def _relief_shot(
    pair: StereoPair, matte: Matte, lifted: LiftedObject, camera: Camera
) -> tuple[F64, float]:
    """Premultiplied (h, w, 3) as the right camera sees the lift, and its disparities' error, px.

    How far away it is one photo does not tell: the median disparity is given, as to the card.
    """
    seen = (lifted.texture.visibility > 0.5) & (lifted.texture.solidity > 0.5)
    depth = lifted.world_points(lifted.gaussians.means)[seen, 2]
    column, row = np.clip(
        lifted.texture.u0[seen].astype(int), 0, np.array(pair.mask.shape[::-1]) - 1
    ).T
    truth = pair.disparity[row, column]
    is_known = truth > 0
    baseline = float(np.median((truth + OFFSET)[is_known] * depth[is_known]) / camera.focal)
    error = camera.focal * baseline / depth - OFFSET - truth
    splats = Puppet(lifted, DeformSettings(), camera).posed(None, Placement())
    moved = np.eye(4)
    moved[0, 3] = -baseline
    right = replace(camera, cx=camera.cx + OFFSET)
    texture = object_texture(matte, lifted)
    picture = tiles.render(replace(splats, placement=moved), texture, right, camera)
    return np.asarray(picture.color, np.float64), float(np.sqrt((error[is_known] ** 2).mean()))


def _card_shot(matte: Matte, disparity: float, shape: tuple[int, int]) -> F64:
    """Premultiplied (h, w, 3): the cut-out, moved."""
    height, width = shape
    box = (0, 0, width, height)
    color = matte.foreground * matte.alpha[..., None]
    warp = np.array([[1, 0, -disparity], [0, 1, 0]])
    return np.asarray(
        cv2.warpAffine(crop(color, matte.box, box), warp, (width, height)), np.float64
    )


def _compared(pair: StereoPair, color: F64) -> tuple[float, float]:
    """PSNR in dB and SSIM inside the motorcycle as the right photo shows it."""
    truth = pair.right / 255.0
    psnr = -10 * np.log10(((color - truth)[pair.right_mask] ** 2).mean())
    _, whole = structural_similarity(color, truth, channel_axis=2, data_range=1.0, full=True)
    return float(psnr), float(whole.mean(2)[pair.right_mask].mean())
