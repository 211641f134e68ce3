"""Models of several files: which size of a family is meant, licences, folders of the user's."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from objectmorpher_core import models
from objectmorpher_core.base.installation import is_frozen
from objectmorpher_core.models import HubModel, HubState

from ...system.texts import t

if TYPE_CHECKING:
    from ..editor import Editor

GIVEN = (".json", ".safetensors", ".onnx")  # files by which a folder is chosen
FIRST = {
    "sam2": "sam2.1-tiny",
    "sam": "sam-vit-base",
    "sam-onnx": "mobile-sam",
}  # what a family offers before one chooses
NO_TORCH = ("sam-onnx", "lama", "migan")  # families that run without PyTorch


class HubModels:
    """What the window offers about them, family by family."""

    def __init__(self, editor: Editor) -> None:
        self._editor = editor
        self.states: tuple[HubState, ...] = ()  # empty until they were looked at
        self.wanted = ""  # id of the model that a folder is being chosen for
        self._chosen: dict[str, str] = {}  # family -> id
        self._accepted: set[str] = set()  # licences, in this session

    @property
    def families(self) -> tuple[str, ...]:
        """In the registry's order."""
        return tuple(dict.fromkeys(state.model.family for state in self.states))

    def of(self, family: str) -> tuple[HubState, ...]:
        """The sizes of a family, the best first."""
        return tuple(state for state in self.states if state.model.family == family)

    def shown(self, family: str) -> HubState:
        """The size that is looked at: the user's choice, one that is there, or a small one."""
        sizes = {state.model.id: state for state in self.of(family)}
        there = [id for id, state in sizes.items() if state.state == "ok"]
        wanted = self._chosen.get(family) or next(iter(there), FIRST.get(family, ""))
        return sizes.get(wanted) or next(iter(sizes.values()))

    def choose(self, family: str, id: str) -> None:
        """Looks at another size."""
        self._chosen[family] = id

    def accepts(self, model: HubModel) -> bool:
        """Whether its licence needs no word, or has been accepted."""
        return model.is_free or model.licence in self._accepted

    def accept(self, model: HubModel, is_accepted: bool) -> None:
        """The user's word on a licence that needs one."""
        (self._accepted.add if is_accepted else self._accepted.discard)(model.licence)

    def why_not(self, model: HubModel) -> str | None:
        """Why it cannot be downloaded now."""
        if model.family not in NO_TORCH and not has_torch():
            if is_frozen():
                return t(
                    "Nothing can be added to this copy; another: {command}", command=models.EXTRA
                )
            return t("Needs PyTorch: {command}", command=models.EXTRA)
        if not self.accepts(model):
            return t("Accept its licence first")
        return t("Another model is on its way") if self._editor.models.downloading else None

    def download(self, id: str) -> None:
        """Gets one; the user has clicked the button, and accepted what licence needs that."""
        model = models.hub_model(id)
        accepted = model.licence if self.accepts(model) else ""
        self._editor.models.run(id, id, lambda progress: models.get(id, progress, accepted))

    def use_folder(self, given: Path) -> None:
        """The folder that a chosen file is in is the model from now on."""
        folder = given if given.is_dir() else given.parent
        self._change(lambda: models.use_folder(self.wanted, folder))

    def remove(self, id: str) -> None:
        """Deletes a downloaded one; a folder of the user's is only forgotten."""
        self._change(lambda: models.remove_hub(id))

    def _change(self, change: Callable[[], object]) -> None:
        try:
            change()
        except models.ModelError as error:
            self._editor.complain(str(error))
        else:
            self._editor.models.use_anew()
        self._editor.models.look()


def has_torch() -> bool:
    """Whether networks of PyTorch's can run; nothing is imported for that."""
    return find_spec("torch") is not None and find_spec("transformers") is not None
