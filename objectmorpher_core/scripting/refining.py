"""An edit refined by a network: the composite made, what is to be seen of it cut out, handed over.

Cutting out and refining are apart, because the second may be done by another computer, which then
is sent the crop and not the document.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from ..base.progress import Progress, part, silent
from ..compose import refine
from ..compose.composite import composite
from ..compose.refine import refinement
from ..compose.refine.refinement import CoarseEdit
from ..deform.puppet import Puppet
from ..document import refine_edits
from ..document.model import Document


@dataclass(frozen=True)
class Refining:
    """How an edit is to be refined."""

    backend: str
    seed: int = 0
    strength: float = 1.0  # in [0, 1]


def coarse_edit(
    document: Document, progress: Progress = silent, puppets: dict[int, Puppet] | None = None
) -> CoarseEdit:
    """What of the edit a refiner sees. Raises RefineError where nothing was edited."""
    bare = replace(document, refined=None)
    result = composite(bare, puppets, progress, keeps_weights=True)
    return refinement.cut_edit(document.photo.pixels, result)


def with_refinement(
    document: Document, how: Refining, progress: Progress, puppets: dict[int, Puppet]
) -> Document:
    """`document` refined. Raises RefineError or ModelError."""
    refiner = refine.load(how.backend)
    edit = coarse_edit(document, part(progress, 0.0, 0.05), puppets)
    rest = part(progress, 0.05, 1.0)
    made = refinement.refine(edit, refiner, rest, how.seed, how.strength)
    return refine_edits.set_refined(document, made)
