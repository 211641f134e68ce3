"""Programs of the user's own that lift: which there are, their licences, choosing one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from objectmorpher_core.lift import LiftError
from objectmorpher_core.lift.workers import file as worker_file
from objectmorpher_core.lift.workers.file import Worker

from ...system.texts import t

if TYPE_CHECKING:
    from ..editor import Editor

STAGE = "lift"


@dataclass(frozen=True)
class WorkerState:
    """What is there of a worker."""

    name: str
    worker: Worker | None  # None: its file is of no use
    is_accepted: bool = False
    why_not: str | None = None  # why it cannot run now: one sentence


class Workers:
    """What the window offers about them."""

    def __init__(self, editor: Editor) -> None:
        self._editor = editor
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
        self._editor.methods.forget()

    def is_chosen(self, name: str) -> bool:
        """Whether it lifts from now on."""
        return self._editor.settings.backends.lift == name

    def choose(self, name: str) -> None:
        """It lifts from now on."""
        self._editor.methods.choose(STAGE, name)
        self._editor.say(t("{name} lifts from now on", name=name))


def _state(name: str) -> WorkerState:
    try:
        worker = worker_file.read_worker(name)
    except LiftError as error:
        return WorkerState(name, None, why_not=str(error))
    return WorkerState(name, worker, worker.is_accepted, worker.missing())
