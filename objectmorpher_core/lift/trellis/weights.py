"""Where the weights lie, and what to get when they do not."""

from __future__ import annotations

from pathlib import Path

from ... import models

TRELLIS, CUPID = "trellis-image-large", "cupid"
ENCODER = "dinov2-with-registers-large"
PACKAGES = ("torch", "transformers", "safetensors")


def weights_folder(id: str) -> Path:
    """The folder of model `id`: the manager's or the user's own.

    Also one that was put, or linked, by hand where the manager would put it.
    """
    return models.place(id) or models.folder() / id


def missing(*ids: str) -> str | None:
    """What has to be installed before the models `ids` can run, as one sentence."""
    if reason := models.not_installed(PACKAGES):
        return reason
    for id in ids:
        state = models.look_hub(id)
        if state.state == "damaged":
            return f"{id} is damaged ({state.reason}): objectmorpher models get {id}"
        where = weights_folder(id)
        if not (where / ("config.json" if id == ENCODER else "pipeline.json")).exists():
            own = f"or objectmorpher models add {state.model.family} FOLDER"
            size = f"{state.model.size / 1e9:.1f} GB, {state.model.licence}"
            return f"{id} is not there: objectmorpher models get {id} ({size}), {own}"
    return None
