"""Writes docs/lifting/README.md: how much of the third dimension one photo gives.

python docs/lifting/make_lifting.py [figures | quick [NAME ...]]

`figures` prints, as JSON, the means over the solids for which nothing has to be fetched. `quick`
prints how turned outlines and newly shown sides look, of the product alone: a few minutes. Without
either the whole page is made, in half an hour.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from depths import depth_scores
from motorcycle import results
from page import write_page
from pictures import draw_backs, draw_real, draw_solids, draw_thickness
from sheet import PHOTOS, draw_sheet
from solids import HELD_OUT, MADE, SOLIDS
from turned_looks import looks
from turning import Row, make_scene, means, measured, row_of

FOLDER = Path(__file__).resolve().parent
sys.path.append(str(FOLDER.parent))
from meshes import fetched  # noqa: E402  # beside this folder: other pages have them, too

PICTURED_WAYS = ("network", "relief", "card")
PICTURED = ("duck", "bunny", "ring", "brick", "figure", "mug")


def figures() -> None:
    rows = [row_of(name, measured(make_scene(name, FOLDER))) for name in MADE]
    told = {f"{way} {group}": (s.iou, s.psnr) for (group, way), s in means(rows).items()}
    print(json.dumps(told))


def quick(names: list[str]) -> None:
    meshes = fetched() if set(names) - set(MADE) else FOLDER
    for name in names:
        for key, look in looks(make_scene(name, meshes)).items():
            print(f"{name:8} {key:9} {look}", flush=True)


def main() -> None:
    meshes = fetched()
    looked = {name: looks(make_scene(name, meshes)) for name in (*SOLIDS, *HELD_OUT)}
    photos = draw_sheet(PHOTOS, FOLDER / "turned.jpg")
    rows: list[Row] = []
    shown = []
    for name in SOLIDS:
        scene = make_scene(name, meshes)
        found = measured(scene)
        rows.append(row_of(name, found))
        print(rows[-1], flush=True)
        if name in PICTURED:
            shown.append((scene, {way: found["yaw 35", way][0] for way in PICTURED_WAYS}))
    draw_solids(FOLDER / "solids.jpg", shown)
    draw_real(FOLDER / "photos.jpg")
    draw_backs(FOLDER / "backs.jpg")
    draw_thickness(FOLDER / "thickness.jpg")
    (FOLDER / "README.md").write_text(
        write_page(rows, looked, photos, depth_scores(meshes), results()), encoding="utf-8"
    )


if __name__ == "__main__":
    if "quick" in sys.argv:
        quick(sys.argv[sys.argv.index("quick") + 1 :] or list(SOLIDS))
    else:
        figures() if "figures" in sys.argv else main()
