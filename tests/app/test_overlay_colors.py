"""Marks that stand for different things differ by shape, or by colour in every kind of sight."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from color_vision import MATRICES, SIGHTS, difference, lab
from objectmorpher.canvas.painter import DEPTH_STOPS, STRAIN_STOPS
from objectmorpher.gui.overlay.canvas import ACCENT, WARM, WHITE
from objectmorpher.gui.overlay.place import COLOURS
from objectmorpher.gui.overlay.pose import HATCHES, YELLOW
from objectmorpher.gui.widgets.theme import PALETTES, rgb
from objectmorpher.gui.window.scenes import INPAINTED, LIFTED, REFINED
from tests.tree import over

APART = 25.0  # Delta E 1976; 2.3 is just noticed side by side, this is seen apart and in a hurry
Mark = tuple[str, tuple[float, float, float]]  # shape, colour

TOGETHER: dict[str, dict[str, Mark]] = {  # what is seen on the photo at the same time
    "selecting": {
        "selected edge": ("line", rgb(ACCENT)),
        "candidate": ("dots", rgb(WHITE)),
        "click that adds": ("disc with +", rgb(ACCENT)),
        "click that removes": ("disc with -", rgb(WARM)),
        "box": ("dashes", rgb(ACCENT)),
    },
    "painting the selection": {
        "brush": ("circle", rgb(WHITE)),
        "eraser": ("circle with -", rgb(WARM)),
        "selected edge": ("line", rgb(ACCENT)),
    },
    "posing": {
        "handle": ("disc", rgb(ACCENT)),
        "pin": ("diamond", rgb(WHITE)),
        "anchor": ("hollow diamond", rgb(WHITE)),
        "ring": ("wide circle", rgb(WHITE)),
        "ring that is taken": ("wide circle", rgb(ACCENT)),
        "crosshair": ("open cross", rgb(WHITE)),
    },
    "rigging": {
        **{mode.name: (f"hatch {angles}", rgb(ink)) for mode, (angles, ink) in HATCHES.items()},
        "cut": ("crosses", rgb(WARM)),
        "glue": ("rungs", rgb(ACCENT)),
    },
    "placing": {
        **{name: ("ring", rgb(code)) for name, code in COLOURS.items()},
        "ring that is taken": ("ring", rgb(ACCENT)),
    },
    "provenance": {
        "invented on the object": (f"stripes {LIFTED.slant}", LIFTED.ink),
        "invented behind it": (f"stripes {INPAINTED.slant}", INPAINTED.ink),
        "refined": (f"stripes {REFINED.slant}", REFINED.ink),
    },
}


@over("sight", SIGHTS)
@over("scene", TOGETHER)
def test_marks_that_are_seen_together_are_told_apart(scene: str, sight: str) -> None:
    for (one, (shape, color)), (other, (its_shape, its)) in combinations(
        TOGETHER[scene].items(), 2
    ):
        assert shape != its_shape or difference(color, its, sight) >= APART, (one, other)


@pytest.mark.parametrize("sight", SIGHTS)
def test_hatches_are_told_apart_by_colour_as_well(sight: str) -> None:
    inks = [LIFTED.ink, INPAINTED.ink, REFINED.ink]
    inks_of_rig = [rgb(WHITE), rgb(YELLOW), rgb(ACCENT)]
    for group in (inks, inks_of_rig):
        for one, other in combinations(group, 2):
            assert difference(one, other, sight) >= APART


@pytest.mark.parametrize("sight", SIGHTS)
def test_depth_darkens_all_the_way_and_strain_keeps_its_ends_apart(sight: str) -> None:
    assert (np.diff([lab(stop, sight)[0] for stop in DEPTH_STOPS]) < 0).all()
    for one, other in combinations(STRAIN_STOPS, 2):
        assert difference(one, other, sight) >= APART


@pytest.mark.parametrize("sight", SIGHTS)
@pytest.mark.parametrize("name", PALETTES)
def test_what_is_chosen_is_lighter_or_darker_than_what_is_not(name: str, sight: str) -> None:
    palette = PALETTES[name]
    chosen, other = (lab(rgb(code), sight)[0] for code in (palette.accent, palette.raised))
    assert abs(chosen - other) >= APART


def test_the_simulation_keeps_greys_and_loses_the_hues_it_should() -> None:
    for sight, matrix in MATRICES.items():
        np.testing.assert_allclose(matrix.sum(1), 1, atol=2e-6)
        assert difference((0.5, 0.5, 0.5), (0.5, 0.5, 0.5), sight) == 0
    red, green = (0.75, 0.35, 0.2), (0.45, 0.5, 0.2)
    for sight in ("protan", "deutan"):
        assert difference(red, green, sight) < 0.5 * difference(red, green, "all colours")
    blue, green = (0.0, 0.5, 0.6), (0.0, 0.5, 0.45)
    assert difference(blue, green, "tritan") < 0.7 * difference(blue, green, "all colours")
