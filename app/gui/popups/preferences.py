"""What the user prefers."""

from __future__ import annotations

from dataclasses import replace

from imgui_bundle import imgui

from ...editor import Editor
from ...settings import AUTO
from ...texts import languages, t
from ..segmented import Choice, segmented
from ..theme import theme
from ..widgets import checkbox, gap, heading, note
from .frame import popup

SIZE = (520.0, 340.0)  # points
LABEL = 132.0  # points, of the names left of the fields
SCALES = (0.0, 1.0, 1.25, 1.5, 2.0)  # 0: the monitor's


def draw_preferences(editor: Editor) -> None:
    """Every change holds at once."""
    with popup(editor, t("Preferences"), *SIZE):
        heading(t("Look"))
        _draw_look(editor)
        gap(16)
        heading(t("Files"))
        _draw_files(editor)
        gap(16)
        note(t("Keys are changed in Help > Keyboard and pointer."))


def _draw_look(editor: Editor) -> None:
    settings = editor.settings
    _label(t("Theme"))
    themes = (Choice("dark", t("Dark")), Choice("light", t("Light")))
    _prefer(editor, "theme", segmented("theme", themes, settings.theme))
    _label(t("Size"))
    scales = tuple(
        Choice(scale, f"{100 * scale:.0f} %" if scale else t("Auto")) for scale in SCALES
    )
    _prefer(editor, "scale", segmented("scale", scales, settings.scale))
    if len(languages()) > 1:
        _label(t("Language"))
        names = tuple(Choice(code, name) for code, name in languages().items())
        _prefer(editor, "language", segmented("language", names, settings.language))
    is_reduced = checkbox(t("No fading and sliding"), settings.is_motion_reduced)
    _prefer(editor, "is_motion_reduced", is_reduced)


def _draw_files(editor: Editor) -> None:
    _label(t("File dialogs"))
    kinds = (Choice(AUTO, t("The system's")), Choice("built-in", t("Built in")))
    _prefer(editor, "dialogs", segmented("dialogs", kinds, editor.settings.dialogs))


def _prefer(editor: Editor, name: str, value: object) -> None:
    """Another settings object only where something changed: it is written then."""
    if getattr(editor.settings, name) != value:
        editor.settings = replace(editor.settings, **{name: value})


def _label(text: str) -> None:
    imgui.align_text_to_frame_padding()
    imgui.text_colored(theme.vec("secondary"), text)
    imgui.same_line(theme.pt(LABEL))
