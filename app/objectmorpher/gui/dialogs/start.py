"""The screen before a photo is open: where to drop, what to try, what was open last."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from imgui_bundle import ImVec2, imgui

from ...commands import run
from ...editor.editor import Editor
from ...editor.recovery import Left, when
from ...render.gpu_memory import PictureTexture
from ...render.renderer import Renderer
from ...system.resources import resource
from ...system.texts import t
from ..widgets.panes import FLAGS, START, Rect
from ..widgets.theme import FIELD, TITLE_SIZE, Icon, theme
from ..widgets.widgets import Emphasis, bold_text, button, drawn_button, fitted, small_text, tooltip
from ..window.landmarks import mark

SAMPLES = {  # title, and a place of the thing that is lifted when it is opened, image px
    "chelsea": ("Cat", (189, 153)), "coffee": ("Coffee", (280, 260)),
    "rocket": ("Rocket", (322, 264)), "flower": ("Flower", (307, 223)),
}  # fmt: skip
COLUMN = 720.0  # points, width of everything
DROP_HEIGHT = 240.0
THUMB = (168.0, 112.0)
SAMPLES_HEIGHT = THUMB[1] + 156.0  # with the title above them, their names and what is around
LEAST_GAP = 12.0  # points between two of them, which are smaller where there is no room
RECENT = 4  # files shown
RECENT_TITLE, RECENT_ROW = 44.0, 28.0  # heights


UNLIKE = imgui.WindowFlags_.no_scrollbar | imgui.WindowFlags_.no_background  # a pane


class StartScreen:
    """Owns the samples' thumbnails."""

    def __init__(self, renderer: Renderer) -> None:
        self._renderer = renderer
        self._thumbs: dict[str, PictureTexture] = {}

    def draw(self, editor: Editor, rect: Rect) -> None:
        imgui.set_next_window_pos(ImVec2(rect.x, rect.y))
        imgui.set_next_window_size(ImVec2(rect.width, rect.height))
        imgui.push_style_color(imgui.Col_.window_bg, theme.vec("surround"))
        imgui.begin(START, None, FLAGS & ~UNLIKE)
        imgui.pop_style_color()
        column = min(theme.pt(COLUMN), rect.width - theme.pt(48))
        recent = [Path(r) for r in editor.settings.recent[:RECENT]]
        content = DROP_HEIGHT + SAMPLES_HEIGHT + recovery_height(editor)
        content += RECENT_TITLE + RECENT_ROW * len(recent) if recent else 0
        top = max((rect.height - theme.pt(content)) / 2, theme.pt(24))
        imgui.set_cursor_pos(ImVec2((rect.width - column) / 2, top))
        imgui.begin_group()
        draw_recovery(editor, column)
        self._draw_drop_target(editor, column)
        imgui.dummy(theme.size(0, 12))
        self._draw_samples(editor, column)
        if recent:
            imgui.dummy(theme.size(0, 8))
            self._draw_recent(editor, recent, column)
        imgui.end_group()
        imgui.end()

    def _draw_drop_target(self, editor: Editor, column: float) -> None:
        draw = imgui.get_window_draw_list()
        low = imgui.get_cursor_screen_pos()
        high = ImVec2(low.x + column, low.y + theme.pt(DROP_HEIGHT))
        draw.add_rect_filled(low, high, theme.u32("panel"), theme.pt(12))
        draw.add_rect(low, high, theme.u32("pressed"), theme.pt(12), thickness=theme.pt(1.5))
        middle = low.x + column / 2
        _draw_centred(Icon.IMAGE, middle, low.y + theme.pt(40), "secondary", TITLE_SIZE)
        with bold_text():
            title = t("Drop a photo here")
            _draw_centred(title, middle, low.y + theme.pt(88), "text", TITLE_SIZE)
        text = t("Click an object in it, lift it into 3D, drag its points, save the photo.")
        _draw_centred(text, middle, low.y + theme.pt(128), "secondary")
        imgui.set_cursor_screen_pos(
            ImVec2(low.x + (column - theme.pt(160)) / 2, low.y + theme.pt(172))
        )
        if button(t("Open a photo…"), Emphasis.PRIMARY, width=160):
            run(editor, "open")
        imgui.set_cursor_screen_pos(ImVec2(low.x, high.y))
        imgui.dummy(ImVec2(column, 0))

    def _draw_samples(self, editor: Editor, column: float) -> None:
        with bold_text():
            imgui.text_unformatted(t("Or try one of these"))
        imgui.dummy(theme.size(0, 0))
        count, least = len(SAMPLES), theme.pt(LEAST_GAP)
        width = min(theme.pt(THUMB[0]), (column - (count - 1) * least) / count)
        gap = (column - count * width) / (count - 1)
        for i, name in enumerate(SAMPLES):
            if i:
                imgui.same_line(0, gap)
            self._draw_sample(editor, name, ImVec2(width, width * THUMB[1] / THUMB[0]))

    def _draw_sample(self, editor: Editor, name: str, size: ImVec2) -> None:
        title, thing = SAMPLES[name]
        low = imgui.get_cursor_screen_pos()
        imgui.begin_group()
        if drawn_button(f"##{name}", size):
            editor.sample.open(resource(f"assets/samples/{name}.jpg"), thing)
        mark(title)
        is_hovered = imgui.is_item_hovered()
        if is_hovered:
            imgui.set_mouse_cursor(imgui.MouseCursor_.hand)
        draw = imgui.get_window_draw_list()
        high = ImVec2(low.x + size.x, low.y + size.y)
        picture = imgui.ImTextureRef(self._thumb(name).glo)
        white = theme.u32("#FFFFFF")
        zero, one = ImVec2(0, 0), ImVec2(1, 1)
        draw.add_image_rounded(picture, low, high, zero, one, white, theme.pt(8))
        if is_hovered:
            draw.add_rect(low, high, theme.u32("accent"), theme.pt(8), thickness=theme.pt(2))
        imgui.text_colored(theme.vec("text" if is_hovered else "secondary"), t(title))
        imgui.end_group()

    def _thumb(self, name: str) -> PictureTexture:
        """The sample's picture, cut to the thumbnail's shape."""
        from PIL import Image

        if name not in self._thumbs:
            with Image.open(str(resource(f"assets/samples/{name}.jpg"))) as file:
                picture = file.convert("RGB")
            aspect = THUMB[0] / THUMB[1]
            width, height = picture.size
            across, down = min(width, height * aspect), min(height, width / aspect)
            left, top = (width - across) / 2, (height - down) / 2
            box = (int(left), int(top), int(left + across), int(top + down))
            size = (int(THUMB[0] * 2), int(THUMB[1] * 2))
            picture = picture.crop(box).resize(size, Image.Resampling.LANCZOS)
            self._thumbs[name] = self._renderer.picture(np.asarray(picture))
        return self._thumbs[name]

    def _draw_recent(self, editor: Editor, recent: list[Path], column: float) -> None:
        with bold_text():
            imgui.text_unformatted(t("Recent"))
        imgui.push_style_var(imgui.StyleVar_.button_text_align, ImVec2(0, 0.5))
        for path in recent:
            name = fitted(path.name, column - theme.pt(56))
            across = imgui.calc_text_size(f"{Icon.FILE}   {name}").x / theme.scale + 16
            if button(f"{Icon.FILE}   {name}##{path}", Emphasis.QUIET, width=max(across, 320)):
                if path.exists():
                    editor.filing.open(path)
                else:
                    editor.complain(t("The file {name} is not there any more", name=path.name))
                    editor.filing.forget_recent(str(path))
            tooltip(str(path))
        imgui.pop_style_var()


def _draw_centred(text: str, middle: float, top: float, role: str, size: float = 0.0) -> None:
    """A line of text; `middle` and `top` on the screen, `size` of the font, 0 as it is."""
    imgui.push_font(None, size)
    at = ImVec2(middle - imgui.calc_text_size(text).x / 2, top)
    imgui.get_window_draw_list().add_text(at, theme.u32(role), text)
    imgui.pop_font()


# On the start screen: unsaved work of an editor that crashed, to take up or to throw away.

ROW = 56.0  # points
MOST = 3  # shown at a time
REST = 24.0  # points of the line that counts the others
LONGEST = 40  # letters of a name
GAP = 12.0
RECOVER, DISCARD = 96.0, 88.0  # widths of the buttons


def recovery_height(editor: Editor) -> float:
    """Points that the list takes, with the gap below it."""
    count = min(len(editor.recovery.left), MOST)
    more = REST if len(editor.recovery.left) > MOST else 0.0
    return count * (ROW + 8) + more + GAP if count else 0.0


def draw_recovery(editor: Editor, width: float) -> None:
    """`width` in window units."""
    shown = editor.recovery.left[:MOST]
    for left in shown:
        _draw_left(editor, left, width)
    if rest := len(editor.recovery.left) - len(shown):
        with small_text():
            imgui.text_colored(
                theme.vec("secondary"), t("{count} more are not shown yet", count=rest)
            )
    if shown:
        imgui.dummy(theme.size(0, GAP - 8))


def _draw_left(editor: Editor, left: Left, width: float) -> None:
    low = imgui.get_cursor_screen_pos()
    high = ImVec2(low.x + width, low.y + theme.pt(ROW))
    draw = imgui.get_window_draw_list()
    draw.add_rect_filled(low, high, theme.u32("panel"), theme.pt(8))
    draw.add_rect(low, high, theme.u32("line"), theme.pt(8))
    middle = low.y + (theme.pt(ROW) - imgui.get_font_size()) / 2
    draw.add_text(ImVec2(low.x + theme.pt(16), middle), theme.u32("warning"), Icon.WARNING)
    end = ImVec2(high.x - theme.pt(RECOVER + DISCARD + 28), high.y)
    draw.push_clip_rect(low, end, True)
    draw.add_text(ImVec2(low.x + theme.pt(44), low.y + theme.pt(9)), theme.u32("text"), _name(left))
    with small_text():
        at = ImVec2(low.x + theme.pt(44), low.y + theme.pt(30))
        draw.add_text(at, theme.u32("secondary"), _facts(left))
    draw.pop_clip_rect()
    imgui.push_id(str(left.folder))
    top = low.y + theme.pt((ROW - FIELD) / 2)
    imgui.set_cursor_screen_pos(ImVec2(high.x - theme.pt(DISCARD + 12), top))
    is_sure = editor.recovery.doubted is left
    label, kind = t("Discard"), Emphasis.PLAIN
    if is_sure:
        label, kind = t("Really?"), Emphasis.PRIMARY_SMALL
    if button(label, kind, width=DISCARD):
        editor.recovery.ask_to_discard(left)
    if not left.problem:
        imgui.set_cursor_screen_pos(ImVec2(high.x - theme.pt(RECOVER + DISCARD + 20), top))
        if button(t("Recover"), width=RECOVER):
            editor.recovery.recover(left)
    imgui.pop_id()
    imgui.set_cursor_screen_pos(ImVec2(low.x, high.y))
    imgui.dummy(ImVec2(width, 0))


def _name(left: Left) -> str:
    """Which photo's."""
    if not left.name:
        return t("Unsaved work")
    name = left.name if len(left.name) <= LONGEST else f"{left.name[: LONGEST - 1]}…"
    return t("Unsaved work on {name}", name=name)


def _facts(left: Left) -> str:
    """When it was edited and what is in it, or why it is lost."""
    if left.problem:
        return left.problem
    count = t("1 object") if left.objects == 1 else t("{count} objects", count=left.objects)
    return t("Edited {time}, {objects}", time=when(left.edited), objects=count)
