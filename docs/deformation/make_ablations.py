"""Makes this page anew: `python docs/deformation/make_ablations.py`, or `make ablations`."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent.parent))

import models  # noqa: E402
from figures import draw_one_handle, draw_split, draw_strain  # noqa: E402
from gaps import compare_gap, handle_marks  # noqa: E402
from methods import LAPLACIAN, METHODS, OURS, PAPER, Handles, Result, apply  # noqa: E402
from models import Model, turned_about  # noqa: E402
from page import Facts, Task, write_page  # noqa: E402
from panels import Panel, draw_figure, posed  # noqa: E402

SHOWN = (OURS, LAPLACIAN, PAPER)
LIMB_ROOT = 0.2  # object units from the middle
WIDE, NARROW = 640, 400  # px of a panel
RING = 0.35  # object units from the middle of the bar: where its turn is measured
GAPS = {
    "Legs 0.04 apart": models.legs,
    "Fingers 0.001 apart": models.fingers,
    "Cup and its handle, 0.05 apart": models.cup,
    "Tail 0.004 above a body": models.tail,
}


def compare(model: Model, handles: Handles, file: str, columns: int) -> dict[str, Result]:
    """The figures of all methods, and a picture of three of them."""
    results = {m.name: apply(m, model, handles) for m in METHODS}
    panels = []
    for method in SHOWN:
        r = results[method.name]
        splats = posed(model, r.skinned, r.normals)
        panels.append(Panel(method.name, model, splats, handle_marks(handles)))
    draw_figure(HERE / file, panels, WIDE if columns == 1 else NARROW, columns)
    return results


def bend_limb(model: Model) -> Task:
    handles = bent_limb(model)
    results = compare(model, handles, "bend-limb.jpg", 3)
    text = (
        "Two handles near the tip of one limb are turned by 90° about its root; the others pinned."
    )
    return Task("A limb bent by 90°", text, "bend-limb.jpg", results)


def bent_limb(model: Model) -> Handles:
    root = tuple(LIMB_ROOT * models.limb_axis(0))
    return models.limb_handles(model, turned_about(root, (0, 0, 90)))


def bend_bar(model: Model) -> Task:
    motion = turned_about((0, 0, 0), (0, 0, -120))
    handles = model.handles(*models.end_ring(1), motion=motion)
    handles += model.handles(*models.end_ring(-1))
    results = compare(model, handles, "bend-bar.jpg", 3)
    text = """Four handles around one end are turned by 120° about the bar's middle; four around
the other end are pinned."""
    return Task("A bar bent round by 120°", text, "bend-bar.jpg", results)


def twist_moved(model: Model) -> Task:
    handles: Handles = ()
    for side in (1, -1):
        motion = turned_about((0, 0, 0), (90 * side, 0, 0))
        handles += model.handles(*models.end_ring(side), motion=motion)
    results = compare(model, handles, "twist-moved.jpg", 1)
    text = """Four handles around each end are moved a quarter turn, in opposite directions.
*Turn* is how much of the 180° arrives on the surface between 0.35 to the left and to the
right of the middle."""
    return Task("A bar twisted by 180°, handles moved", text, "twist-moved.jpg", results,
                turns_of(model, results))  # fmt: skip


def twist_turned(model: Model) -> Task:
    handles = tuple(
        model.handle((side * 0.5, 0, 0), turn=np.array([side * np.pi / 2, 0, 0]))
        for side in (1, -1)
    )
    results = compare(model, handles, "twist-turned.jpg", 1)
    text = """One handle at each tip, which stays where it is and is turned by 90°. The
paper's handles have no turn: its rows show what a turned control point alone does. A low energy
here means that the bar was not twisted; see *turn*."""
    return Task("A bar twisted by 180°, handles turned", text, "twist-turned.jpg", results,
                turns_of(model, results))  # fmt: skip


def turns_of(model: Model, results: dict[str, Result]) -> dict[str, float]:
    """Degrees about the bar's axis between two rings of its surface, for each method."""
    rest = model.mesh.points

    def turn(posed_points: np.ndarray, x: float) -> float:
        own = np.abs(rest[:, 0] - x) < 0.02
        a = rest[own][:, 1:] - rest[own][:, 1:].mean(0)
        b = posed_points[own][:, 1:] - posed_points[own][:, 1:].mean(0)
        cross = (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()
        return float(np.degrees(np.arctan2(cross, (a * b).sum())))

    return {k: turn(r.skinned.points, RING) - turn(r.skinned.points, -RING)
            for k, r in results.items()}  # fmt: skip


def main() -> None:
    start = time.perf_counter()
    limbs, bar = models.five_limbs(), models.bar()
    tasks = [bend_limb(limbs), bend_bar(bar), twist_moved(bar), twist_turned(bar)]
    draw_strain(limbs, bent_limb(limbs), HERE / "strain.jpg", NARROW)
    gaps = {}
    for k, (name, build) in enumerate(GAPS.items(), 1):
        gaps[name] = compare_gap(build(), HERE / f"gap-{k}.jpg", NARROW)
    anchored = draw_one_handle(bar, HERE / "one-handle.jpg", WIDE)
    before, after = draw_split(limbs, HERE / "split.jpg", WIDE)
    page = write_page(tasks, gaps, Facts(anchored, before, after))
    (HERE / "README.md").write_text(page, encoding="utf-8")
    print(f"{time.perf_counter() - start:.0f} s")


if __name__ == "__main__":
    main()
