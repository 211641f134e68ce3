"""Where the weights lie, and what to install when they do not."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from ...models import folder

TRELLIS, CUPID = "trellis-image-large", "cupid"
ENCODER = "dinov2-with-registers-large"
HOW = {  # published name and bytes, of what has to be in a folder
    TRELLIS: "microsoft/TRELLIS-image-large (MIT, 3.1 GB): pipeline.json and ckpts/",
    CUPID: "hbb1/Cupid (MIT): pipeline.json and ckpts/",
    ENCODER: (
        "facebook/dinov2-with-registers-large (Apache-2.0, 1.2 GB): config.json, model.safetensors"
    ),
}
PACKAGES = ("torch", "transformers", "safetensors")


def weights_folder(id: str) -> Path:
    """The folder in which the files of model `id` are looked for."""
    return folder() / id


def missing(*ids: str) -> str | None:
    """What has to be installed before the models `ids` can run, as one sentence."""
    if absent := [name for name in PACKAGES if find_spec(name) is None]:
        return f"{', '.join(absent)} is not installed: pip install 'objectmorpher[models]'"
    for id in ids:
        where = weights_folder(id)
        if not (where / ("config.json" if id == ENCODER else "pipeline.json")).exists():
            return f"the weights are not there: put those of {HOW[id]} into {where}"
    return None
