"""The specification of the picture, slow and clear; every other renderer is compared with it.

Surface splatting of photo-textured Gaussians (Zwicker et al. 2001 and 2002; DESIGN section 3):

1. Each Gaussian is projected (EWA). Its kernel at a pixel is k = o f (exp(-q/2) - exp(-7/2)),
   q the squared Mahalanobis distance, f its facing weight, o its opacity.
2. From the same covariances follows the affine map that says which point of the photo it shows
   at a pixel: u0 + A d, A = J0 Sigma F^T J1^T (J1 F Sigma F^T J1^T)^-1.
3. Along a pixel, from front to back, samples that agree in depth and in what they show of the
   photo form one layer. Within a layer the *points of the photo* are averaged, and the photo is
   then looked up once: neighbours differ by a fraction of a pixel in where they look, and a mean
   of positions stays sharp where a mean of colours would blur. Colours of what the photo does
   not show are averaged as colours.
4. A layer's alpha is the matte's where the photo is carried along and the rim has not turned
   towards the camera; otherwise it ends where the kernel sum falls below a level, antialiased
   by the sum's own gradient.
5. Layers are composited front to back, premultiplied. Where two layers show the same point of
   the photo they are one surface that was split, and their coverage adds up under one matte.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import F32, F64
from ..camera import Camera
from .posed import PosedSplats, TextureLevels, projection_jacobians
from .rules import RULES


@dataclass(frozen=True, eq=False)
class Picture3D:
    """A rendered object."""

    color: F32  # (h, w, 3) sRGB in [0, 1], premultiplied
    alpha: F32  # (h, w)
    depth: F32  # (h, w) world units, of the front layer; inf where there is none
    from_photo: F32  # (h, w) share of the pixel that shows the photo at its own pixels' detail
    shift: F32  # (h, w, 2) photo px from where the pixel is to where it looks, front layer


@dataclass(frozen=True, eq=False)
class Projected:
    """Gaussians on the screen, in the order of their depth."""

    centre: F64  # (N, 2) view px
    conic: F64  # (N, 3) inverse of the filtered screen covariance: xx, xy, yy
    extent: F64  # (N, 2) view px, half-size of the box outside which the kernel is 0
    depth: F64  # (N,) world units
    slope: F64  # (N, 2) depth per view px, within the Gaussian
    shift: F64  # (N, 2) photo px: u0 minus the photo point at `centre`
    shift_slope: F64  # (N, 2, 2) per view px: A minus that of the unmoved photo
    lod: F64  # (N,) log2 of photo px per view px
    photo: F64  # (N,) kernel weight of the photo part
    body: F64  # (N,) kernel weight of the rest
    matted: F64  # (N,) how much the matte's edge is to be trusted
    solidity: F64  # (N,) alpha of the photo part where it is not
    seen: F64  # (N,) 1 = the photo part was visible in the photo
    color: F64  # (N, 3)


def project(splats: PosedSplats, camera: Camera, photo_camera: Camera) -> Projected:
    """Step 1 and 2. `camera` is the view's, `photo_camera` the photo's."""
    near = RULES.near * splats.gap
    index = np.flatnonzero((splats.means[:, 2] > near) & np.isfinite(splats.means).all(1))
    means, motion = splats.means[index], splats.linear[index]
    jacobian = projection_jacobians(means, camera.focal)
    rest = splats.rest_covariances[index]
    world = motion @ rest @ motion.transpose(0, 2, 1)
    screen = jacobian @ world @ jacobian.transpose(0, 2, 1)
    ridge = RULES.ridge * np.trace(screen, axis1=1, axis2=2) + 1e-12
    inverse = np.linalg.inv(screen + ridge[:, None, None] * np.eye(2))
    pictures = splats.rest_pictures[index]
    a = pictures @ motion.transpose(0, 2, 1) @ jacobian.transpose(0, 2, 1) @ inverse
    filtered = screen + RULES.filter * np.eye(2)
    conic = np.linalg.inv(filtered).astype(np.float64)
    # The filter spreads a small Gaussian over more pixels: it must not gain weight by that.
    compensation = np.sqrt(np.linalg.det(screen).clip(0) / np.linalg.det(filtered))
    singular = np.linalg.svd(a, compute_uv=False)
    volume = np.cbrt(np.abs(np.linalg.det(motion)))
    zoom = camera.focal / means[:, 2] / splats.rest_zoom[index]
    stretch = singular[:, 1] * zoom * volume
    carried = _ramp(stretch, RULES.streak_end, RULES.streak_start)
    seen = splats.visibility[index].astype(np.float64)
    cofactor = np.linalg.inv(motion).transpose(0, 2, 1)
    normals = (cofactor @ splats.normals[index][:, :, None])[:, :, 0]
    towards = -means
    cosine = (normals * towards).sum(1) / np.maximum(
        np.linalg.norm(normals, axis=1) * np.linalg.norm(towards, axis=1), 1e-30
    )
    solidity = splats.solidity[index].astype(np.float64)
    ramp = RULES.facing_ramp
    front = np.clip((cosine - ramp * (1 - seen)) / ramp + 1, 0, 1)
    brim = _ramp(np.abs(cosine), RULES.brim_end, RULES.brim_start)
    facing = solidity * front + (1 - solidity) * brim
    weight = splats.opacities[index] * facing * compensation
    centre = camera.project(means)
    ratio = photo_camera.focal / camera.focal  # photo px per view px
    unmoved = (centre - [camera.cx, camera.cy]) * ratio + [photo_camera.cx, photo_camera.cy]
    extent = np.sqrt(RULES.cutoff * np.stack([filtered[:, 0, 0], filtered[:, 1, 1]], axis=1))
    covariance_z = (world @ jacobian.transpose(0, 2, 1))[:, 2]  # (N, 2) depth against screen
    projected = Projected(
        centre=centre,
        conic=np.stack([conic[:, 0, 0], conic[:, 0, 1], conic[:, 1, 1]], axis=1),
        extent=extent,
        depth=means[:, 2],
        slope=(covariance_z[:, None] @ inverse)[:, 0],
        shift=splats.u0[index] - unmoved,
        shift_slope=a - ratio * np.eye(2),
        lod=np.log2(np.maximum(singular[:, 0], 1.0)),
        photo=weight * carried,
        body=weight * (1 - carried) * solidity,
        matted=_ramp(stretch, RULES.matte_end, RULES.matte_start)
        * _ramp(cosine - splats.rest_cosines[index], RULES.turned_end, RULES.turned_start),
        solidity=solidity,
        seen=seen,
        color=splats.colors[index].astype(np.float64),
    )
    order = np.argsort(projected.depth, kind="stable")
    return Projected(**{name: getattr(projected, name)[order] for name in vars(projected)})


class _Layer:
    """Sums over the samples of the layer that is being collected, per pixel."""

    def __init__(self, height: int, width: int) -> None:
        self.total = np.zeros((height, width))  # kernel sum
        self.body = np.zeros((height, width))  # of it, what the photo does not give
        self.slope = np.zeros((height, width, 2))  # gradient of `total`
        self.body_slope = np.zeros((height, width, 2))
        self.depth = np.zeros((height, width))
        self.deepest = np.zeros((height, width))
        self.shift = np.zeros((height, width, 2))
        self.matted = np.zeros((height, width))
        self.unmatted = np.zeros((height, width))  # solidity of the part that is not matted
        self.lod = np.zeros((height, width))
        self.seen = np.zeros((height, width))
        self.color = np.zeros((height, width, 3))


def render(
    splats: PosedSplats, texture: TextureLevels, camera: Camera, photo_camera: Camera
) -> Picture3D:
    """The object as `camera` sees it. `camera` gives the size of the picture."""
    height, width = camera.height, camera.width
    p = project(splats, camera, photo_camera)
    layer = _Layer(height, width)
    out = _Composite(texture, camera, photo_camera)
    for i in range(len(p.depth)):
        x0, y0 = np.floor(p.centre[i] - p.extent[i]).astype(int).clip(0, (width, height))
        x1, y1 = np.ceil(p.centre[i] + p.extent[i]).astype(int).clip(0, (width, height))
        if x0 >= x1 or y0 >= y1 or p.photo[i] + p.body[i] <= 0:
            continue
        window = (slice(y0, y1), slice(x0, x1))
        dx, dy = np.meshgrid(
            np.arange(x0, x1) + 0.5 - p.centre[i, 0], np.arange(y0, y1) + 0.5 - p.centre[i, 1]
        )
        xx, xy, yy = p.conic[i]
        q = xx * dx * dx + 2 * xy * dx * dy + yy * dy * dy
        bell = np.exp(-0.5 * q)
        kernel = np.where(q < RULES.cutoff, bell - RULES.tail, 0.0)
        hit = kernel > 0
        gradient = -bell[..., None] * np.stack([xx * dx + xy * dy, xy * dx + yy * dy], -1)
        depth = p.depth[i] + p.slope[i, 0] * dx + p.slope[i, 1] * dy
        offset = np.stack([dx, dy], -1)
        shift = p.shift[i] + offset @ p.shift_slope[i].T
        total = layer.total[window]
        photo = total - layer.body[window]
        with np.errstate(divide="ignore", invalid="ignore"):
            apart = depth - layer.deepest[window] > splats.gap
            looks = np.linalg.norm(shift - layer.shift[window] / photo[..., None], axis=-1)
        apart |= (photo > 0) & (p.photo[i] > 0) & (looks > splats.texture_gap)
        closed = hit & (total > 0) & apart
        if closed.any():
            out.add(layer, window, closed)
        kernel = np.where(hit, kernel, 0.0)
        gradient = np.where(hit[..., None], gradient, 0.0)
        both = p.photo[i] + p.body[i]
        layer.total[window] += kernel * both
        layer.body[window] += kernel * p.body[i]
        layer.slope[window] += gradient * both
        layer.body_slope[window] += gradient * p.body[i]
        layer.depth[window] += kernel * both * depth
        deepest = layer.deepest[window]
        layer.deepest[window] = np.where(hit, np.maximum(deepest, depth), deepest)
        layer.matted[window] += kernel * p.photo[i] * p.matted[i]
        layer.unmatted[window] += kernel * p.photo[i] * (1 - p.matted[i]) * p.solidity[i]
        layer.shift[window] += (kernel * p.photo[i])[..., None] * shift
        layer.lod[window] += kernel * p.photo[i] * p.lod[i]
        layer.seen[window] += kernel * p.photo[i] * p.seen[i]
        layer.color[window] += (kernel * p.body[i])[..., None] * p.color[i]
    everything = (slice(0, height), slice(0, width))
    out.add(layer, everything, layer.total > 0)
    return out.picture()


class _Composite:
    """Closed layers over one another, front to back (steps 4 and 5)."""

    def __init__(self, texture: TextureLevels, camera: Camera, photo_camera: Camera) -> None:
        self.texture, self.camera, self.photo_camera = texture, camera, photo_camera
        shape = (camera.height, camera.width)
        self.color = np.zeros((*shape, 3))
        self.alpha = np.zeros(shape)
        self.depth = np.full(shape, np.inf)
        self.from_photo = np.zeros(shape)
        self.shift = np.zeros((*shape, 2))
        self.last_shift = np.full((*shape, 2), np.inf)  # of the previous layer
        self.last_through = np.ones(shape)  # transmittance before it
        self.last_whole = np.zeros(shape)  # its coverage

    def add(self, layer: _Layer, window: tuple[slice, slice], closed: np.ndarray) -> None:
        """Composites the layer at the pixels `closed` of `window` and empties it there."""
        rows, columns = np.nonzero(closed)
        rows, columns = rows + window[0].start, columns + window[1].start
        at = (rows, columns)
        total, body = layer.total[at], layer.body[at]
        photo = np.maximum(total - body, 0)
        weight = np.maximum(photo, 1e-30)
        shift = layer.shift[at] / weight[:, None]
        ratio = self.photo_camera.focal / self.camera.focal
        xy = np.stack([columns, rows], 1) + 0.5 - [self.camera.cx, self.camera.cy]
        look = xy * ratio + [self.photo_camera.cx, self.photo_camera.cy] + shift
        sample = sample_texture(self.texture, look, layer.lod[at] / weight)
        matte = (sample[:, 3] * layer.matted[at] + layer.unmatted[at]) / weight
        matte = np.where(photo > 1e-9 * total, matte, 0.0)
        whole = _coverage(total, np.linalg.norm(layer.slope[at], axis=1))
        solid = _coverage(body, np.linalg.norm(layer.body_slope[at], axis=1))
        alpha = matte * whole + (1 - matte) * solid
        shown = photo * matte
        mixed = (shown[:, None] * sample[:, :3] + layer.color[at]) / np.maximum(
            shown + body, 1e-30
        )[:, None]
        size = np.array([self.photo_camera.width, self.photo_camera.height])
        within = ((look > 0) & (look < size)).all(1)  # elsewhere the texture is made up
        seen = within * layer.seen[at] / weight * shown / np.maximum(shown + body, 1e-30)
        with np.errstate(invalid="ignore"):
            same = np.linalg.norm(shift - self.last_shift[at], axis=1) < RULES.same_point
        clear = 1 - self.alpha[at]
        before = np.where(same, self.last_through[at], clear)
        through = before * np.where(same, 1 - self.last_whole[at], 1) * alpha
        self.last_through[at] = before
        self.last_whole[at] = np.where(same, 1 - (1 - self.last_whole[at]) * (1 - whole), whole)
        self.last_shift[at] = np.where((photo > 1e-9 * total)[:, None], shift, np.inf)
        first = (self.depth[at] == np.inf) & (alpha > 0)
        self.depth[at] = np.where(first, layer.depth[at] / total, self.depth[at])
        self.shift[at] = np.where(first[:, None], shift, self.shift[at])
        self.color[at] += through[:, None] * mixed
        self.from_photo[at] += through * seen
        self.alpha[at] += through
        for array in vars(layer).values():
            array[at] = 0.0

    def picture(self) -> Picture3D:
        arrays = (self.color, self.alpha, self.depth, self.from_photo, self.shift)
        return Picture3D(*(a.astype(np.float32) for a in arrays))


def _ramp(value: np.ndarray, zero: float, one: float) -> np.ndarray:
    t = np.clip((value - zero) / (one - zero), 0, 1)
    return t * t * (3 - 2 * t)


def _coverage(total: np.ndarray, slope: np.ndarray) -> np.ndarray:
    edge = (total - RULES.surface_level) / (RULES.edge_width * slope + 1e-6)
    return np.clip(0.5 + edge, 0, 1)


def sample_texture(texture: TextureLevels, look: np.ndarray, lod: np.ndarray) -> np.ndarray:
    """Straight colour and alpha (n, 4) at photo px (n, 2), filtered for `lod` (n,).

    The two nearest levels are mixed; the full-size one is sampled bicubically (Catmull-Rom: it
    returns a pixel's own value at its centre), halved ones bilinearly. Outside the crop alpha
    is 0.
    """
    lod = np.clip(lod, 0, len(texture.levels) - 1)
    lower = np.floor(lod).astype(int)
    result = np.zeros((len(look), 4))
    for level, image in enumerate(texture.levels):
        for use, mix in ((lower == level, 1 - (lod - lower)), (lower + 1 == level, lod - lower)):
            at = np.flatnonzero(use & (mix > 0))
            if len(at):
                xy = (look[at] - [texture.left, texture.top]) / 2**level - 0.5
                values = _cubic(image, xy) if level == 0 else _linear(image, xy)
                result[at] += mix[at, None] * values
    return result


def _linear(image: np.ndarray, xy: np.ndarray) -> np.ndarray:
    return _taps(image, xy, (0, 1), lambda t: [1 - t, t])


def _cubic(image: np.ndarray, xy: np.ndarray) -> np.ndarray:
    def weights(t: np.ndarray) -> list[np.ndarray]:
        return [
            ((-0.5 * t + 1.0) * t - 0.5) * t,
            (1.5 * t - 2.5) * t * t + 1.0,
            ((-1.5 * t + 2.0) * t + 0.5) * t,
            (0.5 * t - 0.5) * t * t,
        ]

    return np.clip(_taps(image, xy, (-1, 0, 1, 2), weights), 0, 1)


def _taps(image, xy, offsets, weights):
    height, width = image.shape[:2]
    base = np.floor(xy).astype(int)
    wx, wy = weights(xy[:, 0] - base[:, 0]), weights(xy[:, 1] - base[:, 1])
    result = np.zeros((len(xy), 4))
    for oy, a in zip(offsets, wy, strict=True):
        for ox, b in zip(offsets, wx, strict=True):
            j, i = base[:, 0] + ox, base[:, 1] + oy
            is_inside = (j >= 0) & (j < width) & (i >= 0) & (i < height)
            value = image[i.clip(0, height - 1), j.clip(0, width - 1)].astype(np.float64)
            value[~is_inside, 3] = 0.0
            result += (a * b)[:, None] * value
    return result
