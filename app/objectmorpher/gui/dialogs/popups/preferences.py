"""The preferences popup."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from imgui_bundle import imgui

from ....editor.editor import Editor
from ....editor.filing import Dialog
from ....editor.settings import AS_THEY_ARE, AUTO, HERE, SERVER
from ....system.desktop import FULL, REDUCED
from ....system.texts import languages, t
from ...widgets.modal import label, popup
from ...widgets.segmented import Segment, draw_method, segmented
from ...widgets.widgets import FILL, button, gap, heading, note

SIZE = (520.0, 660.0)  # points
WITH_SERVER = (520.0, 758.0)
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
        kinds = (Segment(AUTO, t("The system's")), Segment("built-in", t("Built in")))
        _draw_choice(editor, t("File dialogs"), "dialogs", kinds)
        gap(16)
        heading(t("Methods"))
        for stage in METHODS:
            label(t(METHODS[stage]))
            draw_method(editor, stage)
        gap(16)
        heading(t("Compute"))
        compute.draw(editor)
        gap(16)
        note(t("Keys are changed in Help > Keyboard and pointer."))


def _draw_look(editor: Editor) -> None:
    themes = (Segment("dark", t("Dark")), Segment("light", t("Light")))
    _draw_choice(editor, t("Theme"), "theme", themes)
    hint = t("All of the window grows with it")
    sizes = [f"{100 * scale:.0f} %" if scale else t("Auto") for scale in SCALES]
    scales = tuple(Segment(n, name, hint) for n, name in zip(SCALES, sizes, strict=True))
    _draw_choice(editor, t("Text size"), "scale", scales)
    if len(languages()) > 1:
        names = tuple(Segment(code, name) for code, name in languages().items())
        _draw_choice(editor, t("Language"), "language", names)
    motions = (
        Segment(AUTO, t("As the system")),
        Segment(FULL, t("Full")),
        Segment(REDUCED, t("Reduced"), t("Nothing fades or blinks")),
    )
    _draw_choice(editor, t("Motion"), "motion", motions)
    _draw_screen(editor)


def _draw_screen(editor: Editor) -> None:
    """By which profile the photo is shown."""
    label(t("Screen colours"))
    chosen = editor.settings.screen_profile
    file = chosen if chosen not in (AUTO, AS_THEY_ARE) else ""
    kinds = (
        Segment(AUTO, t("The system's")),
        Segment(file, t("A profile…"), file or t("An ICC file of this screen")),
        Segment(AS_THEY_ARE, t("As they are"), t("The photo's numbers, whatever they mean")),
    )
    wanted = segmented("screen", kinds, chosen)
    if wanted == file and chosen != file:
        editor.filing.wanted = Dialog.PROFILE_OPEN
    else:
        _prefer(editor, "screen_profile", wanted)
    if editor.looking.screen_profile() is None and chosen != AS_THEY_ARE:
        note(t("No screen profile found: sRGB is assumed."))


def _draw_choice(editor: Editor, title: str, name: str, choices: Sequence[Segment]) -> None:
    """Of the settings' field `name`."""
    label(title)
    _prefer(editor, name, segmented(name, choices, getattr(editor.settings, name)))


def _prefer(editor: Editor, name: str, value: object) -> None:
    """Another settings object only where something changed: it is written then."""
    if getattr(editor.settings, name) != value:
        editor.settings = replace(editor.settings, **{name: value})


# Preferences > Compute: where long jobs run.

ADDRESS_HINT = "gpu.lan:8717, https://..."
STARS = int(imgui.InputTextFlags_.password)


class ComputeFields:
    """Text that is being typed, until the field is left or Enter is pressed."""

    def __init__(self) -> None:
        self._address: str | None = None  # None: as the settings say
        self._token = ""

    def draw(self, editor: Editor) -> None:
        """The rows of the section."""
        computing = editor.computing
        label(t("Long jobs"))
        if computing.is_given:
            imgui.text_unformatted(t("On {name}, as the environment says", name=computing.address))
        else:
            places = (Segment(HERE, t("This computer")), Segment(SERVER, t("Server")))
            chosen = segmented("compute", places, editor.settings.compute)
            if chosen != editor.settings.compute:
                computing.choose(chosen)
        if not computing.is_elsewhere:
            note(t("A server (objectmorpher serve) can select, lift, fill in and refine for it."))
            return
        if not computing.is_given:
            self._draw_address(editor)
            self._draw_token(editor)
        label("")
        why_not = t("Asking…") if computing.is_testing else None
        if button(t("Test connection"), why_not=why_not):
            computing.test()
        if computing.server is None:
            note(computing.trouble)
        elif computing.is_open_to_all:
            note(t("Photos and token go there unencrypted: use https or an SSH tunnel."))
        else:
            note(t("While it is gone or slow, this computer does the work."))

    def _draw_address(self, editor: Editor) -> None:
        computing = editor.computing
        label(t("Address"))
        imgui.set_next_item_width(FILL)
        shown = computing.address if self._address is None else self._address
        _, typed = imgui.input_text_with_hint("##address", ADDRESS_HINT, shown)
        if typed != shown:
            self._address = typed
        if imgui.is_item_deactivated_after_edit() and self._address is not None:
            computing.set_address(self._address)
            self._address = None

    def _draw_token(self, editor: Editor) -> None:
        computing = editor.computing
        label(t("Token"))
        imgui.set_next_item_width(FILL)
        hint = t("kept; type another one here") if computing.token else t("as the server says")
        self._token = imgui.input_text_with_hint("##token", hint, self._token, STARS)[1]
        if imgui.is_item_deactivated_after_edit() and self._token.strip():
            computing.set_token(self._token)
            self._token = ""
