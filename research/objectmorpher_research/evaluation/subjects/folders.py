"""The subjects of a comparison: photos, what is to be done to each, and what methods made of it.

    FOLDER/NAME/image.png             the photo
    FOLDER/NAME/guidance.json         the edit, in the words of an edit script; a "text" in words
    FOLDER/NAME/guidance.png          a picture that shows it, if there is one
    FOLDER/NAME/results/METHOD.png    what a method made of it
    FOLDER/NAME/results/METHOD.jsonl  its log (`interaction_log`), or METHOD.json, our own report;
                                      METHOD.frames.json: how our window answered

DragBench's and GeoBench's folders are read as they are. Results may also lie in a folder of each
method: METHOD_FOLDER/NAME.png, or NAME/dragged_image.png as DragBench's programs write them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from objectmorpher_core.pictures.image import READ_ENDINGS

from ..error import EvaluationError
from ..pairs import pictures_in
from . import dragbench, geobench
from .guidance import EditGuidance, read_guidance
from .subject import EvaluatedEdit, MethodResult

IMAGE, GUIDANCE, RESULTS = "image", "guidance", "results"  # names in a subject's folder
FRAMES = ".frames.json"  # ending
DRAGGED = "dragged_image"  # in DragBench's results


def read_subjects(
    folder: Path, methods: Mapping[str, Path] | None = None
) -> tuple[EvaluatedEdit, ...]:
    """Read all subjects of a folder, by name, with the results in the folders of `methods`.

    Raises EvaluationError: one sentence.
    """
    if not folder.is_dir():
        raise EvaluationError(f"there is no folder {folder}")
    found: tuple[EvaluatedEdit, ...] = ()
    for read in (own_subjects, geobench.subjects, dragbench.subjects):
        if found := read(folder):
            break
    if not found:
        raise EvaluationError(
            f"{folder} has no subjects: folders with an image.png, or a benchmark's own files"
        )
    for method, where in (methods or {}).items():
        found = with_results(found, method, where)
    return tuple(sorted(found, key=lambda subject: subject.name))


def own_subjects(folder: Path) -> tuple[EvaluatedEdit, ...]:
    """Read the subjects of our own layout; none where the folder has another one."""
    found = []
    for where in sorted(path for path in folder.iterdir() if path.is_dir()):
        image = picture_called(where / IMAGE)
        if image is not None:
            found.append(
                EvaluatedEdit(where.name, image, _guidance(where), _results(where / RESULTS))
            )
    return tuple(found)


def with_results(
    subjects: tuple[EvaluatedEdit, ...], method: str, folder: Path
) -> tuple[EvaluatedEdit, ...]:
    """The subjects with the results of a method that lie in a folder of its own."""
    if not folder.is_dir():
        raise EvaluationError(f"there is no folder {folder}")
    if not method:
        raise EvaluationError(f"the method of {folder} needs a name")
    found = []
    count = 0
    for subject in subjects:
        base = folder / subject.name
        picture = picture_called(base) or picture_called(base / DRAGGED)
        if picture is not None:
            count += 1
            result = _result(picture)
            subject = replace(subject, results={**subject.results, method: result})
        found.append(subject)
    if not count:
        raise EvaluationError(f"{folder} holds no result of any of the {len(subjects)} subjects")
    return tuple(found)


def picture_called(base: Path) -> Path | None:
    """The picture of that name with any ending."""
    for ending in sorted(READ_ENDINGS):
        path = base.with_name(base.name + ending)
        if path.is_file():
            return path
    return None


def _result(picture: Path) -> MethodResult:
    """The picture, and what was recorded while it was made."""
    logs = (picture.with_suffix(ending) for ending in (".jsonl", ".json"))
    frames = picture.with_suffix(FRAMES)
    log = next((path for path in logs if path.is_file()), None)
    return MethodResult(picture, log, frames if frames.is_file() else None)


def _guidance(where: Path) -> EditGuidance:
    script = where / f"{GUIDANCE}.json"
    guidance = read_guidance(script) if script.is_file() else EditGuidance()
    return replace(guidance, picture=picture_called(where / GUIDANCE))


def _results(folder: Path) -> dict[str, MethodResult]:
    if not folder.is_dir():
        return {}
    return {method: _result(path) for method, path in pictures_in(folder).items()}
