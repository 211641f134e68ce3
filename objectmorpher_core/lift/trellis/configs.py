"""The published json layout: `pipeline.json` and a `.json` beside each part's weights."""

from __future__ import annotations

import json
import math
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import Any, TypeVar

from ... import models
from .. import LiftError

LARGEST = 1 << 14  # no number of a config is larger: a lying file cannot ask for all the memory
BYTES = 1 << 20  # of a json file
FOR_TRAINING = {"use_fp16", "use_checkpoint"}  # and what a computer's own precision decides
ONLY = {"pe_mode": "ape", "share_mod": False, "attn_mode": "swin", "norm_type": "layer"}


@dataclass(frozen=True, kw_only=True)
class Transformer:
    """The common settings of all parts' transformers."""

    model_channels: int
    num_blocks: int
    num_heads: int = 0  # 0: as `num_head_channels` says
    num_head_channels: int = 64
    mlp_ratio: float = 4.0
    qk_rms_norm: bool = False

    def __post_init__(self) -> None:
        if self.heads < 1 or self.model_channels % self.heads:
            raise LiftError(f"{self.model_channels} channels cannot be dealt to {self.heads} heads")

    @property
    def heads(self) -> int:
        return self.num_heads or self.model_channels // self.num_head_channels

    @property
    def hidden(self) -> int:
        """Channels inside a feed-forward net."""
        return int(self.model_channels * self.mlp_ratio)


@dataclass(frozen=True, kw_only=True)
class StructureFlowConfig(Transformer):
    """The flow that says where something is."""

    resolution: int
    in_channels: int
    out_channels: int
    cond_channels: int
    patch_size: int = 1
    qk_rms_norm_cross: bool = False


@dataclass(frozen=True, kw_only=True)
class LatentFlowConfig(StructureFlowConfig):
    """The flow that says what it is like there."""

    patch_size: int = 2
    num_io_res_blocks: int = 2
    io_block_channels: tuple[int, ...] = ()
    use_skip_connection: bool = True


@dataclass(frozen=True, kw_only=True)
class ViewLatentFlowConfig(LatentFlowConfig):
    """The settings of a flow that also sees the picture at each cell's place in it (CUPID)."""

    cond_latent_channels: int
    visual_input_channels: int = 3
    visual_feat_resolution: int = 256
    visual_feat_channels: tuple[int, ...] = (4, 4, 4, 4)
    visual_conv_kernel_size: int = 3

    @property
    def all_channels(self) -> int:
        """Return the number of all input channels."""
        return self.in_channels + self.cond_latent_channels + sum(self.visual_feat_channels)


@dataclass(frozen=True, kw_only=True)
class StructureDecoderConfig:
    """The decoder from the first flow's latents to occupied cells."""

    out_channels: int
    latent_channels: int
    num_res_blocks: int
    channels: tuple[int, ...]
    num_res_blocks_middle: int = 2

    def __post_init__(self) -> None:
        if not self.channels:
            raise LiftError("the model's description gives a decoder no channels")


@dataclass(frozen=True, kw_only=True)
class WindowedConfig(Transformer):
    """A transformer whose attention stays in windows of cells."""

    resolution: int
    latent_channels: int
    window_size: int = 8


@dataclass(frozen=True, kw_only=True)
class Activations:
    """The activations that turn a decoder's numbers into Gaussians; names as published."""

    lr: dict[str, float]  # factor of each quantity
    perturb_offset: bool
    voxel_size: float  # x a cell: how far from its middle a Gaussian may be, twice
    num_gaussians: int  # of a cell
    filter_kernel_size: float  # least standard deviation
    scaling_bias: float  # standard deviation where the network says 0
    opacity_bias: float
    scaling_activation: str  # softplus or exp


@dataclass(frozen=True, kw_only=True)
class LatentEncoderConfig(WindowedConfig):
    in_channels: int


@dataclass(frozen=True, kw_only=True)
class GaussianDecoderConfig(WindowedConfig):
    representation_config: Activations


@dataclass(frozen=True, kw_only=True)
class Sampling:
    """The sampling of a flow from noise to its result."""

    steps: int
    guidance: float  # how much more than the picture alone says
    interval: tuple[float, float] = (0.0, 1.0)  # of the time, 1 = noise, in which there is guidance
    rescale_t: float = 1.0  # above 1: shorter steps near the noise


@dataclass(frozen=True)
class Pipeline:
    """The contents of `pipeline.json`."""

    parts: dict[str, str]  # role -> path below the folder, without ending
    structure: Sampling
    latent: Sampling
    mean: tuple[float, ...]  # of the latents, by channel
    std: tuple[float, ...]
    options: dict[str, Any]  # what else it says


C = TypeVar("C")


def read_json(path: Path) -> dict[str, Any]:
    """A json object. Raises LiftError: one sentence."""
    try:
        if path.stat().st_size > BYTES:
            raise LiftError(f"{path} is too large to be a model's description")
        found = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise LiftError(f"{path} is missing: the model's folder is not complete") from error
    except (OSError, ValueError, RecursionError) as error:
        raise LiftError(f"{path} is not a model's description: {error}") from error
    if not isinstance(found, dict):
        raise LiftError(f"{path} is not a model's description: it holds no object")
    return found


def config(kind: type[C], args: dict[str, Any]) -> C:
    """`kind` from a part's published arguments. Raises LiftError for what is not understood."""
    args = {name: value for name, value in args.items() if name not in FOR_TRAINING}
    for name, only in ONLY.items():
        if name in args and args.pop(name) != only:
            raise LiftError(f"a model with another {name} than {only} cannot be run")
    if "representation_config" in args:
        args["representation_config"] = _activations(args["representation_config"])
    known = {field.name: field for field in fields(kind)}  # type: ignore[arg-type]
    if unknown := sorted(set(args) - set(known)):
        raise LiftError(f"the model's description says {', '.join(unknown)}, which is not known")
    needed = {name for name, field in known.items() if field.default is MISSING}
    if absent := sorted(needed - set(args)):
        raise LiftError(f"the model's description does not say {', '.join(absent)}")
    args = {name: _checked(name, value, str(known[name].type)) for name, value in args.items()}
    return kind(**args)


def _checked(name: str, value: Any, kind: str) -> Any:
    """The value of a field whose type is written `kind`."""
    if value is None and kind in ("int", "tuple[int, ...]"):  # json's word for the default
        return 0 if kind == "int" else ()
    if kind == "tuple[int, ...]" and isinstance(value, list):
        return tuple(_checked(name, item, "int") for item in value)
    is_right = {
        "bool": isinstance(value, bool),
        "int": isinstance(value, int) and not isinstance(value, bool) and 0 < value <= LARGEST,
        "float": isinstance(value, int | float) and math.isfinite(value) and abs(value) <= LARGEST,
    }
    if not is_right.get(kind, True):
        raise LiftError(f"the model's description says {name} is {value!r}")
    return value


def _activations(args: Any) -> Activations:
    if not isinstance(args, dict) or not isinstance(args.get("lr"), dict):
        raise LiftError("the model's description does not say how its Gaussians are made")
    args = {**args, "filter_kernel_size": args.get("3d_filter_kernel_size")}
    ours = {field.name for field in fields(Activations)} | {"lr"}
    found = config(Activations, {name: args[name] for name in args if name in ours})
    if found.scaling_activation not in ("softplus", "exp"):
        raise LiftError(f"scales made by {found.scaling_activation!r} are not known")
    return found


def sampling(found: Any) -> Sampling:
    """A flow's sampler, as `pipeline.json` describes it."""
    try:
        params = found["params"]
        return Sampling(
            steps=_checked("steps", params["steps"], "int"),
            guidance=float(params["cfg_strength"]),
            interval=tuple(float(t) for t in params.get("cfg_interval", (0.0, 1.0))),  # type: ignore[arg-type]
            rescale_t=float(params.get("rescale_t", 1.0)),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise LiftError(f"pipeline.json does not say how to sample: {error!r}") from error


def pipeline(folder: Path) -> Pipeline:
    """Read the parts of the model in `folder`. Raises LiftError."""
    args = read_json(folder / "pipeline.json").get("args", {})
    try:
        norm = args["slat_normalization"]
        mean, std = (tuple(float(v) for v in norm[key]) for key in ("mean", "std"))
        parts = {str(role): str(where) for role, where in args["models"].items()}
        samplers = sampling(args["sparse_structure_sampler"]), sampling(args["slat_sampler"])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise LiftError(f"{folder / 'pipeline.json'} is not TRELLIS's: {error!r}") from error
    return Pipeline(parts, *samplers, mean, std, args)


def part_path(folder: Path, where: str, shared: Path | None = None) -> Path:
    """Return a part's path without its ending: in `folder`, or, a relative's, in `shared`.

    Published pipelines name the parts of another model as owner/name/path. Raises LiftError for a
    path that leaves the folder.
    """
    for base, inner in ((folder, where), (shared, "/".join(where.split("/")[2:]))):
        if base is None or not inner:
            continue
        at = base / inner
        if Path(inner).is_absolute() or ".." in Path(inner).parts:
            raise LiftError(f"the model's description points out of its folder: {where!r}")
        if at.with_name(at.name + ".json").exists():
            return at
    raise LiftError(f"{folder / where}.json is missing: the model's folder is not complete")


# Where the weights lie, and what to get when they do not.

TRELLIS, CUPID = "trellis-image-large", "cupid"
ENCODER, TRIPOSPLAT = "dinov2-with-registers-large", "triposplat"
MARKS = {ENCODER: "config.json", TRIPOSPLAT: "vae/flux2-vae.safetensors"}  # else pipeline.json
PACKAGES = ("torch", "transformers", "safetensors")


def weights_folder(id: str) -> Path:
    """The folder of model `id`: the manager's or the user's own.

    Also one that was put, or linked, by hand where the manager would put it.
    """
    return models.place(id) or models.folder() / id


def missing(*ids: str) -> str | None:
    """Return what has to be installed before the models `ids` can run, as one sentence."""
    if reason := models.not_installed(PACKAGES):
        return reason
    for id in ids:
        state = models.look_hub(id)
        if state.state == "damaged":
            return f"{id} is damaged ({state.reason}): objectmorpher models get {id}"
        where = weights_folder(id)
        if not (where / MARKS.get(id, "pipeline.json")).exists():
            own = f"or objectmorpher models add {state.model.family} FOLDER"
            size = f"{state.model.size / 1e9:.1f} GB, {state.model.licence}"
            return f"{id} is not there: objectmorpher models get {id} ({size}), {own}"
    return None
