"""A long working day of an artist: the editor with its worker and OpenGL, but no window."""

from __future__ import annotations

import contextlib
import ctypes
import os
import random
import statistics
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import moderngl
import numpy as np

from objectmorpher.commands import run
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.settings import Settings
from objectmorpher.editor.view import ToolName
from objectmorpher.gui.window.scenes import build_scene
from objectmorpher.render.renderer import Renderer
from objectmorpher.tools.pointer import Pointer
from objectmorpher.tools.pose_tool import PoseTool
from objectmorpher_core.base.arrays import Mask
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import Placement, Prompt

SIZE = (360, 280)  # canvas px: software OpenGL takes a second for four times as many
DRAWN = 50  # edits from one frame to the next
MOVES = 3  # of the pointer in a drag
MOST_HANDLES = 6
MOST_OBJECTS = 4
PATIENCE = 300.0  # s for a job
SAVED, EXPORTED = 500, 1000  # edits from one time to the next
REOPENED = 1000  # edits from one opening of the session to the next
DRAGS = 40  # that a sample's time is the median of
HUNDRED = 100  # edits that are done again and again, the same on the same session
KINDS = (
    ("drag",) * 6 + ("place",) * 6 + ("undo",) * 4 + ("light",) * 2 + ("unpick", "copy", "remove")
)


@dataclass(frozen=True)
class Sample:
    """What the session costs after so many edits."""

    edits: int
    minutes: float
    memory: float  # MiB resident, of the editor
    worker: float  # MiB resident, of its worker; 0 while there is none
    drag: float  # ms of the main thread in a drag, median of the last ones
    files: int  # open
    threads: int
    children: int  # processes
    textures: int  # of OpenGL
    buffers: int
    steps: int  # that can be undone
    kept: int  # files in the program's own folder
    disk: float  # MiB in it


@dataclass(frozen=True)
class Hundred:
    """What the same hundred edits of the same session cost after so many others."""

    edits: int  # done before
    main: float  # s of the main thread
    process: float  # s of all threads, so of OpenGL's in software too
    drag: float  # ms of the main thread in a drag, median
    wall: float  # s
    memory: float  # MiB resident, of the editor, after them
    textures: int  # of OpenGL, likewise
    buffers: int


class Session:
    """One photo, an object lifted, and edits without end. `close` it."""

    def __init__(self, photo: Path, mask: Mask, folder: Path, seed: int = 3) -> None:
        """`mask` (H, W) of the object; `folder`: for the session and exports.

        Raises RuntimeError where OpenGL is missing.
        """
        try:
            self._gl = moderngl.create_standalone_context(require=330, backend="egl")
        except Exception as error:
            raise RuntimeError(f"no OpenGL without a window here: {error}") from error
        self._renderer = window_renderer(self._gl, "gl")
        self._tool, self._chance = PoseTool(), random.Random(seed)
        self._folder, self._begun = folder, time.monotonic()
        self._drags: deque[float] = deque(maxlen=DRAGS)
        self.edits = 0
        self.editor = Editor(Settings())
        self.editor.view.resize(SIZE, 1.0, None)
        self._open(photo)
        document = edits.add_object(self.editor.document)
        self.editor.apply("Select", edits.set_mask(document, 0, mask, Prompt()))
        self._wait()
        run(self.editor, "lift")
        self._wait()
        assert self.editor.is_lifted, self.editor.message
        self.editor.view.tool = ToolName.POSE
        self._first = self.editor.history.cursor  # nothing before it is undone
        self._start = folder / "start.omorph"
        self.editor.filing.save_as(self._start)
        self._wait()
        self._places = np.argwhere(mask)[:, ::-1] + 0.5  # image px of the object

    def close(self) -> None:
        self.editor.shut_down()
        self._gl.release()

    def samples(self, count: int, every: int) -> Iterator[Sample]:
        """Does `count` edits, and measures after each `every` of them."""
        for _ in range(count):
            self.edit()
            if self.edits % every == 0:
                self._wait()
                yield self.measure()

    def hundred(self) -> Hundred:
        """Opens the session of the beginning and does the same edits on it."""
        self._save()
        self._reopen(self._start)
        usual, self._chance = self._chance, random.Random(11)
        self._drags.clear()
        begun = time.thread_time(), time.process_time(), time.monotonic()
        for k in range(HUNDRED):
            self._one(k % DRAWN == 0)
        ended = time.thread_time(), time.process_time(), time.monotonic()
        main, process, wall = (b - a for a, b in zip(begun, ended, strict=True))
        self._chance = usual
        drag = 1e3 * statistics.median(self._drags)
        return Hundred(self.edits, main, process, drag, wall, _resident("self"), *self._on_gpu())

    def _one(self, is_drawn: bool) -> None:
        getattr(self, f"_{self._chance.choice(KINDS)}")()
        self.editor.poll()
        if is_drawn:
            self._draw()

    def edit(self) -> None:
        """One edit, often a frame, and now and then what takes a job."""
        self.edits += 1
        self._one(self.edits % DRAWN == 0)
        if self.edits % SAVED == 0:
            self._save()
        if self.edits % EXPORTED == 0:
            self.editor.exporting.export_to(self._folder / "day.png")
            self._wait()
        if self.edits % REOPENED == 0:
            self._save()
            self._reopen(self._day)
        self.editor.message = None

    def measure(self) -> Sample:
        worker = self.editor.jobs._worker
        pid = worker.process.pid if worker is not None and worker.process.is_alive() else None
        drag = statistics.median(self._drags or [0.0])
        task = Path("/proc/self/task")
        kept = _sizes(Path(os.environ["OBJECTMORPHER_DATA"]))
        children = [kid for t in task.iterdir() for kid in (t / "children").read_text().split()]
        return Sample(
            self.edits, (time.monotonic() - self._begun) / 60, _resident("self"),
            0.0 if pid is None else _resident(str(pid)), 1e3 * drag,
            len(list(Path("/proc/self/fd").iterdir())), threading.active_count(), len(children),
            *self._on_gpu(), len(self.editor.history.steps), len(kept), sum(kept) / 2**20,
        )  # fmt: skip

    def _on_gpu(self) -> tuple[int, int]:
        """How many textures and buffers there are."""
        texture, buffer = self._gl.texture((1, 1), 4), self._gl.buffer(reserve=4)
        counts = _alive("glIsTexture", texture.glo), _alive("glIsBuffer", buffer.glo)
        texture.release()
        buffer.release()
        return counts

    # ---- edits ------------------------------------------------------------------------------

    def _drag(self) -> None:
        """By the pointer, from somewhere on the object."""
        self.editor.objects.choose(0)
        if len(self.editor.object.handles) >= MOST_HANDLES:
            self._unpick()
        view = self.editor.view
        start = view.canvas_from_image(self._places[self._chance.randrange(len(self._places))])
        way = np.array([self._chance.uniform(-25, 25), self._chance.uniform(-25, 25)])
        before, begun = self.editor.document, time.thread_time()
        self._tool.hover(self.editor, Pointer(*start))
        pointer = Pointer(*start, is_down=True)
        self.editor.hand.press(self._tool.press(self.editor, pointer), pointer.button)
        for k in range(1, MOVES + 1):
            self.editor.hand.move(Pointer(*(start + way * k / MOVES), is_down=True))
        self.editor.hand.move(Pointer(*(start + way)))
        if self.editor.document is not before:  # else it was dragged beside the moved object
            self._drags.append(time.thread_time() - begun)

    def _place(self) -> None:
        document, chance = self.editor.document, self._chance
        which = chance.randrange(len(document.objects))
        move = chance.uniform(-40, 40), chance.uniform(-25, 25)
        placement = Placement(move, chance.uniform(-0.2, 0.2), (0.0, chance.uniform(-40, 40), 0.0))
        self.editor.apply("Move object", edits.set_placement(document, which, placement))

    def _undo(self) -> None:
        history = self.editor.history
        steps = min(self._chance.randrange(1, 6), history.cursor - self._first)
        for _ in range(steps):
            self.editor.undo()
        for _ in range(self._chance.randrange(steps + 1)):
            self.editor.redo()

    def _light(self) -> None:
        document = self.editor.document
        harmony = self._chance.random()
        self.editor.apply("Harmony", edits.set_share(document, 0, "harmony", harmony))

    def _unpick(self) -> None:
        self.editor.objects.choose(0)
        if self.editor.object.handles:
            self.editor.posing.remove(self._chance.randrange(len(self.editor.object.handles)))

    def _copy(self) -> None:
        if len(self.editor.document.objects) < MOST_OBJECTS:
            self.editor.objects.choose(0)
            self.editor.objects.duplicate()

    def _remove(self) -> None:
        count = len(self.editor.document.objects)
        if count > 1:
            self.editor.objects.choose(count - 1)
            self.editor.objects.remove()

    # ---- the rest ---------------------------------------------------------------------------

    @property
    def _day(self) -> Path:
        return self._folder / "day.omorph"

    def _save(self) -> None:
        self.editor.filing.save_as(self._day)
        self._wait()

    def _reopen(self, session: Path) -> None:
        self._open(session)
        self._first = 0
        self.editor.view.tool = ToolName.POSE

    def _open(self, path: Path) -> None:
        self.editor.tabs.close(self.editor.tab)  # what is unsaved is given up
        self.editor.filing.open(path)
        self._wait()
        assert self.editor.history is not None, self.editor.message

    def _draw(self) -> None:
        scene = build_scene(self.editor, "gl")
        self._renderer.begin((0.0, 0.0, 0.0), SIZE)
        self._renderer.draw(scene, self.editor.view, (0, 0, *SIZE))
        assert self._renderer.kind == "gl"

    def _wait(self) -> None:
        """As the window's loop does."""
        editor, end = self.editor, time.monotonic() + PATIENCE

        def is_idle() -> bool:
            return not editor.poll() and editor.jobs.is_idle and editor.chores.is_idle

        while not is_idle():
            assert time.monotonic() < end, f"nothing came in time: {editor.message}"
            time.sleep(0.005)


def _alive(is_one: str, last: int) -> int:
    """How many of OpenGL's names up to `last` are of something."""
    ask = getattr(ctypes.CDLL("libGL.so.1"), is_one)
    ask.restype, ask.argtypes = ctypes.c_ubyte, [ctypes.c_uint]
    return sum(ask(name) for name in range(1, last + 1))


def _sizes(folder: Path) -> list[int]:
    """Bytes of every file below; autosave writes and removes them meanwhile."""
    found = []
    for path in folder.rglob("*"):
        with contextlib.suppress(FileNotFoundError):
            found += [path.stat().st_size] if path.is_file() else []
    return found


def _resident(process: str) -> float:
    """MiB."""
    status = Path(f"/proc/{process}/status").read_text()
    return int(status.split("VmRSS:")[1].split()[0]) / 1024


def window_renderer(context: Any, wanted: str) -> Renderer:
    """One whose window is a framebuffer."""
    context._screen = context.framebuffer([context.texture(SIZE, 4)])
    usual: Callable[..., Any] = moderngl.create_context
    moderngl.create_context = lambda **_: context
    try:
        return Renderer(wanted)
    finally:
        moderngl.create_context = usual
