"""The large cases, each through the whole job: `python -m tests.soak.large CASE` (photo, ...).

Works in the editor and its worker, without a window, and prints one line of JSON for each step:
seconds on the wall, processor seconds of the editor, of its main thread and of its worker, the
longest that the main thread was at work without a frame (of the processor and on the wall), and the
most memory that each and both have held in it, what they share counted once. Frames are drawn
as the window does: with OpenGL, or by the processor where that is emulated.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import cv2
import moderngl
import numpy as np

from objectmorpher.commands import run
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.settings import Settings
from objectmorpher.editor.view import ToolName
from objectmorpher.gui.window.scenes import build_scene
from objectmorpher.tools.pointer import Pointer
from objectmorpher.tools.pose_tool import PoseTool
from objectmorpher_core.document import edits
from objectmorpher_core.document.gaussians import Gaussians
from objectmorpher_core.document.model import Document, Placement, Prompt
from objectmorpher_core.document.pose import Pose
from objectmorpher_core.splat_files import encode
from tests import photos

from .session import SIZE, window_renderer
from .watching import Watch, share

SIDE = 10_000  # px of the large photo's
OBJECTS = 20
GAUSSIANS = 2_000_000
STEPS = 10_000
HUNDRED = 100
PATIENCE = 900.0  # s for a job
DRAGS = 40
MOVES = 3  # of the pointer in a drag


class Desk:
    """An editor, and what it costs."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.editor = folder, Editor(Settings())
        self.editor.view.resize(SIZE, 1.0, None)
        self._tool = PoseTool()
        self._stall = self._stall_wall = 0.0  # s, of a step's longest turn of the loop
        self.wait(lambda: None)
        self._watch = Watch(lambda: self._worker)
        try:
            self._gl = moderngl.create_standalone_context(require=330, backend="egl")
            self._renderer = window_renderer(self._gl, "auto")
        except Exception as error:
            print(f"nothing is drawn: {error}", file=sys.stderr)
            self._renderer = None

    @contextmanager
    def step(self, name: str, **more: object) -> Iterator[None]:
        """Tells what it costs, with all the jobs that it starts."""
        self._watch.most()
        self._stall = self._stall_wall = 0.0
        begun = self._clocks()
        yield
        self.wait(lambda: None)
        wall, own, main, worker = np.subtract(self._clocks(), begun)
        most = self._watch.most()
        told = {
            "step": name, "wall_s": round(wall, 2), "editor_s": round(own, 2),
            "main_s": round(main, 2), "worker_s": round(worker, 2),
            "stall_s": round(self._stall, 2), "stall_wall_s": round(self._stall_wall, 2),
            "editor_mib": round(most[0]), "worker_mib": round(most[1]), "both_mib": round(most[2]),
            "editor_now_mib": round(share("self")), "worker_now_mib": round(share(self._worker)),
        }  # fmt: skip
        print(json.dumps(told | more), flush=True)

    def draw(self) -> None:
        """A frame, as the window draws it."""
        if self._renderer is not None:
            scene = build_scene(self.editor, self._renderer.kind)
            self._renderer.begin((0.0, 0.0, 0.0), SIZE)
            self._renderer.draw(scene, self.editor.view, (0, 0, *SIZE))
            self._gl.finish()

    def close(self) -> None:
        self._watch.close()
        self.editor.shut_down()

    def _poll(self) -> bool:
        begun = time.thread_time(), time.monotonic()
        is_changed = self.editor.poll()
        spent = time.thread_time() - begun[0], time.monotonic() - begun[1]
        self._stall = max(self._stall, spent[0])
        self._stall_wall = max(self._stall_wall, spent[1])
        return is_changed

    def wait(self, then: Callable[[], object]) -> None:
        """As the window's loop does, until nothing runs."""
        editor, end = self.editor, time.monotonic() + PATIENCE
        while self._poll() or not editor.jobs.is_idle or not editor.chores.is_idle:
            assert time.monotonic() < end, f"nothing came in time: {editor.message}"
            time.sleep(0.005)
        message = editor.message
        assert message is None or not message.is_error, message
        then()

    def open(self, path: Path) -> Document:
        self.editor.tabs.close(self.editor.tab)
        self.editor.filing.open(path)
        self.wait(lambda: None)
        return self.document

    @property
    def document(self) -> Document:
        document = self.editor.committed
        assert document is not None, self.editor.message
        return document

    def drag(self, k: int, at: np.ndarray, way: tuple[float, float]) -> float:
        """Of object `k`, from `at` (2,) image px by so many canvas px; s of the main thread."""
        editor = self.editor
        editor.objects.choose(k)
        editor.view.tool = ToolName.POSE
        start, begun = editor.view.canvas_from_image(at), time.thread_time()
        self._tool.hover(editor, Pointer(*start))
        editor.hand.press(
            self._tool.press(editor, Pointer(*start, is_down=True)), Pointer(*start).button
        )
        for n in range(1, MOVES + 1):
            editor.hand.move(Pointer(*(start + np.array(way) * n / MOVES), is_down=True))
        editor.hand.move(Pointer(*(start + np.array(way))))
        return time.thread_time() - begun

    def move(self, k: int, *move: float) -> None:
        placement = Placement((move[0], move[1]))
        self.editor.apply("Move object", edits.set_placement(self.document, k, placement))

    def file(self) -> None:
        """Saved, exported, and opened again."""
        with self.step("save"):
            self.editor.filing.save_as(self.folder / "large.omorph")
        with self.step("export"):
            self.editor.exporting.export_to(self.folder / "large.png")
        sizes = {at.suffix: round(at.stat().st_size / 2**20) for at in self.folder.glob("large.*")}
        before, count = id(self.document), len(self.document.objects)  # it need not stay
        with self.step("open the session", mib=sizes):
            self.open(self.folder / "large.omorph")
        assert id(self.document) != before and len(self.document.objects) == count
        _frames(self)

    @property
    def _worker(self) -> str:
        worker = self.editor.jobs._worker
        assert worker is not None
        return str(worker.process.pid)

    def _clocks(self) -> tuple[float, float, float, float]:
        """s: on the wall, of the editor's process, of its main thread, of its worker."""
        own = time.monotonic(), time.process_time(), time.thread_time()
        return (*own, self._worker_seconds())

    def _worker_seconds(self) -> float:
        fields = Path(f"/proc/{self._worker}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def photo(desk: Desk) -> None:
    """100 megapixels: opened, selected by a click, lifted, bent, moved, saved and exported."""
    path = desk.folder / "large.jpg"
    small = photos.photo("astronaut")
    pixels = cv2.resize(small, (SIDE, SIDE), interpolation=cv2.INTER_CUBIC)
    cv2.imwrite(str(path), pixels[..., ::-1])
    del pixels
    with desk.step("open", megapixels=SIDE**2 / 1e6):
        desk.open(path)
    x, y = np.argwhere(photos.outlined("astronaut")).mean(0)[::-1] / small.shape[0] * SIDE
    with desk.step("select"):
        desk.editor.selection.add_click(float(x), float(y), True)
    assert desk.editor.mask is not None
    with desk.step("lift, fill in the background"):
        run(desk.editor, "lift")
    assert desk.document.plate is not None
    with desk.step("drag"):
        desk.drag(0, np.array([x, y]), (25.0, 10.0))
    _frames(desk)
    with desk.step("move"):
        desk.move(0, 300.0, 100.0)
    for n in range(30):
        desk.move(0, 300.0 + n, 100.0)
    with desk.step("thirty moves"):
        pass
    desk.file()


def objects(desk: Desk) -> None:
    """Twenty coins, each selected and lifted, in one document."""
    path = photos.saved("coins", desk.folder)
    desk.open(path)
    masks = _coins()
    first = 0.0
    for k, mask in enumerate(masks):
        document = desk.document if k == 0 else edits.add_object(desk.document)
        document = edits.add_object(document) if not document.objects else document
        with desk.step(f"lift object {k + 1}") if k in (0, OBJECTS - 1) else _silent():
            desk.editor.apply("Select", edits.set_mask(document, k, mask, Prompt()))
            desk.editor.objects.choose(k)
            desk.wait(lambda: run(desk.editor, "lift"))
            desk.wait(lambda: None)
        assert desk.document.objects[k].lifted is not None, desk.editor.message
        if k == 0:
            first = _drags(desk, masks[:1])
    last = _drags(desk, masks)
    alone = _drags(desk, masks[:1])
    told = {
        "drag_ms": {"of one": first, "of the first of twenty": alone, "of each of twenty": last}
    }
    with desk.step("moved", **told):
        for k in range(OBJECTS):
            desk.move(k, 4.0, 3.0)
    desk.file()


def gaussians(desk: Desk) -> None:
    """A file of two million Gaussians takes the place of what is selected."""
    path = desk.folder / "ball.ply"
    path.write_bytes(encode(_ball(GAUSSIANS), path))
    desk.open(photos.saved("astronaut", desk.folder))
    mask = photos.outlined("astronaut")
    document = edits.add_object(desk.document)
    desk.editor.apply("Select", edits.set_mask(document, 0, mask, Prompt()))
    with desk.step("import", file_mib=round(path.stat().st_size / 2**20)):
        desk.editor.shaping.open_file(path)
    lifted = desk.document.objects[0].lifted
    assert lifted is not None, desk.editor.message
    spots = np.argwhere(mask)[:, ::-1] + 0.5
    with desk.step("first drag", gaussians=len(lifted.gaussians)):
        desk.drag(0, spots.mean(0), (15.0, 5.0))
    _frames(desk)
    with desk.step("forty drags, each undone", drag_ms=_drags(desk, [mask])):
        pass
    with desk.step("move"):
        desk.move(0, 20.0, 5.0)
    with desk.step("undo"):
        desk.editor.undo()
    desk.file()


def steps(desk: Desk) -> None:
    """Ten thousand steps, all of them undone and done again, while the document is shown."""
    desk.open(photos.saved("astronaut", desk.folder))
    document = edits.add_object(desk.document)
    mask = photos.outlined("astronaut")
    desk.editor.apply("Select", edits.set_mask(document, 0, mask, Prompt()))
    desk.wait(lambda: run(desk.editor, "lift"))
    desk.wait(lambda: None)
    desk.drag(0, np.argwhere(mask)[:, ::-1].mean(0), (20.0, 5.0))
    history, start = desk.editor.history, desk.document
    assert history is not None and start.objects[0].pose is not None
    pose, chance = start.objects[0].pose, np.random.default_rng(2)
    spent, made = [], [start]
    with desk.step("ten thousand steps"):
        for n in range(STEPS):
            if n % HUNDRED == 0:
                spent.append(0.0)
            noise = chance.normal(0.0, 1e-3, pose.points.shape)
            moved = replace(start.objects[0], pose=Pose(pose.points + noise, pose.rotations.copy()))
            begun = time.thread_time()
            desk.editor.apply("Move handle", start.with_object(0, moved))
            desk.editor.poll()
            spent[-1] += time.thread_time() - begun
            made.append(desk.document)
    ms = [round(1e3 * s, 2) for s in spent]
    with desk.step("undone, and done again", hundreds_ms=[ms[0], ms[1], ms[-2], ms[-1]],
                   old_mib=round(history.old_bytes / 2**20), steps=history.count):  # fmt: skip
        for turn, way in ((reversed(made), desk.editor.undo), (iter(made), desk.editor.redo)):
            for one in turn:
                assert desk.document is one
                way()


# ---- what they are made of ------------------------------------------------------------------


def _frames(desk: Desk) -> None:
    """Of an edit: what did not move is not drawn."""
    with desk.step("first frame"):
        desk.draw()
    with desk.step("second frame"):
        desk.draw()


def _drags(desk: Desk, masks: list[np.ndarray]) -> float:
    """ms of the main thread, median; the coins by turns."""
    spent, chance = [], np.random.default_rng(1)
    for n in range(DRAGS):
        k = n % len(masks)
        spots = np.argwhere(masks[k])[:, ::-1] + 0.5
        spent.append(desk.drag(k, spots[chance.integers(len(spots))], (6.0, 3.0)))
        desk.editor.poll()
        desk.editor.undo()
    return round(1e3 * float(np.median(spent)), 1)


def _coins() -> list[np.ndarray]:
    """(H, W) masks of the largest coins in the photo."""
    grey = cv2.GaussianBlur(photos.photo("coins")[..., 0], (0, 0), 1.0)
    light = cv2.adaptiveThreshold(
        grey, 255, cv2.ADAPTIVE_THRESH_MEAN_C, cv2.THRESH_BINARY, 151, -12
    )
    filled = cv2.morphologyEx(light, cv2.MORPH_CLOSE, np.ones((7, 7), np.uint8))
    filled = cv2.morphologyEx(filled, cv2.MORPH_OPEN, np.ones((9, 9), np.uint8))
    _, labels, facts, _ = cv2.connectedComponentsWithStats(filled)
    largest = np.argsort(-facts[1:, cv2.CC_STAT_AREA])[:OBJECTS] + 1
    assert facts[largest[-1], cv2.CC_STAT_AREA] > 400, "these are no twenty coins"
    return [labels == label for label in largest]


def _ball(count: int) -> Gaussians:
    """An uneven ball, (count,) on its surface, its colours of the photo of a cup."""
    chance = np.random.default_rng(3)
    way = chance.normal(size=(count, 3)).astype(np.float32)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    radius = 0.4 + 0.08 * np.sin(5 * way[:, :1]) * np.cos(4 * way[:, 1:2])
    cup = photos.photo("coffee")
    rows = ((way[:, 1] + 1) / 2 * (cup.shape[0] - 1)).astype(int)
    columns = ((way[:, 0] + 1) / 2 * (cup.shape[1] - 1)).astype(int)
    upright = np.zeros((count, 4), np.float32)
    upright[:, 0] = 1.0
    scales = np.full((count, 3), 0.4 * np.sqrt(4 * np.pi / count), np.float32)
    return Gaussians(
        (radius * way).astype(np.float32), upright, scales,
        np.full(count, 0.95, np.float32), cup[rows, columns].astype(np.float32) / np.float32(255),
    )  # fmt: skip


@contextmanager
def _silent() -> Iterator[None]:
    yield


CASES = {case.__name__: case for case in (photo, objects, gaussians, steps)}


def main() -> int:
    if len(sys.argv) != 2 or sys.argv[1] not in CASES:
        print(__doc__)
        return 2
    with tempfile.TemporaryDirectory() as folder:
        os.environ["OBJECTMORPHER_DATA"] = folder
        desk = Desk(Path(folder))
        try:
            CASES[sys.argv[1]](desk)
        finally:
            desk.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
