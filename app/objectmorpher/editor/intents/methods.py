"""Which backend does each stage: what there is to choose from here, and choosing."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from objectmorpher_core import compose, lift, segment
from objectmorpher_core.compose import refine
from objectmorpher_core.lift import LiftError
from objectmorpher_core.lift.workers import file as worker_file
from objectmorpher_core.lift.workers.file import LiftWorker

from ...system.texts import t
from ...worker import job_functions
from ..settings import AUTO, by_stage

if TYPE_CHECKING:
    from objectmorpher_core.doctor import StageReport

    from ...server.address import Server
    from ...server.running import Offer, Offers
    from ..state import EditorState
    from ..tasks import Tasks
    from .computing import Computing


LOOK = "look at stages"  # kind of job
KNOWN: dict[str, Iterable[str]] = {
    "segment": segment.BACKENDS,
    "lift": lift.BACKENDS,
    "inpaint": compose.BACKENDS,
    "refine": refine.BACKENDS,
}
NOT_FOR_CLICKS = ("subject",)  # segmenters


@dataclass(frozen=True)
class BackendOffer:
    """A backend of a stage."""

    name: str
    why_not: str | None = None  # why it cannot run here: one sentence


class Methods:
    """The backends of "segment", "lift", "inpaint" and "refine", and which ones are chosen.

    Where a server does the long jobs, what can run there counts: only it is asked.
    """

    def __init__(self, editor: EditorState, computing: Computing, tasks: Tasks) -> None:
        self._editor = editor
        self._computing, self._tasks = computing, tasks
        computing.changed = self.forget
        self._stages: dict[str, StageReport] = {}  # empty until looked at
        self._is_asked = self._is_told = False
        self._served: tuple[Server, Offers] | None = None  # with no offers until it answers
        self._fillers: dict[str, tuple[str | None, bool]] = {}

    def forget(self) -> None:
        """A model came or went: what can run is looked at again, when it is wanted."""
        self._stages, self._served, self._fillers = {}, None, {}
        self._is_asked = self._is_told = False

    @property
    def is_known(self) -> bool:
        """Whether it was looked at what can run here."""
        self._look()
        return self._is_told

    def of(self, stage: str) -> tuple[BackendOffer, ...]:
        """Return all backends of a stage, "auto" first; before a check all seem able to run."""
        self._look()
        offer, found = self._offer(stage), self._stages.get(stage)
        why_not = self._absent(stage)
        names = [AUTO, *(name for name in KNOWN[stage] if name not in NOT_FOR_CLICKS)]
        able = offer.able if offer is not None else found.able if found is not None else ()
        names += [name for name in (*able, *why_not) if name not in (*names, *NOT_FOR_CLICKS)]
        if self.chosen(stage) not in names:  # a model's own id, written into the settings file
            names.append(self.chosen(stage))
        return tuple(BackendOffer(name, why_not.get(name)) for name in names)

    def taken(self, stage: str) -> str:
        """The backend that "auto" is; empty while that is not known, or where none can run."""
        self._look()
        offer, found = self._offer(stage), self._stages.get(stage)
        if offer is not None:
            return offer.auto
        return found.auto if found is not None else ""

    def why_not(self, stage: str) -> str | None:
        """Why what is chosen cannot run: one sentence; None while that is not known."""
        chosen = self.chosen(stage)
        if chosen == AUTO and not self.taken(stage):
            if self._offer(stage) is not None:
                return t("The server has no network for it")
            if stage in self._stages:
                return t("No refinement model is installed: Window > Models… gets one")
        return next(m.why_not for m in self.of(stage) if m.name == chosen)

    def filler(self, name: str) -> tuple[str | None, bool]:
        """Why an inpainter cannot run here, or None; whether another seed gives another fill.

        Asked in every frame: to look for packages takes milliseconds, so the answer is kept.
        """
        if name not in self._fillers:
            reason = compose.missing(name)
            self._fillers[name] = reason, reason is None and compose.is_random(name)
        return self._fillers[name]

    @property
    def _server(self) -> Server | None:
        """That is asked; None: this computer does the work."""
        return self._computing.reached

    def _offer(self, stage: str) -> Offer | None:
        """What the server says of a stage; a stage that it does not serve is done here."""
        if self._served is None or self._served[0] != self._server:
            return None
        return self._served[1].get(stage)

    def _absent(self, stage: str) -> dict[str, str]:
        """Backend -> why it cannot run."""
        offer, found = self._offer(stage), self._stages.get(stage)
        if offer is None:
            return dict(found.others) if found is not None else {}
        reason = t("The server does not have it")
        return {name: reason for name in KNOWN[stage] if name not in offer.able}

    def chosen(self, stage: str) -> str:
        """The one that is asked to do it; "auto" where the settings name one that is not known."""
        name = getattr(self._editor.settings.backends, stage)
        offer, found = self._offer(stage), self._stages.get(stage)
        known = {*KNOWN[stage], *(offer.able if offer else ())}
        known |= {*found.able, *dict(found.others)} if found else set()
        is_known = segment.is_known(name) if stage == "segment" else name in known
        return name if is_known else AUTO

    def choose(self, stage: str, name: str) -> None:
        """Who does it from now on. What is done stays; a photo is read anew for its clicks."""
        editor = self._editor
        if name == getattr(editor.settings.backends, stage):
            return
        backends = replace(editor.settings.backends, **{stage: name})
        editor.settings = replace(editor.settings, backends=backends)
        if stage == "segment":
            self._tasks.read_photo()

    def _look(self) -> None:
        """In the worker, for it may load PyTorch to ask for a GPU; and the server, if there is."""
        server = self._server
        if server is not None and (self._served is None or self._served[0] != server):
            self._served = server, {}
            self._computing.ask_offers(lambda offers: self._take_offers(server, offers))
        if self._is_asked:
            return
        self._is_asked = True
        self._editor.jobs.start(
            "Looking at what can run here", job_functions.look_at_stages,
            done=self._take, failed=lambda error: self._give_up(), cancelled=self._give_up,
            kind=LOOK, is_quiet=True,
        )  # fmt: skip

    def _take(self, stages: tuple[StageReport, ...]) -> None:
        self._stages, self._is_told = by_stage(stages), True

    def _give_up(self) -> None:
        """All seem able to run: who is asked for it says what is missing."""
        self._is_told = True

    def _take_offers(self, server: Server, offers: Offers) -> None:
        self._served = server, offers


# Programs of the user's own that lift: which there are, their licences, choosing one.

STAGE = "lift"


@dataclass(frozen=True)
class WorkerState:
    """The state of a worker."""

    name: str
    worker: LiftWorker | None  # None: its file is of no use
    is_accepted: bool = False
    why_not: str | None = None  # why it cannot run now: one sentence


class Workers:
    """Workers as the window offers them."""

    def __init__(self, editor: EditorState, methods: Methods) -> None:
        self._editor = editor
        self._methods = methods
        self.states: tuple[WorkerState, ...] = ()  # as they were looked at last

    def look(self) -> None:
        """Reads their files, which are small."""
        self.states = tuple(_state(name) for name in worker_file.worker_names())

    def accept(self, name: str, is_accepted: bool) -> None:
        """The user's word on the licence of a worker."""
        state = next(state for state in self.states if state.name == name)
        if state.worker is None or state.is_accepted == is_accepted:
            return
        try:
            if is_accepted:
                worker_file.accept_licence(name, state.worker.licence)
            else:
                worker_file.forget_licence(name)
        except LiftError as error:
            self._editor.complain(str(error))
        self.look()
        self._methods.forget()

    def is_chosen(self, name: str) -> bool:
        """Whether it lifts from now on."""
        return self._editor.settings.backends.lift == name

    def choose(self, name: str) -> None:
        """It lifts from now on."""
        self._methods.choose(STAGE, name)
        self._editor.say(t("{name} lifts from now on", name=name))


def _state(name: str) -> WorkerState:
    try:
        worker = worker_file.read_worker(name)
    except LiftError as error:
        return WorkerState(name, None, why_not=str(error))
    return WorkerState(name, worker, worker.is_accepted, worker.missing())
