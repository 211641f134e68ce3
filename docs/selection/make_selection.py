"""Makes docs/selection.md and its picture anew: `make evidence PAGES=selection`.

About ten minutes. Times want a machine that does nothing else.
"""

from __future__ import annotations

import os
import platform
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy, as the program itself does

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent.parent))

from correcting import Encoded, cases, correct_all  # noqa: E402
from measure import measure, measure_large, measure_later, segmenter  # noqa: E402
from page import write_page  # noqa: E402
from panels import draw_objects  # noqa: E402

from tests.core.segment.truth_masks import TRUTHS, truth_mask  # noqa: E402


def main() -> None:
    rows = measure()
    made = correct_all(segmenter("dino"), Encoded(segmenter("dino")), cases())
    machine = f"Measured on {os.cpu_count()} cores ({platform.machine()}), no GPU"
    page = write_page(rows, measure_later(), measure_large(), made, machine)
    (HERE.parent / "selection.md").write_text(page, encoding="utf-8")
    masks = {each.name: truth_mask(each.name) for each in TRUTHS}
    draw_objects(rows, masks, HERE / "objects.jpg")


if __name__ == "__main__":
    main()
