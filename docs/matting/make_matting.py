"""Makes docs/matting anew: `python docs/matting/make_matting.py`.

pymatting (MIT) is compared with where it is installed; the program does not use it.
"""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent.parent))

import cost  # noqa: E402
from measures import Score, score  # noqa: E402
from methods import methods  # noqa: E402
from page import write_page  # noqa: E402
from panels import draw_case  # noqa: E402
from truth import Case, cases  # noqa: E402

SHOWN = {  # where a case's picture is taken, x and y px
    "fur over a pagoda": (70, 30), "hair over a dusk sky": (255, 20),
    "fur over leaves": (290, 110), "dahlia, outlined": (395, 180),
    "flower out of focus": (385, 150), "suit, sharp": (290, 250), "glass over coffee": (130, 70),
    "glass over china": (190, 90),
}  # fmt: skip


def main() -> None:
    scores: dict[tuple[str, str], Score] = {}
    done: list[Case] = []
    for case in cases():
        found = {name: method(case.photo, case.given) for name, method in methods().items()}
        for name, (alpha, foreground) in found.items():
            scores[case.name, name] = score(case, alpha, foreground)
        if case.name in SHOWN:
            draw_case(HERE / picture(case.name), case, found, SHOWN[case.name])
        done.append(case)
        print(case.name, {n: round(scores[case.name, n].halo, 1) for n in found}, flush=True)
    pictures = {name: picture(name) for name in SHOWN}
    page = write_page(done, list(methods()), scores, pictures, cost.measure())
    (HERE / "README.md").write_text(page, encoding="utf-8")


def picture(name: str) -> str:
    return name.replace(",", "").replace(" ", "-") + ".jpg"


if __name__ == "__main__":
    main()
