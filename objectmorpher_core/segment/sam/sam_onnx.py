"""MobileSAM, SAM and EfficientSAM as two ONNX files, an encoder and a decoder, by onnxruntime.

Two layouts. SAM's own export, which MobileSAM's is, too (decoder inputs `point_coords`,
`mask_input`, `has_mask_input`, ...): its encoder takes normalised pictures (1, 3, n, n), or the
pixels (h, w, 3). EfficientSAM's (`batched_point_coords`, ...): its encoder takes (1, 3, h, w) in
[0, 1]; it knows points and boxes, but neither clicks on what is not the object nor earlier answers.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ... import models
from ...base.arrays import F32, RGB
from ...models import HubModel, ModelError
from ...models.onnx_graphs import EFFICIENT, SCORES, opened, sam_inputs
from ...models.weight_folder import check_folder
from .view import CORNER, GROUND, NOTHING, OBJECT, OTHER_CORNER, Asked, Masks, normalized

SIDE = 1024  # px, where the file does not say
LOW = 256  # px of logits, likewise
MOST_POINTS = 6  # that EfficientSAM looks at, a box's corners among them


class SamOnnx:
    """A model on the CPU."""

    def __init__(self, model: HubModel) -> None:
        """Raises ModelError: one sentence."""
        folder = models.place(model.id)
        if folder is None:
            raise ModelError(f"{model.id} is not here: {model.home}")
        encoder, decoder = (folder / name for name in check_folder(model.family, folder))
        self._encoder, self._decoder = opened(encoder), opened(decoder)
        self._picture, self._inputs = sam_inputs(
            self._encoder, self._decoder, (encoder.name, decoder.name)
        )
        self._is_efficient = self._inputs.keys() >= EFFICIENT
        self.is_padded = not self._is_efficient
        fixed = [n for n in self._picture.shape if isinstance(n, int) and n > 3]
        self.side = fixed[0] if fixed else SIDE
        masks = {output.name: output for output in self._decoder.get_outputs()}
        first = next(iter(masks.values()))
        told = self._inputs.get("mask_input") or masks.get("low_res_masks", first)
        self.low = told.shape[-1] if isinstance(told.shape[-1], int) else LOW

    def encode(self, picture: RGB) -> tuple[F32, ...]:
        """See `SamNetwork.encode`."""
        if self._is_efficient:
            given = (picture.astype(np.float32) / 255).transpose(2, 0, 1)[None]
        elif len(self._picture.shape) == 3:
            given = picture.astype(np.float32)
        else:
            given = normalized(picture, self.side)
        found = _run(self._encoder, {self._picture.name: np.ascontiguousarray(given)})
        return (np.asarray(found[0], np.float32),)

    def decode(self, features: tuple[F32, ...], asked: Asked, is_several: bool) -> Masks:
        """See `SamNetwork.decode`."""
        if not self._is_efficient:
            found = self._decode_as_sam(features[0], asked)
            if len(found.scores) == 4:  # the one for clear prompts, and three
                part = np.s_[1:] if is_several else np.s_[:1]
                return Masks(found.logits[part], found.scores[part])
            return found
        found = self._decode_as_efficient(features[0], asked)
        return found if is_several else self._settled(features[0], asked, found)

    def _decode_as_sam(self, features: F32, asked: Asked) -> Masks:
        points, labels = _labelled(asked)
        if asked.box is None:
            points, labels = np.concatenate([points, [[0, 0]]]), np.append(labels, NOTHING)
        has_logits = asked.logits is not None
        logits = asked.logits if has_logits else np.zeros((self.low, self.low))
        given = {
            "image_embeddings": features, "point_coords": points[None] - 0.5,
            "point_labels": labels[None], "mask_input": np.asarray(logits)[None, None],
            "has_mask_input": np.array([has_logits]), "orig_im_size": np.full(2, self.side),
        }  # fmt: skip
        return self._answer(given)

    def _decode_as_efficient(self, features: F32, asked: Asked) -> Masks:
        points, labels = _labelled(asked)
        kept = labels != GROUND
        points, labels = points[kept], labels[kept]
        if len(labels) > MOST_POINTS:  # a box's corners come first; the last clicks say most
            first = 2 if asked.box is not None else 1
            chosen = np.r_[:first, len(labels) - (MOST_POINTS - first) : len(labels)]
            points, labels = points[chosen], labels[chosen]
        given = {
            "image_embeddings": features, "batched_point_coords": points[None, None] - 0.5,
            "batched_point_labels": labels[None, None], "orig_im_size": np.full(2, self.side),
        }  # fmt: skip
        return self._answer(given)

    def _settled(self, features: F32, asked: Asked, found: Masks) -> Masks:
        """One of three masks: most like the one before, without what is said not to be in it."""
        if asked.logits is None:
            best = int(np.argmax(found.scores))
        else:
            before = asked.logits > 0
            inside = found.logits > 0
            both = (inside & before).sum((1, 2))
            best = int(np.argmax(both / np.maximum((inside | before).sum((1, 2)), 1)))
        logits = found.logits[best].copy()
        for point in asked.points[~asked.is_object]:
            column, row = (int(v) for v in np.clip(point * self.low / self.side, 0, self.low - 1))
            if logits[row, column] > 0:
                one = Asked(point[None], np.ones(1, np.bool_))
                parts = self._decode_as_efficient(features, one).logits
                smallest = min(parts, key=lambda part: int((part > 0).sum()))
                logits = np.minimum(logits, -smallest)
        return Masks(logits[None], found.scores[best : best + 1])

    def _answer(self, given: dict[str, Any]) -> Masks:
        """Runs the decoder; what it takes says which numbers it wants."""
        kinds = {"tensor(float)": np.float32, "tensor(int64)": np.int64}
        fed = {
            name: np.ascontiguousarray(given[name], kinds[self._inputs[name].type])
            for name in self._inputs
            if name in given
        }
        names = [output.name for output in self._decoder.get_outputs()]
        found = dict(zip(names, _run(self._decoder, fed), strict=True))
        scores = np.asarray(found[SCORES], np.float32).reshape(-1)
        key = "low_res_masks" if "low_res_masks" in found else names[0]
        logits = np.asarray(found[key], np.float32)
        logits = logits.reshape(-1, *logits.shape[-2:])
        if len(logits) != len(scores):
            raise ModelError(f"the decoder gives {len(logits)} masks and {len(scores)} scores")
        return Masks(_at(logits, self.low), scores)


def _at(logits: F32, low: int) -> F32:
    """(k, low, low) of logits (k, h, w)."""
    import cv2

    if logits.shape[1:] == (low, low):
        return logits
    small = [cv2.resize(each, (low, low), interpolation=cv2.INTER_AREA) for each in logits]
    return np.asarray(small, np.float32)


def _labelled(asked: Asked) -> tuple[np.ndarray, np.ndarray]:
    """(n, 2) points and their (n,) labels, a box's corners first."""
    labels = np.where(asked.is_object, OBJECT, GROUND)
    if asked.box is None:
        return asked.points, labels
    corners = asked.box.reshape(2, 2)
    both = np.concatenate([corners, asked.points])
    return both, np.concatenate([[CORNER, OTHER_CORNER], labels])


def _run(session: Any, given: dict[str, Any]) -> list[Any]:
    try:
        return session.run(None, given)
    except Exception as error:
        shapes = ", ".join(f"{name} {np.shape(array)}" for name, array in given.items())
        raise ModelError(f"the ONNX network cannot take {shapes}") from error
