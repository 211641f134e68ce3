"""Learned models: which are there, and getting one. None is downloaded without being asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from objectmorpher_core import models
from objectmorpher_core.base import torch_environment
from objectmorpher_core.base.progress import Progress
from objectmorpher_core.models import Added, CacheState, HubModel, HubState, Weight, registry

from ...system.texts import t
from ...worker import job_functions
from ...worker.requests import JobError
from ..view import Action
from .methods import Workers

if TYPE_CHECKING:
    from objectmorpher_core.model_sets import SetOffer

    from ..state import EditorState
    from ..tasks import Tasks
    from .methods import Methods
    from .shaping import Shaping

    Looked = tuple[
        tuple[CacheState, ...], tuple[Added, ...], tuple[HubState, ...], tuple[SetOffer, ...]
    ]

DOWNLOAD, LOOK, FORGET = "download", "look at models", "forget segmenter"  # kinds of what runs
ADD = "add model"  # likewise
DEPTH = "depth"  # the id of the one that users bring
MODEL_ENDING = ".onnx"
SELECTING = ("dinov2-vits14", "u2netp")  # what the Select tool does better with, best first


@dataclass(frozen=True)
class Names:
    """A model's name for people, and its purpose."""

    name: str
    gain: str


NAMES = {
    "dinov2-vits14": Names("DINOv2 ViT-S/14", "A click selects the whole object, not its colour"),
    "u2netp": Names("U²-Net small", "Select subject, and better outlines"),
}


class Models:
    """Models as the window offers them."""

    def __init__(
        self, editor: EditorState, methods: Methods, shaping: Shaping, tasks: Tasks
    ) -> None:
        self._editor = editor
        self._methods, self._shaping, self._tasks = methods, shaping, tasks
        self.states: tuple[CacheState, ...] = ()  # empty until they were looked at
        self.added: tuple[Added, ...] = ()  # what users bring, likewise
        self.hub = HubModels(editor, self)  # those of several files
        self.workers = Workers(editor, methods)  # programs of the user's
        self.is_open = False  # the window shows the list
        self.offers: tuple[SetOffer, ...] = ()  # of sets, on this machine
        self._loading = ""
        self._waiting: dict[str, Callable[[], None]] = {}  # id -> how it is begun

    def look(self) -> None:
        """Reads anew what is there; a damaged file counts as none."""
        self._editor.chores.start(
            "Looking at the models", lambda progress: _looked(),
            kind=LOOK, done=self._take, failed=lambda error: None, is_quiet=True,
        )  # fmt: skip

    def open(self) -> None:
        """Shows the list."""
        self.is_open = True
        self.look()

    @property
    def offered(self) -> Weight | None:
        """A model that would make selecting better, is not there and was not declined."""
        declined = self._editor.settings.declined_models
        missing = {s.weight.id: s.weight for s in self.states if s.state != "ok"}
        return next((missing[m] for m in SELECTING if m in missing and m not in declined), None)

    @property
    def downloading(self) -> str | None:
        """The model on its way."""
        return self._loading if self._editor.chores.is_busy(DOWNLOAD) else None

    def download(self, id: str) -> None:
        """Gets a model; the user has clicked the button that says so."""
        self.run(id, names_of(id).name, lambda progress: models.fetch(id, progress))

    def run(self, id: str, name: str, fetch: Callable[[Progress], Path]) -> None:
        """Downloads model `id`, called `name`, once the one before is there; the worker uses it."""
        editor = self._editor
        if self.downloading is not None:
            self._waiting[id] = lambda: self.run(id, name, fetch)
            return
        self._loading = id
        editor.message = None

        def accept(_: Path) -> None:
            self.look()
            self.use_anew()
            editor.say(t("{name} is ready", name=name))
            self._next()

        def complain(error: JobError) -> None:
            # Whatever it was: networks come back, disks are cleared, indexes are mended.
            again = Action(t("Retry"), lambda: self.run(id, name, fetch))
            editor.complain(error.sentence, action=again)
            self._next()

        def stop() -> None:
            self.look()
            self._next()

        editor.chores.start(
            t("Downloading {name}", name=name), fetch, kind=DOWNLOAD,
            done=accept, failed=complain, cancelled=stop,
        )  # fmt: skip

    def _next(self) -> None:
        """What waits longest is begun."""
        if self._waiting and self.downloading is None:
            self._waiting.pop(next(iter(self._waiting)))()

    def is_waiting(self, id: str) -> bool:
        """Whether it is begun when others are there."""
        return id in self._waiting

    def forget_waiting(self, id: str) -> None:
        """It is not begun after all."""
        self._waiting.pop(id, None)

    def download_set(self, offer: SetOffer) -> None:
        """Gets all that is missing of a set; the user has clicked the button that says so."""

        def fetch(progress: Progress) -> Path:
            from objectmorpher_core.model_sets import get_set

            get_set(offer, progress)
            return models.folder()

        self.run(offer.set.id, offer.set.id, fetch)

    def why_not_set(self, offer: SetOffer) -> str | None:
        """Why it cannot be downloaded."""
        return next((why for s in offer.steps if (why := self.hub.why_not(s.model))), None)

    def cancel(self) -> None:
        """Stops the download; nothing of it stays."""
        self._editor.chores.cancel(DOWNLOAD)

    def decline(self, id: str) -> None:
        """Not now: it is not offered again, but stays in the list."""
        settings = self._editor.settings
        declined = (*settings.declined_models, id)
        self._editor.settings = replace(settings, declined_models=declined)

    @property
    def has_depth(self) -> bool:
        """Return whether a depth model is there, of the user's or of ours."""
        is_ours = any(s.model.stage == DEPTH and s.state == "ok" for s in self.hub.states)
        return is_ours or any(own.kind.id == DEPTH and own.state == "ok" for own in self.added)

    @property
    def has_shape(self) -> bool:
        """Whether the shape network can look at what is lifted."""
        is_fed = any(s.weight.id == registry.TOKENS and s.state == "ok" for s in self.states)
        return is_fed and registry.is_shipped()

    def add(self, path: Path) -> None:
        """The user's depth model, tried before it is kept."""
        editor = self._editor
        editor.message = None

        def accept(own: Added) -> None:
            self.look()
            again = Action(t("Lift it again"), lambda: self._shaping.say(t("Depth model")))
            can_follow = editor.is_lifted and self._shaping.why_fixed is None
            editor.say(t("{name} is ready", name=own.name), again if can_follow else None)

        editor.jobs.start(
            t("Trying {name}", name=path.name), job_functions.add_model, DEPTH, path,
            done=accept, failed=editor.complain_of, kind=ADD,
        )  # fmt: skip

    def remove(self) -> None:
        """The depth model's copy is deleted; the user's own file stays where it is."""
        try:
            models.remove(DEPTH)
        except models.ModelError as error:
            self._editor.complain(str(error))
        self.look()

    def _take(self, found: Looked) -> None:
        self.states, self.added, self.hub.states, self.offers = found
        self.workers.look()
        self._methods.forget()

    def use_anew(self) -> None:
        """The worker chooses its segmenter again, and reads the photo with it."""
        self._editor.jobs.start(
            "Changing the model", job_functions.forget_segmenter,
            done=lambda _: self._tasks.read_photo(), failed=lambda error: None,
            kind=FORGET, is_quiet=True,
        )  # fmt: skip


def _looked() -> Looked:
    several = tuple(models.look_hub(model.id) for model in models.hub_models())
    single = tuple(state for state in models.verify() if state.weight.category == "edit")
    return single, tuple(models.added(kind.id) for kind in models.KINDS), several, _offers()


def _offers() -> tuple[SetOffer, ...]:
    """None where the environment asks for a device that is not there."""
    from objectmorpher_core.model_sets import offers

    try:
        return offers()
    except models.ModelError:
        return ()


def names_of(id: str) -> Names:
    """Return the names for people."""
    return NAMES.get(id) or Names(id, models.weight(id).purpose)


# Models of several files: which size of a family is meant, licences, folders of the user's.

GIVEN = (".json", ".safetensors", ".onnx")  # files by which a folder is chosen
FIRST = {
    "sam2": "sam2.1-tiny",
    "sam": "sam-vit-base",
    "sam-onnx": "mobile-sam",
}  # what a family offers before one chooses
NO_TORCH = ("sam-onnx", "lama", "migan", "depth-graph")  # families that run without PyTorch


class HubModels:
    """Models of several files as the window offers them, family by family."""

    def __init__(self, editor: EditorState, own: Models) -> None:
        self._editor = editor
        self._models = own
        self.states: tuple[HubState, ...] = ()  # empty until they were looked at
        self.wanted = ""  # id of the model that a folder is being chosen for
        self._chosen: dict[str, str] = {}  # family -> id
        self._accepted: set[str] = set()  # licences, in this session

    @property
    def families(self) -> tuple[str, ...]:
        """Return the families in the registry's order."""
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
            return t("Needs PyTorch: {command}", command=models.EXTRA)
        if not self.accepts(model):
            return t("Accept its licence first")
        return None

    def download(self, id: str) -> None:
        """Gets one; the user has clicked the button, and accepted what licence needs that."""
        model = models.hub_model(id)
        accepted = model.licence if self.accepts(model) else ""

        def fetch(progress: Progress) -> Path:
            models.get_all(models.missing(id), id, progress, accepted)
            return models.folder() / id

        self._models.run(id, id, fetch)

    def missing(self, model: HubModel) -> tuple[HubModel, ...]:
        """A model after all that it needs and that is not there."""
        there = {state.model.id for state in self.states if state.state == "ok"}
        return models.with_needs(model.id, there.__contains__)

    def use_folder(self, given: Path) -> None:
        """The folder that a chosen file is in is the model from now on."""
        folder = given if given.is_dir() else given.parent
        editor = self._editor
        editor.message = None

        def accept(_: Path) -> None:
            self._models.look()
            self._models.use_anew()

        editor.jobs.start(
            t("Trying {name}", name=folder.name), job_functions.use_model_folder,
            self.wanted, folder, done=accept, failed=editor.complain_of, kind=ADD,
        )  # fmt: skip

    def remove(self, id: str) -> None:
        """Deletes a downloaded one; a folder of the user's is only forgotten."""
        try:
            models.remove_hub(id)
        except models.ModelError as error:
            self._editor.complain(str(error))
        else:
            self._models.use_anew()
        self._models.look()


def has_torch() -> bool:
    """Whether networks of PyTorch's can run, here or apart; nothing is imported for that."""
    is_here = find_spec("torch") is not None and find_spec("transformers") is not None
    return is_here or torch_environment.apart() is not None
