"""Compiles every kernel once, so that no first click waits for it.

`python -m objectmorpher_core.warm_up` runs the main job on a made picture of 96 x 96 pixels. The
compiled kernels stay in numba's cache on the disk.
"""

from __future__ import annotations

import cv2
import numpy as np

from .document import Document

SIZE = 96  # px


def warm_up() -> Document:
    """The edited picture; a minute or two the first time after an installation, a second later."""
    from .image import Picture, encode_mask, encode_picture
    from .pipeline import run_script
    from .script import EditScript, HandleMove
    from .segment.closed_form import affine, applied
    from .segment.halving import halved_pixels

    rgb, alpha = np.zeros((4, 4, 3), np.float32), np.zeros((4, 4), np.float32)
    applied(affine(rgb, alpha), rgb, alpha == 0, alpha)  # of large photos only
    halved_pixels(rgb.astype(np.uint16))
    rng = np.random.default_rng(0)
    pixels = cv2.GaussianBlur(rng.integers(0, 255, (SIZE, SIZE, 3), np.uint8), (0, 0), 2)
    pixels = pixels.astype(np.uint8)
    mask = np.zeros((SIZE, SIZE), np.uint8)
    cv2.circle(mask, (SIZE // 2, SIZE // 2), SIZE // 4, 1, -1)
    middle = (SIZE / 2, SIZE / 2)
    handle = HandleMove(middle, (middle[0] + 3, middle[1]))
    script = EditScript(gaussians=400, handle=(handle,), turn=(10.0, 0.0, 0.0))
    photo = encode_picture(Picture(pixels), ".png")
    return run_script(photo, "warm-up", script, encode_mask(mask.astype(bool))).document


if __name__ == "__main__":
    warm_up()
