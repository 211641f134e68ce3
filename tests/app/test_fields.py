"""Fields for numbers, by a hand without a window."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from imgui_bundle import imgui

from objectmorpher.gui.widgets.widgets import Number, number_field

NUMBER = Number("Yaw", "%.1f°", 0.5, 1.0)
ROW = 18.0  # px


class Field:
    """One field in a panel, and what it says."""

    def __init__(self, value: float) -> None:
        self.value = value

    def frame(self) -> None:
        imgui.new_frame()
        imgui.set_next_window_pos(imgui.ImVec2(0, 0))
        imgui.set_next_window_size(imgui.ImVec2(300, 100))
        imgui.begin("panel", None, imgui.WindowFlags_.no_decoration)
        self.value = number_field(NUMBER, self.value).value
        imgui.end()
        imgui.render()

    def press(self) -> None:
        for is_down in (True, False):
            imgui.get_io().add_mouse_button_event(0, is_down)
            self.frame()

    def key(self, key: imgui.Key) -> None:
        for is_down in (True, False):
            imgui.get_io().add_key_event(key, is_down)
            self.frame()


@pytest.fixture
def field() -> Iterator[Field]:
    imgui.create_context()
    try:
        io = imgui.get_io()
        io.set_ini_filename("")
        io.display_size = imgui.ImVec2(400, 200)
        io.backend_flags |= imgui.BackendFlags_.renderer_has_textures.value
        io.config_drag_click_to_input_text = True  # as in the window
        made = Field(-11.7)
        for _ in range(2):
            made.frame()
        yield made
    finally:
        imgui.destroy_context()


@pytest.mark.parametrize("clicks", [1, 2])
def test_what_is_typed_takes_the_place_of_the_whole_number(field: Field, clicks: int) -> None:
    """Wherever in the field: before the point, behind it, beside the digits."""
    for x in range(130, 230, 8):
        imgui.get_io().mouse_double_click_time = 0.0  # the one before was another
        imgui.get_io().add_mouse_pos_event(float(x), ROW)
        field.value = -11.7
        field.frame()
        for k in range(clicks):
            imgui.get_io().mouse_double_click_time = 0.3 * k
            field.press()
        for _ in range(3):
            field.frame()
        imgui.get_io().add_input_characters_utf8("25")
        field.frame()
        field.key(imgui.Key.enter)
        field.frame()
        assert field.value == pytest.approx(25.0), x
