"""The object alone, seen from any side; the document stays as it is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core.base.arrays import U8
from objectmorpher_core.base.rotations import turn_matrix, turn_of
from objectmorpher_core.document.model import Document, Placement
from objectmorpher_core.document.placement import with_centre

from ...canvas.memo import Memo
from ...system.texts import t
from ..settings import AS_THEY_ARE, AUTO
from ..view import Orbit, ToolName
from .landing import OF_THE_PHOTO, Landing

if TYPE_CHECKING:
    from ..state import EditorState

FILLS = 0.8  # x the photo's smaller side, that the object takes while one walks around it
NEAREST = 0.9  # object diameters, from the camera to its centre


class LookingIntents:
    """The canvas while the Look tool walks around an object."""

    def __init__(self, editor: EditorState, landing: Landing) -> None:
        self._editor = editor
        self._landing = landing
        # of the last orbit: what is derived from a document is remembered by identity
        self._made: tuple[Document, int, Orbit, Document] | None = None
        self._screens, self._proofs, self._tables = Memo(), Memo(), Memo()

    @property
    def orbit(self) -> Orbit | None:
        """Return the direction from which the object alone is shown; None in the photo's view."""
        view = self._editor.view
        is_there = view.tool is ToolName.LOOK and self._editor.is_lifted
        return view.orbit if is_there else None

    @property
    def document(self) -> Document | None:
        """Return the document on the canvas: the edit, or its object alone, turned and centred."""
        editor, orbit = self._editor, self.orbit
        document, k = editor.document, editor.current
        if document is None or orbit is None:
            self._made = None
            return document
        made = self._made
        if made is None or made[0] is not document or made[1:3] != (k, orbit):
            made = self._made = (document, k, orbit, _alone(document, k, orbit))
        return made[3]

    # The colours of the screen

    def screen_profile(self) -> bytes | None:
        """Return the ICC profile of the screen; None: it is taken for sRGB."""
        from ...system.desktop import read_profile, system_profile

        chosen = self._editor.settings.screen_profile

        def load() -> bytes | None:
            return system_profile() if chosen == AUTO else read_profile(Path(chosen))

        return None if chosen == AS_THEY_ARE else self._screens(load, chosen)

    def screen_table(self) -> U8 | None:
        """Return the photo's colours on this screen, see `screen_colours`; None: as they are."""
        from objectmorpher_core.pictures.screen_colours import screen_table

        document, proof = self._editor.document, self.proof_profile()
        if document is None:
            return None
        if proof is None and self._editor.settings.screen_profile == AS_THEY_ARE:
            return None
        photo, screen = document.photo.picture.icc, self.screen_profile()
        return self._tables(lambda: screen_table(photo, screen, proof), photo, screen, proof)

    def proof_profile(self) -> bytes | None:
        """Return the ICC profile by which colours are proofed now; None: they are not."""
        chosen = self._editor.settings.proof_profile
        if not chosen or not self._editor.view.is_proof:
            return None
        from ...system.desktop import read_profile

        return self._proofs(lambda: read_profile(Path(chosen)), chosen)

    def toggle_proof(self) -> None:
        """Shows the colours of the export on a printer or another screen, or as they are again."""
        editor = self._editor
        editor.view.is_proof = not editor.view.is_proof
        if editor.view.is_proof and self.proof_profile() is None:
            editor.view.is_proof = False
            name = Path(editor.settings.proof_profile).name
            editor.complain(t("{name} is not there any more: choose another profile", name=name))

    def proof_by(self, path: Path) -> None:
        """From now on colours are proofed by the profile of a file, which is shown at once."""
        editor, name = self._editor, self._named(path, is_proof=True)
        if name is None:
            editor.complain(t("{name} is no colour profile", name=path.name))
            return
        editor.settings = replace(editor.settings, proof_profile=str(path.absolute()))
        editor.view.is_proof = True
        editor.say(t("Colours are shown as by {name}", name=name))

    def _named(self, path: Path, is_proof: bool = False) -> str | None:
        """A profile's own name; None where the file is none."""
        from objectmorpher_core.pictures.screen_colours import profile_name

        from ...system.desktop import read_profile

        profile = read_profile(path)
        return None if profile is None else profile_name(profile, is_proof)

    def use_profile(self, path: Path) -> None:
        """From now on the screen has the profile of a file."""
        editor, name = self._editor, self._named(path)
        if name is None:
            editor.complain(t("{name} is no colour profile of a screen", name=path.name))
            return
        editor.settings = replace(editor.settings, screen_profile=str(path.absolute()))
        editor.say(t("The photo is shown by the profile {name}", name=name))

    @property
    def badge(self) -> str:
        """Return the canvas's badge, where it is not plain whether the photo or the edit is shown.

        Without a word, and with the last one, the canvas shows the edited picture.
        """
        editor = self._editor
        if editor.document is None:
            return ""
        if editor.view.is_before:
            return t("The photo as it was")
        if self.proof_profile() is not None:
            name = Path(editor.settings.proof_profile).stem
            return t("Proof · colours of {name}", name=name)
        if editor.view.tool in OF_THE_PHOTO and self._landing.is_edit_shown:
            return t("Your edit · Hold X to see the photo")
        return ""

    def turn(self, orbit: Orbit) -> None:
        """Looks from there."""
        self._editor.view.orbit = orbit

    def reset(self) -> None:
        """The photo's own view again."""
        self._editor.view.orbit = None


def _alone(document: Document, k: int, orbit: Orbit) -> Document:
    """A document to be shown only: object `k` turned about its centre, before the camera."""
    item, camera = document.objects[k], document.photo.camera
    assert item.lifted is not None
    turn = turn_matrix(orbit.yaw, orbit.pitch, 0.0) @ turn_matrix(*item.placement.turn)
    placement = Placement(turn=turn_of(turn), scale=item.placement.scale)
    diameter = item.lifted.diameter * item.lifted.scale * placement.scale
    width, height = document.photo.size
    depth = max(camera.focal / (FILLS * min(width, height)), NEAREST) * diameter
    middle = camera.unproject(np.array([width / 2, height / 2]), depth)
    placed = replace(
        item, placement=with_centre(placement, middle, item.lifted, camera), is_visible=True
    )
    others = (replace(other, is_visible=False) for other in document.objects)
    objects = tuple(placed if i == k else other for i, other in enumerate(others))
    return replace(document, objects=objects, refined=None)
