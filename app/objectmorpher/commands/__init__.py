"""Every command by name: menu, shortcuts, buttons and tests run the same entry."""

from __future__ import annotations

from ..editor.editor import Editor
from ..editor.tasks import SELECT
from ..editor.view import ToolName
from ..system.texts import t
from . import compose, edit, objects
from .command import Command

# Which settings there are, by the command that brings them into view: for the command palette.
#
# English keys of texts, as the panels have them; a test checks that each is one. What a command
# of the same name switches on and off is not among them.

SETTINGS: dict[str, tuple[str, ...]] = {
    "preferences": ("Theme", "Text size", "Language", "Motion", "Screen colours", "File dialogs",
                    "Long jobs"),
    "select": ("Select by",),
    "mask": (
        "Brush", "Radius", "Hardness", "Distance", "Edge", "Decontaminate", "Clean", "Depth",
        "Hidden",
    ),
    "pose": (
        "Rigidity", "What stays", "Drag the mirrored point too", "Rotation ring (R)", "Anchors",
        "Regions", "Softness", "Stiffness", "Turn", "X", "Y", "Depth", "Pin: it holds still",
        "Turns with the object",
    ),
    "place": ("Right", "Down", "Farther", "Yaw", "Pitch", "Roll", "From above", "Scale"),
    "look": (
        "Thickness", "Learned shape", "It stands in the photo", "Use the depth model", "Zoom",
        "Before and after", "Kind", "Other side", "Symmetry",
    ),
    "compose": (
        "Show it alone", "Opacity", "Exposure", "Warmth", "Saturation", "Sharpness", "Blur",
        "Blend mode", "Shadow", "Strength", "Length", "Softness", "Contact", "Ground", "Falls to",
        "Falls on walls and steps", "Light", "Grain", "Focus", "Blend", "AI refinement", "Amount",
    ),
}  # fmt: skip

# What other programs and people call them: the palette finds those words, too, in English.

OTHER_WORDS = {
    "Actual size": "100% 1:1",
    "Add key pose": "animation keyframe timeline video",
    "Add or remove shadow": "drop shadow delete",
    "Another object": "new layer add",
    "Background alone": "heal repair retouch clean plate spot",
    "Blend": "feather edge anti-alias",
    "Blend mode": "multiply screen overlay",
    "Blur": "soften gaussian",
    "Bring forward": "layers arrange order raise above",
    "Brush": "size radius width",
    "Cancel the running job": "stop abort",
    "Clear selection": "deselect select none",
    "Close": "tab",
    "Contact": "ambient occlusion",
    "Copy": "object cut-out clipboard",
    "Copy photo": "merged picture clipboard",
    "Double size": "200%",
    "Duplicate object": "clone copy another twice",
    "Edge brush": "hair fur refine matting",
    "Export mask…": "save alpha",
    "Exposure": "brightness lightness light levels",
    "Export photo…": "save jpeg jpg png tiff webp psd transparency alpha layers gif video render",
    "Fill from a spot": "clone stamp patch source",
    "Fill in again": "inpaint content-aware generative heal",
    "Fit to window": "zoom whole",
    "Focus": "depth of field bokeh defocus",
    "Grain": "noise",
    "Grow": "expand dilate",
    "Hide object": "take away remove delete erase show visible eye",
    "History": "steps undo redo snapshots",
    "Invert selection": "inverse",
    "Keyboard and pointer…": "hotkeys shortcuts keymap keys",
    "Language": "translation locale",
    "Larger brush": "size bigger wider",
    "Lift object": "3d extract model cut out",
    "Light": "relight harmonise match",
    "Lock object": "freeze protect",
    "Long jobs": "server remote gpu cloud",
    "Motion": "animation reduced",
    "Opacity": "transparency alpha transparent",
    "Open…": "load import",
    "Other side": "mirror flip back",
    "Paste": "photo clipboard",
    "Paint on the object": "clone stamp draw",
    "Panel": "sidebar inspector dock",
    "Pitch": "rotate tilt",
    "Pose": "bend deform warp puppet liquify",
    "Place": "move transform rotate resize scale",
    "Preferences…": "settings options configuration",
    "Proof colours": "cmyk print gamut",
    "Recover unsaved work": "autosave restore crash backup lost",
    "Redo": "repeat forward again",
    "Refine": "ai harmonize enhance",
    "Refine mask": "brush paint selection",
    "Put back into the photo": "discard object revert original restore",
    "Remove handle": "delete",
    "Reset pose": "revert original",
    "Reset position": "move back original",
    "Roll": "rotate spin",
    "Rotation ring": "rotate turn",
    "Saturation": "hue colour color vibrance",
    "Save session": "project",
    "Save session as…": "project",
    "Scale": "resize size larger smaller",
    "Screen colours": "icc profile color management monitor",
    "Select": "magic wand quick selection",
    "Select by": "lasso marquee box rectangle rectangular rubber band freehand",
    "Select subject": "remove background auto",
    "Send backward": "layers arrange order lower below",
    "Shadow": "drop shadow remove",
    "Shrink": "contract erode",
    "Smaller brush": "size thinner",
    "Split before/after": "compare",
    "Strength": "drop shadow",
    "Symmetry": "mirror flip object",
    "Text size": "font zoom interface scale dpi",
    "Take out of the photo": "remove object delete erase take away",
    "Theme": "dark mode light mode colours appearance",
    "Undo": "back revert step history",
    "Tutorial and how-to…": "help manual documentation",
    "Warmth": "temperature white balance hue tint colour color",
    "Yaw": "rotate turn",
}  # fmt: skip

__all__ = [
    "COMMANDS", "GROUPS", "OTHER_WORDS", "Command", "hint_of", "keys_of", "label_of",
    "meaning_of", "next_step", "run", "take_next_step", "why_not",
]  # fmt: skip

GROUPS: dict[str, dict[str, Command]] = {  # by the titles of the table of shortcuts
    "File": edit.FILE_COMMANDS,
    "Edit": edit.COMMANDS,
    "Select": objects.SELECT_COMMANDS,
    "Objects": objects.COMMANDS,
    "Pose": objects.POSE_COMMANDS,
    "Place": objects.PLACE_COMMANDS,
    "Look": edit.LOOK_COMMANDS,
    "Compose": compose.COMMANDS,
    "Window": edit.WINDOW_COMMANDS,
}
COMMANDS: dict[str, Command] = {
    name: command for group in GROUPS.values() for name, command in group.items()
}


def why_not(editor: Editor, name: str) -> str | None:
    """Why a command cannot run now, or None."""
    return COMMANDS[name].why_not(editor)


def run(editor: Editor, name: str) -> None:
    """Runs a command, or says why it cannot."""
    command = COMMANDS[name]
    reason = command.why_not(editor)
    if reason is None:
        command.run(editor)
    else:
        editor.say(reason)


def keys_of(editor: Editor, name: str) -> str:
    """The keys that run a command: the user's own, or the usual ones; "" for none."""
    return editor.settings.shortcuts.get(name, COMMANDS[name].keys)


def label_of(editor: Editor, name: str) -> str:
    """What a command is called; of the current object, where that makes a difference."""
    is_removing = name == "remove_object" and editor.object is not None
    return editor.objects.removing if is_removing else t(COMMANDS[name].label)


def meaning_of(editor: Editor, name: str) -> str:
    """What a command does, where its name alone leaves doubt; else ""."""
    match name:
        case "hide":
            return t("Closes its eye in the list, or opens it: while it is hidden, the picture and "
                     "exports show what is behind it")  # fmt: skip
        case "take_out":
            return t("Removes it from the picture and fills in what was behind it. It stays in "
                     "the list, hidden: its eye brings it back as it was edited")  # fmt: skip
        case "remove_object" if editor.objects.removing == t("Put back into the photo"):
            return t("Drops what was done to it: it is in the picture, where the photo has it")
        case _:
            return ""


def hint_of(editor: Editor, name: str) -> str:
    """What a command is called, and the keys that run it."""
    keys = keys_of(editor, name)
    return label_of(editor, name) + (f" ({keys})" if keys else "")


def take_next_step(editor: Editor) -> None:
    """Carry out the primary button's step; where it asks for a click, click at the pointer.

    While something is being selected, that is lifted as soon as it is there.

    Also before the candidate is marked: a slow machine, or a worker that ended, marks none.
    """
    name = next_step(editor)[1]
    if editor.hand.is_busy:
        return
    if editor.tasks.question is not None and name in (None, "lift"):
        editor.tasks.lift_when_selected()
    elif name is not None:
        run(editor, name)
    elif editor.tasks.is_click_awaited and editor.hover.place is not None:
        editor.selection.add_click(*editor.hover.place, is_foreground=True)


def next_step(editor: Editor) -> tuple[str, str | None]:
    """Return the primary button's text and its command (None where it is only a text)."""
    if editor.document is None:
        return t("Open a photo…"), "open"
    if editor.is_lifting:
        return t("Lifting…"), None
    if editor.mask is None:
        is_busy = editor.jobs.is_busy(SELECT)
        return (t("Selecting…") if is_busy else t("Click an object in the photo")), None
    if not editor.is_lifted:
        is_kept = editor.object is not None and editor.object.stays_in_front
        return (t("Another object"), "another") if is_kept else (t("Lift object"), "lift")
    is_moved, is_gone = editor.chosen.is_moved, not editor.chosen.is_visible
    is_before_posing = editor.view.tool in (ToolName.SELECT, ToolName.MASK) or (
        editor.view.tool is ToolName.LOOK and not is_moved
    )
    if is_before_posing and not is_gone:
        return t("Pose the object"), "pose"
    if not is_moved:
        is_posing = editor.view.tool is ToolName.POSE
        return (t("Drag a point on the object") if is_posing else t("Drag the object")), None
    is_awaited = editor.exporting.returns is not None
    return (t("Send back"), "send_back") if is_awaited else (t("Export photo…"), "export")
