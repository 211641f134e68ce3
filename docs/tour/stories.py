"""The edits of the tour, step by step. Places are px of the photo."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from guide import Guide

RING = 28  # px, radius of the ring around a handle at scale 1
EMPTY = (1110.0, 60.0)  # px on the screen: on the canvas, beside every photo of the tour
ABOVE = (1200.0, 120.0)  # the same on the large screen


@dataclass(frozen=True)
class Story:
    """One edit."""

    name: str
    about: str
    theme: str
    scale: float
    photo_size: tuple[int, int]  # px
    tell: Callable[[Guide], None]


def _tilt_head(guide: Guide) -> None:
    """The astronaut's head, in the dark theme."""
    guide.place("Open a photo…")
    guide.point((1000, 720))
    guide.shoot("Start", "Nothing is open yet: drop a photo, open one, or try a sample.")
    guide.choose("Open a photo…")
    guide.area("One folder up")
    guide.settle()
    guide.xdotool("type", "--delay", 20, "astronaut.jpg")
    guide.shoot("Open", "Where the desktop has no file dialog, the editor has its own.")
    guide.press("Return")
    guide.point(EMPTY)
    guide.area("Photo")
    guide.shoot("Opened", "The photo, fitted. The button at the lower right says what comes next.")
    guide.rest(220, 80)
    guide.shoot("Candidate", "The pointer rests: dots go around what a click would select.")
    guide.click(*guide.at(220, 80))
    guide.area("Lift object")
    guide.point(EMPTY)
    guide.shoot("Selected", "One click. The rest is veiled; the blue dot is the click.")
    guide.choose("Tool: Refine mask")
    guide.area("Hardness")
    for _ in range(3):
        guide.press("bracketleft")
    with guide.dragging(guide.at(4, 382), guide.at(6, 508), button=3):
        guide.shoot("Refined", "The selection took a piece of the flag along: a right drag of the "
                    "brush takes it away.")  # fmt: skip
    guide.choose("Lift object")
    guide.area("Drag a point on the object")
    guide.point(EMPTY)
    guide.shoot("Lifted", "A second later she is a 3D shape; the dots say where it can be dragged.")
    pin(guide, (170, 230), (300, 240), (210, 290), (100, 320), (330, 330))
    guide.point(EMPTY)
    guide.shoot("Pins", "Alt-clicks pin her collar and her chest: white diamonds.")
    with guide.dragging(guide.at(228, 40), guide.at(268, 50)):
        guide.shoot("First handle", "A point of her hair is dragged, and the head follows: the "
                    "picture is drawn anew under the pointer.")  # fmt: skip
    guide.drag(guide.at(222, 165), guide.at(227, 165))
    guide.area("Handle 7")
    guide.click(*guide.place("Handle 6"))
    x, y = guide.place("Handle 6")
    with guide.dragging(ring(x, y, 12), ring(x, y, 20)):
        guide.shoot("Rotation ring", "A second handle holds the chin. The ring turns the first one "
                    "by a few degrees more.")  # fmt: skip
    guide.choose("Tool: Place")
    x, y = guide.place("Ring: yaw")
    guide.drag((x, y), (x + 20, y))
    guide.shoot("Place", "The whole object turns by rings, scales by corners and goes into depth "
                "by the arrow. Ctrl+Z takes this turn back.")  # fmt: skip
    guide.press("ctrl+z")
    look(guide, (300, 420), (272, 414), "Around the object; a preview, which changes nothing. Esc "
         "is the photo.")  # fmt: skip
    split(guide, (268, 256), "A line that is dragged: the photo on its left, the edit on its "
          "right.")  # fmt: skip
    guide.choose("Tool: Compose")
    guide.reach("Harmonise")
    guide.choose("Harmonise")
    guide.point(guide.at(480, 256))
    guide.shoot("Compose", "What joins object and photo: background, shadow, light, edge. Here she "
                "takes on the light of her new place.")  # fmt: skip
    guide.rewind()
    guide.press("b")
    guide.area("Radius")
    guide.drag(guide.at(110, 183), guide.at(118, 193))
    guide.settle()
    guide.point(guide.at(140, 240))
    guide.shoot("Repaired", "What was filled in behind her, alone. A speck of her suit had stayed "
                "at the left of the collar: a stroke of the brush fills it again.")  # fmt: skip
    guide.press("b")
    guide.press("ctrl+h")
    guide.point(EMPTY)
    guide.shoot("History", "Every step; a click goes back to it.")
    guide.choose("Export photo…")
    guide.area("Export astronaut-edited.jpg")
    guide.shoot("Export", "What, how and where to. The button names the file that it will write.")
    export(guide, "astronaut-edited.jpg", "The status line says what was written.")


def _turn_cup(guide: Guide) -> None:
    """The cup leans and turns, in the light theme."""
    guide.place("Coffee")
    guide.point(guide.place("Coffee"))
    guide.shoot("Start", "The samples; the frame is the pointer's.")
    open_sample(guide, "Coffee")
    guide.point(EMPTY)
    guide.area("Photo")
    guide.shoot("Opened", "The same window in the light theme; what surrounds the photo stays a "
                "neutral grey.")  # fmt: skip
    guide.rest(300, 130)
    guide.shoot("Candidate", "Cup, saucer and spoon are what a click here would select.")
    guide.click(*guide.at(300, 130))
    guide.area("Lift object")
    guide.point(EMPTY)
    guide.shoot("Selected", "The veil shows what is left out.")
    guide.choose("Tool: Refine mask")
    guide.area("Hardness")
    for _ in range(9):
        guide.press("bracketleft")
    with guide.dragging(guide.at(155, 76), guide.at(183, 56), button=3):
        guide.shoot("Refined", "A sliver of table at the saucer's upper rim is taken away by a "
                    "right drag of the brush.")  # fmt: skip
    guide.choose("Lift object")
    guide.area("Drag a point on the object")
    guide.point(EMPTY)
    guide.shoot("Lifted", "Ready to be dragged.")
    pin(guide, (105, 230), (150, 330), (300, 378), (440, 320), (462, 230))
    guide.shoot("Pins", "The saucer's rim is pinned all around.")
    with guide.dragging(guide.at(300, 112), guide.at(320, 106)):
        guide.shoot("First handle", "The cup leans to the right; its saucer stays.")
    x, y = guide.place("Handle 6")
    with guide.dragging(ring(x, y, 3), ring(x, y, 20)):
        guide.shoot("Rotation ring", "A few degrees about the line of sight.")
    guide.choose("Tool: Place")
    x, y = guide.place("Ring: yaw")
    with guide.dragging((x, y), (x - 110, y)):
        guide.shoot(
            "Place", "All of it turns on the table, about its own upright; the number says how far."
        )
    guide.pull("Scale", 32)
    look(guide, (300, 220), (250, 200), "The cup from elsewhere, as far as one photo tells.")
    split(guide, (280, 200), "Photo and edit.")
    guide.choose("Tool: Compose")
    guide.reach("Strength")
    guide.pull("Strength", 90)
    guide.shoot("Compose", "A shadow on the table, its direction on a dial.")
    guide.press("b")
    guide.rewind()
    guide.choose("Try 3 variants")
    guide.settle()
    guide.point(guide.at(560, 200))
    guide.shoot("Variants", "Three other fillings of what the saucer hid; a click takes one.")
    guide.press("b")
    guide.press("ctrl+h")
    guide.point(EMPTY)
    guide.shoot("History", "What was done, the newest step at the end.")
    guide.choose("Export photo…")
    guide.area("Export coffee-edited.jpg")
    guide.shoot("Export", "A JPEG stays a JPEG, which has a quality instead of a depth.")
    export(guide, "coffee-edited.jpg", "Done.")


def _bend_rocket(guide: Guide) -> None:
    """The rocket, on a screen with twice as many pixels."""
    guide.place("Rocket")
    guide.point(guide.place("Rocket"))
    guide.shoot("Start", "At twice the scale text and lines are as large, and finer.")
    open_sample(guide, "Rocket")
    guide.point(ABOVE)
    guide.area("Photo")
    guide.shoot("Opened", "The photo, fitted.")
    guide.rest(320, 250)
    guide.shoot("Candidate", "What a click here would select.")
    guide.click(*guide.at(320, 250))
    guide.area("Lift object")
    guide.point(ABOVE)
    guide.shoot("Selected", "One click.")
    guide.choose("Tool: Refine mask")
    guide.area("Hardness")
    guide.point(guide.at(360, 180))
    guide.shoot("Refined", "The brush shows how far it reaches, and its soft rim.")
    guide.choose("Lift object")
    guide.area("Drag a point on the object")
    guide.point(ABOVE)
    guide.shoot("Lifted", "Two seconds later.")
    pin(guide, (320, 395), (320, 310))
    guide.shoot("Pins", "Foot and middle are pinned.")
    with guide.dragging(guide.at(321, 150), guide.at(372, 165)):
        guide.shoot("First handle", "One point dragged: the rocket bends.")
    guide.press("alt+6")
    guide.point(guide.at(100, 60))
    guide.shoot("Strain", "Where the pose makes it longer or shorter than in the photo.")
    guide.press("alt+1")
    guide.choose("Tool: Place")
    x, y = guide.place("Ring: roll")
    with guide.dragging((x, y), (x + 30, y + 10)):
        guide.shoot("Place", "All of it turns about the line of sight.")
    guide.press("ctrl+z")
    look(guide, (320, 250), (280, 240), "From the side, as far as one photo tells.")
    split(guide, (345, 213), "Photo and edit.")
    guide.choose("Tool: Compose")
    guide.point(ABOVE)
    guide.shoot("Compose", "Background, shadow, light and edge.")
    guide.press("ctrl+h")
    guide.point(ABOVE)
    guide.shoot("History", "Every step.")
    guide.press("ctrl+h")
    guide.press("F1")
    guide.area("Reset all")
    guide.shoot("Keys", "F1: every key and gesture. A click on a key changes it.")
    guide.press("Escape")
    guide.choose("Export photo…")
    guide.area("Export rocket-edited.jpg")
    guide.shoot("Export", "What, how and where to.")
    export(guide, "rocket-edited.jpg", "The status line says what was written.", ABOVE)


def open_sample(guide: Guide, name: str) -> None:
    """Opens a sample, which is lifted at once, and goes back to its photo."""
    guide.choose(name)
    guide.area("Drag a point on the object")
    guide.press("ctrl+z")
    guide.press("ctrl+z")
    guide.choose("Tool: Select")


def pin(guide: Guide, *places: tuple[float, float]) -> None:
    """Pins points of the object."""
    for x, y in places:
        guide.pin(x, y)
    guide.area(f"Handle {len(places)}")


def look(guide: Guide, start: tuple[float, float], end: tuple[float, float], about: str) -> None:
    """Goes around the object, and back to the photo's view."""
    guide.choose("Tool: Look")
    with guide.dragging(guide.at(*start), guide.at(*end)):
        guide.shoot("Look", about)
    guide.press("Escape")


def split(guide: Guide, place: tuple[float, float], about: str) -> None:
    """Drags the line between photo and edit to a place."""
    guide.press("backslash")
    with guide.dragging(guide.middle(), guide.at(*place)):
        guide.shoot("Before and after", about)
    guide.press("backslash")


def export(guide: Guide, name: str, about: str, pointer: tuple[float, float] = EMPTY) -> None:
    """Writes the file that the export dialog names."""
    guide.choose(f"Export {name}")
    guide.wait((guide.pictures / name).exists, "exporting")
    guide.point(pointer)
    guide.shoot("Exported", about)


def ring(x: float, y: float, degrees: float) -> tuple[float, float]:
    """A place on the ring around a handle, clockwise from the top."""
    angle = math.radians(degrees)
    return x + RING * math.sin(angle), y - RING * math.cos(angle)


STORIES = {
    story.name: story
    for story in (
        Story("dark", "A head is tilted", "dark", 1.0, (512, 512), _tilt_head),
        Story("light", "A cup leans and turns, in the light theme", "light", 1.0, (600, 400),
              _turn_cup),
        Story("large", "A rocket is bent, at 2880 × 1800 px", "dark", 2.0, (640, 427),
              _bend_rocket),
    )
}  # fmt: skip
