"""Our own method on a subject, with a log of its stages and of a drag made again.

The time of the edit is all of it, with reading the photo and without writing the result, whatever
else the stages in it are. After the edit its handles and its placement are taken back and dragged
again in `STEPS` moves, each solved, skinned and drawn on the processor as the editor's window does
it: the time from a move to its picture is what the log's "input" and "feedback" tell. What a window
adds, waiting for the screen, is not in it (docs/tour/feel.md measures that).
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from objectmorpher_core.base.progress import Progress, silent
from objectmorpher_core.compose.composite import object_texture
from objectmorpher_core.deform.puppet import Puppet
from objectmorpher_core.document.model import Document, Handle, Placement, Pose
from objectmorpher_core.pictures.image import Picture
from objectmorpher_core.pipeline import run_script
from objectmorpher_core.raster import tiles

from ..error import EvaluationError
from ..subjects.subject import EvaluatedEdit
from .interaction_log import BEGIN, COMPUTING, END, FEEDBACK, INPUT, Event

STEPS = 30  # moves of the drag, as in half a second at 60 Hz
VIEW = 1024  # px, the longer side of what the window shows
BUDGET = 0.01  # s of solving a move, as in the editor


@dataclass(frozen=True, eq=False)
class Timed:
    """Our method's result for a subject."""

    picture: Picture
    events: tuple[Event, ...]


def run_subject(subject: EvaluatedEdit, progress: Progress = silent) -> Timed:
    """Edits the subject as its guidance says. Raises EvaluationError and the stages' errors."""
    item = subject.guidance.item
    if item is None:
        raise EvaluationError(f"{subject.name}: {subject.guidance.reason}")
    script = item.script
    mask = None
    try:
        if script.mask:
            with open(script.mask, "rb") as file:
                mask = file.read()
        data = subject.image.read_bytes()
    except OSError as error:
        raise EvaluationError(f"{subject.name}: {error.filename} cannot be read") from error
    start = time.perf_counter()
    edited = run_script(data, subject.image.name, script, mask, progress, others=item.others)
    events = [Event(0.0, BEGIN, "edit")]
    for span in edited.stopwatch.spans:
        if span.stage in COMPUTING:
            events.append(Event(span.begin - start, BEGIN, span.stage))
            events.append(Event(span.end - start, END, span.stage))
    events.append(Event(time.perf_counter() - start, END, "edit"))
    events += _drag(edited.document, edited.first, edited.puppet, start)
    return Timed(edited.picture, tuple(sorted(events, key=lambda event: event.t)))


def _drag(document: Document, k: int, puppet: Puppet, start: float) -> list[Event]:
    """Inputs and what answers them, of the first object."""
    item = document.objects[k]
    if not item.is_moved or item.matte is None:
        return []
    texture = object_texture(item.matte, item.lifted)
    camera = puppet.camera
    zoom = min(1.0, VIEW / max(camera.width, camera.height))
    size = (max(1, round(camera.width * zoom)), max(1, round(camera.height * zoom)))
    view = camera.windowed(0, 0, *size, zoom)
    pose: Pose | None = None
    events: list[Event] = []
    for share in _shares():
        begun = time.perf_counter()
        handles = tuple(_on_the_way(handle, share) for handle in item.handles)
        if any(not handle.is_pin for handle in handles):
            before = pose or puppet.deformer.rest()
            solution = puppet.deformer.solve(handles, item.footing, before, BUDGET)
            pose = solution.pose
        splats = puppet.posed(pose, _part_of(item.placement, share))
        tiles.draw_rgba(tiles.prepare(splats, view, camera), texture)
        events.append(Event(begun - start, INPUT, "drag"))
        events.append(Event(time.perf_counter() - start, FEEDBACK))
    return events[2:]  # the first move prepares what the editor has prepared when a drag begins


def _shares() -> Iterator[float]:
    yield from np.linspace(0, 1, STEPS + 1)


def _on_the_way(handle: Handle, share: float) -> Handle:
    if handle.is_pin:
        return handle
    return replace(handle, target=handle.point + share * (handle.target - handle.point))


def _part_of(whole: Placement, share: float) -> Placement:
    yaw, pitch, roll = (share * angle for angle in whole.turn)
    move = share * whole.move[0], share * whole.move[1]
    scale = float(whole.scale**share)
    return replace(
        whole, move=move, depth=share * whole.depth, turn=(yaw, pitch, roll), scale=scale
    )
