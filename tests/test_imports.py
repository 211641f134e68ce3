"""Who may import whom. Each rule is one test over all files, so that a new file needs no entry."""

from __future__ import annotations

import ast
import compileall
import importlib.util
import os
import resource
import subprocess
import sys
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

import pytest

from tests.tree import PYTHONPATH, parsed

ROOT = Path(__file__).parents[1]
CORE, APP = ROOT / "objectmorpher_core", ROOT / "app" / "objectmorpher"
RESEARCH = ROOT / "research" / "objectmorpher_research"
ONNX = CORE / "models" / "onnx_session.py"  # imports onnxruntime, with its telemetry off
NETWORKS = {  # classes of PyTorch's; what is imported first needs none
    CORE / "lift" / "trellis",
    CORE / "lift" / "triposplat",
    CORE / "compose" / "plate" / "latent_diffusion.py",
    CORE / "compose" / "plate" / "moebius.py",
    CORE / "compose" / "plate" / "pixelhacker.py",
}
WINDOW = {"imgui_bundle", "imgui", "glfw", "OpenGL"}
GL = {"moderngl", "glcontext"}
HEAVY = {"torch", "onnxruntime", "patchmatch", "trimesh", "tifffile", "ray"}  # inside functions
CORE_AT_IMPORT = {
    "numpy", "scipy", "numba", "llvmlite", "cv2", "PIL", "platformdirs", "objectmorpher_core",
}  # fmt: skip
LATER = {  # than the window's first frame
    "scipy", "numba", "torch", "diffusers", "onnxruntime", "skimage", "ray", "http",
    "objectmorpher.server.address", "objectmorpher.server.running",
}  # fmt: skip

WINDOW_IMPORT = "import objectmorpher.cli.parser, objectmorpher.gui.window.window"
OTHERS_IMPORT = "import numpy, cv2, imgui_bundle"  # what the window cannot do without
RUNS, MOST_RUNS = 5, 25
sys.path.append(str(ROOT / "packaging"))

import bundled  # noqa: E402

MOST_RATIO = 2.0  # it is 1.3 to 1.8; scipy would add 0.5 to 1, torch 6


def sources(*places: Path) -> list[Path]:
    """The files themselves, and those in the folders."""
    return [f for p in places for f in ([p] if p.is_file() else sorted(p.rglob("*.py")))]


@cache
def imports(path: Path, is_at_import: bool = False) -> frozenset[str]:
    """Absolute names of what a file imports; `is_at_import`: without what functions import."""
    return frozenset(_imports(path, is_at_import))


def _imports(path: Path, is_at_import: bool) -> Iterator[str]:
    package = path.relative_to(ROOT).parent.parts
    package = package[1:] if package[0] in ("app", "research") else package
    nodes: list[ast.AST] = [parsed(path)]
    while nodes:
        node = nodes.pop()
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else ()
            module = ".".join((*above, *([node.module] if node.module else [])))
            yield module
            yield from (f"{module}.{alias.name}" for alias in node.names)
        is_function = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        if not (is_at_import and (is_function or _is_for_types(node))):
            nodes.extend(n for n in ast.iter_child_nodes(node) if not isinstance(n, ast.expr))


def _is_for_types(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"


def tops(path: Path, is_at_import: bool = False) -> set[str]:
    return {name.split(".")[0] for name in imports(path, is_at_import)}


def broken(found: dict[Path, Iterable[str]]) -> list[str]:
    """A line for each file that breaks the rule, and what it imports against it."""
    return [f"{path.relative_to(ROOT)}: {', '.join(sorted(w))}" for path, w in found.items() if w]


def test_no_import_at_load_goes_in_a_circle():
    """Not even through several files."""
    ahead = {_module(path): imports(path, is_at_import=True) for path in sources(CORE, APP)}
    ahead = {  # a module's own package is loaded before it in any case
        module: {n for n in names & ahead.keys() if not f"{module}.".startswith(f"{n}.")}
        for module, names in ahead.items()
    }
    while free := {module for module, names in ahead.items() if not names}:
        ahead = {m: names - free for m, names in ahead.items() if m not in free}
    assert not sorted(ahead)


def test_at_most_two_files_know_each_other_in_a_circle():
    """Types and what functions import included: what is larger cannot be read file by file."""
    known = {_module(path): imports(path) for path in sources(CORE, APP)}
    known = {
        module: {n for n in names & known.keys() if not f"{module}.".startswith(f"{n}.")}
        for module, names in known.items()
    }
    assert not [circle for circle in _circles(known) if len(circle) > 2]


def _circles(ahead: dict[str, set[str]]) -> list[set[str]]:
    """Groups of modules that all reach each other (strongly connected components, Tarjan 1972)."""
    order: dict[str, int] = {}
    lowest: dict[str, int] = {}
    stack, circles = [], []

    def visit(module: str) -> None:
        order[module] = lowest[module] = len(order)
        stack.append(module)
        for other in ahead[module]:
            if other not in order:
                visit(other)
            if other in stack:
                lowest[module] = min(lowest[module], lowest[other])
        if lowest[module] == order[module]:
            place = stack.index(module)
            circles.append(set(stack[place:]))
            del stack[place:]

    for module in ahead:
        if module not in order:
            visit(module)
    return circles


def _module(path: Path) -> str:
    parts = path.relative_to(CORE.parent if CORE in path.parents else APP.parent).with_suffix("")
    return ".".join(part for part in parts.parts if part != "__init__")


def test_core_knows_no_window():
    other = {"objectmorpher"} | WINDOW | GL
    assert not broken({path: tops(path) & other for path in sources(CORE)})


def test_core_and_program_import_heavy_packages_inside_functions():
    allowed = {path: {"torch"} for path in sources(*NETWORKS)}
    found = {}
    for path in sources(CORE):
        others = tops(path, is_at_import=True) - set(sys.stdlib_module_names)
        found[path] = others - CORE_AT_IMPORT - allowed.get(path, set())
    for path in sources(APP):
        found[path] = tops(path, is_at_import=True) & HEAVY
    assert not broken(found)


def test_onnxruntime_is_imported_in_one_place():
    everywhere = sources(CORE, APP, RESEARCH, ROOT / "tests")
    named = [path for path in everywhere if "onnxruntime" in path.read_text(encoding="utf-8")]
    assert [path for path in named if "onnxruntime" in tops(path)] == [ONNX]


def test_the_program_knows_nothing_of_the_research_package():
    """It finds that package's commands by entry points."""
    texts = {path: path.read_text(encoding="utf-8") for path in sources(CORE, APP)}
    assert not [path for path, text in texts.items() if RESEARCH.name in text]


def test_gl_and_window_stay_in_their_folders():
    found = {}
    for path in sources(APP):
        folder = path.relative_to(APP).parts[0]
        found[path] = tops(path) & (
            (WINDOW | GL) - {"render": GL, "gui": WINDOW}.get(folder, set())
        )
    assert not broken(found)


def test_only_the_window_and_the_renderer_draw():
    """The editor, the tools and the canvas need no screen; the renderer knows no editor."""
    found = {}
    for path in sources(APP / "editor", APP / "tools", APP / "canvas", APP / "worker"):
        found[path] = _within(path, "objectmorpher.gui", "objectmorpher.render")
    for path in sources(APP / "render"):
        others = _within(path, "objectmorpher.gui", "objectmorpher.editor")
        found[path] = {name for name in others if not name.startswith("objectmorpher.editor.view")}
        found[path] -= {"objectmorpher.editor"}
    assert not broken(found)


def _within(path: Path, *packages: str) -> set[str]:
    return {
        name for name in imports(path) for p in packages if name == p or name.startswith(p + ".")
    }


def test_importing_pulls_in_nothing_heavy():
    modules = (
        "objectmorpher_core.pipeline", "objectmorpher.editor.editor", "objectmorpher.cli.parser",
        "objectmorpher_core.lift.trellis.lifter",
    )  # fmt: skip
    assert not loaded_by(f"import {', '.join(modules)}") & (HEAVY | WINDOW | GL)


def test_the_window_is_there_before_the_rest():
    assert not loaded_by(WINDOW_IMPORT) & LATER


def loaded_by(code: str) -> set[str]:
    """Names of the modules that a fresh Python has after it has run `code`."""
    command = [sys.executable, "-c", f"import sys\n{code}\nprint(*sys.modules)"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    return set(done.stdout.split())


@pytest.mark.slow
def test_the_window_imports_in_less_than_twice_what_its_libraries_take():
    """Before its first frame: what takes longer is imported when it is needed.

    The least of several runs, taken in turns, and of more of them on a busy machine: what else it
    does only adds to a run. As from the second start on: compiled to bytecode.
    """
    for folder in (APP, CORE):
        compileall.compile_dir(folder, quiet=1)
    runs: list[list[float]] = []
    ratio = MOST_RATIO + 1
    while len(runs) < RUNS or (ratio > MOST_RATIO and len(runs) < MOST_RUNS):
        runs.append([_seconds(code) for code in ("", OTHERS_IMPORT, WINDOW_IMPORT)])
        bare, others, window = (min(column) for column in zip(*runs, strict=True))
        ratio = (window - bare) / (others - bare)
    assert ratio <= MOST_RATIO, runs


def _seconds(code: str) -> float:
    """Of the processor, by a process of its own; `os.times` would count in hundredths."""
    start = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)
    end = resource.getrusage(resource.RUSAGE_CHILDREN)
    return (end.ru_utime - start.ru_utime) + (end.ru_stime - start.ru_stime)


WITHOUT = """
import importlib, sys
from pathlib import Path
left_out, folder, *wanted = sys.argv[1:]

class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name in left_out.split(","):
            raise ImportError(f"{name} is not packaged")

sys.meta_path.insert(0, Blocker())
for name in wanted:
    importlib.import_module(name)
import trimesh
from objectmorpher_core.splat_files import read
for ending in (".glb", ".obj", ".stl"):
    path = Path(folder) / ("ball" + ending)
    trimesh.creation.icosphere(1).export(path)
    assert len(read(path, 200)) > 100
"""


def test_the_parts_of_scipy_that_packages_leave_out_are_not_imported(tmp_path):
    """Neither by us, nor by what we use of SciPy, nor where trimesh reads a mesh."""
    left_out = ",".join(f"scipy.{part}" for part in bundled.UNUSED_SCIPY)
    used = {n for path in sources(CORE, APP) for n in imports(path) if n.startswith("scipy.")}
    used = {n for n in used if importlib.util.find_spec(n.rpartition(".")[0]) is not None}
    modules = {n if _is_module(n) else n.rpartition(".")[0] for n in used}
    assert len(modules) >= 5
    command = [sys.executable, "-c", WITHOUT, left_out, tmp_path, *sorted(modules)]
    subprocess.run(command, check=True, env=os.environ | {"PYTHONPATH": PYTHONPATH})


def _is_module(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except ModuleNotFoundError:
        return False


def test_no_two_public_classes_have_the_same_name():
    places: dict[str, list[str]] = {}
    for path in sources(CORE, APP, RESEARCH):
        for node in parsed(path).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places.setdefault(node.name, []).append(str(path.relative_to(ROOT)))
    assert len(places) > 500
    assert {name: found for name, found in places.items() if len(found) > 1} == {}


def test_what_the_scripts_of_docs_and_packages_import_exists():
    """No other test runs them as a whole, and none checks their types."""
    scripts = sources(ROOT / "docs", ROOT / "packaging")
    assert len(scripts) > 50
    assert broken({path: set(_missing(path)) for path in scripts}) == []


def _missing(path: Path) -> Iterator[str]:
    """Names that a script takes from the project's modules, and that these do not have."""
    tree = parsed(path)
    taken = {
        (alias.asname or alias.name): f"{node.module}.{alias.name}"
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module and not node.level
        for alias in node.names
    }
    bound = {node.arg for node in ast.walk(tree) if isinstance(node, ast.arg)}
    bound |= {
        n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)
    }
    asked = set(taken.values()) | {
        f"{taken[node.value.id]}.{node.attr}"
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)
        if node.value.id in taken.keys() - bound
    }
    for name in asked:
        module, _, member = name.rpartition(".")
        source = _source(module)
        if source and not _source(name) and not {member, "__getattr__"} & _names(source):
            yield name


def _source(module: str) -> Path | None:
    """The file of a module of the project."""
    root, *rest = module.split(".")
    folder = {folder.name: folder for folder in (CORE, APP, RESEARCH)}.get(root)
    if folder is None:
        return None
    place = folder.joinpath(*rest)
    return next((p for p in (place.with_suffix(".py"), place / "__init__.py") if p.is_file()), None)


@cache
def _names(path: Path) -> frozenset[str]:
    """Every name that a module binds, wherever in it: more than it has, never less."""
    found = set()
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            found.add(node.name)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            found.add(node.id)
        elif isinstance(node, ast.alias):
            found.add((node.asname or node.name).split(".")[0])
    return frozenset(found)
