"""Gaussians onto the screen: the motion, EWA projection and the map into the photo, in one pass.

64 Gaussians at a time: what the skinning has computed is projected while it is still in the
processor's cache, and never written out.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..base.arrays import F32, frozen
from ..base.camera import Camera
from ..base.kernel_files import numba
from ..base.threads import FAST, in_threads
from ..deform.binding import LANES
from ..deform.skinning import LINEAR, SHIFT, Skin, Skinned, skin_block
from . import ewa
from .posed import REST_ROWS, SIDE_ROWS, PosedSplats, view_limits
from .rules import ASIDE, PLAIN_SPAN, RULES, SPAN, SX, Z


def project(
    splats: PosedSplats, camera: Camera, photo_camera: Camera, depths: F32 | None = None
) -> F32:
    """Gaussians on the screen (N, SPAN), columns as in `columns`; unseen ones are all 0.

    (N, PLAIN_SPAN) where nothing of the photo is shown. `depths` (N,) gets the column Z: to sort
    them one has to read them only, and not a line of memory for each.
    """
    rest = splats.rest
    out = np.empty((len(rest), SPAN if splats.is_layered else PLAIN_SPAN), np.float32)
    linear, offset = splats.world_from_object[:3, :3], splats.world_from_object[:3, 3]
    frame = np.concatenate(
        [
            linear.ravel(), offset, [splats.scale, RULES.near * splats.gap],
            [camera.focal, camera.cx, camera.cy],
            [photo_camera.focal, photo_camera.cx, photo_camera.cy],
            view_limits(photo_camera),
        ]
    )  # fmt: skip
    inputs: tuple[Any, ...] = (
        *_motion(splats), rest.blocks.reshape(-1), rest.side_blocks.reshape(-1), frozen(frame),
        RULES, rest.splatting,
        splats.is_layered, out, _NO_DEPTHS if depths is None else depths,
    )  # fmt: skip
    in_threads(lambda first, last: _project(first, last, *inputs), len(rest.blocks), 2)
    return out


_NO_SKIN = (
    frozen(np.zeros((0, 3))), frozen(np.zeros((0, 4), np.uint32)), frozen(np.zeros((0, 0))),
    frozen(np.zeros((0, 8))), frozen(np.zeros((2, 3))),
)  # fmt: skip
_NO_DEPTHS = np.zeros(0, np.float32)
_NO_POINTS = (frozen(np.zeros((0, 3))), frozen(np.zeros((0, 3, 3))))


def _motion(splats: PosedSplats) -> tuple[Any, ...]:
    """What moves the Gaussians, as the kernel takes it: one of three, the others empty."""
    motion = splats.motion
    if isinstance(motion, Skin):
        return (*motion.inputs(), *_NO_POINTS)
    if isinstance(motion, Skinned):
        points, linear = frozen(motion.points, np.float64), frozen(motion.linear, np.float64)
        return (*_NO_SKIN, points, linear)
    return (*_NO_SKIN, *_NO_POINTS)


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _project(
    first, last, x, control_points, shares, nodes, centre, points, linear,
    rest, sides, frame, rules, kind, is_textured, out, depths,
):  # fmt: skip
    """Fills the rows of `out` that belong to the blocks first..last."""
    s = np.ones(ewa.ROWS * LANES)
    left, right, one = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    drift = np.zeros(3)
    if len(x) > 0:
        for a in range(3):
            drift[a] = centre[1, a]
    else:
        for row in range(SHIFT, SHIFT + 3):
            s[row * LANES : (row + 1) * LANES] = 0.0
        for row in range(9):
            at = (LINEAR + row) * LANES
            s[at : at + LANES] = 1.0 if row % 4 == 0 else 0.0
    screen = ewa.screen_of(frame, drift, kind)
    for block in range(first, last):
        start = block * LANES
        count = min(LANES, len(out) - start)
        base = block * REST_ROWS * LANES
        if len(x) > 0:
            skin_block(block, count, x, control_points, shares, nodes, centre, s, left, right, one)
        elif len(points) > 0:
            for k in range(count):
                for a in range(3):
                    s[(SHIFT + a) * LANES + k] = points[start + k, a] - rest[base + a * LANES + k]
                    for b in range(3):
                        s[(LINEAR + 3 * a + b) * LANES + k] = linear[start + k, a, b]
        if is_textured:
            at = block * SIDE_ROWS * LANES if len(sides) > 0 else -1
            ewa.project_textured(s, rest, base, sides, at, screen, rules, kind)
            ewa.weigh_textured(s, rest, base, frame[12], rules, kind)
            ewa.limit(s, kind)
            ewa.limit_front(s, rules, kind)
            ewa.write(s, rest, base, start, count, ASIDE + 1, out)
        else:
            ewa.project_plain(s, rest, base, screen, rules, kind)
            ewa.limit(s, kind)
            ewa.write(s, rest, base, start, count, SX, out)
        for i in range(start, min(start + count, len(depths))):
            depths[i] = out[i, Z]
