"""Registration: an object from elsewhere put where the photo shows it (BACKENDS section 2).

Every rotation is tried on small pictures (`placement_search`), the best are refined on larger and
larger ones (`placement_refine`), and up to three poses that differ are proposed. Silhouettes and
colours count, under the light that explains the photo best. The score of a proposal is the IoU of
the silhouettes less the colour error; nothing is accepted that lowers it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ...base.arrays import F32, F64, freeze
from ...base.camera import Camera
from ...base.progress import Progress, part, silent
from ...base.threads import core_count, in_threads
from ...document.gaussians import Gaussians
from .. import LiftError
from .search import angles, search
from .sketch import COVERAGE, Matches, Surfels, even_surfels, own_frame
from .sketch import NEAR_MATCH as NEAR
from .view import (
    Agreement,
    RegistrationView,
    Stance,
    Target,
    agreement,
    fitted_light,
    lit,
    sketched,
)

# The fine search of a registration: Levenberg and Marquardt on silhouette and colour.
#
# Residuals are differences of small pictures, a little blurred; they change smoothly with the pose,
# so that seven slightly moved pictures are its derivative. The light on the object is found anew in
# each step and held while the pose moves.

BLUR = 0.9  # px of the view, of the silhouettes' and the colours' differences
COLOUR = 1.4  # weight of a difference of colour beside one of coverage
ROBUST = 0.25  # sRGB: a larger difference is no longer believed in full
STEP = np.array([0.5, 0.5, 0.5, 0.4, 0.4, 0.5, 0.06])  # of the derivative: px, but for log focal
FOCAL_PRIOR = 0.002  # x the mask's area: what one natural logarithm of the focal length costs
OUTLINE = 2.0  # x the object's size: px^2 of coverage that change where it is a px aside
FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 3e-2, 1e-4, 1e3
ENOUGH = 0.02  # px: a smaller step is the last one


@dataclass(frozen=True, eq=False)
class Fit:
    """A stance and how well it agrees."""

    stance: Stance
    agreement: Agreement


def refine(
    surfels: Surfels,
    start: Stance,
    view: RegistrationView,
    photo: Camera,
    is_focal_free: bool,
    steps: int,
    matches: Matches | None = None,
) -> Fit:
    """The stance near `start` that agrees best with the view; never one that scores less."""
    problem = _Problem(surfels, view, photo, is_focal_free, matches)
    picture = problem.picture(start)
    stance, damping = start, FIRST_DAMPING
    best = Fit(start, agreement(picture, view, support(matches, start, photo)))
    for _ in range(steps):
        light = problem.light(picture)
        step, damping = problem.descent(stance, picture, light, damping)
        if step is None:
            break
        stance = stance.moved(step, problem.radius(stance))
        picture = problem.picture(stance)
        found = agreement(picture, view, support(matches, stance, photo))
        if found.score > best.agreement.score:
            best = Fit(stance, found)
        if np.abs(step[:6]).max() < ENOUGH / problem.zoom:
            break
    return best


def support(matches: Matches | None, stance: Stance, photo: Camera) -> float:
    """Share of the matches, in the surfels' frame, that agree with a stance; 0 without any."""
    if matches is None:
        return 0.0
    return matches.support(stance.matrix(photo), replace(photo, focal=stance.focal))


class _Problem:
    """Residuals and their derivative. A step is in photo px, but for the logarithm of the focal."""

    def __init__(
        self,
        surfels: Surfels,
        view: RegistrationView,
        photo: Camera,
        is_focal_free: bool,
        matches: Matches | None,
    ) -> None:
        self.surfels, self.view, self.photo, self.matches = surfels, view, photo, matches
        self.zoom = view.camera.focal / photo.focal  # px of the view per px of the photo
        self.count = 7 if is_focal_free else 6
        self.area = float(view.mask.sum())

    def picture(self, stance: Stance) -> F32:
        return sketched(self.surfels, stance, self.view, self.photo)

    def radius(self, stance: Stance) -> float:
        """Photo px: a turn by an angle moves the rim by about that much times the angle."""
        return 0.4 * stance.size

    def descent(
        self, stance: Stance, picture: F32, light: F32, damping: float
    ) -> tuple[F64 | None, float]:
        """A step (7,) that lowers the energy, None where none does, and the next damping."""
        residual, jacobian = self.linearised(stance, picture, light)
        hessian, gradient = jacobian.T @ jacobian, jacobian.T @ residual
        # By the mean of the diagonal, too: what the picture hardly shows must not run away.
        diagonal = np.diag(hessian) + 0.05 * np.diag(hessian).mean()
        while damping < MOST_DAMPING:
            step = -np.linalg.solve(hessian + np.diag(damping * diagonal + 1e-12), gradient)
            step = np.pad(self.limited(step.astype(np.float64)), (0, 7 - self.count))
            moved = stance.moved(step, self.radius(stance))
            if self.energy(moved, self.picture(moved), light) < float(residual @ residual):
                return step, max(damping / 3.0, LEAST_DAMPING)
            damping *= 4.0
        return None, damping

    def limited(self, step: F64) -> F64:
        """No step moves anything farther than the linearisation can know."""
        most = max(float(np.abs(step[:6]).max()) * self.zoom / 6.0, 1.0)
        if len(step) > 6:
            most = max(most, abs(float(step[6])) / 0.25)
        return step / most

    def light(self, picture: F32) -> F32:
        view = self.view
        both = np.minimum(picture[..., COVERAGE] * view.within, view.mask)
        return fitted_light(picture, view, both)

    def residual(self, stance: Stance, picture: F32, light: F32) -> F64:
        view = self.view
        coverage = picture[..., COVERAGE] * view.within
        both = np.minimum(coverage, view.mask)
        rest = lit(picture, light) - view.pixels
        rest = rest / np.sqrt(1 + (rest / ROBUST) ** 2)
        stack = np.dstack([coverage - view.mask, COLOUR / np.sqrt(3) * both[..., None] * rest])
        stack = cv2.GaussianBlur(stack, (0, 0), BLUR)
        prior = np.log(stance.focal / self.photo.focal) * np.sqrt(FOCAL_PRIOR * self.area)
        pull = [] if self.matches is None else self.pull(self.matches, stance)
        return np.concatenate([stack.ravel().astype(np.float64), pull, [prior]])

    def pull(self, matches: Matches, stance: Stance) -> F64:
        """(2 n,) residuals of the matches.

        All of them a view's px aside cost what it costs the outline to be so; far off ones nothing
        more (Geman & McClure 1985).
        """
        gaps = matches.gaps(stance.matrix(self.photo), replace(self.photo, focal=stance.focal))
        gaps /= np.sqrt(1 + (gaps * gaps).sum(1, keepdims=True))
        size = np.sqrt(self.area)  # px of the view
        return (gaps * (NEAR * size) * np.sqrt(OUTLINE * size / matches.reliable)).ravel()

    def energy(self, stance: Stance, picture: F32, light: F32) -> float:
        residual = self.residual(stance, picture, light)
        return float(residual @ residual)

    def linearised(self, stance: Stance, picture: F32, light: F32) -> tuple[F64, F64]:
        """Residuals (n,) and their derivative (n, count) with the step."""
        residual = self.residual(stance, picture, light)
        jacobian = np.empty((len(residual), self.count))
        for k in range(self.count):
            step = np.zeros(7)
            step[k] = STEP[k] / (1.0 if k == 6 else self.zoom)
            moved = stance.moved(step, self.radius(stance))
            shifted = self.residual(moved, self.picture(moved), light)
            jacobian[:, k] = (shifted - residual) / step[k]
        return residual, jacobian


FOCALS = (0.75, 1.6)  # x the camera's: where a free focal length is looked for at first


@dataclass(frozen=True)
class Level:
    """The fineness of one round of the registration."""

    size: int  # px, the view's side
    surfels: int
    kept: int  # stances that are refined; a cube has 24 turns that only its colours tell apart
    steps: int  # at most, of each


LEVELS = (Level(40, 800, 36, 5), Level(80, 3_000, 10, 7), Level(160, 8_000, 4, 10))
SAME = math.radians(10.0)  # rotations that are nearer to one another are one pose
PROPOSALS = 3
NOISE = 0.01  # of scores: poses that differ by less cannot be distinguished


@dataclass(frozen=True, eq=False)
class Proposal:
    """A pose of the object in the photo."""

    world_from_object: F64  # (4, 4) similarity, from the frame of the Gaussians that were given
    camera: Camera  # the photo's; its focal length is the one with which the pose was found
    iou: float  # of the silhouettes, inside the photo
    colour_error: float  # RMS sRGB where they overlap, light and exposure taken out
    score: float  # IoU less colour error, and the support of matches if there are any

    def __post_init__(self) -> None:
        freeze(self, world_from_object=np.float64)


@dataclass(frozen=True, eq=False)
class Registration:
    """Poses that differ, the best first."""

    proposals: tuple[Proposal, ...]  # 1 to 3
    is_ambiguous: bool  # whether another pose looks the same in the photo
    reason: str  # one sentence; empty where it is clear

    @property
    def best(self) -> Proposal:
        return self.proposals[0]


@dataclass(frozen=True, eq=False)
class Hints:
    """Facts about the pose that are known beforehand."""

    is_focal_free: bool = False  # whether the camera's focal length is only a guess
    up: tuple[float, float, float] | None = None  # of the object; poses that tie: upright first
    start: F64 | None = None  # (4, 4) world from object: a pose that is to be beaten, or kept
    matches: Matches | None = None  # points of the object that the photo shows, its own frame


def register(
    gaussians: Gaussians,
    target: Target,
    hints: Hints | None = None,
    progress: Progress = silent,
    seed: int = 0,
) -> Registration:
    """Register `gaussians`, in any frame and at any scale, to the photo.

    Raises LiftError where the object or the mask is too small to tell.
    """
    progress(0.0, "Looking at the object")
    hints = hints or Hints()
    return Registrar(gaussians, target, seed, hints.matches).propose(hints, progress)


class Registrar:
    """An object and a mask to which it is registered. Costly to make, cheap to ask."""

    def __init__(
        self, gaussians: Gaussians, target: Target, seed: int = 0, matches: Matches | None = None
    ) -> None:
        self.target = target
        try:
            self._frame = own_frame(gaussians)
            counts = tuple(level.surfels for level in LEVELS)
            self._surfels: tuple[Surfels, ...] = even_surfels(gaussians, self._frame, counts, seed)
        except ValueError as error:
            raise LiftError(f"the object cannot be registered: {error}") from error
        self._views = tuple(target.view(level.size) for level in LEVELS)
        self._matches = None if matches is None else matches.moved(self._frame)

    def rated(self, world_from_object: F64) -> Proposal:
        """A pose that was chosen by hand, and how well it agrees: some milliseconds."""
        return self._proposal(self._rated(self._stance(world_from_object)))

    def improved(self, proposal: Proposal, is_focal_free: bool = False) -> Proposal:
        """The best pose near `proposal`; the same one where nothing near is better."""
        stance = self._stance(proposal.world_from_object, proposal.camera.focal)
        start = self._rated(stance)
        fit = Fit(stance, start.agreement)
        for k in range(1, len(LEVELS)):
            fit = self._refined(fit, k, is_focal_free)
        better = fit.agreement.score > start.agreement.score
        return self._proposal(fit) if better else proposal

    def propose(self, hints: Hints, progress: Progress = silent) -> Registration:
        """See `register`."""
        fits = [*self._matched(), *self._searched(hints, part(progress, 0.0, 0.4))]
        for k, level in enumerate(LEVELS):
            span = part(progress, 0.4 + 0.2 * k, 0.4 + 0.2 * (k + 1))
            fits = self._all_refined(fits[: level.kept], k, hints.is_focal_free, span)
            if hints.start is not None and k == 0:
                fits.insert(0, self._rated(self._stance(hints.start), k))
        fits = [self._rated(fit.stance) for fit in fits]
        if hints.start is not None:
            fits.append(self._rated(self._stance(hints.start)))
        fits = _distinct(fits)
        rivals = [fit for fit in fits[1:] if _score(fits[0]) - _score(fit) < NOISE]
        reason = _reason(fits[0], rivals)
        if rivals and (up := hints.up) is not None:
            tied = sorted([fits[0], *rivals], key=lambda fit: -self._uprightness(fit, up))
            fits = [*tied, *(fit for fit in fits[1:] if fit not in rivals)]
        progress(1.0, "Registered")
        proposals = tuple(self._proposal(fit) for fit in fits[:PROPOSALS])
        return Registration(proposals, bool(rivals), reason)

    def _searched(self, hints: Hints, progress: Progress) -> list[Fit]:
        camera = self.target.camera
        focals = tuple(f * camera.focal for f in FOCALS) if hints.is_focal_free else (camera.focal,)
        found = search(self._surfels[0], self._views[0], self.target, focals, progress)
        return [self._rated(f.stance, 0) for f in found[: LEVELS[0].kept]]

    def _matched(self) -> list[Fit]:
        """The pose on which most matches agree."""
        camera = self.target.camera
        found = None if self._matches is None else self._matches.pose(camera)
        return [] if found is None else [self._rated(Stance.of(found, camera), 0)]

    def _all_refined(self, fits: list[Fit], k: int, is_free: bool, progress: Progress) -> list[Fit]:
        """All of them refined at level `k`; of those that end as one pose the best."""
        refined: list[Fit] = list(fits)

        def run(first: int, last: int) -> None:
            for i in range(first, last):
                refined[i] = self._refined(fits[i], k, is_free)

        batch = core_count()
        for start in range(0, len(fits), batch):
            progress(start / len(fits), "Refining the best poses")
            count = min(batch, len(fits) - start)
            in_threads(lambda a, b, at=start: run(at + a, at + b), count)
        return _distinct(refined)

    def _refined(self, fit: Fit, k: int, is_free: bool) -> Fit:
        camera, level = self.target.camera, LEVELS[k]
        return refine(
            self._surfels[k], fit.stance, self._views[k], camera, is_free, level.steps,
            self._matches,
        )  # fmt: skip

    def _rated(self, stance: Stance, k: int = -1) -> Fit:
        view = self._views[k]
        picture = sketched(self._surfels[k], stance, view, self.target.camera)
        own = support(self._matches, stance, self.target.camera)
        return Fit(stance, agreement(picture, view, own))

    def _stance(self, world_from_object: F64, focal: float | None = None) -> Stance:
        camera = replace(self.target.camera, focal=focal or self.target.camera.focal)
        return Stance.of(world_from_object @ np.linalg.inv(self._frame), camera)

    def _proposal(self, fit: Fit) -> Proposal:
        camera = replace(self.target.camera, focal=fit.stance.focal)
        found = fit.agreement
        matrix = fit.stance.matrix(camera) @ self._frame
        return Proposal(matrix, camera, found.iou, found.colour_error, found.score)

    def _uprightness(self, fit: Fit, up: tuple[float, float, float]) -> float:
        """Cosine of the object's `up` with the photo's."""
        camera = replace(self.target.camera, focal=fit.stance.focal)
        turned = fit.stance.matrix(camera)[:3, :3] @ np.array(up)
        return float(-turned[1] / np.linalg.norm(turned))


def _score(fit: Fit) -> float:
    return fit.agreement.score


def _distinct(fits: list[Fit]) -> list[Fit]:
    """Best first, without those that another, better one is nearly the same pose as."""
    kept: list[Fit] = []
    for fit in sorted(fits, key=lambda fit: -_score(fit)):
        turns = np.array([other.stance.turn for other in kept]).reshape(-1, 3, 3)
        if not (angles(fit.stance.turn, turns) < SAME).any():
            kept.append(fit)
    return kept


def _reason(best: Fit, rivals: list[Fit]) -> str:
    if not rivals:
        return ""
    turns = np.array([fit.stance.turn for fit in rivals])
    degrees = sorted({round(float(a)) for a in np.degrees(angles(best.stance.turn, turns))})
    listed = ", ".join(f"{d}" for d in degrees)
    return (
        f"turned by {listed} degrees it looks the same in the photo "
        f"(scores {_score(best):.3f} and {_score(rivals[0]):.3f})"
    )
