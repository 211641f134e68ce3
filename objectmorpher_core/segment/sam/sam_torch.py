"""SAM, SAM 2.1 and SAM 3's tracker by transformers, which needs no torchvision for the networks.

The ledger keeps the network between two clicks, and the last photo's features on its device.

The image encoder, which is nearly all of them, runs with the plan's numbers; prompts and masks
stay in float32: a click in bfloat16 would be off by pixels.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np

from ... import models
from ...base.arrays import F32, RGB
from ...models import HubModel, ModelError, device, ledger
from ...models.plans import Need, Plan
from ...models.weight_folder import CONFIG, count_parameters, stamp
from .view import Asked, Masks, normalized

HALF = np.full(3, 0.5, np.float32)  # SAM 3's mean and deviation
CLASSES = {"sam": "SamModel", "sam2": "Sam2Model", "sam3": "Sam3TrackerModel"}
WORK = {
    "sam": 2_500_000_000,
    "sam2": 950_000_000,
    "sam3": 2_500_000_000,
}  # bytes beside them


class SamTorch:
    """A model on the device of the plan."""

    def __init__(self, model: HubModel) -> None:
        """Reads config.json only. Raises ModelError."""
        folder = models.place(model.id)
        if folder is None:
            raise ModelError(f"{model.id} is not here: `objectmorpher models get {model.id}`")
        self._folder, self._family = folder, model.family
        self.side, patch = _sizes(model)
        self.low = 4 * (self.side // patch)
        self.is_padded = model.family == "sam"
        need = Need(count_parameters(folder), WORK[model.family])
        self._model = ledger.Model("SAM", (folder, stamp(folder)), need, self._load)

    def encode(self, picture: RGB) -> tuple[F32, ...]:
        """See `SamNetwork.encode`."""
        return ledger.SHARED.run(self._model, lambda sam, plan: self._encode(sam, plan, picture))

    def decode(self, features: tuple[F32, ...], asked: Asked, is_several: bool) -> Masks:
        """See `SamNetwork.decode`."""
        return ledger.SHARED.run(
            self._model, lambda sam, plan: self._decode(sam, plan, (features, asked), is_several)
        )

    def _encode(self, sam: _Opened, plan: Plan, picture: RGB) -> tuple[F32, ...]:
        import torch

        is_third = self._family == "sam3"
        pixels = normalized(picture, self.side, *((HALF, HALF) if is_third else ()))
        given = torch.from_numpy(pixels).to(plan.device, getattr(torch, plan.number))
        found = sam.network.get_image_embeddings(given)
        tensors = [found] if isinstance(found, torch.Tensor) else list(found)
        features = tuple(t.float().cpu().numpy() for t in tensors)
        sam.held = features, found
        return features

    def _decode(
        self, sam: _Opened, plan: Plan, told: tuple[tuple[F32, ...], Asked], is_several: bool
    ) -> Masks:
        import torch

        features, asked = told

        def tensor(array: Any, kind: Any = np.float32) -> Any:
            return torch.from_numpy(np.ascontiguousarray(array, kind)).to(plan.device)

        given: dict[str, Any] = {}
        if len(asked.points):
            # The networks take a pixel's number for its centre and add the half themselves.
            given["input_points"] = tensor(asked.points[None, None] - 0.5)
            given["input_labels"] = tensor(asked.is_object[None, None], np.int64)
        if asked.box is not None:
            given["input_boxes"] = tensor(asked.box[None, None] - 0.5)
        if asked.logits is not None:
            given["input_masks"] = tensor(asked.logits[None, None])
        if sam.held is None or sam.held[0] is not features:
            tensors = [tensor(f) for f in features]
            sam.held = features, tensors[0] if self._family == "sam" else tensors
        with torch.inference_mode():
            found = sam.network(
                image_embeddings=sam.held[1], multimask_output=is_several, **given
            )  # fmt: skip
        logits = found.pred_masks[0, 0].float().cpu().numpy()
        return Masks(logits, found.iou_scores[0, 0].float().cpu().numpy())

    def _load(self, plan: Plan) -> _Opened:
        """The network where the plan wants it."""
        import torch
        import transformers

        transformers.utils.logging.disable_progress_bar()
        level = transformers.utils.logging.get_verbosity()
        transformers.utils.logging.set_verbosity_error()  # the trackers' other parts are not used
        try:
            network, told = getattr(transformers, CLASSES[self._family]).from_pretrained(
                self._folder, local_files_only=True, use_safetensors=True, dtype=torch.float32,
                output_loading_info=True,
            )  # fmt: skip
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise ModelError(f"{self._folder.name} cannot be opened as {self._family}") from error
        except RuntimeError as error:
            if device.is_out_of_memory(error):
                raise
            raise ModelError(f"{self._folder.name}: its weights do not fit its config") from error
        finally:
            transformers.utils.logging.set_verbosity(level)
        if told["missing_keys"] or told["mismatched_keys"]:
            raise ModelError(f"{self._folder.name} lacks some of its weights")
        network.vision_encoder.to(getattr(torch, plan.number))
        network.vision_encoder.register_forward_hook(_in_float32)
        return _Opened(network.eval().to(plan.device))


@dataclass(eq=False)
class _Opened:
    """A network, and the features that it was given last."""

    network: Any
    held: tuple[tuple[F32, ...], Any] | None = None  # features, and as tensors


def _in_float32(module: Any, given: Any, found: Any) -> Any:
    """The encoder's answer (a hook of PyTorch's), for the parts that stay in float32."""
    for key, value in found.items():
        if hasattr(value, "float"):
            found[key] = value.float()
        elif isinstance(value, tuple | list):
            found[key] = type(value)(v.float() for v in value)
    return found


def _sizes(model: HubModel) -> tuple[int, int]:
    """px of the square that a model sees, and of its patches, as its config says.

    Raises ModelError.
    """
    folder = models.place(model.id)
    assert folder is not None
    try:
        said = json.loads((folder / CONFIG).read_text(encoding="utf-8"))
        prompts = (said.get("tracker_config") or said).get("prompt_encoder_config") or {}
        usual = (1008, 14) if model.family == "sam3" else (1024, 16)
        side, patch = prompts.get("image_size", usual[0]), prompts.get("patch_size", usual[1])
        if not 16 <= int(side) <= 8192 or not 1 <= int(patch) <= int(side):
            raise ValueError(side)
    except (OSError, ValueError, TypeError, AttributeError) as error:
        raise ModelError(f"{folder.name}/{CONFIG} cannot be read as {model.family}'s") from error
    return int(side), int(patch)
