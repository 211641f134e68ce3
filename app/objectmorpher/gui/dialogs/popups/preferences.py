"""What the user prefers."""

from __future__ import annotations

from dataclasses import replace

from ....editor.editor import Editor
from ....editor.settings import AUTO
from ....system.motion import FULL, REDUCED
from ....system.texts import languages, t
from ...widgets.method_choice import draw_method
from ...widgets.segmented import Choice, segmented
from ...widgets.widgets import gap, heading, note
from .compute import ComputeFields
from .frame import label, popup

SIZE = (520.0, 580.0)  # points
WITH_SERVER = (520.0, 678.0)
METHODS = {"segment": "Select", "lift": "Lift", "inpaint": "Fill in"}  # stage -> label
SCALES = (0.0, 1.0, 1.25, 1.5, 2.0)  # 0: the monitor's


def draw_preferences(editor: Editor, compute: ComputeFields) -> None:
    """Every change holds at once."""
    size = WITH_SERVER if editor.computing.is_elsewhere else SIZE
    with popup(editor, t("Preferences"), *size):
        heading(t("Look"))
        _draw_look(editor)
        gap(16)
        heading(t("Files"))
        _draw_files(editor)
        gap(16)
        heading(t("Methods"))
        _draw_methods(editor)
        gap(16)
        heading(t("Compute"))
        compute.draw(editor)
        gap(16)
        note(t("Keys are changed in Help > Keyboard and pointer."))


def _draw_look(editor: Editor) -> None:
    settings = editor.settings
    label(t("Theme"))
    themes = (Choice("dark", t("Dark")), Choice("light", t("Light")))
    _prefer(editor, "theme", segmented("theme", themes, settings.theme))
    label(t("Text size"))
    hint = t("All of the window grows with it")
    sizes = [f"{100 * scale:.0f} %" if scale else t("Auto") for scale in SCALES]
    scales = tuple(Choice(n, name, hint) for n, name in zip(SCALES, sizes, strict=True))
    _prefer(editor, "scale", segmented("scale", scales, settings.scale))
    if len(languages()) > 1:
        label(t("Language"))
        names = tuple(Choice(code, name) for code, name in languages().items())
        _prefer(editor, "language", segmented("language", names, settings.language))
    label(t("Motion"))
    motions = (
        Choice(AUTO, t("The system's")),
        Choice(FULL, t("Full")),
        Choice(REDUCED, t("Reduced"), t("Nothing fades or blinks")),
    )
    _prefer(editor, "motion", segmented("motion", motions, settings.motion))


def _draw_files(editor: Editor) -> None:
    label(t("File dialogs"))
    kinds = (Choice(AUTO, t("The system's")), Choice("built-in", t("Built in")))
    _prefer(editor, "dialogs", segmented("dialogs", kinds, editor.settings.dialogs))


def _draw_methods(editor: Editor) -> None:
    for stage in METHODS:
        label(t(METHODS[stage]))
        draw_method(editor, stage)


def _prefer(editor: Editor, name: str, value: object) -> None:
    """Another settings object only where something changed: it is written then."""
    if getattr(editor.settings, name) != value:
        editor.settings = replace(editor.settings, **{name: value})
