"""Preferences > Compute: where long jobs run."""

from __future__ import annotations

from imgui_bundle import imgui

from ....editor.editor import Editor
from ....editor.settings import HERE, SERVER
from ....system.texts import t
from ...widgets.segmented import Choice, segmented
from ...widgets.widgets import FILL, button, note
from .frame import label

ADDRESS_HINT = "gpu.lan:8717, https://..."
STARS = int(imgui.InputTextFlags_.password)


class ComputeFields:
    """What is being typed, until it is left or Enter is pressed."""

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
            places = (Choice(HERE, t("This computer")), Choice(SERVER, t("Server")))
            chosen = segmented("compute", places, editor.settings.compute)
            if chosen != editor.settings.compute:
                computing.choose(chosen)
        if not computing.is_elsewhere:
            note(t("A server, `objectmorpher serve`, can select, lift, fill in and refine for it."))
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
