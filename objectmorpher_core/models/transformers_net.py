"""A network of the transformers package, from a folder: nothing fetched, nothing pickled."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from .registry import ModelError


def open_net(kind: Any, folder: Path, absent: str, whose: str, **options: Any) -> Any:
    """The network of class `kind` in `folder`, ready to be asked; `options` as its own has them.

    Raises ModelError: "`folder` `absent`: why", or that the weights are not `whose`.
    """
    from transformers.utils import logging

    logging.disable_progress_bar()
    try:
        net, said = kind.from_pretrained(
            folder, local_files_only=True, use_safetensors=True, output_loading_info=True, **options
        )
    except Exception as error:  # of many kinds: of json, safetensors, the hub, and its own
        reason = str(error).strip().partition("\n")[0]
        raise ModelError(f"{folder} {absent}: {reason}") from error
    if wrong := sorted(map(str, {*said["missing_keys"], *said["mismatched_keys"]})):
        raise ModelError(f"the weights in {folder} are not {whose}: {wrong[0]}")
    return net.eval().requires_grad_(False)
