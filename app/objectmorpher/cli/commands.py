"""The work of the subcommands. All outputs are written at the end, or none of them."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable, Iterable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from objectmorpher_core.base.arrays import Mask
from objectmorpher_core.base.files import read_input, write_all
from objectmorpher_core.base.progress import Progress
from objectmorpher_core.document.model import Document
from objectmorpher_core.document.settings import AS_IN_THE_PHOTO
from objectmorpher_core.pictures.image import ENDINGS, encode_mask, encode_picture
from objectmorpher_core.pipeline import Edited, open_photo, replay, run_script
from objectmorpher_core.pipeline import select as select_object
from objectmorpher_core.scripting.animation import Clip
from objectmorpher_core.scripting.options import (
    EditScript,
    ScriptError,
    files_of,
    said_by,
    script_from,
)
from objectmorpher_core.scripting.outputs import NEED_PLATE, OUTPUTS, Export, encode_output
from objectmorpher_core.scripting.report import Stopwatch, provenance, role_of, taken_for
from objectmorpher_core.scripting.runner import refuse_missing
from objectmorpher_core.scripting.script import BatchItem, beside, read_scripts
from objectmorpher_core.segment import UNSURE
from objectmorpher_core.splat_files import COUNT, SPLAT_ENDINGS, read
from objectmorpher_core.splat_files import encode as encode_splats
from objectmorpher_core.splat_files.meshes.textured import plain_glb

from .. import __version__
from ..system.logs import log_path
from ..system.report import without_names
from .idle_options import refuse_idle, said_on
from .terminal import PROGRAM, UsageError, progress_bar

# `objectmorpher doctor`: what each stage would use on this machine, and what would help.


def run_doctor(options: argparse.Namespace) -> None:
    from objectmorpher_core import doctor, models
    from objectmorpher_core.base import installation

    machine, stages = doctor.look_at_machine(), doctor.look_at_stages()
    if options.is_json:
        told = {"version": __version__, "machine": asdict(machine), "models": str(models.folder())}
        told["stages"] = [asdict(stage) for stage in stages]
        told["compute"] = _compute()
        sys.stdout.write(json.dumps(told, indent=2) + "\n")
        return
    memory = "" if machine.memory is None else f", {machine.memory / 2**30:.1f} GB of memory free"
    packages = ", ".join(f"{name} {number}" for name, number in machine.packages)
    lines = [
        f"objectmorpher {__version__} on {machine.system}",
        f"  {machine.cores} cores{memory}; networks run on {machine.device}",
        f"  {packages}",
        f"  models are kept in {models.folder()}, {machine.disk / 2**30:.0f} GB free",
    ]
    if installation.is_frozen():
        lines += ["", "An installer brought this copy. PyTorch can be added beside it, by"]
        lines += [f"`{models.EXTRA}`, or a server of yours has it."]
    for stage in stages:
        lines += ["", f"{stage.name}: {stage.uses}, {stage.why}"]
        lines += [f"  not {name}: {reason}" for name, reason in stage.others]
        lines += [f"  also {name}: {told}" for name, told in stage.also]
        lines += [f"  better with: {stage.better}"] if stage.better else []
    lines += ["", f"long jobs of the window: {_compute()}", f"the log is {log_path()}"]
    sys.stdout.write(without_names("\n".join(lines)) + "\n")


def _compute() -> str:
    """Where the window's long jobs run; nobody is asked."""
    from importlib.util import find_spec

    from ..editor.intents.computing import ADDRESS
    from ..editor.settings import SERVER, read_settings, settings_path

    settings = read_settings(settings_path())
    server = os.environ.get(ADDRESS) or (settings.server if settings.compute == SERVER else "")
    if server:
        return f"on {server}, and here while that is gone"
    if find_spec("ray"):
        return "on this computer; `objectmorpher serve` lets others use it (docs/serve.md)"
    told = "lets others use it; the extra `cluster` joins several machines (docs/serve.md)"
    return f"on this computer; `objectmorpher serve --alone` {told}"


SCRIPT_OPTIONS = tuple(EditScript.__dataclass_fields__)
EXTRAS = {  # further outputs of `edit` and what each holds
    "session": "session",
    "save_mask": "mask",
    "save_plate": "plate",
    "save_object": "object",
    "save_splats": "splats",
    "save_mesh": "mesh",
    "save_depth": "depth",
    "save_layers": "layers",
    "save_video": "video",
    "report": "report",
}
LEAST_COUNT, MOST_COUNT = 100, 500_000  # Gaussians on a mesh


def run_edit(options: argparse.Namespace) -> None:
    items = _items(options)
    _compile_beside()
    scripts = [s for i in items for s in (i.script, *(o.script for o in i.others.objects))]
    named = [name for s in scripts for name in files_of(s)]
    inputs = [Path(name) for name in (*(i.photo for i in items), *named, options.script) if name]
    outputs: dict[Path, bytes] = {}
    lines: list[str] = []
    clip = _clip(options)
    notes: tuple[str, ...] = ()
    for item in items:
        out = Path(item.out or "")
        extras = {name: getattr(options, name) for name in EXTRAS if getattr(options, name)}
        check_outputs(inputs, {out: ENDINGS})
        files = {n: path for n, path in extras.items() if not _is_folder(n, path)}
        for name in extras.keys() - files.keys():
            _check_folder(extras[name])
        check_outputs(inputs, {path: _endings(EXTRAS[name]) for name, path in files.items()})
        everything = [*outputs, out, *extras.values()]
        _check_distinct(everything)
        refuse_missing(item.script, item.others)
        if len(items) == 1:
            said = {**said_by(item.script), "objects": item.others.objects}
            notes = refuse_idle("edit", said | said_on(options, options.parser))
        written, line = _edit_one(item, extras, clip)
        outputs |= written
        lines.append(line)
    write_all(outputs)
    sys.stderr.write("".join(f"{PROGRAM}: {note}\n" for note in notes))
    sys.stdout.write("".join(lines))


def _compile_beside() -> None:
    """Of the first edit after an installation most is compiling: say so, and use all cores."""
    from objectmorpher_core.warm_up import compile_beside

    if compile_beside():
        sys.stderr.write(f"{PROGRAM}: compiling for this processor, once: about a minute more\n")


def edited_by(item: BatchItem, progress: Progress, needs_plate: bool = False) -> Edited:
    """Carry out one edit of a batch, or the only one."""
    photo, script = Path(item.photo or ""), item.script
    mask = read_input(Path(script.mask)) if script.mask else None
    data = read_input(photo)
    return run_script(data, photo.name, script, mask, progress, needs_plate, item.others)


def _edit_one(
    item: BatchItem, extras: dict[str, Path], clip: Clip
) -> tuple[dict[Path, bytes], str]:
    """The files of an edit, and the line that is printed once they are written."""
    out = Path(item.out or "")
    with progress_bar("Opening") as progress:
        edited = edited_by(item, progress, any(EXTRAS[name] in NEED_PLATE for name in extras))
        with edited.stopwatch.stage("save"):
            outputs = {out: encode_output("photo", edited, out)}
            for name, path in extras.items():
                if name != "report":
                    outputs |= _encoded(name, edited, path, clip)
        if "report" in extras:
            outputs[extras["report"]] = json_bytes(edited.report())
    for note in edited.notes:
        sys.stderr.write(f"{PROGRAM}: {out}: {note}\n")
    told = provenance(edited.composite) + taken_for(edited.document)
    return outputs, _wrote((out, *extras.values()), edited.stopwatch, told)


def _wrote(files: Iterable[Path], stopwatch: Stopwatch, told: str = "") -> str:
    """The line about files that were written, and what is `told` of them."""
    names, seconds = ", ".join(map(str, files)), stopwatch.read()["total"]
    return f"wrote {names} in {seconds:.1f} s{told and f': {told}'}\n"


def _is_folder(name: str, path: Path) -> bool:
    """Whether a video goes into a folder, as a picture a frame."""
    return name == "save_video" and not path.suffix


def _encoded(name: str, edited: Edited, path: Path, clip: Clip) -> dict[Path, bytes]:
    """The files of a further output; a folder for frames is made where it is not there."""
    if not _is_folder(name, path):
        return {path: encode_output(EXTRAS[name], edited, path, clip)}
    found = Export(edited.document, edited, clip=clip).files("video", path)
    path.mkdir(exist_ok=True)
    return found


def _check_folder(path: Path) -> None:
    """Raises UsageError where no folder of frames can be made."""
    if path.exists() and not path.is_dir():
        raise UsageError(f"{path} is a file; a video without an ending is a folder of frames")
    if not path.parent.is_dir():
        raise UsageError(f"{path} cannot be written: the folder {path.parent} does not exist")


def _clip(options: argparse.Namespace) -> Clip:
    """The video that is asked for."""
    said = {"motion": options.video, "seconds": options.seconds}
    return Clip(**{name: value for name, value in said.items() if value is not None})


def _endings(what: str) -> tuple[str, ...]:
    return (".json",) if what == "report" else OUTPUTS[what]


def run_select(options: argparse.Namespace) -> None:
    script = _script(options)
    inputs = [options.photo, *([Path(script.mask)] if script.mask else [])]
    check_outputs(inputs, {options.out: (".png",)})
    refuse_missing(script)
    given = read_input(Path(script.mask)) if script.mask else None
    sureness: list[float | None] = []
    stopwatch = Stopwatch()
    with progress_bar("Selecting") as progress:
        document = open_photo(read_input(options.photo), options.photo.name)
        document = select_object(document, script, given, progress, sureness.append)
    mask = _mask(document)
    write_all({options.out: encode_mask(mask)})
    told = f"{_percent(mask)} of the photo selected{_how_sure(*sureness)}"
    sys.stdout.write(_wrote((options.out,), stopwatch, told))


def _percent(mask: Mask) -> str:
    """How much a mask (H, W) covers, for people: of a small thing its px say more than 0%."""
    share = float(mask.mean())
    return f"{share:.0%}" if share >= 0.005 else f"{np.count_nonzero(mask):,} px"


def _how_sure(sure: float | None) -> str:
    """What there is to be said of a selection that is `sure`, to be appended; None: nothing."""
    if sure is None:
        return ""
    if sure >= UNSURE:
        return f", {sure:.0%} sure"
    return f", only {sure:.0%} sure: --click what is missing, --not-click what is too much"


def run_replay(options: argparse.Namespace) -> None:
    from objectmorpher_core.scripting.handle_file import encode_handles, with_handles
    from objectmorpher_core.session.file import encode_session, load_session

    further: tuple[tuple[Path | None, tuple[str, ...], Callable[[Edited], bytes]], ...] = (
        (options.out, ENDINGS, lambda e: encode_picture(e.picture, options.out.suffix)),
        (options.save_handles, (".json",), lambda e: encode_handles(e.document)),
        (options.save_mesh, OUTPUTS["mesh"], lambda e: encode_output("mesh", e, options.save_mesh)),
        (options.save_session, (".omorph",), lambda e: encode_session(e.document)),
        (options.report, (".json",), lambda e: json_bytes(e.report())),
    )
    wanted = {path: endings for path, endings, _ in further if path}
    refuse_idle("replay", said_on(options, options.parser))
    video, clip = options.save_video, _clip(options)
    if video and _is_folder("save_video", video):
        _check_folder(video)
    elif video:
        wanted[video] = _endings("video")
    inputs = [options.session, *([options.handles] if options.handles else [])]
    check_outputs(inputs, wanted)
    files = [path for path in (*(path for path, _, _ in further), video) if path]
    _check_distinct(files)
    stopwatch = Stopwatch()
    with progress_bar("Opening") as progress:
        document = load_session(options.session)
        if options.handles:
            document = with_handles(document, read_input(options.handles))
        edited = replay(document, progress)
        outputs = _encoded("save_video", edited, video, clip) if video else {}
        outputs |= {path: encode(edited) for path, _, encode in further if path}
    write_all(outputs)
    sys.stdout.write(_wrote(files, stopwatch, provenance(edited.composite)))


def run_info(options: argparse.Namespace) -> None:
    from objectmorpher_core.session.file import load_session

    info = describe(load_session(options.session))
    if options.json:
        sys.stdout.write(json_bytes(info).decode())
        return
    for key, value in info.items():
        if key != "objects":
            sys.stdout.write(f"{_label(key)}: {_line(value)}\n")
    for item in info["objects"]:
        told = ", ".join(f"{_label(k)}: {_line(v)}" for k, v in item.items() if k != "name")
        sys.stdout.write(f"- {item['name']}: {told}\n")


def describe(document: Document) -> dict[str, Any]:
    """Describe the contents of a document in plain values."""
    width, height = document.photo.size
    objects = []
    for k, item in enumerate(document.objects):
        lifted = item.lifted
        finish = {
            name: value
            for name, value in vars(item.finish).items()
            if value != getattr(AS_IN_THE_PHOTO, name)
        }
        objects.append({
            "name": item.name, "role": role_of(document.objects, k),
            "mask_area_px": 0 if item.mask is None else int(item.mask.sum()),
            "kind": None if lifted is None else lifted.kind or None,
            "gaussians": 0 if lifted is None else len(lifted.body),
            "edge_gaussians": 0 if lifted is None else len(lifted.gaussians) - len(lifted.body),
            "control_points": 0 if lifted is None else len(lifted.control_points),
            "handles": sum(not h.is_pin for h in item.handles),
            "pins": sum(h.is_pin for h in item.handles),
            "is_moved": item.is_moved,
            "move": list(item.placement.move), "depth": item.placement.depth,
            "turn": list(item.placement.turn), "scale": item.placement.scale,
            **finish,
        })  # fmt: skip
    return {
        "photo": {
            "name": document.photo.name, "width": width, "height": height,
            "bits": document.photo.pixels.dtype.itemsize * 8,
        },
        "focal_px": round(document.photo.camera.focal, 2),
        "seed": document.seed,
        "backends": dict(document.backends),
        "has_plate": document.plate is not None,
        "objects": objects,
    }  # fmt: skip


def run_convert(options: argparse.Namespace) -> None:
    refuse_idle("convert", said_on(options, options.parser))
    count = COUNT if options.count is None else options.count
    if not LEAST_COUNT <= count <= MOST_COUNT:
        raise UsageError(f"--count must be from {LEAST_COUNT} to {MOST_COUNT:,}, not {count:,}")
    source, out = options.source, options.out
    check_outputs([source], {out: (*SPLAT_ENDINGS, *OUTPUTS["mesh"])})
    is_mesh = out.suffix.lower() in OUTPUTS["mesh"]
    stopwatch = Stopwatch()
    with progress_bar("Converting") as progress:
        if source.suffix.lower() in OUTPUTS["session"]:
            data = _object_of(source, "mesh" if is_mesh else "splats", out, progress)
        else:
            gaussians = read(source, count, options.flip)
            progress(0.7, "Writing")
            data = plain_glb(gaussians) if is_mesh else encode_splats(gaussians, out)
    write_all({out: data})
    sys.stdout.write(_wrote((out,), stopwatch))


def _object_of(session: Path, what: str, out: Path, progress: Progress) -> bytes:
    """The file of a session's first object in 3D, as it is posed."""
    from objectmorpher_core.session.file import load_session

    return Export(load_session(session), progress=progress).encode(what, out)


def run_warm_up(options: argparse.Namespace) -> None:
    from ..system.warm_up import compile_kernels

    compile_kernels()


def _items(options: argparse.Namespace) -> list[BatchItem]:
    """The edits that the command line asks for, each with its photo and output."""
    said = _script(options)
    if options.script is None:
        items = [BatchItem(said)]
    else:
        read = read_scripts(options.script)
        folder = options.script.parent
        items = [beside(item, folder) for item in read]
        items = [replace(i, script=i.script.merged(said, _said(options))) for i in items]
    if len(items) > 1:
        single = [name for name in EXTRAS if getattr(options, name)]
        if options.photo or options.out or single:
            raise UsageError('a batch names "photo" and "out" in the script, and nothing else')
        if any(item.photo is None or item.out is None for item in items):
            raise ScriptError('every edit of a batch needs "photo" and "out"')
        return items
    photo, out = options.photo or items[0].photo, options.out or items[0].out
    if photo is None:
        raise UsageError("which photo? objectmorpher edit PHOTO -o OUT.png")
    if out is None:
        raise UsageError("where to? add -o OUT.png")
    return [replace(items[0], photo=str(photo), out=str(out))]


def _script(options: argparse.Namespace) -> EditScript:
    said = _said(options)
    return script_from({name.replace("_", "-"): value for name, value in said.items()}, "--")


def _said(options: argparse.Namespace) -> dict[str, Any]:
    """The script's options that stand on the command line."""
    return {
        name: getattr(options, name)
        for name in SCRIPT_OPTIONS
        if getattr(options, name, None) is not None
    }


def check_outputs(inputs: list[Path], outputs: dict[Path, tuple[str, ...]]) -> None:
    """Refuses, before any work, what could not be written or would overwrite an input."""
    read = {path.resolve() for path in inputs}
    for path, endings in outputs.items():
        if path.resolve() in read:
            raise UsageError(f"{path} is an input; choose another name for the output")
        if path.suffix.lower() not in endings:
            raise UsageError(f"{path}: the ending must be {' or '.join(endings)}")
        if path.is_dir():
            raise UsageError(f"{path} is a folder, not a file")
        if not path.parent.is_dir():
            raise UsageError(f"{path} cannot be written: the folder {path.parent} does not exist")


def _check_distinct(outputs: Iterable[Path]) -> None:
    """Refuses two outputs of one name, of which only the last would be there."""
    names = [path.resolve() for path in outputs]
    if len(set(names)) < len(names):
        raise UsageError("two outputs have the same name")


def _mask(document: Document) -> Mask:
    mask = document.objects[0].mask
    assert mask is not None
    return mask


def json_bytes(value: Any) -> bytes:
    return (json.dumps(value, indent=2) + "\n").encode()


def _label(key: str) -> str:
    """The key of a figure in words."""
    return key.removeprefix("is_").removeprefix("has_").replace("_", " ")


def _line(value: Any) -> str:
    """A figure in words: yes and no, numbers with spaces between them."""
    if value is None:
        return "unknown"
    if isinstance(value, dict):
        return ", ".join(f"{_label(k)} {_line(v)}" for k, v in value.items()) or "none"
    if isinstance(value, list):
        return " ".join(map(_line, value))
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:g}" if isinstance(value, float) else str(value)


# `objectmorpher share`: a session as one web page in which its object can be dragged.


def run_share(options: argparse.Namespace) -> None:
    from objectmorpher_core.session.file import load_session

    from ..server.share_page import encode_page

    check_outputs([options.session], {options.out: (".html",)})
    stopwatch = Stopwatch()
    with progress_bar("Reading") as progress:
        document = load_session(options.session)
        index = object_to_share(document, options.object)
        progress(0.3, "Writing")
        page = encode_page(document, index)
    write_all({options.out: page})
    sys.stdout.write(_wrote((options.out,), stopwatch))


def object_to_share(document: Document, number: int | None) -> int:
    """Return the index of object `number`, or of the first that is lifted. Raises UsageError."""
    objects = enumerate(document.objects)  # the page has one photo
    lifted = [k for k, item in objects if item.lifted is not None and not item.is_visitor]
    if document.plate is None or not lifted:
        raise UsageError("no object of the session is lifted, so there is nothing to drag")
    if number is None:
        return lifted[0]
    if number - 1 not in lifted:
        told = ", ".join(str(k + 1) for k in lifted)
        raise UsageError(f"--object must be the number of a lifted object: {told}")
    return number - 1
