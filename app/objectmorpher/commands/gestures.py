"""Actions of the pointer and of held keys, for the table of shortcuts, as keys into the texts."""

from __future__ import annotations

GESTURES: dict[str, tuple[tuple[str, str], ...]] = {
    "Everywhere": (
        ("Space-drag, middle drag", "Pan"),
        ("Wheel", "Zoom at the pointer"),
        ("X (hold)", "Show the photo as it was"),
        ("Esc", "Take back the stroke, deselect"),
        ("Enter", "The next step, which the large button names"),
        ("Tab, Shift+Tab", "To the panel, from control to control"),
        ("F6, Shift+F6, F10", "Next part of the window, the one before, the menus"),
        ("Arrows", "A crosshair on the photo · Shift: far · Alt: 1 px"),
        ("Space, Shift+Space", "Click, right-click at the crosshair"),
        ("Shift+Enter", "Take hold at the crosshair, let go: arrows drag"),
    ),
    "Select": (
        ("Click, Enter", "Add to the selection"),
        ("Right-click, Alt-click", "Remove from the selection"),
        ("Drag", "Draw a box around the object"),
    ),
    "Refine mask": (
        ("Drag", "Paint"),
        ("Alt-drag, right drag", "Erase"),
    ),
    "Pose": (
        ("Drag", "Move a point of the object"),
        ("Shift-drag", "Along one axis of the picture"),
        ("Alt-drag", "Along the surface's normal"),
        ("Ctrl-drag", "Turn the point"),
        ("Wheel while dragging", "Nearer, farther"),
        ("Alt-click, P", "Pin that stays"),
        ("Right-click", "Remove a point"),
        ("Click on another object", "Choose it"),
        ("Arrows, with Shift, Alt", "Nudge by 1 px, by 10 px, by 0.1 px"),
        ("PageUp, PageDown", "Farther, nearer · Shift: much · Alt: little"),
    ),
    "Place": (
        ("Drag", "Move the object"),
        ("Drag another object", "Choose and move it"),
        ("Wheel while dragging", "Nearer, farther"),
        ("Corner", "Scale"),
        ("Ring", "Turn · Shift: in steps of 15°"),
        ("Arrows, with Shift, Alt", "Nudge by 1 px, by 10 px, by 0.1 px"),
        ("PageUp, PageDown", "Farther, nearer · Shift: much · Alt: little"),
    ),
    "Compose": (
        ("Drag", "Repair the background, or choose what it is filled from"),
        ("Alt-drag, right drag", "Bring the photo back"),
    ),
}
