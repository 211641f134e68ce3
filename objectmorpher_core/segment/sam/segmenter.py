"""Clicks or a box -> object by a Segment Anything model: SAM, SAM 2.1, SAM 3's tracker, or ONNX.

The photo is encoded once. What is small in a large photo is looked at once more, in a crop around
it at the photo's own resolution: the network sees about 1000 px of whatever it is shown.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ... import models
from ...base.arrays import F32, RGB, Mask
from ...base.masks import box_of
from ...base.progress import Progress, part, silent
from ...document.model import Click, Prompt
from ...models import HubModel, ModelError, device
from ...models.hub import EXTRA
from ..salience import SubjectNet
from ..selection import (
    SelectionError,
    at_level,
    check_mask,
    check_prompt,
    fill_small_holes,
    free_mask,
    keep_touched,
)
from ..subject import subject_guess
from .view import Box, Encoded, SamAnswer, SamFrame, SamNetwork, SamView, inside_box

WITHOUT_GPU = 110  # millions of parameters; a larger SAM takes minutes a photo on a CPU
SMALL = 0.4  # x longer side of the photo: a smaller thing is looked at once more
MARGIN = 0.5  # x larger side of a thing: what is looked at around it
FITS = 0.85  # x side of a closer look: a thing that is no larger is looked at in the same
SAME = 0.6  # overlap (IoU) of two looks; below it they have not seen the same thing
LOOKS = 2  # closer looks that are kept
NAMES = {"sam": "SAM", "sam2": "SAM 2", "sam3": "SAM 3", "sam-onnx": "a SAM in ONNX files"}
SMALLEST = {"sam": "sam-vit-base", "sam2": "sam2.1-tiny", "sam3": "sam3", "sam-onnx": "mobile-sam"}


@dataclass(frozen=True, eq=False)
class SamPhoto:
    """The encodings of a photo that are worth keeping."""

    encoded: Encoded
    salience: F32 | None  # (320, 320) in [0, 1]; None without the subject network's weights


class Sam:
    """Segmenter: the best model of a family that is here, or the one called `id`."""

    def __init__(self, family: str, id: str = "") -> None:
        self.name = id or family
        self._family, self._id = family, id
        self._subject = SubjectNet()
        self._network: SamNetwork | None = None
        self._open_id = ""  # of the model whose network that is
        self._view: tuple[SamPhoto, SamView] | None = None  # of the last photo
        self._looks: list[SamView] = []  # closer ones at it
        self._told: tuple[SamPhoto, Prompt, float] | None = None  # how sure the last answer was

    def missing(self) -> str | None:
        """Why this backend cannot run here, or None."""
        try:
            is_here = self.model() is not None
        except ModelError as error:
            return str(error)
        lacks = [] if self._family == "sam-onnx" or _has_torch() else [f"`{EXTRA}`"]
        if not is_here:
            model = models.hub_model(self._id or SMALLEST[self._family])
            how = f"get {model.id}`" if model.repository else f"add {model.id} FOLDER`"
            how += "" if model.repository else f", from {model.home}"
            lacks.append(f"`objectmorpher models {how}")
        what = self._id or NAMES[self._family]
        return f"{what} is not here: {', then '.join(lacks)}" if lacks else None

    def model(self) -> HubModel | None:
        """Which model it is: without a GPU a large one only where there is no other."""
        if self._id:
            return models.hub_model(self._id) if models.place(self._id) else None
        found = models.installed(self._family)
        if self._family != "sam-onnx" and len(found) > 1 and not device.has_gpu():
            found = tuple(m for m in found if m.parameters <= WITHOUT_GPU) or found[-1:]
        return found[0] if found else None

    def encode(self, rgb: RGB, progress: Progress = silent) -> SamPhoto:
        """The photo (H, W, 3) as the network sees it, and its subject map."""
        progress(0.0, "opening the model")
        network = self._opened()
        progress(0.1, "looking at the photo")
        height, width = rgb.shape[:2]
        encoded = self._encode(network, rgb, (0, 0, width, height))
        progress(0.9, "looking for the subject")
        salience = self._subject.salience(rgb) if self._subject.missing() is None else None
        progress(1.0, "read the photo")
        return SamPhoto(encoded, salience)

    def segment(
        self,
        rgb: RGB,
        prompt: Prompt,
        embedding: SamPhoto | None = None,
        progress: Progress = silent,
        seed: int = 0,
    ) -> Mask:
        """(H, W) bool: the object that clicks, box or subject mean. Nothing here is random."""
        check_prompt(rgb, prompt)
        if prompt.is_subject and (reason := self._subject.missing()) is not None:
            raise SelectionError(f"the subject cannot be found: {reason}")
        if embedding is None:
            embedding = self.encode(rgb, part(progress, 0.0, 0.7))
        progress(0.7, "looking for its outline")
        view = self._view_of(embedding)
        scores: list[float] = []

        def find(meant: Prompt) -> Mask:
            asked = self._boxed_subject(rgb, meant, embedding) if meant.is_subject else meant
            answer = self._answer(view, asked)
            mask, score = self._closer(rgb, view, asked, answer, part(progress, 0.75, 1.0))
            scores.append(score)
            mask &= free_mask(rgb.shape, meant)
            for click in meant.clicks:
                mask[int(click.y), int(click.x)] = click.is_foreground
            return check_mask(fill_small_holes(keep_touched(mask, meant), meant))

        mask = at_level(prompt, find)
        self._told = embedding, prompt, float(np.clip(scores[-1], 0, 1))
        progress(1.0, "cut out the object")
        return mask

    def confidence(self, rgb: RGB, prompt: Prompt, embedding: SamPhoto | None = None) -> float:
        """Return the network's estimate of the overlap of `segment`'s mask with what is meant."""
        told = self._told
        if (
            told is None
            or told[1] != prompt
            or (embedding is not None and told[0] is not embedding)
        ):
            self.segment(rgb, prompt, embedding)
            told = self._told
        assert told is not None
        return told[2]

    def _opened(self) -> SamNetwork:
        reason = self.missing()
        if reason is not None:
            raise SelectionError(reason)
        if self._network is None:
            model = self.model()
            assert model is not None, "nothing is missing"
            try:
                self._network, self._open_id = open_network(model), model.id
            except ModelError as error:
                raise SelectionError(models.unusable(model.id, error)) from error
        return self._network

    def _encode(self, network: SamNetwork, rgb: RGB, box: Box) -> Encoded:
        frame = SamFrame(box, network.side, network.is_padded)
        try:
            return Encoded(self._open_id, frame, network.encode(frame.picture(rgb)))
        except ModelError as error:
            raise SelectionError(str(error)) from error

    def _view_of(self, embedding: SamPhoto) -> SamView:
        """The photo, the same for every click on it."""
        if self._view is None or self._view[0] is not embedding:
            network = self._opened()
            if embedding.encoded.model != self._open_id:
                raise SelectionError(
                    f"the photo was read by {embedding.encoded.model}: read it anew"
                )
            self._view, self._looks = (embedding, SamView(network, embedding.encoded)), []
        return self._view[1]

    def _answer(self, view: SamView, prompt: Prompt, before: F32 | None = None) -> SamAnswer:
        try:
            return view.answer(prompt, before)
        except ModelError as error:
            raise SelectionError(str(error)) from error

    def _closer(
        self, rgb: RGB, view: SamView, prompt: Prompt, answer: SamAnswer, progress: Progress
    ) -> tuple[Mask, float]:
        """(H, W) the answer, refined where the thing is small, and how sure it is."""
        mask = view.mask(rgb, answer)
        box = box_of(mask)
        longer = max(rgb.shape[:2])
        if box[0] == box[2] or longer <= view.frame.side or _side(box) > SMALL * longer:
            return mask, answer.score
        look = next((k for k in self._looks if _holds(k.frame.box, box)), None)
        if look is None:
            progress(0.1, "looking at it more closely")
            crop = _around(box, rgb.shape[:2])
            network = self._opened()
            look = SamView(network, self._encode(network, rgb, crop))
            self._looks = [*self._looks, look][-LOOKS:]
        near, (left, top, right, bottom) = inside_box(prompt, look.frame.box), look.frame.box
        coarse = mask[top:bottom, left:right]
        found = self._answer(
            look, replace(near, box=tuple(float(v) for v in box), is_subject=False),
            look.logits_of(coarse, look.frame.box),
        )  # fmt: skip
        fine = look.mask(rgb, found)
        if (fine & coarse).sum() < SAME * (fine | coarse).sum():
            return mask, answer.score
        mask = mask.copy()
        mask[top:bottom, left:right] = fine
        return mask, found.score

    def _boxed_subject(self, rgb: RGB, prompt: Prompt, embedding: SamPhoto) -> Prompt:
        """The photo's subject as a box around it, and a click on the middle of it."""
        assert embedding.salience is not None, "it was looked for where a subject is asked for"
        guess = subject_guess(rgb, prompt, embedding.salience)
        rows, columns = np.nonzero(guess > 0.5)
        scale = rgb.shape[1] / guess.shape[1], rgb.shape[0] / guess.shape[0]
        box = (
            columns.min() * scale[0], rows.min() * scale[1],
            (columns.max() + 1) * scale[0], (rows.max() + 1) * scale[1],
        )  # fmt: skip
        row, column = np.unravel_index(int(np.argmax(guess)), guess.shape)
        middle = Click(float((column + 0.5) * scale[0]), float((row + 0.5) * scale[1]))
        box = tuple(float(v) for v in box)
        return replace(prompt, clicks=(middle, *prompt.clicks), box=box, is_subject=False)


def _has_torch() -> bool:
    from importlib.util import find_spec

    return all(find_spec(name) is not None for name in ("torch", "transformers", "safetensors"))


def best() -> Sam | None:
    """The SAM that "auto" takes: the best that is here and not too slow; None where none is."""
    for family in ("sam2", "sam3", "sam", "sam-onnx"):
        found = Sam(family)
        if not models.installed(family) or found.missing() is not None:
            continue
        model = found.model()
        if family == "sam-onnx" or (
            model and (model.parameters <= WITHOUT_GPU or device.has_gpu())
        ):
            return found
    return None


def _side(box: Box) -> int:
    return max(box[2] - box[0], box[3] - box[1])


def _holds(crop: Box, box: Box) -> bool:
    """Whether a closer look shows a thing whole, and not too small."""
    inside = crop[0] <= box[0] and crop[1] <= box[1] and box[2] <= crop[2] and box[3] <= crop[3]
    return inside and _side(crop) * SMALL <= _side(box) <= FITS * _side(crop)


def _around(box: Box, shape: tuple[int, ...]) -> Box:
    """A square around a box, with a margin, as far as a photo (H, W) goes."""
    half = (0.5 + MARGIN) * _side(box)
    x, y = (box[0] + box[2]) / 2, (box[1] + box[3]) / 2
    left, top = max(0, int(x - half)), max(0, int(y - half))
    return left, top, min(shape[1], int(x + half) + 1), min(shape[0], int(y + half) + 1)


def sam() -> Sam:
    """The paper's own: Kirillov et al. 2023."""
    return Sam("sam")


def sam2() -> Sam:
    """SAM 2.1: Ravi et al. 2024."""
    return Sam("sam2")


def sam3() -> Sam:
    """SAM 3's tracker, by clicks."""
    return Sam("sam3")


def sam_onnx() -> Sam:
    """MobileSAM or EfficientSAM, without PyTorch."""
    return Sam("sam-onnx")


def open_network(model: HubModel) -> SamNetwork:
    """The network of a model that is there. Raises ModelError."""
    if model.family == "sam-onnx":
        from .sam_onnx import SamOnnx

        return SamOnnx(model)
    from .sam_torch import SamTorch

    return SamTorch(model)
