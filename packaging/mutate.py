"""Measures what the tests find: changes the core a little, and counts which changes are noticed.

`python packaging/mutate.py --count 400 --out build/mutants.tsv` takes a fixed sample of all changes
of a comparison, an operator, a number or a truth value in plain Python (compiled kernels are left
out), and for each runs the tests of that part of the core until one fails. A second run with the
same table goes on where the first one stopped. `--like TABLE` takes the changes of another table,
as far as their lines are still there, to compare two states of the tests.
"""

from __future__ import annotations

import argparse
import ast
import importlib.machinery
import os
import random
import re
import resource
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

CORE, TESTS = Path("objectmorpher_core"), Path("tests/core")
FOLDERS = {  # part of the core: where its tests are, and one that is run for every file of it
    "deform": ("deform", "test_deformer.py"),
    "raster": ("raster", "test_reference.py"),
    "document": (".", "test_edits.py"),
    "session": (".", "test_session_file.py"),
    "compose": ("compose", "test_composite.py"),
}
PAIRS = (
    (ast.Lt, ast.LtE), (ast.Gt, ast.GtE), (ast.Eq, ast.NotEq), (ast.Is, ast.IsNot),
    (ast.In, ast.NotIn), (ast.And, ast.Or), (ast.Add, ast.Sub), (ast.Mult, ast.Div),
    (ast.BitAnd, ast.BitOr), (ast.FloorDiv, ast.Mult), (ast.Mod, ast.Mult), (ast.Pow, ast.Mult),
)  # fmt: skip
SWAPS: dict[type, type] = {b: a for a, b in reversed(PAIRS)} | {a: b for a, b in PAIRS}
CPU = 120  # s that the tests of one change may take: an endless loop is noticed, too
Mutant = tuple[str, str, str, str]  # file, function, what becomes what, which of the same there


def sites(path: Path) -> Iterator[tuple[Mutant, ast.Module]]:
    """Every change of a file, with its whole tree as it then is: to be used before the next."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    seen: dict[tuple[str, str], int] = {}
    for function, node in _nodes(tree, ""):
        before = ast.unparse(node)
        undo = _change(node)
        if undo is None:
            continue
        if not function:  # constants are compiled into kernels, which are kept
            undo()
            continue
        change = " ".join(f"{before} -> {ast.unparse(node)}".split())
        ordinal = seen[function, change] = seen.get((function, change), -1) + 1
        yield (str(path), function, change, str(ordinal)), tree
        undo()


def _nodes(node: ast.AST, name: str) -> Iterator[tuple[str, ast.AST]]:
    """Everything in functions, with their names; not kernels, annotations or decorators."""
    for field, value in ast.iter_fields(node):
        if field in ("annotation", "returns", "decorator_list"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if not isinstance(child, ast.AST):
                continue
            inside = name
            if isinstance(child, ast.FunctionDef | ast.ClassDef):
                if any("njit" in ast.unparse(one) for one in child.decorator_list):
                    continue
                inside = f"{name}.{child.name}".lstrip(".")
            yield inside, child
            yield from _nodes(child, inside)


def _change(node: ast.AST) -> Callable[[], None] | None:
    """Changes the node, and returns what takes it back; None where there is nothing to change."""
    field, value = "", None
    if isinstance(node, ast.Compare) and type(node.ops[0]) in SWAPS:
        field, value = "ops", [SWAPS[type(node.ops[0])](), *node.ops[1:]]
    elif isinstance(node, ast.BinOp | ast.BoolOp) and type(node.op) in SWAPS:
        field, value = "op", SWAPS[type(node.op)]()
    elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
        field, value = "value", not node.value
    elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        field, value = "value", node.value + 1 if isinstance(node.value, int) else node.value * 2
    if not field or (field == "value" and value == node.value):  # type: ignore[attr-defined]
        return None
    old = getattr(node, field)
    setattr(node, field, value)
    return lambda: setattr(node, field, old)


def all_mutants() -> list[Mutant]:
    """In an order that is always the same, of which the first ones are a fair sample."""
    parts = ("deform", "raster", "document", "session")
    files = [path for part in parts for path in sorted((CORE / part).glob("*.py"))]
    found = [one for path in [*files, CORE / "compose/composite.py"] for one, _ in sites(path)]
    random.Random(31).shuffle(found)
    return found


def test_files(path: str, first: str) -> list[str]:
    """Those that name the file: first the one that found the change before, and its own ones."""
    folder, always = FOLDERS[Path(path).parts[1]]
    stem = Path(path).stem
    there = {*(TESTS / folder).glob("test_*.py"), *TESTS.glob(f"test_{stem}.py")}
    files = [
        file for file in there
        if file.name in (always, f"test_{stem}.py")
        or re.search(rf"\b{stem}\b", file.read_text(encoding="utf-8"))
    ]  # fmt: skip
    slow = ("test_tiles", "test_surface_links", "test_regions", "test_hold_edits", "test_several",
            "test_refitting", "test_pipeline")  # fmt: skip
    files.sort(key=lambda f: (str(f) != first, stem not in f.stem, f.stem in slow, f.name))
    return [str(f) for f in files]


def noticed(mutant: Mutant | None, files: list[str], left_out: list[str]) -> tuple[str, str]:
    """How the tests end in a process of its own, and which one failed first."""
    log = Path(os.environ.get("MUTANT_LOG", "/tmp/mutant.log"))
    process = os.fork()
    if process == 0:
        resource.setrlimit(resource.RLIMIT_CPU, (CPU, CPU))
        output = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        os.dup2(output, 1)
        os.dup2(output, 2)
        if mutant is not None:
            _install(mutant)
        import pytest

        options = ["-q", "-p", "no:cacheprovider", "-p", "no:xdist", "--tb=no", "-rfE"]
        options += ["--hypothesis-seed=0", "-m", "not slow"] + ["-x"] * bool(mutant)
        os._exit(int(pytest.main([*options, *(f"--deselect={one}" for one in left_out), *files])))
    status = os.waitpid(process, 0)[1]
    if os.WIFSIGNALED(status):
        return "timeout", ""
    found = re.search(r"^(?:FAILED|ERROR) (\S+)", log.read_text(errors="replace"), re.MULTILINE)
    return "failed" if os.WEXITSTATUS(status) else "passed", found[1] if found else ""


def _install(mutant: Mutant) -> None:
    """Lets imports find the changed file; the one on disk stays, and so do compiled kernels."""
    path = Path(mutant[0]).resolve()
    tree = next(ast.fix_missing_locations(t) for one, t in sites(Path(mutant[0])) if one == mutant)
    code, load = compile(tree, str(path), "exec"), importlib.machinery.SourceFileLoader.get_code
    importlib.machinery.SourceFileLoader.get_code = (  # type: ignore[method-assign]
        lambda self, name: code if self.path == str(path) else load(self, name)
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=400)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--like", type=Path, help="take the changes of this table")
    parser.add_argument("--leave-out", type=Path, help="names of tests that fail without a change")
    arguments = parser.parse_args()
    sys.path[:0] = [str(Path.cwd()), str(Path.cwd() / "app")]
    for name in ("scipy.sparse.linalg", "numba", "cv2", "PIL.Image", "pytest", "hypothesis"):
        __import__(name)
    first = dict.fromkeys(all_mutants(), "")
    if arguments.like:
        rows = [line.split("\t") for line in arguments.like.read_text().splitlines()]
        before = {tuple(row[3:]): row[2].split("::")[0] for row in rows}
        first = {one: test for one, test in before.items() if one in first}
    known = len(arguments.out.read_text().splitlines()) if arguments.out.exists() else 0
    left_out = arguments.leave_out.read_text().splitlines() if arguments.leave_out else []
    for mutant, test in list(first.items())[known : arguments.count]:
        start = time.monotonic()
        how, by = noticed(mutant, test_files(mutant[0], test), left_out)
        with arguments.out.open("a") as file:
            print(how, f"{time.monotonic() - start:.1f}", by, *mutant, sep="\t", file=file)
    rows = [line.split("\t")[0] for line in arguments.out.read_text().splitlines()]
    print(f"{len(rows)} changes, {len(rows) - rows.count('passed')} noticed")


if __name__ == "__main__":
    main()
