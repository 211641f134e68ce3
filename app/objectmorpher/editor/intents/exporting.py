"""The export that the user puts together: what, how, and where to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from objectmorpher_core.document.key_edits import count_keys
from objectmorpher_core.pictures.formats import LOSSLESS_AT_100, Trait
from objectmorpher_core.pictures.guests import missing_jxl

from ...system import clipboard
from ...system.texts import folder_of, t
from ...worker.job_functions import encode_export, write_export
from ..export_plan import (
    FORMATS,
    LENGTHS,
    LOSSLESS,
    NAMES,
    ExportPlan,
    Format,
    VideoMotion,
    What,
    format_of,
    is_folder,
)
from ..settings import pictures_folder
from ..tasks import WRITE

if TYPE_CHECKING:
    from ..state import EditorState

COPY = "copy"  # kind of jobs and chores
KNOWN = ", ".join(f.value for f in (*FORMATS[What.PHOTO], *FORMATS[What.LAYERS][:-1]))


@dataclass(frozen=True)
class Draft:
    """The choices so far."""

    what: What
    format: Format
    bits: int  # 0: the photo's own
    quality: int  # of JPEG
    webp_quality: int
    motion: VideoMotion
    seconds: float  # of a video
    folder: Path
    name: str  # as typed: a file name, or a whole path


class Exporting:
    """The export dialog's state, and what may be done with it."""

    def __init__(self, editor: EditorState) -> None:
        self._editor = editor
        self.draft: Draft | None = None  # None: no dialog
        self._replacing: Path | None = None  # asked whether it may be overwritten
        self.returns: Path | None = None  # where another program, which waits, wants the edit

    # Choosing

    def open(self) -> None:
        """Begins with the photo, which the command names, as it was written last."""
        editor, settings = self._editor, self._editor.settings
        self._replacing = None
        file = editor.source or editor.path
        last = Path(settings.export_folder)
        is_kept = file is None and settings.export_folder and last.is_dir()
        folder = file.absolute().parent if file else (last if is_kept else pictures_folder())
        motion = self._motion(settings.export_motion)
        seconds = min(max(settings.export_seconds, LENGTHS[0]), LENGTHS[1])
        draft = Draft(
            What.PHOTO, self._usual_format, settings.export_bits, settings.quality,
            settings.webp_quality, motion, seconds, folder, "",
        )  # fmt: skip
        self.draft = self._named(self._fitting(draft))

    def _motion(self, last: str) -> VideoMotion:
        """The way through the key poses, in the first video of a tab that has some; else `last`."""
        motion = next((m for m in VideoMotion if m.value == last), VideoMotion.MORPH)
        is_first = What.VIDEO not in self._editor.tab.exported
        if is_first and self.why_no_motion(VideoMotion.KEYS) is None:
            return VideoMotion.KEYS
        return motion if self.why_no_motion(motion) is None else VideoMotion.SWAY

    def close(self) -> None:
        self.draft = self._replacing = None

    def why_not(self, what: What) -> str | None:
        """Why this cannot be exported now, or None."""
        editor = self._editor
        document = editor.committed
        if what in (What.CUTOUT, What.MASK) and editor.mask is None:
            return t("Click an object in the photo first")
        if what is What.SOLID:
            return self._why_no_shape()
        objects = () if document is None else document.objects
        is_bare = what is not What.BACKGROUND and objects and all(o.is_visitor for o in objects)
        has_plate = bool(is_bare) or (document is not None and document.plate is not None)
        is_lifted = any(item.lifted is not None for item in objects)
        if what is What.DEPTH and not is_lifted:
            return editor.why_no_shape
        if what in (What.BACKGROUND, What.LAYERS, What.VIDEO) and not has_plate:
            return t("The background is not ready yet") if is_lifted else editor.why_no_shape
        return None

    def why_no_motion(self, motion: VideoMotion) -> str | None:
        """Why a video cannot show this now, or None."""
        document = self._editor.committed
        objects = () if document is None else document.objects
        if motion is VideoMotion.MORPH:
            is_moved = any(item.is_moved for item in objects)
            return None if is_moved else t("Move or pose an object first")
        if motion is VideoMotion.KEYS and document is not None:
            has_keys = count_keys(document) > 1
            return None if has_keys else t("Keep two key poses first, in Pose")
        return self._why_no_shape()

    def why_no_format(self, format: Format) -> str | None:
        """Why nothing can be written in this format here, or None."""
        return missing_jxl() if format is Format.JXL else None

    def choose_what(self, what: What) -> None:
        """It has its usual name, unless another one was typed."""
        draft = self._draft
        is_usual = draft.name.strip() in ("", self._named(draft).name)
        changed = self._fitting(self._as_last(replace(draft, what=what)))
        self._change(self._named(changed) if is_usual else _ended(changed))

    def choose_format(self, format: Format) -> None:
        self._change(_ended(replace(self._draft, format=format)))

    def choose_bits(self, bits: int) -> None:
        """8 or 16 a channel; 0 the photo's own."""
        self._change(replace(self._draft, bits=bits))

    def choose_quality(self, quality: int) -> None:
        draft = self._draft
        is_whole = draft.format in LOSSLESS_AT_100
        self._change(
            replace(draft, webp_quality=quality) if is_whole else replace(draft, quality=quality)
        )

    def choose_motion(self, motion: VideoMotion) -> None:
        self._change(replace(self._draft, motion=motion))

    def choose_seconds(self, seconds: float) -> None:
        self._change(replace(self._draft, seconds=seconds))

    def set_name(self, name: str) -> None:
        """Take a name as it was typed; an ending chooses the format, and layers by theirs."""
        draft = replace(self._draft, name=name)
        format, what = format_of(name.strip()), _what_of(Path(name.strip()))
        if draft.what in (What.PHOTO, What.LAYERS) and format in FORMATS[what]:
            draft = replace(draft, what=draft.what if self.why_not(what) else what)
        if format is not None and format in FORMATS[draft.what]:
            draft = replace(draft, format=format)
        self._change(draft)

    def set_path(self, path: Path) -> None:
        """A file was chosen in a file dialog."""
        self._change(replace(self._draft, folder=path.parent))
        several = is_folder(self._draft.what, format_of(path.name))
        self.set_name(path.stem if several else path.name)

    # What it comes to

    @property
    def formats(self) -> tuple[Format, ...]:
        return FORMATS[self._draft.what]

    @property
    def is_folder(self) -> bool:
        """Whether several files are written into a folder."""
        return is_folder(self._draft.what, self._draft.format)

    @property
    def own_bits(self) -> int:
        """The photo's bits a channel."""
        document = self._editor.committed
        return 8 if document is None else 8 * document.photo.pixels.dtype.itemsize

    @property
    def bits(self) -> int:
        """Bits a channel of what will be written."""
        draft = self._draft
        if draft.what is What.DEPTH:
            return 16
        if not self.has_bits:
            return 8
        return draft.bits or self.own_bits

    @property
    def has_bits(self) -> bool:
        """Whether there is a choice of bit depth."""
        has_none = (What.MASK, What.DEPTH, What.VIDEO)
        return self._draft.format.has_16_bits and self._draft.what not in has_none

    @property
    def has_quality(self) -> bool:
        """Whether there is a choice between size and truth."""
        return self._draft.format.has_quality and self._draft.what is not What.VIDEO

    @property
    def quality(self) -> int:
        draft = self._draft
        return draft.webp_quality if draft.format in LOSSLESS_AT_100 else draft.quality

    @property
    def is_lossless(self) -> bool:
        """Whether every pixel is kept at the quality that is chosen."""
        return self._draft.format in LOSSLESS_AT_100 and self.quality == LOSSLESS

    @property
    def path(self) -> Path:
        """The file, or the folder."""
        draft = self._draft
        name = Path(draft.name.strip())
        typed = draft.folder / (name.expanduser() if name.parts[:1] == ("~",) else name)
        if self.is_folder or not typed.name or format_of(typed.name) is not None:
            return typed
        return typed.with_name(typed.name + draft.format.endings[0])

    @property
    def is_replacing(self) -> bool:
        """Whether the next click replaces a file that is there."""
        return self._replacing is not None and self._replacing == self.path

    @property
    def label(self) -> str:
        """Return the button's text, which says what will be written."""
        name = self.path.name if self._draft.name.strip() else ""
        return (
            t("Replace {name}", name=name) if self.is_replacing else t("Export {name}", name=name)
        )

    @property
    def problem(self) -> str | None:
        """Why this cannot be written, one sentence; None where it can be tried."""
        draft, path = self._draft, self.path
        if not draft.name.strip():
            return t("Type a file name")
        if (reason := self.why_not(draft.what)) is not None:
            return reason
        if draft.what is What.VIDEO and (reason := self.why_no_motion(draft.motion)) is not None:
            return reason
        if not self.is_folder and format_of(path.name) not in FORMATS[draft.what]:
            return self._why_no_ending(path.suffix)
        if (reason := self.why_no_format(draft.format)) is not None:
            return reason
        try:
            return self._cannot_be_there(path)
        except (OSError, RuntimeError, ValueError):  # a name that no disk can hold
            return t("This is no name for a file")

    def _why_no_ending(self, ending: str) -> str:
        """Why this cannot be written into a file with that ending."""
        what = self._draft.what
        if what is What.PHOTO and format_of(ending) in FORMATS[What.LAYERS]:
            reason = self.why_not(What.LAYERS)
            return t("{ending} holds layers. {reason}", ending=ending, reason=reason)
        known = ", ".join(f.value for f in FORMATS[what])
        return t("It cannot be written as {ending}; choose {known}", ending=ending, known=known)

    @property
    def renaming(self) -> str:
        """What the file will be called, where the typed ending is none that is known; else ""."""
        name, path = self._draft.name.strip(), self.path
        is_known = self.is_folder or not Path(name).suffix or format_of(name) is not None
        return "" if is_known else t("The file will be called {name}", name=path.name)

    def confirm(self) -> None:
        """Exports; asks once more where that replaces a file."""
        if self.problem is not None:
            return
        draft, path = self._draft, self.path
        if path.exists() and not self.is_replacing:
            self._replacing = path
            return
        self._remember(draft, path)
        plan = ExportPlan(
            draft.what, path, self._editor.current, self.bits, self.quality, draft.motion,
            draft.seconds,
        )  # fmt: skip
        self.close()
        self._start(plan)

    def export_to(self, path: Path) -> None:
        """The edited photo, or its layers, into a file of the kind that its ending says."""
        editor, settings = self._editor, self._editor.settings
        format, what = format_of(path.name), _what_of(path)
        if format is None or format not in FORMATS[what]:
            editor.complain(
                t("a photo cannot be written as {ending}; choose {known}",
                  ending=path.suffix, known=KNOWN)
            )  # fmt: skip
        elif editor.is_opened(path):
            editor.complain(t("the export would overwrite the opened photo; choose another name"))
        else:
            is_whole = format in LOSSLESS_AT_100
            quality = settings.webp_quality if is_whole else settings.quality
            self._start(ExportPlan(what, path, quality=quality))

    @property
    def why_not_back(self) -> str | None:
        """Why the edit cannot be sent back now, or None."""
        if self.returns is None:
            return t("No other program waits for this edit")
        return self.why_not(_what_of(self.returns))

    def send_back(self, then: Callable[[], None]) -> None:
        """Write the edit where the other program waits for it; `then` closes the window."""
        editor, document, path = self._editor, self._editor.committed, self.returns
        if document is None or path is None:
            return
        editor.jobs.start(
            t("Sending back"), write_export, document, ExportPlan(_what_of(path), path),
            done=lambda _: then(),
            failed=lambda error: editor.complain_of(
                error.retried_by(lambda: self.send_back(then))
            ),
            kind=f"{WRITE} {path}",
        )  # fmt: skip

    def copy(self, what: What, offered: Callable[[bytes], None] = lambda png: None) -> None:
        """Put the edited photo, or the current object alone, into the clipboard.

        `offered` gets its PNG file.
        """
        editor, document = self._editor, self._editor.committed
        if document is None:
            return
        plan, before = ExportPlan(what, Path("copied.png"), editor.current, bits=8), editor.message
        told = t("Copied the photo")
        if what is What.CUTOUT:
            told = t("Copied {name} · Ctrl+Shift+C copies the photo", name=editor.chosen.name)

        def tell() -> None:
            if editor.message is None or editor.message is before:  # else newer is said, of a paste
                editor.say(told)

        def offer(png: bytes) -> None:
            offered(png)
            editor.chores.start(
                t("Copying"), lambda progress: clipboard.copy(png), kind=COPY,
                done=lambda _: tell(), failed=editor.complain_of,
            )  # fmt: skip

        editor.jobs.start(
            t("Copying"), encode_export, document, plan, done=offer,
            failed=lambda error: editor.complain_of(
                error.retried_by(lambda: self.copy(what, offered))
            ), kind=COPY,
        )  # fmt: skip

    # Inside

    @property
    def _draft(self) -> Draft:
        assert self.draft is not None, "the dialog is open"
        return self.draft

    def _change(self, draft: Draft) -> None:
        self.draft = self._fitting(draft)
        if self._replacing != self.path:
            self._replacing = None

    def _fitting(self, draft: Draft) -> Draft:
        """The format is one that can hold it."""
        known, own = FORMATS[draft.what], self.own_format
        usual = own if own in known else known[0]
        return draft if draft.format in known else replace(draft, format=usual)

    def _as_last(self, draft: Draft) -> Draft:
        """Give films and layers the format of the last ones, and never the photo's.

        The first ones have that of one file: a PNG photo's would be a folder of PNG files.
        """
        settings = self._editor.settings
        lasts = {What.VIDEO: settings.export_film, What.LAYERS: settings.export_layers}
        if draft.what not in lasts or self._draft.what is draft.what:
            return draft
        known, last = FORMATS[draft.what], lasts[draft.what]
        return replace(draft, format=next((f for f in known if f.value == last), known[0]))

    @property
    def own_format(self) -> Format:
        """The photo's own, where it can be written: a JPEG file becomes a JPEG file."""
        document = self._editor.committed
        own = None if document is None else format_of(document.photo.name)
        return own if own is not None and own in FORMATS[What.PHOTO] else Format.PNG

    @property
    def _usual_format(self) -> Format:
        """The one chosen last; the photo's own instead of one that would lose some of it, until
        this photo was written so."""
        last = self._editor.settings.export_format
        format = next((f for f in Format if f.value == last), self.own_format)
        is_meant = What.PHOTO in self._editor.tab.exported or self._is_held_by(format)
        return format if is_meant else self.own_format

    def _is_held_by(self, format: Format) -> bool:
        """Whether a format holds the photo's bits and transparency."""
        document = self._editor.committed
        has_alpha = document is not None and document.photo.picture.alpha is not None
        is_deep_enough = format.has_16_bits or self.own_bits == 8
        return is_deep_enough and (Trait.ALPHA in format.traits or not has_alpha)

    def _why_no_shape(self) -> str | None:
        document, current = self._editor.committed, self._editor.current
        objects = () if document is None else document.objects
        is_lifted = current < len(objects) and objects[current].lifted is not None
        return None if is_lifted else self._editor.why_no_shape

    def _named(self, draft: Draft) -> Draft:
        document = self._editor.committed
        stem = Path(document.photo.name).stem if document is not None else "photo"
        return _ended(replace(draft, name=f"{stem}-{NAMES[draft.what]}"))

    def _cannot_be_there(self, path: Path) -> str | None:
        """Why nothing can be written to `path`, or None."""
        if not path.parent.is_dir():
            return t("There is no folder {folder}", folder=path.parent)
        if self._editor.is_opened(path):
            return t("The export would overwrite the opened photo; choose another name")
        is_taken = path.is_dir() and (not path.name or not self.is_folder)
        return t("{name} is a folder", name=path.name or path) if is_taken else None

    def _remember(self, draft: Draft, path: Path) -> None:
        editor = self._editor
        format = "" if draft.format is self.own_format else draft.format.value
        proposed = self._fitting(replace(draft, format=self._usual_format)).format
        is_film, is_layers = draft.what is What.VIDEO, draft.what is What.LAYERS
        is_proposed = draft.what is not What.PHOTO and draft.format is proposed
        if is_film or is_layers or is_proposed:
            format = editor.settings.export_format  # nobody chose another
        film = draft.format.value if is_film else editor.settings.export_film
        layers = draft.format.value if is_layers else editor.settings.export_layers
        editor.tab.exported |= {draft.what}
        editor.settings = replace(
            editor.settings, export_format=format, export_film=film, export_layers=layers,
            export_bits=draft.bits, quality=draft.quality, webp_quality=draft.webp_quality,
            export_motion=draft.motion.value, export_seconds=draft.seconds,
            export_folder=str(path.parent.absolute()),
        )  # fmt: skip

    def _start(self, plan: ExportPlan) -> None:
        editor, document = self._editor, self._editor.committed
        if document is None:
            return
        name = plan.path.name
        editor.jobs.start(
            t("Exporting {name}", name=name), write_export, document, plan,
            done=lambda _: editor.say(t("Exported {name} to {folder}", name=name,
                                        folder=folder_of(plan.path))),
            failed=lambda error: editor.complain_of(error.retried_by(lambda: self._start(plan))),
            cancelled=lambda: editor.say(t("{name} was not written", name=name)),
            kind=f"{WRITE} {plan.path}",
        )  # fmt: skip
        before = editor.jobs.shown
        if before is not None and before.kind != f"{WRITE} {plan.path}":
            editor.say(t("{name} is written next, after: {job}", name=name, job=before.title))


def _what_of(path: Path) -> What:
    """What a file of that name holds: layers where it can, else the edited photo."""
    return What.LAYERS if format_of(path.name) in FORMATS[What.LAYERS][:-1] else What.PHOTO


def _ended(draft: Draft) -> Draft:
    """The draft whose name ends as its format's files do, or as folders do."""
    name = draft.name.strip()
    if not Path(name).name:
        return draft
    format = format_of(name)
    known = () if format is None else format.endings
    stem = next((name[: -len(e)] for e in known if name.lower().endswith(e)), name)
    several = is_folder(draft.what, draft.format)
    return replace(draft, name=stem + ("" if several else draft.format.endings[0]))
