"""The fine search of a registration: Levenberg and Marquardt on silhouette and colour.

Residuals are differences of small pictures, a little blurred; they change smoothly with the pose,
so that seven slightly moved pictures are its derivative. The light on the object is found anew in
each step and held while the pose moves.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from ...base.arrays import F32, F64
from ...base.camera import Camera
from .matches import NEAR, Matches
from .sketch import COVERAGE, Surfels
from .view import Agreement, RegistrationView, Stance, agreement, fitted_light, lit, sketched

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
        # By the mean of the diagonal, too: what the picture hardly tells must not run away.
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
