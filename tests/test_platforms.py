"""What Windows and macOS lack or do otherwise, as far as Linux can tell.

See docs/reliability-tests.md.
"""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from objectmorpher_core import models
from objectmorpher_core.base.files import OutputError, write_all
from tests.tree import PYTHONPATH, parsed

ROOT = Path(__file__).parents[1]
SOURCES = [
    p for name in ("app", "objectmorpher_core", "research") for p in (ROOT / name).rglob("*.py")
]
RESERVED = re.compile(r'[<>:"|?*\x00-\x1f]|[. ]$|^(con|prn|aux|nul|com\d|lpt\d)(\.|$)', re.I)
# Of OpenGL 4 and its shaders; macOS has 4.1 at most, and by our request 3.3.
OPENGL_4 = re.compile(
    r"\b(buffer|shared)\b\s*\{|layout\s*\(\s*(binding|std430|local_size)|\bimage(Load|Store)\b"
    r"|\bdouble\b|\bdvec\d|\btextureGather\b|\bfma\s*\(|\bsubroutine\b|\batomic\w+"
)
CALLS_4 = re.compile(r"\.(?:compute_shader|storage_buffer|bind_to_storage_buffer|bind_to_image)\b")
OPENS = re.compile(r"\b(?:open|read_text|write_text)\b")  # what `_is_text` looks for

# Everything that POSIX has and Windows lacks is taken away after the libraries were imported; then
# the job is done, from a photo to a session and back.
WITHOUT_POSIX = """
import sys, os, signal, importlib, subprocess, multiprocessing, tempfile, shutil, types
import numpy, scipy.sparse.linalg, scipy.ndimage, numba, cv2, PIL.Image, onnxruntime, platformdirs
import resource as _resource
for name in ("fork", "killpg", "waitid", "nice", "getuid", "geteuid", "getpgid", "setsid", "wait4",
             "sched_getaffinity", "O_DIRECTORY", "fchmod", "uname", "statvfs"):
    if hasattr(os, name):
        delattr(os, name)
for name in ("SIGKILL", "SIGALRM", "SIGHUP", "SIGUSR1", "alarm", "setitimer"):
    delattr(signal, name)
for name in ("fcntl", "resource", "pwd", "grp", "termios"):
    sys.modules[name] = None
msvcrt = types.ModuleType("msvcrt")
msvcrt.LK_NBLCK, msvcrt.locking = 2, lambda number, mode, count: None
sys.modules["msvcrt"] = msvcrt
sys.platform = "win32"
for path in sys.argv[4:]:
    importlib.import_module(path)
from objectmorpher.cli import parser as cli
from objectmorpher.editor import autosave
from pathlib import Path
photo, session, out = sys.argv[1:4]
edit = ["edit", photo, "--click", "280,150", "--turn", "15,0,0", "--session", session, "-o", out]
assert cli.main(edit + ["--segment", "grabcut"]) == 0
assert cli.main(["replay", session, "-o", out + ".again.png"]) == 0
assert Path(out).stat().st_size > 10_000
lock = autosave.FileLock.take(Path(out + ".lock"))
assert lock is not None
lock.release()
"""


@pytest.mark.slow
def test_the_job_is_done_without_what_windows_lacks(tmp_path) -> None:
    photo = ROOT / "assets" / "samples" / "coffee.jpg"
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_POSIX, photo, tmp_path / "s.omorph", tmp_path / "o.png",
         "objectmorpher.worker.jobs", "objectmorpher.editor.editor",
         "objectmorpher.editor.recovery",
         "objectmorpher.editor.autosave", "objectmorpher_core.scripting.report",
         "objectmorpher_core.doctor", "objectmorpher_core.lift.workers.external"],
        cwd=ROOT, capture_output=True, text=True, env=os.environ | {"PYTHONPATH": PYTHONPATH},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]


def test_text_files_name_their_encoding() -> None:
    """Without it Windows writes code page 1252."""
    found = []
    for path in SOURCES:
        if not OPENS.search(path.read_text("utf-8")):
            continue
        tree = parsed(path)
        own = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
        for node in ast.walk(tree):
            is_own = isinstance(node, ast.Call) and getattr(node.func, "id", "") in own
            if isinstance(node, ast.Call) and not is_own and _is_text(node):
                found.append(f"{path.relative_to(ROOT)}:{node.lineno}")
    assert found == []


def _is_text(call: ast.Call) -> bool:
    """Whether a call opens a file as text and leaves its encoding to the system."""
    named = {word.arg for word in call.keywords}
    if "encoding" in named or None in named:
        return False
    target = call.func
    name = target.attr if isinstance(target, ast.Attribute) else getattr(target, "id", "")
    if name == "read_text":
        return not call.args
    if name == "write_text":
        return len(call.args) < 2
    if name == "open" and isinstance(target, ast.Name):
        mode = call.args[1] if len(call.args) > 1 else _keyword(call, "mode")
        return not (isinstance(mode, ast.Constant) and "b" in str(mode.value))
    return False


def _keyword(call: ast.Call, name: str) -> ast.expr | None:
    return next((word.value for word in call.keywords if word.arg == name), None)


def test_no_process_is_forked() -> None:
    """Neither Windows nor a program with threads can; jobs and workers are spawned."""
    found = [
        f"{path.relative_to(ROOT)}"
        for path in SOURCES
        if re.search(
            r"os\.fork\(|get_context\(\s*\"fork|set_start_method\(\"fork", path.read_text("utf-8")
        )
    ]
    assert found == []


def test_files_that_the_product_names_can_be_named_on_windows() -> None:
    names = [w.file for w in models.weights()] + [m.id for m in models.hub_models()]
    names += [part for m in models.hub_models() for file in m.files for part in file.split("/")]
    assert names
    assert [name for name in names if RESERVED.search(name.replace("*", ""))] == []  # patterns


def test_a_file_that_another_program_holds_open_stays_as_it_is(tmp_path, monkeypatch) -> None:
    """Windows refuses to put another file in its place."""

    def refuse(source, target):
        raise PermissionError(13, "The process cannot access the file", str(target))

    path = tmp_path / "edited.png"
    path.write_bytes(b"before")
    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(OutputError) as caught:
        write_all({path: b"after"})
    assert "\n" not in str(caught.value)
    assert path.read_bytes() == b"before"
    assert os.listdir(tmp_path) == ["edited.png"]


def test_names_as_long_as_a_folder_takes_are_written(tmp_path) -> None:
    path = tmp_path / ("n" * 251 + ".png")
    write_all({path: b"x"})
    assert os.listdir(tmp_path) == [path.name]


def test_a_terminal_without_the_characters_gets_a_sentence(tmp_path) -> None:
    """Windows' pipes have code page 1252."""
    done = subprocess.run(
        [sys.executable, "-m", "objectmorpher", "info", "東京の写真.omorph"],
        cwd=tmp_path, capture_output=True,
        env=os.environ | {"PYTHONIOENCODING": "cp1252", "PYTHONPATH": PYTHONPATH},
    )  # fmt: skip
    told = done.stderr.decode("cp1252")
    assert done.returncode == 1
    assert "Traceback" not in told
    assert told.strip().endswith(".omorph does not exist"), told


def test_shaders_and_their_use_are_of_opengl_3_3() -> None:
    shaders = [p for p in (ROOT / "shaders").iterdir() if p.suffix in (".vert", ".frag", ".geom")]
    assert shaders
    for shader in shaders:
        text = re.sub(r"//.*|/\*.*?\*/", "", shader.read_text("utf-8"))
        assert text.lstrip().startswith("#version 330"), shader.name
        assert not OPENGL_4.search(text), shader.name
    used = {path.name: CALLS_4.findall(path.read_text("utf-8")) for path in SOURCES}
    assert {name: calls for name, calls in used.items() if calls} == {}
