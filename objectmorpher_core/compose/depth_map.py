"""The distance of the lifted objects as a picture for other programs."""

from __future__ import annotations

import numpy as np

from ..base.arrays import F32
from ..base.progress import Progress, silent
from ..deform.puppet import Puppet, puppet_of
from ..document.model import Document
from ..pictures.image import Picture
from ..raster import tiles
from .composite import object_texture
from .plate.plate import overlap

SOLID = 0.5  # alpha from which on a pixel shows an object
TOP = 65535


def depth_map(
    document: Document, puppets: dict[int, Puppet] | None = None, progress: Progress = silent
) -> F32:
    """(H, W) world units along the view, of the nearest object; infinite where there is none.

    Of the visible lifted objects, where they are now. `puppets` by index save making them again.
    """
    camera = document.photo.camera
    nearest = np.full((camera.height, camera.width), np.inf, np.float32)
    for k, item in enumerate(document.objects):
        progress(k / len(document.objects), "drawing")
        if item.lifted is None or item.matte is None or not item.is_visible:
            continue
        puppet = (puppets or {}).get(k) or puppet_of(item, camera)
        drawable = tiles.prepare(puppet.posed(item.pose, item.placement), camera, camera)
        whole = drawable.box()
        box = None if whole is None else overlap(whole, (0, 0, camera.width, camera.height))
        if box is None:
            continue
        picture = tiles.draw(drawable, object_texture(item.matte, item.lifted), box)
        depth = np.where(picture.alpha > SOLID, picture.depth, np.float32(np.inf))
        part = nearest[box[1] : box[3], box[0] : box[2]]
        np.minimum(part, depth, out=part)
    return nearest


def depth_picture(
    document: Document, puppets: dict[int, Puppet] | None = None, progress: Progress = silent
) -> Picture:
    """The `nearness` of the objects, 16-bit grey."""
    near = nearness(depth_map(document, puppets, progress))
    return Picture(np.repeat(near[..., None], 3, axis=2), is_grey=True)


def nearness(depth: F32) -> np.ndarray:
    """(H, W) u16 of a depth map: the nearest point is 65535, twice as far half of that.

    0 is where there is no object. The depth is the nearest one's x 65535 / value.
    """
    finite = depth[np.isfinite(depth)]
    least = float(finite.min()) if len(finite) else 1.0
    return np.rint(TOP * least / depth.astype(np.float64)).astype(np.uint16)
