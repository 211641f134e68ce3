"""A folder with a model in it, looked at without opening the model.

Only formats that hold numbers and nothing else are taken: safetensors and ONNX. Pickled weights
can run any code when they are read, so a folder that has nothing else is refused.
"""

from __future__ import annotations

import json
from pathlib import Path

from .registry import ModelError

CONFIG = "config.json"
PLAIN = ".safetensors"
GRAPH = ".onnx"
PICKLED = (".bin", ".pt", ".pth", ".ckpt", ".pkl", ".pickle")
MOST_HEADER = 100 << 20  # bytes; the format's own limit
ONNX = "-onnx"  # ending of the families that are ONNX files


def check_folder(family: str, at: Path) -> tuple[str, ...]:
    """Names of the files that are a model of `family`. Raises ModelError: one sentence."""
    if not at.is_dir():
        raise ModelError(f"{at} is not a folder")
    names = sorted(path.name for path in at.iterdir() if path.is_file())
    if family.endswith(ONNX):
        graphs = tuple(name for name in names if name.endswith(GRAPH))
        sides = [[n for n in graphs if side in n.lower()] for side in ("encoder", "decoder")]
        if any(len(side) != 1 for side in sides):
            _refuse_pickled(at, names, bool(graphs))
            raise ModelError(f"{at.name} needs one encoder and one decoder, each an {GRAPH} file")
        return (*sides[0], *sides[1])
    weights = tuple(name for name in names if name.endswith(PLAIN))
    if not weights:
        _refuse_pickled(at, names, False)
        raise ModelError(f"{at.name} holds no {PLAIN} file")
    if CONFIG not in names:
        raise ModelError(f"{at.name} holds no {CONFIG}: it says what the weights are")
    check_kind(family, at)
    for name in weights:
        check_safetensors(at / name)
    return (CONFIG, *weights)


def _refuse_pickled(at: Path, names: list[str], is_otherwise_there: bool) -> None:
    pickled = [name for name in names if name.endswith(PICKLED)]
    if pickled and not is_otherwise_there:
        raise ModelError(
            f"{at.name} holds only pickled weights ({pickled[0]}), which can run any code:"
            f" bring them as {PLAIN}"
        )


def check_kind(family: str, at: Path) -> None:
    """Raises ModelError where config.json is of another kind of model."""
    try:
        said = json.loads((at / CONFIG).read_text(encoding="utf-8"))["model_type"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ModelError(f"{at.name}/{CONFIG} does not say which model it is") from error
    if said not in KINDS.get(family, (said,)):
        raise ModelError(f"{at.name} holds a model of the kind {said!r}, not {family}")


# What transformers calls them; the video models hold the same networks for still pictures.
KINDS = {
    "sam": ("sam",),
    "sam2": ("sam2", "sam2_video"),
    "sam3": ("sam3", "sam3_video", "sam3_tracker", "sam3_tracker_video"),
}


def check_safetensors(at: Path) -> None:
    """Raises ModelError where a file is cut off or no safetensors file; reads only its header."""
    try:
        size = at.stat().st_size
        with at.open("rb") as file:
            length = int.from_bytes(file.read(8), "little")
            if not 2 <= length <= min(MOST_HEADER, size - 8):
                raise ValueError("header")
            header = json.loads(file.read(length))
        ends = [t["data_offsets"][1] for name, t in header.items() if name != "__metadata__"]
        needed = 8 + length + max(ends, default=0)
    except OSError as error:
        raise ModelError(f"{at.name} cannot be read: {error.strerror or error}") from error
    except (ValueError, KeyError, TypeError, AttributeError, IndexError) as error:
        raise ModelError(f"{at.name} is not a {PLAIN} file, or only its beginning") from error
    if needed != size:
        raise ModelError(f"{at.name} is cut off: {size} of {needed} bytes are there")
