"""Many edit scripts, one after the other: `objectmorpher batch`.

A failure does not stop the others. What was made already is left as it is, so that a batch that
was stopped goes on where it was. Each edit may be made on another machine (`server/spread.py`).
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from objectmorpher_core.base.files import make_folder, read_input, write_all
from objectmorpher_core.pictures.image import ENDINGS, READ_ENDINGS, encode_picture
from objectmorpher_core.scripting.options import files_of
from objectmorpher_core.scripting.script import (
    BatchItem,
    beside,
    parse_scripts,
    read_scripts,
    script_text,
)

from .command_parser import check_ray
from .commands import check_outputs, edited_by, json_bytes
from .idle_options import refuse_idle, said_on
from .terminal import FAILURES, PROGRAM, UsageError, failure_sentence, progress_bar

USUAL_ENDING = ".png"  # of edits of photos in formats that are only read


@dataclass(frozen=True)
class Task:
    """One edit and the script that holds it; `problem` is the reason why it cannot be tried."""

    script: Path
    item: BatchItem | None
    problem: str = ""


def run_batch(options: argparse.Namespace) -> None:
    """`objectmorpher batch`. Raises RuntimeError at the end where an edit has failed."""
    refuse_idle("batch", said_on(options, options.parser))
    if options.report:
        scripts = [path for path in _files(options.scripts, (".json",)) if not _is_report(path)]
        check_outputs(scripts, {options.report: (".json",)})
    if options.out is not None and options.out.exists() and not options.out.is_dir():
        raise UsageError(f"{options.out} is no folder")
    check_ray(options)
    tasks = list(_tasks(options))
    if not tasks:
        raise UsageError("there is no script to run")
    _refuse_unused(tasks, options)
    if options.out is not None:
        make_folder(options.out)
    entries: dict[int, dict[str, Any]] = {}
    for number, entry in _entries(tasks, options):
        entries[number] = entry
        _say(entry)
    _finish([entries[number] for number in sorted(entries)], options.report)


def _refuse_unused(tasks: list[Task], options: argparse.Namespace) -> None:
    """Raises UsageError where photos are given that no script has a use for."""
    items = [task.item for task in tasks]
    if None in items:  # a script that cannot be read might have had
        return
    photos = {str(photo) for photo in _files(options.photo or [], READ_ENDINGS)}
    if photos and not any(item and item.photo in photos for item in items):
        raise UsageError('--photo has no effect: every script names its own "photo"')


def _finish(entries: list[dict[str, Any]], report: Path | None) -> None:
    """The summary; an error where something failed."""
    counts = {
        state: sum(e["state"] == state for e in entries) for state in ("done", "kept", "failed")
    }
    told = f"{counts['done']} done, {counts['kept']} kept, {counts['failed']} failed"
    sys.stdout.write(f"{told}\n")
    if report is not None:
        write_all({report: json_bytes({"version": 1, **counts, "edits": entries})})
    if counts["failed"]:
        raise RuntimeError(f"{counts['failed']} of {len(entries)} edits failed")


def _is_report(path: Path) -> bool:
    """Whether a file is what `_finish` has written."""
    try:
        report = json.loads(read_input(path))
    except (ValueError, OSError, RecursionError):
        return False
    return isinstance(report, dict) and {"version", "edits"} <= report.keys()


def _entries(
    tasks: list[Task], options: argparse.Namespace
) -> Iterator[tuple[int, dict[str, Any]]]:
    """What became of each edit, with its number: in their order, or as a cluster is done."""
    if options.ray is None:
        for number, task in enumerate(tasks):
            known = _known(task, options.overwrite)
            yield number, _told(task) | (known or _outcome(task.item))
        return
    from ..editor.settings import STAGES
    from ..server.spread import spread

    jobs = []
    for number, task in enumerate(tasks):
        if (known := _known(task, options.overwrite)) is not None:
            yield number, _told(task) | known
        elif task.item is not None:
            text = script_text(beside(task.item, Path.cwd()))  # with whole paths
            jobs.append({"number": number, "edit": text})
    for answer in spread(_made_there, jobs, options.ray, STAGES):
        number = answer["number"]
        yield number, _told(tasks[number]) | answer["outcome"]


def _made_there(job: dict[str, Any]) -> dict[str, Any]:
    """In a worker of a cluster: one edit."""
    (item,) = parse_scripts(job["edit"])
    return {"number": job["number"], "outcome": _outcome(item)}


def _told(task: Task) -> dict[str, Any]:
    out = None if task.item is None else task.item.out
    return {"script": str(task.script), "out": None if out is None else str(Path(out))}


def _known(task: Task, is_overwriting: bool) -> dict[str, Any] | None:
    """What becomes of an edit that is not to be made."""
    if task.item is None or task.problem:
        return {"state": "failed", "error": task.problem}
    try:
        is_kept = not is_overwriting and _is_newer(task)
    except FAILURES as error:
        return {"state": "failed", "error": failure_sentence(error)}
    return {"state": "kept", "seconds": 0.0} if is_kept else None


def _outcome(item: BatchItem | None) -> dict[str, Any]:
    assert item is not None, "a task without an edit has a problem"
    start = time.perf_counter()
    try:
        figures = _edit(item)
    except FAILURES as error:
        return {"state": "failed", "error": failure_sentence(error)}
    seconds = round(time.perf_counter() - start, 3)
    return {"state": "done", "seconds": seconds, "report": figures}


def _edit(item: BatchItem) -> dict[str, Any]:
    out = Path(item.out or "")
    check_outputs([Path(name) for name in _inputs(item)], {out: ENDINGS})
    with progress_bar("Opening") as progress:
        edited = edited_by(item, progress)
        write_all({out: encode_picture(edited.picture, out.suffix)})
    return edited.report()


def _inputs(item: BatchItem) -> list[str]:
    scripts = (item.script, *(each.script for each in item.others.objects))
    names = (item.photo, *(name for script in scripts for name in files_of(script)))
    return [name for name in names if name is not None]


def _is_newer(task: Task) -> bool:
    """Whether the output was made after all that it is made from."""
    assert task.item is not None
    out = Path(task.item.out or "")
    if not out.is_file():
        return False
    sources = [task.script, *(Path(name) for name in _inputs(task.item))]
    return all(s.is_file() and s.stat().st_mtime <= out.stat().st_mtime for s in sources)


def _say(entry: dict[str, Any]) -> None:
    """Its line."""
    told = {
        "done": f"{entry.get('seconds', 0):.1f} s",
        "kept": "newer than its script and photo",
        "failed": entry.get("error", ""),
    }[entry["state"]]
    sys.stdout.write(f"{entry['state']:<6}  {entry['out'] or entry['script']}  {told}\n")
    sys.stdout.flush()
    for note in (entry.get("report") or {}).get("notes") or ():
        sys.stderr.write(f"{PROGRAM}: {entry['out']}: {note}\n")


def _tasks(options: argparse.Namespace) -> Iterator[Task]:
    """All edits in their order. One that makes no sense is a task that fails.

    What is made in a folder of photos is no photo of this folder when the batch is run again.
    """
    photos = _files(options.photo or [], READ_ENDINGS)
    tasks = list(_tasks_with(photos, options))
    named = set(options.photo or [])
    outs = {Path(task.item.out).resolve() for task in tasks if task.item and task.item.out}
    own = [photo for photo in photos if photo in named or photo.resolve() not in outs]
    return iter(tasks) if own == photos else _tasks_with(own, options)


def _tasks_with(photos: list[Path], options: argparse.Namespace) -> Iterator[Task]:
    taken: set[Path] = set()
    report = options.report and options.report.resolve()
    for script in _files(options.scripts, (".json",)):
        if script.resolve() == report:  # of the run before
            continue
        try:
            items = read_scripts(script)
        except (ValueError, OSError) as error:
            yield Task(script, None, failure_sentence(error))
            continue
        for number, item in enumerate(items, 1):
            stem = script.stem if len(items) == 1 else f"{script.stem}-{number}"
            for each, name in _with_photos(beside(item, script.parent), stem, photos):
                yield _task(script, _with_out(each, name, options), taken)


def _task(script: Path, item: BatchItem, taken: set[Path]) -> Task:
    if item.photo is None:
        return Task(script, item, 'it names no "photo"; add --photo PHOTO')
    if item.out is None:
        return Task(script, item, 'it names no "out"; add -o FOLDER')
    out = Path(item.out).resolve()
    if out in taken:
        return Task(script, item, "an edit before it writes the same file")
    taken.add(out)
    return Task(script, item)


def _with_photos(item: BatchItem, stem: str, photos: list[Path]) -> Iterator[tuple[BatchItem, str]]:
    """The edit for each photo it is meant for, and a name for what it makes."""
    if item.photo is not None or not photos:
        yield item, stem
        return
    for photo in photos:
        yield replace(item, photo=str(photo)), f"{photo.stem}-{stem}"


def _with_out(item: BatchItem, name: str, options: argparse.Namespace) -> BatchItem:
    """In the folder for outputs, in the format that is asked for or else in the photo's own."""
    if item.out is not None or options.out is None:
        return item
    own = Path(item.photo or "").suffix.lower()
    ending = f".{options.format}" if options.format else own if own in ENDINGS else USUAL_ENDING
    return replace(item, out=str(options.out / f"{name}{ending}"))


def _files(paths: list[Path], endings: tuple[str, ...]) -> list[Path]:
    """Files as they are, and those in folders with these endings by their names."""
    found: list[Path] = []
    for path in paths:
        if path.is_dir():
            found += sorted(f for f in path.iterdir() if f.suffix.lower() in endings)
        else:
            found.append(path)
    return found
