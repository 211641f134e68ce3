"""The specification of the picture, slow and clear; every other renderer is compared with it.

1. Each Gaussian is projected (EWA, Zwicker et al. 2002). Its alpha on a pixel is
   w (exp(-q/2) - tail), q the squared Mahalanobis distance and w its opacity, times the facing
   weight; `rules.SPLATTINGS` says what differs between kinds of assets: the screen
   filter, the tail, the least and most alpha.
2. From the same covariances follows the affine map that says which point of the photo it shows
   at a pixel: u0 + A d, A = J0 Sigma F^T J1^T (J1 F Sigma F^T J1^T)^-1.
3. Gaussians that show nothing of the photo, and are no surface, are composited one by one, front
   to back by the depth of their means, premultiplied: 3D Gaussian splatting.
4. All others are put together in layers, pixel by pixel (surface splatting, Zwicker et al. 2001).
   A layer begins at its *front*: the nearest sample that is no mere tail and not in a layer
   before. What agrees with the front in depth and in what it shows of the photo belongs to it;
   membership fades, so that no sample jumps from layer to layer. Nothing depends on the order in
   which Gaussians come, and nothing has to be sorted. The last layer takes what is left.
5. Within a layer the *points of the photo* are averaged, and the photo is then looked up once:
   neighbours differ by a fraction of a pixel in where they look, and a mean of positions stays
   sharp where a mean of colours would blur. Colours of what the photo does not show are averaged
   as colours. Where some Gaussians show the photo and others an invented picture of the same
   surface, either is looked up at its own mean, and both are mixed by their shares.
6. A layer's alpha is the matte's where the photo is carried along and the rim has not turned
   towards the camera; otherwise it ends where the kernel sum falls below a level, antialiased
   by the sum's own gradient (a surface), or is 1 - prod(1 - alpha) (other assets). Of an edged
   surface all that the photo has shown keeps the matte, and the rest covers what lies beneath;
   where the rim has turned towards the camera, the inner half of the matte's edge is closed.
7. Layers are composited front to back, premultiplied. As far as two successive layers show the
   same point of the photo they are one surface that was split, and their coverage adds up under
   one matte.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.arrays import F32, F64
from ..base.camera import Camera
from .posed import PosedSplats, projection_jacobians, view_limits
from .rules import LAYERS, RULES, Splatting
from .texture import TextureLevels, sample_texture


def project(splats: PosedSplats, camera: Camera, photo_camera: Camera) -> Projected:
    """Step 1 and 2. `camera` is the view's, `photo_camera` the photo's."""
    rest, kind = splats.rest, splats.rest.splatting
    texture, gaussians = rest.lifted.texture, rest.lifted.gaussians
    near = RULES.near * splats.gap
    is_there = (splats.means[:, 2] > near) & np.isfinite(splats.means).all(1)
    index = np.flatnonzero(is_there & np.isfinite(splats.linear).all((1, 2)))
    means, motion = splats.means[index], splats.linear[index]
    jacobian = projection_jacobians(_flattened(means, photo_camera, kind), camera.focal)
    world = motion @ rest.covariances[index] @ motion.transpose(0, 2, 1)
    screen = jacobian @ world @ jacobian.transpose(0, 2, 1)
    ridge = RULES.ridge * np.trace(screen, axis1=1, axis2=2) + 1e-12
    inverse = np.linalg.inv(screen + ridge[:, None, None] * np.eye(2))
    seen = texture.visibility[index].astype(np.float64)
    cosine = moved_cosines(rest.normals[index], motion, means)
    pictures, look, zoomed = rest.pictures[index], texture.u0[index], rest.zoom[index]
    aside = np.zeros(len(index), bool)
    if rest.sides is not None:  # where an invented picture shows the surface better
        zoom = rest.sides.zoom[index]
        least = np.where(zoom < 0, RULES.fringe_aside, RULES.look_aside)
        aside = (zoom != 0) & (rest.cosines[index] < least * cosine)
        pictures = np.where(aside[:, None, None], rest.side_pictures[index], pictures)
        look = np.where(aside[:, None], rest.sides.at[index], look)
        zoomed = np.where(aside, np.abs(zoom), zoomed)
    a = pictures @ motion.transpose(0, 2, 1) @ jacobian.transpose(0, 2, 1) @ inverse
    filtered = screen + kind.filter * np.eye(2)
    conic = np.linalg.inv(filtered).astype(np.float64)
    # Where the filter spreads a small Gaussian over more pixels, it must not gain weight by that.
    larger = np.sqrt(np.linalg.det(screen).clip(0) / np.linalg.det(filtered))
    compensation = larger if kind.is_compensated else np.ones(len(index))
    singular = np.linalg.svd(a, compute_uv=False).astype(np.float64)
    volume = np.cbrt(np.abs(np.linalg.det(motion)))
    zoom = camera.focal / means[:, 2] / zoomed
    stretch = singular[:, 1] * zoom * volume
    carried = smoothstep(stretch, RULES.streak_end, RULES.streak_start)
    turned = cosine - rest.cosines[index]
    if kind.is_edged:
        cosine = np.where(seen == 0, np.minimum(cosine, turned), cosine)
    solidity = texture.solidity[index].astype(np.float64)
    if not splats.is_layered:  # no brim where no photo is carried
        solidity = np.ones(len(index))
    ramp, front = RULES.facing_ramp, np.ones(len(index))
    if kind.is_surface:
        front = np.clip((cosine - ramp * (1 - seen)) / ramp + 1, 0, 1)
    fades = (RULES.brim_end, RULES.brim_start)
    if kind.is_edged:
        fades = (RULES.edged_end, RULES.edged_start)
    brim = smoothstep(np.abs(cosine), *fades)
    facing = solidity * front + (1 - solidity) * brim
    matted = smoothstep(stretch, RULES.matte_end, RULES.matte_start)
    if kind.is_edged:
        kept = smoothstep(turned, RULES.closing_end, RULES.closing_start)
        matted *= seen * (solidity + (1 - solidity) * kept)
    else:
        matted *= smoothstep(turned, RULES.turned_end, RULES.turned_start)
    matted *= ~aside
    photo = np.where(aside, carried, seen * carried) if kind.has_colors else carried
    body = (1 - photo) * solidity
    seen = ~aside * (np.ones(len(index)) if kind.has_colors else seen)
    weight = gaussians.opacities[index] * facing * compensation
    centre = camera.project(means)
    ratio = photo_camera.focal / camera.focal  # photo px per view px
    unmoved = (centre - [camera.cx, camera.cy]) * ratio + [photo_camera.cx, photo_camera.cy]
    ends = -2 * np.log((kind.tail + kind.least / np.maximum(weight, 1e-30)).clip(1e-30, 1))
    extent = np.sqrt(ends[:, None] * np.stack([filtered[:, 0, 0], filtered[:, 1, 1]], axis=1))
    covariance_z = (world @ jacobian.transpose(0, 2, 1))[:, 2]  # (N, 2) depth against screen
    projected = Projected(
        centre=centre,
        conic=np.stack([conic[:, 0, 0], conic[:, 0, 1], conic[:, 1, 1]], axis=1),
        extent=extent,
        depth=means[:, 2],
        slope=(covariance_z[:, None] @ inverse)[:, 0],
        shift=look - unmoved,
        shift_slope=a - ratio * np.eye(2),
        magnified=singular[:, 0],
        weight=weight,
        photo=photo,
        body=body,
        matted=matted,
        solidity=solidity,
        edged=(1 - matted) * solidity * kind.is_edged,
        seen=seen,
        aside=aside.astype(np.float64),
        color=gaussians.colors[index].astype(np.float64),
    )
    order = np.argsort(projected.depth.astype(np.float32), kind="stable")
    return Projected(**{name: getattr(projected, name)[order] for name in vars(projected)})


def _flattened(means: F64, photo_camera: Camera, kind: Splatting) -> F64:
    """Where the Jacobians are taken: for clouds not far beyond the photo's edge, as in 3DGS.

    There the projection is anything but affine, and would smear a large Gaussian over the picture.
    """
    if kind.is_surface:
        return means
    x, y = view_limits(photo_camera)
    sides = np.clip(means[:, :2] / means[:, 2:], [-x, -y], [x, y])
    return np.concatenate([sides * means[:, 2:], means[:, 2:]], axis=1)


def moved_cosines(normals: F64, motion: F64, means: F64) -> F64:
    """(N,) of the moved normals with the directions to the camera. Normals move by cofactors."""
    cofactor = np.stack(
        [np.cross(motion[:, (k + 1) % 3], motion[:, (k + 2) % 3]) for k in range(3)], axis=1
    )
    moved = np.sign(np.linalg.det(motion))[:, None] * (cofactor @ normals[:, :, None])[:, :, 0]
    lengths = np.linalg.norm(moved, axis=1) * np.linalg.norm(means, axis=1)
    return -(moved * means).sum(1) / np.maximum(lengths, 1e-30)


def _sampled(p: Projected, i: int, splats: PosedSplats, camera: Camera) -> GaussianSamples | None:
    """Gaussian `i` on the pixels that it may touch, None where there are none."""
    kind = splats.rest.splatting
    x0, y0 = np.floor(p.centre[i] - p.extent[i]).astype(int).clip(0, (camera.width, camera.height))
    x1, y1 = np.ceil(p.centre[i] + p.extent[i]).astype(int).clip(0, (camera.width, camera.height))
    if x0 >= x1 or y0 >= y1 or p.weight[i] * (p.photo[i] + p.body[i]) <= 0:
        return None
    dx, dy = np.meshgrid(
        np.arange(x0, x1) + 0.5 - p.centre[i, 0], np.arange(y0, y1) + 0.5 - p.centre[i, 1]
    )
    xx, xy, yy = p.conic[i]
    bell = np.exp(-0.5 * (xx * dx * dx + 2 * xy * dx * dy + yy * dy * dy))
    alpha = np.minimum(p.weight[i] * (bell - kind.tail), kind.most)
    alpha = np.where((alpha > 0) & (alpha >= kind.least), alpha, 0.0)
    gradient = -p.weight[i] * bell[..., None] * np.stack([xx * dx + xy * dy, xy * dx + yy * dy], -1)
    depth = p.depth[i] + p.slope[i, 0] * dx + p.slope[i, 1] * dy
    shift = p.shift[i] + np.stack([dx, dy], -1) @ p.shift_slope[i].T
    window = (slice(y0, y1), slice(x0, x1))
    return GaussianSamples(window, alpha, np.where(alpha[..., None] > 0, gradient, 0), depth, shift)


def render(
    splats: PosedSplats, texture: TextureLevels, camera: Camera, photo_camera: Camera
) -> Picture3D:
    """The object as `camera` sees it. `camera` gives the size of the picture."""
    photo_camera = splats.rest.carried(photo_camera)
    p = project(splats, camera, photo_camera)
    samples = [_sampled(p, i, splats, camera) for i in range(len(p.depth))]
    there = [(i, s) for i, s in enumerate(samples) if s is not None]
    if not splats.is_layered:
        return _composite_one_by_one(p, there, camera)
    out = ReferenceComposite(texture, camera, photo_camera, splats.rest.splatting)
    fronts: list[_Front] = []
    for layer in range(LAYERS):
        shares = {i: _remaining(p, i, s, fronts, splats) for i, s in there}
        front = _find_front(p, there, shares, camera)
        if np.isinf(front.depth).all():
            break
        sums = Sums(camera.height, camera.width)
        for i, s in there:
            member = shares[i] * (front.depth[s.window] < np.inf)
            if layer < LAYERS - 1:
                member = member * _membership(p, i, s, front, splats)
            sums.add(p, i, s, member)
        out.add(sums)
        fronts.append(front)
    return out.picture()


def _composite_one_by_one(
    p: Projected, there: list[tuple[int, GaussianSamples]], camera: Camera
) -> Picture3D:
    """Step 3. The depth is that of the sample with which alpha reaches a half, else the mean."""
    shape = (camera.height, camera.width)
    color, alpha = np.zeros((*shape, 3)), np.zeros(shape)
    median, mean = np.full(shape, np.inf), np.zeros(shape)
    for i, s in there:
        through = (1 - alpha[s.window]) * s.alpha
        color[s.window] += through[..., None] * p.color[i]
        mean[s.window] += through * s.depth
        alpha[s.window] += through
        is_half = np.isinf(median[s.window]) & (alpha[s.window] >= MEDIAN)
        median[s.window] = np.where(is_half, s.depth, median[s.window])
    with np.errstate(divide="ignore", invalid="ignore"):
        fallback = np.where(alpha > 0, mean / alpha, np.inf)
    depth = np.where(np.isinf(median), fallback, median)
    nothing = np.zeros(shape)
    arrays = (color, alpha, depth, nothing, np.dstack([nothing, nothing]))
    return Picture3D(*(a.astype(np.float32) for a in arrays))


@dataclass(frozen=True, eq=False)
class _Front:
    """Where a layer begins, pixel by pixel."""

    depth: F64  # (h, w), inf where there is no further layer
    shift: F64  # (h, w, 2)
    shows: F64  # (h, w) 1: the photo, -1: an invented picture, 0: neither


def _find_front(
    p: Projected, there: list[tuple[int, GaussianSamples]], shares: dict[int, F64], camera: Camera
) -> _Front:
    """The nearest samples of those that are left: `shares` of each, (h, w) of its box."""
    shape = (camera.height, camera.width)
    depth, shift = np.full(shape, np.inf), np.zeros((*shape, 2))
    shows = np.zeros(shape)
    for i, s in there:
        alpha = shares[i] * s.alpha * (p.photo[i] + p.body[i])
        nearer = (alpha >= RULES.least_front) & (s.depth < depth[s.window])
        depth[s.window] = np.where(nearer, s.depth, depth[s.window])
        shift[s.window] = np.where(nearer[..., None], s.shift, shift[s.window])
        shows[s.window] = np.where(nearer, _shows(p, i), shows[s.window])
    return _Front(depth, shift, shows)


def _shows(p: Projected, i: int) -> float:
    """1: the photo, -1: an invented picture, 0: neither."""
    return float(p.photo[i] > 0) * (1 - 2 * float(p.aside[i]))


def _membership(
    p: Projected, i: int, s: GaussianSamples, front: _Front, splats: PosedSplats
) -> F64:
    """(h, w) of a box: how much of a sample belongs to the layer of `front`."""
    depth, shift = front.depth[s.window], front.shift[s.window]
    there = np.isfinite(depth)
    away = np.where(there, np.abs(s.depth - np.where(there, depth, 0)) / splats.gap, 1e9)
    if p.photo[i] > 0:
        looks = np.linalg.norm(s.shift - shift, axis=-1) / splats.texture_gap
        is_alike = front.shows[s.window] * _shows(p, i) > 0
        away = np.where(is_alike, np.maximum(away, looks), away)
    return smoothstep(away**2, RULES.fade**2, 1.0)


def _remaining(
    p: Projected, i: int, s: GaussianSamples, fronts: list[_Front], splats: PosedSplats
) -> F64:
    """(h, w) of a box: the share of a sample that belongs to none of the layers so far."""
    left = np.ones(s.alpha.shape)
    for front in fronts:
        left = left * (1 - _membership(p, i, s, front, splats))
    return left


# The layers: steps 5 to 7.

MEDIAN = 0.5  # of alpha: where the object is


@dataclass(frozen=True, eq=False)
class Picture3D:
    """A rendered object."""

    color: F32  # (h, w, 3) sRGB in [0, 1], premultiplied
    alpha: F32  # (h, w)
    # (h, w) world units: of the layer with which alpha, from the front, reaches a half; else of the
    # first that is visible; inf where there is none
    depth: F32
    from_photo: F32  # (h, w) share of the pixel that shows the photo at its own pixels' detail
    shift: F32  # (h, w, 2) photo px from where the pixel is to where it looks, the same layer


@dataclass(frozen=True, eq=False)
class Projected:
    """Gaussians on the screen, in the order of their depth."""

    centre: F64  # (N, 2) view px
    conic: F64  # (N, 3) inverse of the filtered screen covariance: xx, xy, yy
    extent: F64  # (N, 2) view px, half-size of the box outside which alpha is 0
    depth: F64  # (N,) world units
    slope: F64  # (N, 2) depth per view px, within the Gaussian
    shift: F64  # (N, 2) photo px: u0 minus the photo point at `centre`
    shift_slope: F64  # (N, 2, 2) per view px: A minus that of the unmoved photo
    magnified: F64  # (N,) photo px per view px, the larger
    weight: F64  # (N,) alpha's, see step 1
    photo: F64  # (N,) share of alpha that shows the photo
    body: F64  # (N,) share that shows the Gaussian's own colour
    matted: F64  # (N,) how much the matte's edge is to be trusted
    solidity: F64  # (N,) alpha of the photo part where it is not
    edged: F64  # (N,) share of the photo part that ends with the surface, as bodies do
    seen: F64  # (N,) 1 = the photo part was visible in the photo
    aside: F64  # (N,) 1 = the photo part is an invented picture
    color: F64  # (N, 3)


@dataclass(frozen=True, eq=False)
class GaussianSamples:
    """A Gaussian at the pixels of its box."""

    window: tuple[slice, slice]
    alpha: F64  # (h, w)
    gradient: F64  # (h, w, 2) of alpha, per px
    depth: F64  # (h, w)
    shift: F64  # (h, w, 2)


class Sums:
    """Over the samples of one layer, per pixel."""

    def __init__(self, height: int, width: int) -> None:
        self.total = np.zeros((height, width))  # of alpha
        self.body = np.zeros((height, width))  # of it, what the photo does not give
        self.slope = np.zeros((height, width, 2))  # gradient of `total`
        self.ended = np.zeros((height, width))  # of it, what ends with the surface
        self.ended_slope = np.zeros((height, width, 2))
        self.clear = np.ones((height, width))  # product of 1 - alpha
        self.body_clear = np.ones((height, width))
        self.depth = np.zeros((height, width))
        self.shift = np.zeros((height, width, 2))
        self.side = np.zeros((height, width))  # of the photo part, what is invented
        self.side_shift = np.zeros((height, width, 2))
        self.matted = np.zeros((height, width))
        self.unmatted = np.zeros((height, width))  # solidity of the part that is not matted
        self.magnified = np.zeros((height, width))
        self.seen = np.zeros((height, width))
        self.color = np.zeros((height, width, 3))

    def add(self, p: Projected, i: int, s: GaussianSamples, member: F64) -> None:
        """Adds a Gaussian's samples; `member` (h, w) is how much of them belongs here."""
        at, alpha = s.window, member * s.alpha
        gradient = member[..., None] * s.gradient
        photo, body = alpha * p.photo[i], alpha * p.body[i]
        both = p.photo[i] + p.body[i]
        self.total[at] += alpha * both
        self.body[at] += body
        self.slope[at] += gradient * both
        ended = p.body[i] + p.photo[i] * p.edged[i]
        self.ended[at] += alpha * ended
        self.ended_slope[at] += gradient * ended
        self.clear[at] *= 1 - np.minimum(alpha * both, 1)
        self.body_clear[at] *= 1 - np.minimum(body, 1)
        self.depth[at] += alpha * both * s.depth
        aside = photo * p.aside[i]
        self.shift[at] += (photo - aside)[..., None] * s.shift
        self.side[at] += aside
        self.side_shift[at] += aside[..., None] * s.shift
        self.matted[at] += photo * p.matted[i]
        self.unmatted[at] += photo * (1 - p.matted[i]) * p.solidity[i]
        self.magnified[at] += photo * max(p.magnified[i] / RULES.sharp, 1.0)
        self.seen[at] += photo * p.seen[i]
        self.color[at] += body[..., None] * p.color[i]


class ReferenceComposite:
    """Layers over one another, front to back (steps 5 to 7)."""

    def __init__(
        self, texture: TextureLevels, camera: Camera, photo_camera: Camera, kind: Splatting
    ) -> None:
        self.texture, self.camera, self.photo_camera = texture, camera, photo_camera
        self.kind = kind
        shape = (camera.height, camera.width)
        self.color = np.zeros((*shape, 3))
        self.alpha = np.zeros(shape)
        self.depth = np.full(shape, np.inf)
        self.from_photo = np.zeros(shape)
        self.shift = np.zeros((*shape, 2))
        self.last_shift = np.zeros((*shape, 2))  # of the previous layer
        self.last_share = np.zeros(shape)  # of it, that shows the photo itself
        self.last_through = np.ones(shape)  # transmittance before it
        self.last_whole = np.zeros(shape)  # its coverage

    def add(self, layer: Sums) -> None:
        """Composites the next layer."""
        at = np.nonzero(layer.total > 0)
        total, body = layer.total[at], layer.body[at]
        photo = np.maximum(total - body, 0)
        is_photo = photo > 1e-6 * total
        weight = np.maximum(photo, 1e-30)
        side = np.where(is_photo, layer.side[at] / weight, 0)
        own = np.maximum(photo - layer.side[at], 0)
        is_own, is_side = own > 1e-6 * total, side > 1e-6
        shift = layer.shift[at] / np.maximum(own, 1e-30)[:, None]
        aside = layer.side_shift[at] / np.maximum(layer.side[at], 1e-30)[:, None]
        lod = np.log2(np.maximum(layer.magnified[at] / weight, 1.0))
        look = self._looks(at, shift, is_own)
        sample = sample_texture(self.texture, look, lod)
        sample[~is_own, 3] = 0.0
        invented = sample_texture(self.texture, self._looks(at, aside, is_side), lod)[:, :3]
        matte = (sample[:, 3] * layer.matted[at] + layer.unmatted[at]) / weight
        if self.kind.is_edged:
            turned = 1 - (layer.matted[at] + layer.unmatted[at]) / weight
            closed = np.clip(turned / RULES.closing_share, 0, 1)
            closed *= smoothstep(sample[:, 3], RULES.closed_start, RULES.closed_end)
            matte += (1 - matte) * closed
        matte = np.where(is_photo, matte, 0.0)
        # The photo counts as far as the matte has something of it, invented pictures are whole.
        share = np.where(is_own, np.minimum(side * is_side / np.maximum(matte, 1e-30), 1), is_side)
        sample[:, :3] += share[:, None] * (invented - sample[:, :3])
        shift = np.where(is_own[:, None], shift, aside)
        visible = np.minimum((1 - share) / np.maximum(1 - side, 1e-6), 1) * layer.seen[at]
        if self.kind.is_surface:
            whole = _coverage(total, np.linalg.norm(layer.slope[at], axis=1))
            slope = np.linalg.norm(layer.ended_slope[at], axis=1)
            solid = _coverage(layer.ended[at], slope)
        else:
            whole, solid = 1 - layer.clear[at], 1 - layer.body_clear[at]
        alpha = matte * whole + (1 - matte) * solid
        shown = photo * matte
        mixed = (shown[:, None] * sample[:, :3] + layer.color[at]) / np.maximum(
            shown + body, 1e-30
        )[:, None]
        size = np.array([self.photo_camera.width, self.photo_camera.height])
        within = is_own & ((look > 0) & (look < size)).all(1)  # elsewhere the texture is made up
        seen = within * visible / weight * shown / np.maximum(shown + body, 1e-30)
        distance = np.linalg.norm(shift - self.last_shift[at], axis=1)
        same = smoothstep(distance, RULES.apart, RULES.same_point)
        share = np.where(is_photo, np.maximum(1 - side, 0) * photo / total, 0.0)
        same = same * share * self.last_share[at]
        clear = 1 - self.alpha[at]
        apart, split = clear * alpha, self.last_through[at] * (1 - self.last_whole[at]) * alpha
        through = np.minimum(apart + same * (split - apart), clear)
        self.last_through[at] = clear + same * (self.last_through[at] - clear)
        covered = same * self.last_whole[at]
        self.last_whole[at] = 1 - (1 - covered) * (1 - whole)
        self.last_shift[at], self.last_share[at] = shift, share
        first = np.isinf(self.depth[at]) & (alpha > RULES.visible)
        first |= (self.alpha[at] < MEDIAN) & (self.alpha[at] + through >= MEDIAN)
        self.depth[at] = np.where(first, layer.depth[at] / total, self.depth[at])
        self.shift[at] = np.where((first & is_photo)[:, None], shift, self.shift[at])
        self.color[at] += through[:, None] * mixed
        self.from_photo[at] += through * seen
        self.alpha[at] += through

    def _looks(self, at: tuple[np.ndarray, ...], shift: F64, is_there: np.ndarray) -> F64:
        """(n, 2) px of the photo that is shown at pixels `at` with a `shift` (n, 2), else 0."""
        ratio = self.photo_camera.focal / self.camera.focal
        xy = np.stack([at[1], at[0]], 1) + 0.5 - [self.camera.cx, self.camera.cy]
        look = xy * ratio + [self.photo_camera.cx, self.photo_camera.cy] + shift
        return np.where(is_there[:, None], look, 0)

    def picture(self) -> Picture3D:
        """Return the picture of all layers so far."""
        arrays = (self.color, self.alpha, self.depth, self.from_photo, self.shift)
        return Picture3D(*(a.astype(np.float32) for a in arrays))


def smoothstep(value: np.ndarray, zero: float, one: float) -> np.ndarray:
    """Rise smoothly from 0 at `zero` to 1 at `one`."""
    t = np.clip((value - zero) / (one - zero), 0, 1)
    return t * t * (3 - 2 * t)


def _coverage(total: np.ndarray, slope: np.ndarray) -> np.ndarray:
    edge = (total - RULES.surface_level) / (RULES.edge_width * slope + 1e-6)
    return np.clip(0.5 + edge, 0, 1)
