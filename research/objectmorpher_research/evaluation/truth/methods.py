"""The methods that are compared: each differs in what its name says."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from objectmorpher_core.base.arrays import RGB
from objectmorpher_core.document.model import Matte

from . import flat_methods
from .cases import EditOutcome, TruthCase
from .chain import CARD, PLAIN, Chain, Way
from .lifted_mesh import draw_mesh


@dataclass(frozen=True, eq=False)
class Given:
    """The input that all methods of a case share: case, cut-out of the mask, plate, chain."""

    case: TruthCase
    matte: Matte
    plate: RGB
    chain: Chain


@dataclass(frozen=True)
class EditMethod:
    """A method of making an edit."""

    name: str
    told: str  # what it is, for the report
    apply: Callable[[Given], EditOutcome]
    only_bends: bool = False  # otherwise the same as ours where the thing moves as a whole


OURS = "ours"


def _chain(name: str, told: str, way: Way, only_bends: bool = False) -> EditMethod:
    return EditMethod(name, told, lambda given: given.chain.apply(given.case, way), only_bends)


_ALL = (
    _chain(OURS, "the product: lifted, deformed by ARAP, harmonised", Way()),
    EditMethod("nothing", "the photo as it is", lambda given: flat_methods.do_nothing(given.case)),
    EditMethod(
        "paste", "best 2-D similarity of the cut-out",
        lambda given: flat_methods.paste(given.case, given.matte, given.plate),
    ),
    EditMethod(
        "warp", "2-D as-rigid-as-possible warp of the cut-out",
        lambda given: flat_methods.warp(given.case, given.matte, given.plate),
    ),
    _chain("card", "a flat card in 3D", Way(lift=CARD)),
    _chain("plain", "plain-colour Gaussians, four times as many", Way(lift=PLAIN)),
    EditMethod(
        "mesh", "a textured mesh of the lifted body instead of Gaussians",
        lambda given: draw_mesh(given.chain, given.case, given.matte, given.plate),
    ),
    _chain("laplacian", "Laplacian instead of ARAP", Way(deform="laplacian"), True),
    _chain("euclidean", "Euclidean links", Way(links="euclidean"), True),
    _chain("no-harmonise", "without harmonise", Way(is_harmonised=False)),
)  # fmt: skip
METHODS: Mapping[str, EditMethod] = {method.name: method for method in _ALL}
