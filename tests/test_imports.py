"""Who may import whom (ARCHITECTURE section 2)."""

from __future__ import annotations

import ast
import compileall
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
CORE, APP = ROOT / "objectmorpher_core", ROOT / "app"
RESEARCH = ROOT / "research" / "objectmorpher_research"
ONNX = CORE / "models" / "onnx_session.py"  # imports onnxruntime, with its telemetry off
NETWORKS = {
    CORE / "lift" / "trellis",
    CORE / "compose" / "pixelhacker",
}  # classes of torch's; what is imported first needs none
WINDOW = {"imgui_bundle", "imgui", "glfw", "OpenGL"}
GL = {"moderngl", "glcontext"}
HEAVY = {
    "torch",
    "onnxruntime",
    "patchmatch",
    "trimesh",
    "tifffile",
    "ray",
}  # only inside functions
CORE_AT_IMPORT = {
    "numpy", "scipy", "numba", "llvmlite", "cv2", "PIL", "platformdirs", "objectmorpher_core",
}  # fmt: skip

WINDOW_IMPORT = "import app.cli, app.gui.window"
RUNS = 7
MOST_RATIO = 7.0  # it is about 4.5; scipy alone would add 2, torch 20


def sources(folder: Path) -> list[Path]:
    return sorted(folder.rglob("*.py"))


def imports(path: Path, is_at_import: bool = False) -> Iterator[str]:
    """Absolute names of what a file imports; `is_at_import`: without what functions import."""
    package = path.relative_to(ROOT).parent.parts
    nodes: list[ast.AST] = [ast.parse(path.read_text(encoding="utf-8"))]
    while nodes:
        node = nodes.pop()
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else ()
            module = ".".join((*above, *([node.module] if node.module else [])))
            yield module
            yield from (f"{module}.{alias.name}" for alias in node.names)
        is_function = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
        if not (is_at_import and (is_function or _is_for_types(node))):
            nodes.extend(ast.iter_child_nodes(node))


def _is_for_types(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"


def tops(path: Path, is_at_import: bool = False) -> set[str]:
    return {name.split(".")[0] for name in imports(path, is_at_import)}


def name_of(path: Path) -> str:
    return str(path.relative_to(ROOT))


@pytest.mark.parametrize("path", sources(CORE), ids=name_of)
def test_core_knows_no_window(path):
    assert not tops(path) & ({"app"} | WINDOW | GL)


@pytest.mark.parametrize("path", sources(CORE), ids=name_of)
def test_core_starts_light(path):
    others = tops(path, is_at_import=True) - set(sys.stdlib_module_names)
    if path.parent in NETWORKS:  # networks are classes of torch's
        others -= {"torch"}
    assert others <= CORE_AT_IMPORT, "import it inside the function that needs it"


def test_onnxruntime_is_imported_in_one_place():
    everywhere = {p for folder in (CORE, APP, RESEARCH, ROOT / "tests") for p in sources(folder)}
    assert {p for p in everywhere if "onnxruntime" in tops(p)} == {ONNX}


@pytest.mark.parametrize("path", [*sources(CORE), *sources(APP)], ids=name_of)
def test_the_program_knows_nothing_of_the_research_package(path):
    """It finds that package's commands by entry points."""
    assert RESEARCH.name not in path.read_text(encoding="utf-8")


@pytest.mark.parametrize("path", sources(APP), ids=name_of)
def test_gl_and_window_stay_in_their_folders(path):
    folder = path.relative_to(APP).parts[0]
    names = tops(path)
    assert folder == "render" or not names & GL, "only app/render imports moderngl"
    assert folder == "gui" or not names & WINDOW, "only app/gui imports imgui and glfw"


@pytest.mark.parametrize("path", [APP / "editor.py", *sources(APP / "tools")], ids=name_of)
def test_editor_and_tools_need_no_screen(path):
    reached = {".".join(name.split(".")[:2]) for name in imports(path)}
    assert not reached & {"app.render", "app.gui"}


@pytest.mark.parametrize("path", sources(APP), ids=name_of)
def test_app_starts_light(path):
    assert not tops(path, is_at_import=True) & HEAVY


@pytest.mark.parametrize("path", sources(APP / "render"), ids=name_of)
def test_renderer_knows_no_editor(path):
    reached = {".".join(name.split(".")[:2]) for name in imports(path)}
    assert not reached & {"app.editor", "app.history", "app.gui"}


@pytest.mark.parametrize(
    "module",
    [
        "objectmorpher_core.pipeline", "app.editor", "app.cli",
        "objectmorpher_core.lift.trellis.lifter", "objectmorpher_core.lift.trellis.cupid_lifter",
    ],
)  # fmt: skip
def test_importing_pulls_in_nothing_heavy(module):
    heavy = sorted(HEAVY | WINDOW | GL)
    code = f"import sys, {module}; print(*[m for m in {heavy} if m in sys.modules])"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == ""


def test_the_window_imports_in_a_few_times_what_numpy_takes():
    """Before its first frame: what takes longer is imported when it is needed.

    The least of several runs, taken in turns: what else the machine does only adds to a run.
    As from the second start on: compiled to bytecode.
    """
    for folder in (APP, CORE):
        compileall.compile_dir(folder, quiet=1)
    runs = [[_seconds(code) for code in ("", "import numpy", WINDOW_IMPORT)] for _ in range(RUNS)]
    bare, numpy, window = (min(column) for column in zip(*runs, strict=True))
    assert (window - bare) / (numpy - bare) <= MOST_RATIO, runs


@pytest.mark.parametrize(
    "module",
    [
        "scipy", "numba", "torch", "diffusers", "onnxruntime", "skimage", "ray", "http",
        "app.remote.server", "app.remote.offers", "app.remote.tokens",
    ],
)  # fmt: skip
def test_the_window_is_there_before(module):
    code = f"import sys\n{WINDOW_IMPORT}\nsys.exit({module!r} in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT).returncode == 0


def _seconds(code: str) -> float:
    """Of the processor, by a process of its own."""
    start = os.times()
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)
    end = os.times()
    return (end.children_user - start.children_user) + (end.children_system - start.children_system)
