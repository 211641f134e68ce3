"""Makes docs/rendering and docs/performance.md anew, or one of them: `make rendering`.

`python docs/rendering/make_rendering.py [rendering] [performance]`; times want a machine that does
nothing else.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy, as the program itself does

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent.parent))

import cost  # noqa: E402
import growth  # noqa: E402
import performance  # noqa: E402
import photos  # noqa: E402
import truth  # noqa: E402
from page import write_page  # noqa: E402

TRUTHS = {
    "turn": truth.compare_turn, "small": truth.compare_small,
    "stretched": truth.compare_stretched, "far": truth.compare_far,
}  # fmt: skip


def make_rendering() -> None:
    """docs/rendering: README.md and its pictures."""
    costs = cost.measure()
    cost.draw_curves(costs, HERE / "cost.png")
    cost.draw_parts(costs, HERE / "parts.png")
    of_photos = [(s, photos.compare(s, HERE / s.file)) for s in photos.subjects()]
    of_truth = {name: compare(HERE / f"{name}.jpg") for name, compare in TRUTHS.items()}
    page = write_page(of_photos, of_truth, costs, performance.machine())
    (HERE / "README.md").write_text(page, encoding="utf-8")


def make_performance() -> None:
    """docs/performance.md and its plots."""
    growth.main(list(growth.TITLES))
    (HERE.parent / "performance.md").write_text(performance.write_page(), encoding="utf-8")


PAGES = {"rendering": make_rendering, "performance": make_performance}


def main() -> None:
    for name in sys.argv[1:] or PAGES:
        start = time.perf_counter()
        PAGES[name]()
        print(f"{name}: {time.perf_counter() - start:.0f} s")


if __name__ == "__main__":
    main()
