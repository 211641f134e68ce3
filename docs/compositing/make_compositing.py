"""Writes docs/compositing/README.md: what happens to light, shadow and background.

python docs/compositing/make_compositing.py [places|focus|shadows|photos|plates]

With a section's name only that section is made anew.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np

FOLDER = Path(__file__).resolve().parent
sys.path += [str(FOLDER.parent), str(FOLDER.parent / "lifting")]  # what other pages have, too

import focus  # noqa: E402
import grains  # noqa: E402
import lights  # noqa: E402
import places  # noqa: E402
import plate_times  # noqa: E402
import plates  # noqa: E402
import shadows  # noqa: E402
from meshes import fetched  # noqa: E402
from page import (  # noqa: E402
    FOCUS,
    GRAIN,
    PLACE,
    PLATE,
    SHADOW,
    Measures,
    focus_section,
    place_section,
    plate_section,
    shadow_section,
    write_page,
)
from photos import shadow_pictures  # noqa: E402
from solids import SOLIDS  # noqa: E402

SHOWN = {("ball", "left", "yaw 35"), ("duck", "above", "pitch 25"), ("figure", "left", "yaw -35"),
         ("box", "left", "yaw -35")}  # fmt: skip
FOCUS_SHOWN = 3.0  # px
GRAINS = ("x 2.2", "x 0.6", "half a pixel")
QUALITY = 88
TILE, WIDE, PHOTO = 200, 280, 400  # px


def main() -> None:
    if sys.argv[1:] == ["plates"]:
        page = FOLDER / "README.md"
        rest = page.read_text(encoding="utf-8").split(PLATE.partition("\n")[0])[0]
        page.write_text(rest + plate_section(*_plates()), encoding="utf-8")
        return
    if sys.argv[1:] == ["places"]:
        page = FOLDER / "README.md"
        before, _, rest = page.read_text(encoding="utf-8").partition(PLACE.partition("\n")[0])
        after = rest[rest.index(GRAIN.partition("\n")[0]) :]
        section = place_section(places.measured(fetched()))
        page.write_text(f"{before}{section}\n{after}", encoding="utf-8")
        return
    if sys.argv[1:] == ["focus"]:
        page = FOLDER / "README.md"
        before, _, rest = page.read_text(encoding="utf-8").partition(FOCUS.partition("\n")[0])
        after = rest[rest.index(SHADOW.partition("\n")[0]) :]
        page.write_text(before + focus_section(*_focus()) + after, encoding="utf-8")
        return
    if sys.argv[1:] == ["shadows"]:
        page = FOLDER / "README.md"
        before, _, rest = page.read_text(encoding="utf-8").partition(SHADOW.partition("\n")[0])
        after = rest[rest.index(PLATE.partition("\n")[0]) :]
        shaded = _shaded(fetched())
        page.write_text(f"{before}{shadow_section(shaded)}\n{after}", encoding="utf-8")
        return
    if sys.argv[1:] == ["photos"]:
        _write("photos.jpg", shadow_pictures(), PHOTO)
        return
    meshes = fetched()
    turned = [case for name in SOLIDS for case in lights.measured(name, meshes)]
    shown = [case for case in turned if (case.name, case.lamp, case.turn) in SHOWN]
    _write("lights.jpg", [[_bytes(p)[110:400, 110:400] for p in case.pictures] for case in shown])
    shaded = _shaded(meshes)
    _write("photos.jpg", shadow_pictures(), PHOTO)
    grained = grains.measured()
    own = [c for c in grained if c.noise == next(iter(grains.NOISES)) and c.place in GRAINS]
    _write("grains.jpg", [[p[:40, :40] for p in c.pictures] for c in own], WIDE)
    measures = Measures(
        turned,
        places.measured(meshes),
        grained,
        grains.found_on_photos(),
        *_focus(),
        shaded,
        *_plates(),
    )
    (FOLDER / "README.md").write_text(write_page(measures), encoding="utf-8")


def _shaded(meshes: Path) -> list[shadows.Shaded]:
    """Solids with shadows, eight drawn to shadows.jpg."""
    cases = [
        case
        for number, name in enumerate(SOLIDS)
        for case in shadows.measured(name, number, meshes)
    ]
    found = [case for case in cases if case.is_found][:8]
    rows = [[p[120:440, 96:416] for p in case.pictures] for case in found]
    _write("shadows.jpg", [a + b for a, b in zip(rows[::2], rows[1::2], strict=True)])
    return cases


def _focus() -> tuple[list[focus.Focussed], list[focus.Sharp]]:
    """Things gone nearer and farther, some drawn to focus.jpg; and photographs that are sharp."""
    cases = focus.measured()
    shown = [c for c in cases if c.far == FOCUS_SHOWN and c.ratio == max(focus.RATIOS)]
    _write("focus.jpg", [[p[90:330, 160:420] for p in c.pictures] for c in shown], WIDE)
    return cases, focus.on_photos()


def _plates() -> tuple[dict[str, dict[str, plates.Filled]], list[plate_times.Taken]]:
    """Holes filled, drawn to plates.jpg; and how long plates take."""
    filled, pictures = {}, []
    for name in plates.HOLES:
        photo, cut, filled[name] = plates.measured(name)
        pictures.append([photo, cut, *(found.picture for found in filled[name].values())])
        print(name, flush=True)
    _write("plates.jpg", pictures)
    for name in plates.OTHER_HOLES:
        *_, filled[name] = plates.measured(name)
        print(name, flush=True)
    return filled, plate_times.measured()


def _bytes(picture: np.ndarray) -> np.ndarray:
    return np.rint(np.clip(picture, 0, 1) * 255).astype(np.uint8)


def _write(name: str, rows: list[list[np.ndarray]], width: int = TILE) -> None:
    """Rows of pictures (h, w, 3), all as wide."""

    def sized(picture: np.ndarray) -> np.ndarray:
        height = round(picture.shape[0] * width / picture.shape[1])
        return np.asarray(cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA))

    sheet = np.vstack([np.hstack([sized(p) for p in row]) for row in rows])
    cv2.imwrite(str(FOLDER / name), sheet[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])


if __name__ == "__main__":
    main()
