"""Exports, in the worker process: what is written is encoded whole, and then replaces the file."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from objectmorpher_core.base.progress import Progress
from objectmorpher_core.document.model import Document

from ..editor.export_plan import ExportPlan

if TYPE_CHECKING:
    from objectmorpher_core.scripting.outputs import Export


def write_export(document: Document, plan: ExportPlan, progress: Progress) -> None:
    """Renders what the plan asks for and writes it. Raises OutputError, ImageError."""
    from objectmorpher_core.base.files import make_folder, write_all

    export = _export(document, plan, progress)
    if not plan.is_folder:
        data = export.encode(plan.what.key, plan.path)
        progress(0.95, "writing")
        write_all({plan.path: data})
        return
    outputs = export.files(plan.what.key, plan.path)
    is_new = not plan.path.exists()
    try:
        make_folder(plan.path)
        write_all(outputs)
    except OSError:
        if is_new:
            with suppress(OSError):  # what the disk keeps, it keeps
                plan.path.rmdir()
        raise


def encode_export(document: Document, plan: ExportPlan, progress: Progress) -> bytes:
    """Return the file that `write_export` would write."""
    return _export(document, plan, progress).encode(plan.what.key, plan.path)


def _export(document: Document, plan: ExportPlan, progress: Progress) -> Export:
    from objectmorpher_core.scripting.animation import Clip
    from objectmorpher_core.scripting.outputs import Export

    progress(0.02, "drawing")
    clip = Clip(plan.motion.name.lower(), plan.seconds, object=plan.object)
    return Export(
        document, object=plan.object, bits=plan.bits, quality=plan.quality,
        webp_quality=plan.quality, clip=clip, progress=progress,
    )  # fmt: skip
