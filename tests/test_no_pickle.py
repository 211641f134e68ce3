"""Nothing that is read can run: no pickle, and no reader that would take one."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from tests.tree import over, parsed

ROOT = Path(__file__).parents[1]
FOLDERS = ("app", "objectmorpher_core", "packaging", "research")
SOURCES = sorted(path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py"))
RUNNING = {"pickle", "cPickle", "dill", "cloudpickle", "joblib", "marshal", "shelve", "yaml"}
# Between the window and the worker that it started itself: no byte of it comes from elsewhere.
OWN_PIPE = {"app/objectmorpher/worker/wire.py"}
# Only files with such a word are parsed.
IMPORTING = re.compile(rf"\b({'|'.join(RUNNING)})\b")
CALLING = re.compile(r"\b(load|eval|exec|system)\b")
ONLY_ITS_ERROR = {  # that torch and numba raise
    "research/objectmorpher_research/evaluation/measures/trunk_files.py",
    "objectmorpher_core/base/kernel_files.py",
}


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def has(path: Path, word: re.Pattern[str]) -> bool:
    return word.search(path.read_text(encoding="utf-8")) is not None


def calls(path: Path) -> Iterator[tuple[str, ast.Call]]:
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Call):
            yield ast.unparse(node.func), node


def given(call: ast.Call, name: str) -> str | None:
    """What a keyword of a call is."""
    return next((ast.unparse(k.value) for k in call.keywords if k.arg == name), None)


def uses(path: Path) -> set[str]:
    """Modules of RUNNING that a file imports, and what it uses of them."""
    tree, found = parsed(path), set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {a.name.split(".")[0] for a in node.names} & RUNNING
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module.split(".")[0]} & RUNNING
    return found


@over("path", SOURCES)
def test_no_module_that_runs_what_it_reads_is_imported(path: Path) -> None:
    if name_of(path) in OWN_PIPE or not has(path, IMPORTING):
        return
    found = uses(path)
    if name_of(path) in ONLY_ITS_ERROR:
        text = path.read_text(encoding="utf-8")
        assert text.count("pickle.") == text.count("pickle.UnpicklingError") > 0
        return
    assert not found


@over("path", SOURCES)
def test_numpy_and_torch_read_numbers_only(path: Path) -> None:
    for name, call in calls(path) if has(path, CALLING) else ():
        if name in ("np.load", "numpy.load"):
            assert given(call, "allow_pickle") in (None, "False"), f"line {call.lineno}"
        if name in ("torch.load", "torch.jit.load"):
            assert given(call, "weights_only") == "True", f"line {call.lineno}"
        assert name not in ("eval", "exec", "os.system", "yaml.load"), f"line {call.lineno}"


def test_what_comes_from_the_wire_is_not_the_pipes() -> None:
    """The server's messages are decoded by `message.py`, which knows no pickle."""
    for path in (ROOT / "app" / "objectmorpher" / "server").glob("*.py"):
        tree = parsed(path)
        modules = {n.module for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
        assert not any(m is not None and m.endswith("wire") for m in modules), path.name
