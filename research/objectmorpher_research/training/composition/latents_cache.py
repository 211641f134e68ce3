"""Encoders' outputs for each triplet, computed once and kept: latents and embeddings on the disk.

A file's name is a hash of everything that it depends on: the triplet's own bytes, the encoders, the
instruction, the size. So nothing is ever out of date, and trainings may share a folder.
"""

from __future__ import annotations

import gc
import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from objectmorpher_core.base.files import write_all
from objectmorpher_core.base.progress import Progress, silent
from objectmorpher_core.compose.refine.diffusion import INSTRUCTION

from . import TrainingError
from .edit_models import EditModel, Latents
from .triplet_folder import Stored

if TYPE_CHECKING:
    from torch import Tensor

VERSION = 1
ENDING = ".safetensors"
HEAD = 1 << 20  # bytes of each weight file that tell it from others, with its size
ENCODERS = ("vae", "text_encoder", "tokenizer", "processor")
GRIDS, SAID = "grids", ("embedding", "mask")


@dataclass(frozen=True)
class Encoding:
    """The encoding of triplets."""

    model: EditModel
    weights: Path  # the pipeline's folder
    side: int  # px: A has about the square of it
    number: str  # of torch's dtypes, in which it is computed and kept
    device: str

    def fingerprint(self) -> str:
        """SHA-256 of all that latents depend on besides the pictures."""
        told = {
            "version": VERSION, "model": self.model.name, "side": self.side,
            "number": self.number, "instruction": INSTRUCTION,
            "encoders": weights_fingerprint(self.weights, ENCODERS),
        }  # fmt: skip
        return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()


def weights_fingerprint(folder: Path, parts: tuple[str, ...]) -> str:
    """SHA-256 of the files of a pipeline's `parts`: of large ones the beginning and the size."""
    told = hashlib.sha256()
    for part in parts:
        for at in sorted(p for p in (folder / part).rglob("*") if p.is_file()):
            told.update(f"{at.relative_to(folder).as_posix()} {at.stat().st_size}\n".encode())
            with at.open("rb") as file:
                told.update(file.read(HEAD))
    return told.hexdigest()


class LatentsCache:
    """Latents of triplets; `fill` first, then `read` as often as wanted."""

    def __init__(self, folder: Path, encoding: Encoding) -> None:
        self._folder, self._encoding = folder, encoding
        self._common = encoding.fingerprint()

    def file(self, triplet: Stored) -> Path:
        """Return the file of a triplet's encodings."""
        name = hashlib.sha256((self._common + triplet.content).encode()).hexdigest()[:32]
        return self._folder / f"{name}{ENDING}"

    def fill(self, triplets: tuple[Stored, ...], progress: Progress = silent) -> int:
        """Computes what is not there; how many. The encoders are loaded only if there is any.

        Raises TrainingError.
        """
        wanted = [t for t in triplets if not self.file(t).is_file()]
        if not wanted:
            return 0
        import torch

        progress(0.0, "Loading the encoders")
        how = self._encoding
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            pipeline = how.model.encoders(how.weights, how.device, how.number)
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise TrainingError(f"{how.weights} cannot be opened: {_line(error)}") from error
        with torch.inference_mode():
            for k, triplet in enumerate(wanted):
                progress(k / len(wanted), f"encoding {k + 1} of {len(wanted)} triplets")
                found = how.model.encode(pipeline, triplet.read(), how.side)
                write_all(self._outputs(triplet, found))
        del pipeline
        gc.collect()
        if how.device == "cuda":
            torch.cuda.empty_cache()
        return len(wanted)

    def _outputs(self, triplet: Stored, found: Latents) -> dict[Path, bytes]:
        from safetensors.torch import save

        held = _tensors(found)
        if self._encoding.model.sees_pictures:
            return {self.file(triplet): save(held)}
        said = save({name: held.pop(name) for name in SAID if name in held})
        return {self._common_file(): said, self.file(triplet): save(held)}

    def _common_file(self) -> Path:
        """What the text encoder says of every triplet, where it sees none."""
        return self._folder / f"text-{self._common[:32]}{ENDING}"

    def read(self, triplet: Stored, device: str = "cpu") -> Latents:
        """Raises TrainingError."""
        from safetensors import SafetensorError
        from safetensors.torch import load_file

        at = self.file(triplet)
        try:
            held = load_file(at)
            if not self._encoding.model.sees_pictures:
                held |= load_file(self._common_file())
            held = {name: value.to(device) for name, value in held.items()}
            grids = [(int(rows), int(columns)) for rows, columns in held.pop(GRIDS).tolist()]
            return Latents(
                held["target"], held["conditions"], held["embedding"],
                (grids[0], grids[1], grids[2]), held.get("mask"),
            )  # fmt: skip
        except (OSError, KeyError, ValueError, SafetensorError) as error:
            raise TrainingError(f"{at} is damaged, delete it: {_line(error)}") from error


def _tensors(found: Latents) -> dict[str, Tensor]:
    import torch

    held: dict[str, Tensor] = {
        "target": found.target, "conditions": found.conditions, "embedding": found.embedding,
        GRIDS: torch.tensor(found.grids),
    }  # fmt: skip
    if found.mask is not None:
        held["mask"] = found.mask
    return {name: value.contiguous().cpu() for name, value in held.items()}


def _line(error: Any) -> str:
    return " ".join(str(error).split())[:300]
