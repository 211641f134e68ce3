"""The models list's rows of workers: the licence's box, and which one lifts."""

from __future__ import annotations

from imgui_bundle import imgui

from ..editing.workers import WorkerState
from ..editor import Editor
from ..texts import sentence, t
from .theme import theme
from .widgets import Kind, bold_text, button, checkbox, gap, heading, note, rule

BUTTON = 120.0  # points
SIDE = 20.0 + BUTTON + 16.0


def draw_worker_rows(editor: Editor) -> None:
    """All that there are; nothing where there is none."""
    states = editor.models.workers.states
    if states:
        gap(12)
        heading(t("Workers, which lift in environments of their own"))
    for state in states:
        imgui.push_id(f"worker {state.name}")
        _draw_worker(editor, state)
        imgui.pop_id()


def _draw_worker(editor: Editor, state: WorkerState) -> None:
    workers, worker = editor.models.workers, state.worker
    rule()
    with bold_text():
        imgui.align_text_to_frame_padding()
        imgui.text_unformatted(state.name)
    imgui.same_line(imgui.get_window_width() - theme.pt(20 + BUTTON))
    if workers.is_chosen(state.name):
        button(t("Lifts now"), Kind.PLAIN, t("It is chosen"), width=BUTTON)
    elif button(t("Lift with it"), Kind.PLAIN, _why_not(state), width=BUTTON):
        workers.choose(state.name)
    if worker is None:
        note(f"{sentence(state.why_not or '')}.")
        return
    note(t("Licence {licence}", licence=worker.licence or t("unknown")))
    if worker.page:
        note(t("From {source}", source=worker.page.removeprefix("https://")))
    if not worker.is_free:
        label = t("I have read and accept the {licence}", licence=worker.licence)
        workers.accept(state.name, checkbox(label, state.is_accepted))
    if state.why_not is not None and state.is_accepted:
        note(f"{sentence(state.why_not)}.")


def _why_not(state: WorkerState) -> str | None:
    """Why it cannot be chosen: short where the row says the rest."""
    is_asked = state.worker is not None and not state.is_accepted
    return t("Accept its licence first") if is_asked else state.why_not
