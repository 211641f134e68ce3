"""Which cells of a grid over the canvas something has moved from, or to: compiled."""

from __future__ import annotations

from objectmorpher_core.base.kernel_files import numba


@numba.njit(cache=True, nogil=True)
def mark_moved(free, rest, world, lens, corner, scale, least, has_left):
    """Sets `free` (h, w) u8 to 0 where Gaussians that moved are, and with `has_left` were.

    `rest` (N, 2) image px; `world` (N, 3) where they are now, or (0, 3) where they are hidden:
    then all have gone. `lens`: focal length and centre of the photo's camera, px; `corner`: image
    px at the grid's left top; `scale`: cells per image px; `least`: squared image px, by
    more than which a Gaussian has moved.
    """
    height, width = free.shape
    focal, cx, cy = lens
    left, top = corner
    for i in range(len(rest)):
        x, y = rest[i, 0], rest[i, 1]
        if len(world) > 0:
            z = world[i, 2]
            if z <= 0.0:  # behind the camera
                continue
            u, v = focal * world[i, 0] / z + cx, focal * world[i, 1] / z + cy
            if not (u - x) ** 2 + (v - y) ** 2 > least:
                continue
            column, row = int((u - left) * scale // 1), int((v - top) * scale // 1)
            if 0 <= column < width and 0 <= row < height:
                free[row, column] = 0
        if has_left:
            column, row = int((x - left) * scale // 1), int((y - top) * scale // 1)
            if 0 <= column < width and 0 <= row < height:
                free[row, column] = 0
