"""A file dialog of our own, for desktops that have none: a path to type and a list of files."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import ImVec2, imgui

from objectmorpher_core.base.arrays import RGB

from ...editor.editor import Editor
from ...editor.filing import Dialog
from ...editor.opening import PHOTO_ENDINGS, SESSION_ENDING, read_thumbnail
from ...system.texts import t
from ..widgets.modal import is_dismissed, modal
from ..widgets.theme import Icon, theme
from ..widgets.widgets import (
    FILL,
    Emphasis,
    button,
    icon_button,
    note,
    pictures,
    shortened,
    shown_path,
    text_top,
)

WIDTH, HEIGHT = 640.0, 480.0  # points
ROW = 28.0
TALL = 44.0  # of rows with a picture
THUMB = (60.0, 40.0)  # room for it
THUMBNAIL = "thumbnail"  # kind of chores
VERBS = {
    Dialog.OPEN: "Open", Dialog.SAVE: "Save", Dialog.EXPORT: "Choose",
    Dialog.MASK_OPEN: "Import", Dialog.SHAPE_OPEN: "Use", Dialog.MASK_SAVE: "Export",
    Dialog.MODEL_OPEN: "Use", Dialog.MODEL_FOLDER: "Use",
    Dialog.PROFILE_OPEN: "Use", Dialog.PROOF_OPEN: "Use", Dialog.VIEW_OPEN: "Add",
}  # fmt: skip


class _Thumbnails:
    """Small pictures of the files that are in sight, read one after another beside the window."""

    def __init__(self) -> None:
        self._found: dict[Path, RGB | None] = {}  # None: it is no picture

    def of(self, editor: Editor, path: Path) -> RGB | None:
        """Return the picture of a file; None where it has none, or not yet."""
        if path not in self._found and not editor.chores.is_busy(THUMBNAIL):
            editor.chores.start(
                "Reading a thumbnail", lambda progress: read_thumbnail(path),
                done=lambda found: self._found.update({path: found}),
                failed=lambda error: self._found.update({path: None}),
                kind=THUMBNAIL, is_quiet=True,
            )  # fmt: skip
        return self._found.get(path)

    def forget(self) -> None:
        """A folder is listed anew: its files may have changed."""
        self._found = {}


class FileChooser:
    """The file dialogs, of which one is open at a time."""

    def __init__(self) -> None:
        self.is_open = False
        self._dialog = Dialog.OPEN
        self._folder = Path.home()
        self._endings: tuple[str, ...] = ()
        self._name = ""
        self._is_first = False
        self._entries: list[Path] = []
        self._replacing: Path | None = None  # asked whether it may be overwritten
        self._thumbnails = _Thumbnails()

    def open(self, dialog: Dialog, suggestion: Path, endings: tuple[str, ...]) -> None:
        """`suggestion`: a folder, or a file's path."""
        self._dialog, self._endings = dialog, endings
        is_folder = suggestion.is_dir()
        self._enter(suggestion if is_folder else suggestion.parent)
        self._name = "" if is_folder else suggestion.name
        self.is_open = self._is_first = True
        self._replacing = None

    def draw(self, editor: Editor) -> None:
        if not self.is_open:
            return
        endings = ", ".join(sorted({e[1:].upper().replace("JPEG", "JPG") for e in self._endings}))
        if self._dialog is Dialog.OPEN:  # of which there are twenty
            endings = t("A photo, a camera RAW file or a session")
        elif self._dialog is Dialog.SAVE:
            endings = t("A session (.omorph) keeps photo, objects and poses")
        about = t("{endings}. Type a name or a whole path, or choose below.", endings=endings)
        with modal(t(self._dialog.value), WIDTH, about, HEIGHT) as is_shown:
            if is_shown:
                self._draw(editor)

    def _draw(self, editor: Editor) -> None:
        is_entered = self._draw_path()
        self._is_first = False
        chosen = self._draw_list(editor)
        is_confirmed, is_cancelled = self._draw_foot()
        if is_cancelled or is_dismissed():
            self._close()
            editor.filing.cancel_dialog()
        elif chosen is not None or is_entered or is_confirmed:
            self._choose(editor, chosen or self._typed())

    def _draw_path(self) -> bool:
        """The field; True when Enter was pressed in it."""
        if self._is_first:
            imgui.set_keyboard_focus_here()
        imgui.set_next_item_width(FILL)
        is_entered, self._name = imgui.input_text_with_hint(
            "##path", t("name or path"), self._name, imgui.InputTextFlags_.enter_returns_true
        )
        return is_entered and bool(self._name)

    def _draw_list(self, editor: Editor) -> Path | None:
        """Folders and files; a file that was double-clicked."""
        if icon_button(Icon.UP, "up", t("One folder up")):
            self._enter(self._folder.parent)
        imgui.same_line()
        imgui.align_text_to_frame_padding()
        room = imgui.get_content_region_avail().x
        imgui.text_colored(theme.vec("secondary"), shortened(shown_path(self._folder), room))
        imgui.push_style_color(imgui.Col_.child_bg, theme.vec("surround"))
        imgui.push_style_var(imgui.StyleVar_.window_padding, theme.size(6, 6))
        imgui.push_style_var(imgui.StyleVar_.item_spacing, theme.size(8, 2))
        foot = theme.pt(56)
        flags = imgui.ChildFlags_.always_use_window_padding | imgui.ChildFlags_.nav_flattened
        imgui.begin_child("##files", ImVec2(0, -foot), flags)
        chosen = None
        for entry in self._entries:
            chosen = self._draw_entry(editor, entry) or chosen
        if not self._entries:
            note(_nothing_here(self._dialog))
        imgui.end_child()
        imgui.pop_style_var(2)
        imgui.pop_style_color()
        return chosen

    def _draw_entry(self, editor: Editor, entry: Path) -> Path | None:
        is_folder = entry.is_dir()
        icon = Icon.FOLDER if is_folder else Icon.IMAGE
        flags = imgui.SelectableFlags_.allow_double_click
        has_picture = not is_folder and entry.suffix.lower() in (*PHOTO_ENDINGS, SESSION_ENDING)
        height = ImVec2(0, theme.pt(TALL if has_picture else ROW))
        is_current = entry.name == self._name
        start = imgui.get_cursor_screen_pos()
        imgui.push_style_var(imgui.StyleVar_.selectable_text_align, ImVec2(0, 0.5))
        label = f"##{entry.name}" if has_picture else f"{icon}   {entry.name}"
        is_clicked = imgui.selectable(label, is_current, flags, height)[0]
        imgui.pop_style_var()
        if has_picture and imgui.is_item_visible():
            _draw_picture(self._thumbnails.of(editor, entry), icon, start)
            at = ImVec2(start.x + theme.pt(THUMB[0] + 12), text_top(start, height.y))
            imgui.get_window_draw_list().add_text(at, theme.u32("text"), entry.name)
        if not is_clicked:
            return None
        if is_folder:
            self._enter(entry)
        else:
            self._name, self._replacing = entry.name, None
            if imgui.is_mouse_double_clicked(0):
                return entry
        return None

    def _draw_foot(self) -> tuple[bool, bool]:
        imgui.set_cursor_pos_y(imgui.get_window_height() - theme.pt(60))
        if self._replacing is not None:
            imgui.align_text_to_frame_padding()
            text = t("{name} exists. Press again to replace it.", name=self._replacing.name)
            imgui.text_colored(theme.vec("warning"), text)
            imgui.same_line()
        verb = t("Replace") if self._replacing is not None else t(VERBS[self._dialog])
        right = imgui.get_window_width() - theme.pt(20 + 120 + 8 + 96)
        imgui.same_line(right)
        imgui.set_cursor_pos_y(imgui.get_window_height() - theme.pt(54))
        is_cancelled = button(t("Cancel"), width=96)
        imgui.same_line()
        imgui.set_cursor_pos_y(imgui.get_window_height() - theme.pt(60))
        why_not = None if self._name else t("Type a name or choose a file")
        return button(verb, Emphasis.PRIMARY, why_not, width=120), is_cancelled

    def _typed(self) -> Path:
        return self._folder / Path(self._name.strip()).expanduser()

    def _choose(self, editor: Editor, path: Path) -> None:
        """Enters a folder, asks before replacing, else gives the file to the editor."""
        if path.is_dir():
            self._enter(path)
            self._name = "" if self._dialog.is_opening else self._name
            return
        is_asking = self._dialog in (Dialog.SAVE, Dialog.MASK_SAVE)  # an export asks by itself
        if is_asking and path.exists() and path != self._replacing:
            self._replacing = path
            return
        self._close()
        editor.filing.choose(self._dialog, path)

    def _close(self) -> None:
        self.is_open = False
        imgui.close_current_popup()

    def _enter(self, folder: Path) -> None:
        """Lists a folder: folders first, then the files that can be chosen."""
        try:
            entries = [e for e in folder.iterdir() if not e.name.startswith(".")]
            folders = sorted((e for e in entries if e.is_dir()), key=lambda e: e.name.lower())
            files = [e for e in entries if e.suffix.lower() in self._endings and e.is_file()]
        except OSError:
            return
        self._folder, self._is_first = folder.resolve(), True  # the field has the keys again
        self._thumbnails.forget()
        self._entries = folders + sorted(files, key=lambda e: e.name.lower())


def _nothing_here(dialog: Dialog) -> str:
    """What a folder says that has neither folders nor files of the kind that is asked for."""
    if dialog is Dialog.OPEN:
        return t("No photos in this folder.")
    if dialog is Dialog.SAVE:
        return t("No sessions in this folder yet.")
    return t("No such files here.")


def _draw_picture(picture: RGB | None, icon: str, start: ImVec2) -> None:
    """A file's picture in the middle of its room at the left of the row, or an icon there."""
    draw, (width, height) = imgui.get_window_draw_list(), THUMB
    if picture is None:
        at = ImVec2(start.x + theme.pt(width / 2 - 8), text_top(start, theme.pt(TALL)))
        draw.add_text(at, theme.u32("secondary"), icon)
        return
    scale = min(width / picture.shape[1], height / picture.shape[0])
    across, down = theme.pt(scale * picture.shape[1]), theme.pt(scale * picture.shape[0])
    left = round(start.x + (theme.pt(width) - across) / 2)
    top = round(start.y + (theme.pt(TALL) - down) / 2)
    end = ImVec2(left + round(across), top + round(down))
    draw.add_image(pictures.texture(picture), ImVec2(left, top), end)
