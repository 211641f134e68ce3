"""Which settings there are, by the command that brings them into view: for the command palette.

English keys of texts, as the panels have them; a test checks that each is one.
"""

from __future__ import annotations

SETTINGS: dict[str, tuple[str, ...]] = {
    "preferences": ("Theme", "Text size", "Language", "Motion", "File dialogs", "Long jobs"),
    "select": ("Select by", "Keep in front"),
    "mask": ("Brush", "Radius", "Hardness", "Distance", "Edge", "Decontaminate", "Depth", "Hidden"),
    "pose": (
        "Rigidity", "What stays", "Symmetry", "Drag the mirrored point too", "Rotation ring (R)",
        "Anchors", "Regions", "Influence of the handle", "Strain", "Softness", "Stiffness", "Turn",
    ),
    "place": ("Move over the ground",),
    "look": (
        "Thickness", "Learned shape", "It stands in the photo", "Use the depth model", "Zoom",
        "Before and after",
    ),
    "compose": (
        "Show it alone", "Shadow", "Strength", "Length", "Contact", "Ground", "Light", "Blend",
        "Network", "Amount",
    ),
}  # fmt: skip
