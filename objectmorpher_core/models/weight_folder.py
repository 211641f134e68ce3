"""A folder with a model in it, looked at without opening the model.

Only formats that hold numbers and nothing else are taken: safetensors and ONNX. Pickled weights
can run any code when they are read, so a folder that has nothing else is refused.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..base.limits import WEIGHTS_HEADER as MOST_HEADER
from ..base.quoting import named, shown
from .registry import ModelError, hub_models

CONFIG = "config.json"
PIPELINE = "pipeline.json"
PLAIN = ".safetensors"
GRAPH = ".onnx"
QUANTISED = ".gguf"  # a pipeline's transformer in few bits; numbers only, too
PICKLED = (".bin", ".pt", ".pth", ".ckpt", ".pkl", ".pickle")
ONNX = "-onnx"  # ending of the families that are ONNX files
ONE_GRAPH = ("lama", "migan", "depth-graph")  # families that are one ONNX file
CODEC = "vae"  # folder of an autoencoder
# Families of a network, perhaps in a folder of its own, and an autoencoder -> which must be there.
LATENT = {"pixelhacker": ("network", CODEC), "moebius": ("network",), "pixelhacker-vae": (CODEC,)}
NETWORK = "diffusion_pytorch_model"  # what diffusers calls its files
TRIPOSPLAT = "triposplat"  # its files are named in the registry
INDEX = "model_index.json"
ADAPTER = ("-lora", "-lightning")  # endings of the families that are one file beside a model
# Networks of a pipeline that must be there; diffusers' names.
DIFFUSERS = {
    "qwen-image-edit": ("QwenImageEditPlusPipeline", ("transformer", "vae", "text_encoder")),
    "flux2-klein": ("Flux2KleinPipeline", ("transformer", "vae")),
}


def check_folder(family: str, at: Path) -> tuple[str, ...]:
    """Names of the files that are a model of `family`. Raises ModelError: one sentence."""
    if not at.is_dir():
        raise ModelError(f"{at} is not a folder")
    if family in DIFFUSERS:
        return _check_diffusers(family, at)
    if family in PIPELINES:
        return _check_pipeline(family, at)
    names = sorted(path.name for path in at.iterdir() if path.is_file())
    if family in LATENT:
        return _latent(family, at, names)
    if family == TRIPOSPLAT:
        files = next(model.files for model in hub_models() if model.family == family)
        for name in files:
            check_safetensors(at / name)
        return files
    if family in ONE_GRAPH:
        graphs = tuple(name for name in names if name.endswith(GRAPH))
        if len(graphs) != 1:
            _refuse_pickled(at, names, bool(graphs))
            raise ModelError(f"{at.name} holds {len(graphs)} {GRAPH} files: give the file itself")
        return graphs
    if family.endswith(ADAPTER):
        return _check_adapter(at, names)
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


def check_file(family: str, at: Path) -> None:
    """Raises ModelError where one file cannot be a model of `family`."""
    is_adapter = family.endswith(ADAPTER)
    if not is_adapter and family not in ONE_GRAPH:
        raise ModelError(f"{family} is a folder of files, and {at.name} is a file")
    if at.suffix != (ending := PLAIN if is_adapter else GRAPH):
        _refuse_pickled(at.parent, [at.name], False)
        raise ModelError(f"{at.name} is no {ending} file")
    if is_adapter:
        check_safetensors(at)


def check_files(family: str, at: Path, names: Sequence[str]) -> tuple[str, ...]:
    """Check what was added like `check_folder`; beside the one file of a model others may lie.

    `names`: of what was added.
    """
    if family not in ONE_GRAPH and not family.endswith(ADAPTER):
        return check_folder(family, at)
    if len(names) != 1:
        raise ModelError(f"{family} is one file, and {len(names)} were added of {at.name}")
    check_file(family, at / names[0])
    return tuple(names)


def pickled_latent(family: str, at: Path) -> dict[str, Path]:
    """Find one of `LATENT` in a folder as published: names in a folder of ours, and files to take.

    The fine-tuning that is used is Places2's, of scenes, if it is there. Raises ModelError.
    """
    folders = [at / name for name in ("ft_places2", ".", "pretrained")]
    own = [f for f in folders if _of_name(f, (PICKLED[0], PLAIN))]
    codec = _of_name(at / CODEC, (PLAIN, PICKLED[0])) if (at / CODEC / CONFIG).is_file() else []
    if ("network" in LATENT[family] and not own) or (CODEC in LATENT[family] and not codec):
        raise ModelError(f"{at.name} lacks {NETWORK}{PICKLED[0]}, or {CODEC} with its {CONFIG}")
    found = {}
    if own:
        found[NETWORK + PLAIN] = own[0] / _of_name(own[0], (PLAIN, PICKLED[0]))[0]
        if (own[0] / CONFIG).is_file():
            found[CONFIG] = own[0] / CONFIG
    if codec:
        found[f"{CODEC}/{NETWORK}{PLAIN}"] = at / CODEC / codec[0]
        found[f"{CODEC}/{CONFIG}"] = at / CODEC / CONFIG
    return found


def _of_name(at: Path, endings: tuple[str, ...]) -> list[str]:
    return [NETWORK + end for end in endings if (at / (NETWORK + end)).is_file()]


def _latent(family: str, at: Path, names: list[str]) -> tuple[str, ...]:
    """See `check_folder`."""
    codec = [f"{CODEC}/{NETWORK}{PLAIN}", f"{CODEC}/{CONFIG}"]
    own = [n for n in names if n.endswith(PLAIN)]
    below = sorted(p for p in at.glob(f"*/*{PLAIN}") if p.parent.name != CODEC)
    own += [p.relative_to(at).as_posix() for p in below]
    absent = [name for name in codec if not (at / name).is_file()]
    lacks = [("network", not own), (CODEC, bool(absent))]
    is_short = any(is_absent and part in LATENT[family] for part, is_absent in lacks)
    if is_short and (any(at.glob(f"*{PICKLED[0]}")) or any(at.glob(f"*/*{PICKLED[0]}"))):
        raise ModelError(
            f"{at.name} holds only pickled weights, which can run any code: to take nothing but"
            f" their numbers, objectmorpher models add {family} FOLDER --convert"
        )
    if "network" in LATENT[family] and len(own) != 1:
        raise ModelError(f"{at.name} holds {len(own)} {PLAIN} files beside {CODEC}, not one")
    if CODEC in LATENT[family] and absent:
        raise ModelError(f"{at.name} lacks {absent[0]}")
    found = [*own, *([] if absent else codec)]
    for name in found:
        if name.endswith(PLAIN):
            check_safetensors(at / name)
    configs = [Path(name).with_name(CONFIG).as_posix() for name in own]
    return (*found, *(name for name in configs if (at / name).is_file()))


def _check_diffusers(family: str, at: Path) -> tuple[str, ...]:
    """The files of a pipeline, each network of which is a folder."""
    kind, networks = DIFFUSERS[family]
    try:
        said = json.loads((at / INDEX).read_text(encoding="utf-8"))["_class_name"]
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise ModelError(f"{at.name} holds no {INDEX} that says which pipeline it is") from error
    if said != kind:
        raise ModelError(f"{at.name} holds a {named(str(said))}, not a {kind}")
    for network in networks:
        inside = sorted(p.name for p in (at / network).glob("*") if p.is_file())
        weights = [name for name in inside if name.endswith(PLAIN)]
        few_bits = [name for name in inside if name.endswith(QUANTISED)]
        _refuse_pickled(at / network, inside, bool(weights or few_bits))
        if few_bits and not weights:
            if network != "transformer" or CONFIG not in inside:
                raise ModelError(f"{at.name}/{network}: only a transformer's {few_bits[0]} is read,"
                                 f" with its {CONFIG} beside it")  # fmt: skip
        elif not weights:
            raise ModelError(f"{at.name}/{network} holds no {PLAIN} file")
        for name in weights:
            check_safetensors(at / network / name)
    files = [p for p in sorted(at.rglob("*")) if p.is_file() and not p.name.endswith(PICKLED)]
    return tuple(p.relative_to(at).as_posix() for p in files)


def _check_adapter(at: Path, names: list[str]) -> tuple[str, ...]:
    """The one file of an adapter."""
    weights = [name for name in names if name.endswith(PLAIN)]
    _refuse_pickled(at, names, bool(weights))
    if len(weights) != 1:
        raise ModelError(
            f"{at.name} needs one {PLAIN} file with the adapter, it has {len(weights)}"
        )
    check_safetensors(at / weights[0])
    return (weights[0],)


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
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise ModelError(f"{at.name}/{CONFIG} does not say which model it is") from error
    if said not in KINDS.get(family, (said,)):
        raise ModelError(f"{at.name} holds a model of the kind {shown(said)}, not {family}")


# What transformers calls them; the video models hold the same networks for still pictures.
KINDS = {
    "sam": ("sam",),
    "sam2": ("sam2", "sam2_video"),
    "sam3": ("sam3", "sam3_video", "sam3_tracker", "sam3_tracker_video"),
    "dinov2-with-registers": ("dinov2_with_registers",),
    "depth-anything": ("depth_anything",),
}
_OF_TRELLIS = (
    "sparse_structure_flow_model", "sparse_structure_decoder", "slat_flow_model", "slat_decoder_gs",
)  # fmt: skip
PIPELINES = {  # parts without which they cannot run, of families that come with a pipeline.json
    "trellis": _OF_TRELLIS,
    "cupid": (*_OF_TRELLIS, "sparse_structure_uv_decoder"),
}


def _check_pipeline(family: str, at: Path) -> tuple[str, ...]:
    """As `check_folder`: `pipeline.json` names parts, each a .json and a .safetensors file.

    Parts that are not needed may be absent; a path that starts with owner/name is another model's.
    """
    try:
        text = (at / PIPELINE).read_text(encoding="utf-8")
        parts = {str(k): str(v) for k, v in json.loads(text)["args"]["models"].items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ModelError(f"{at.name}/{PIPELINE} does not say which parts it has") from error
    if absent := [role for role in PIPELINES[family] if role not in parts]:
        raise ModelError(f"{at.name}/{PIPELINE} is not {family}'s: it names no {absent[0]}")
    found = [PIPELINE]
    for role, where in parts.items():
        if Path(where).is_absolute() or ".." in Path(where).parts:
            raise ModelError(f"{at.name}/{PIPELINE} points out of its folder: {shown(where)}")
        files = f"{where}.json", f"{where}{PLAIN}"
        absent = [name for name in files if not _is_file(at / name)]
        if not absent:
            check_safetensors(at / files[1])
            found += files
        elif role in PIPELINES[family] and where.count("/") < 2:
            beside = [f"{where}{end}" for end in PICKLED if _is_file(at / f"{where}{end}")]
            _refuse_pickled(at, beside, False)
            raise ModelError(f"{at.name} lacks {named(absent[0])}")
    return tuple(found)


def _is_file(at: Path) -> bool:
    """Names out of a file may be such that no file system takes them."""
    try:
        return at.is_file()
    except (OSError, ValueError):
        return False


def stamp(at: Path) -> tuple[tuple[str, int, int], ...]:
    """Name, bytes and time (ns) of each file of a folder: other weights have another."""
    found = [(p.relative_to(at).as_posix(), p.stat()) for p in sorted(at.rglob("*")) if p.is_file()]
    return tuple((name, facts.st_size, facts.st_mtime_ns) for name, facts in found)


def count_parameters(at: Path) -> int:
    """Numbers in the safetensors files of a folder, by their headers. Raises ModelError."""
    try:
        return sum(
            math.prod(tensor["shape"])
            for file in at.glob(f"*{PLAIN}")
            for tensor in _tensors(file)[0].values()
        )
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        raise ModelError(f"the weights in {at.name} cannot be read") from error


def _tensors(at: Path) -> tuple[dict[str, Any], int]:
    """What a safetensors file's header says of each tensor, and the header's bytes."""
    with at.open("rb") as file:
        length = int.from_bytes(file.read(8), "little")
        if not 2 <= length <= min(MOST_HEADER, at.stat().st_size - 8):
            raise ValueError("header")
        header = json.loads(file.read(length))
    header.pop("__metadata__", None)
    return header, 8 + length


def check_safetensors(at: Path) -> None:
    """Raises ModelError where a file is cut off or no safetensors file; reads only its header."""
    try:
        size = at.stat().st_size
        tensors, start = _tensors(at)
        needed = start + max((t["data_offsets"][1] for t in tensors.values()), default=0)
    except OSError as error:
        raise ModelError(f"{at.name} cannot be read: {error.strerror or error}") from error
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        raise ModelError(f"{at.name} is not a {PLAIN} file, or only its beginning") from error
    if needed != size:
        raise ModelError(f"{at.name} is cut off: {size} of {shown(needed)} bytes are there")
