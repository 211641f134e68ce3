"""A web page in which an object of a document can be dragged and turned.

The page holds everything: pictures, Gaussians, control points and the programs in assets/share.
It loads nothing from elsewhere, and runs in any browser with WebGL 2.
"""

from __future__ import annotations

import base64
import html
import json
import logging
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_array, lil_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from objectmorpher_core.base.rotations import quats_from_matrices
from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.plate.plate import plate_picture
from objectmorpher_core.deform.puppet import Puppet, puppet_of
from objectmorpher_core.deform.resampling import thinned
from objectmorpher_core.document.model import Document, LiftedObject
from objectmorpher_core.document.placement import gimbal_of
from objectmorpher_core.pictures.image import (
    Picture,
    encode_coverage,
    encode_picture,
    resized,
    to_u8,
)
from objectmorpher_core.raster.posed import SURFACE_GAP
from objectmorpher_core.raster.rules import SPLATTINGS

from ..system.resources import resource

log = logging.getLogger(__name__)

LONGEST = 1600  # px, of the photo in the page
MOST = 24_000  # Gaussians
MOST_BYTES = 8_000_000  # of a page
# Longest side of the photo, px, and quality of WebP, until a page has no more bytes.
SIZES = ((LONGEST, 92), (LONGEST, 80), (1280, 80), (1024, 75), (800, 70))
JOINTS = 4  # links of a part that has none
PARTS = ("arap.js", "splat.vert", "splat.frag", "resolve.frag", "view.js")


def encode_page(document: Document, index: int) -> bytes:
    """Return the page in which object `index` can be dragged; the others are as they were left.

    A page of more than MOST_BYTES gets a photo that is compressed more, and then a smaller one.
    """
    item, photo = document.objects[index], document.photo
    lifted = item.shown
    assert lifted is not None and item.matte is not None, "the caller checks"
    puppet = puppet_of(item, photo.camera)
    body = thinned(lifted, MOST)
    shown = lifted if body is None else body[0]
    plate = to_u8(_background(document, index))
    page = b""
    for longest, quality in SIZES:
        page = _page(document, index, puppet, shown, plate, longest, quality)
        if len(page) <= MOST_BYTES:
            break
        log.info("A page of %d bytes is too large", len(page))
    return page


def _page(
    document: Document, index: int, puppet: Puppet, shown: LiftedObject, plate: np.ndarray,
    longest: int, quality: int,
) -> bytes:  # fmt: skip
    """The page with a photo of at most `longest` px, whose WebP files have that `quality`."""
    item, photo = document.objects[index], document.photo
    matte = item.matte
    assert matte is not None
    scale = min(longest / max(photo.size), 1.0)
    width, height = (max(round(side * scale), 1) for side in photo.size)
    arrays = _arrays(shown, puppet, scale)
    arrays |= _graph(puppet, item.pose)
    about, data = _packed(arrays)
    about |= _places(document, index, puppet, scale)
    side = tuple(max(round(n * scale), 1) for n in reversed(matte.alpha.shape))
    foreground = np.rint(np.clip(resized(matte.shown, *side), 0, 1) * 255).astype(np.uint8)
    alpha = np.rint(np.clip(resized(matte.alpha, *side), 0, 1) * 255).astype(np.uint8)
    values = {
        "title": html.escape(Path(photo.name).stem), "width": str(width), "height": str(height),
        "foreground": _image(_webp(foreground, quality)),
        "plate": _image(_webp(resized(plate, width, height), quality)),
        "matte": _image(encode_coverage(alpha), "png"),
        "about": json.dumps(about, separators=(",", ":")).replace("<", "\\u003c"),
        "data": base64.b64encode(data).decode(),
    }  # fmt: skip
    values |= {name: _text(f"assets/share/{name}") for name in PARTS}
    page = re.sub(r"\{\{(\S+?)\}\}", lambda part: values[part[1]], _text("assets/share/page.html"))
    return page.encode("utf-8", "replace")  # in a title: a file's name may be no UTF-8


def _background(document: Document, index: int) -> np.ndarray:
    """(H, W, 3) the photo without the object; what else was moved is where it was left."""
    others = [item for k, item in enumerate(document.objects) if k != index]
    if not any(other.is_moved for other in others):
        return plate_picture(document)
    hidden = replace(document.objects[index], is_visible=False)
    objects = tuple(hidden if k == index else o for k, o in enumerate(document.objects))
    return composite(replace(document, objects=objects, refined=None)).pixels


def _arrays(lifted: LiftedObject, puppet: Puppet, scale: float) -> dict[str, np.ndarray]:
    """What the page knows of each Gaussian; see assets/share/splat.vert."""
    gaussians, texture, deformer = lifted.gaussians, lifted.texture, puppet.deformer
    binding = deformer.binding
    if lifted is not puppet.lifted:
        from objectmorpher_core.deform.binding import bind

        binding = bind(gaussians.means, deformer.points, deformer.graph, gaussians.normals)
    c = gaussians.covariances()
    covs = np.stack([c[:, a, b] for a, b in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))], 1)
    shares = np.rint(binding.weights * 65535).astype(np.int64)
    shares[:, 0] += 65535 - shares.sum(1)
    colors = np.column_stack([gaussians.colors, gaussians.opacities])
    seen = np.column_stack([texture.visibility, texture.solidity])
    slopes = binding.weight_gradients.reshape(len(gaussians), 12)
    steep = max(float(np.abs(slopes).max()), 1e-12)
    return {
        "means": gaussians.means.astype("<f4"), "covs": covs.astype("<f4"),
        "u0": (texture.u0 * scale).astype("<f4"), "seen": _bytes(seen), "colors": _bytes(colors),
        "normals": np.rint(gaussians.normals * 32767).astype("<i2"),
        "nodes": binding.control_points.astype("<u2"), "shares": shares.astype("<u2"),
        "slopes": np.rint(slopes / steep * 32767).astype("<i2"),
        "steep": np.array([steep], "<f4"),
    }  # fmt: skip


def _graph(puppet: Puppet, pose: Any) -> dict[str, np.ndarray]:
    """Control points at rest and as they are posed, and the links of ARAP."""
    deformer = puppet.deformer
    links = joined(deformer.points, deformer.graph.weights)
    points = deformer.points if pose is None else pose.points
    turns = np.tile(np.eye(3), (len(points), 1, 1)) if pose is None else pose.rotations
    return {
        "rest": deformer.points.astype("<f4"), "points": points.astype("<f4"),
        "quats": quats_from_matrices(turns).astype("<f4"), "starts": links.indptr.astype("<u4"),
        "columns": links.indices.astype("<u2"), "weights": links.data.astype("<f4"),
    }  # fmt: skip


def joined(points: np.ndarray, weights: csr_array) -> csr_array:
    """Return links (M, M) in which every part hangs on the one that is nearest to it.

    The page has no rigid bodies: a part without links would stay where it is.
    """
    parts, of = connected_components(weights, directed=False)
    if parts == 1:
        return weights
    mean, table = float(weights.data.mean()), lil_array(weights)
    for part in range(parts):
        own, others = np.flatnonzero(of == part), np.flatnonzero(of != part)
        far, which = KDTree(points[others]).query(points[own])
        for k in np.asarray(far).argsort()[:JOINTS]:
            a, b = own[k], others[np.asarray(which)[k]]
            table[a, b] = table[b, a] = mean
    return csr_array(table)


def _places(document: Document, index: int, puppet: Puppet, scale: float) -> dict[str, Any]:
    """Where the object is, and how it is to be drawn. Lengths of the photo are px of the page's."""
    item, camera, lifted = document.objects[index], document.photo.camera, puppet.lifted
    matte, kind = item.matte, SPLATTINGS[lifted.splatting]
    assert matte is not None
    now = item.placement.matrix(lifted, camera) @ lifted.world_from_object
    rest = lifted.world_from_object
    down = gimbal_of(item, document).down
    left, top, right, bottom = (side * scale for side in matte.box)
    return {
        "camera": [camera.focal * scale, camera.cx * scale, camera.cy * scale],
        "size": [max(round(side * scale), 1) for side in document.photo.size],
        "crop": [left, top, right - left, bottom - top],
        "turn": now[:3, :3].ravel().tolist(), "shift": now[:3, 3].tolist(),
        "rest_turn": rest[:3, :3].ravel().tolist(), "rest_shift": rest[:3, 3].tolist(),
        "middle": lifted.object_points(lifted.centre).tolist(), "depth": float(lifted.centre[2]),
        "down": (rest[:3, :3].T @ down).tolist(),  # object frame, of any length
        "gap": SURFACE_GAP * lifted.spacing * lifted.scale,
        "extent": lifted.diameter * lifted.scale,
        "is_surface": int(kind.is_surface), "is_edged": int(kind.is_edged),
    }  # fmt: skip


def _packed(arrays: dict[str, np.ndarray]) -> tuple[dict[str, Any], bytes]:
    """Where each array is in the bytes of all, and those."""
    steep = float(arrays.pop("steep")[0])
    data, table = bytearray(), {}
    for name, array in arrays.items():
        kind = array.dtype.kind + str(array.dtype.itemsize)
        table[name] = {"at": len(data), "kind": kind, "length": array.size}
        data += array.tobytes()
        data += bytes(-len(data) % 4)
    return {"arrays": table, "steep": steep}, bytes(data)


def _bytes(values: np.ndarray) -> np.ndarray:
    return np.rint(np.clip(values, 0, 1) * 255).astype(np.uint8)


def _webp(pixels: np.ndarray, quality: int) -> bytes:
    return encode_picture(Picture(pixels), ".webp", webp_quality=quality)


def _image(data: bytes, kind: str = "webp") -> str:
    return f"data:image/{kind};base64,{base64.b64encode(data).decode()}"


def _text(name: str) -> str:
    return resource(name).read_text(encoding="utf-8")
