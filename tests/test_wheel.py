"""The wheel works away from the checkout: its command, its shaders, its photos."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
sys.path.append(str(ROOT / "packaging"))

import index_page  # noqa: E402
from check_tools import bring_kernels  # noqa: E402

READ_RESOURCES = """
import sys
from pathlib import Path
from objectmorpher.system.resources import resource
for name in sys.argv[1:]:
    assert resource(name).stat().st_size > 0, name
    assert Path(sys.prefix) in resource(name).parents, resource(name)
print(len(sys.argv) - 1)
"""


def clean() -> dict[str, str]:
    """The environment, without what leads to the checkout."""
    return {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONHOME")}


def run(*command: object, cwd: Path) -> str:
    done = subprocess.run(
        [str(part) for part in command], cwd=cwd, env=clean(), capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def installed(tmp_path_factory) -> Path:
    """Folder of a fresh environment with the wheel in it; `bin` or `Scripts` holds its programs.

    What the wheel depends on is seen through this environment's packages, and its kernels are the
    checkout's, so that the tests take seconds; `.ci/run` installs and compiles everything anew.
    """
    folder = tmp_path_factory.mktemp("wheel")
    run(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder, cwd=ROOT)
    (wheel,) = folder.glob("*.whl")
    run(sys.executable, "-m", "venv", folder / "venv", cwd=folder)
    programs = folder / "venv" / ("Scripts" if os.name == "nt" else "bin")
    run(programs / "python", "-m", "pip", "install", "-q", "--no-deps", wheel, cwd=folder)
    packages = run(
        programs / "python", "-c", "import sysconfig; print(sysconfig.get_path('purelib'))",
        cwd=folder,
    ).strip()  # fmt: skip
    # Behind the wheel on sys.path; an editable install there would need its own .pth file read.
    import numpy

    (Path(packages) / "dependencies.pth").write_text(str(Path(numpy.__file__).parents[1]))
    bring_kernels(Path(packages))
    return programs


@pytest.mark.slow
def test_version(installed, tmp_path):
    assert run(installed / "objectmorpher", "--version", cwd=tmp_path).startswith("objectmorpher ")


@pytest.mark.slow
def test_the_research_package_is_apart(installed, tmp_path):
    """The wheel holds none of it, does not list its commands, and says how to get them."""
    files = run(installed / "python", "-m", "pip", "show", "--files", "objectmorpher", cwd=tmp_path)
    files = files.partition("Files:")[2]
    assert "objectmorpher/cli/parser.py" in files and "research" not in files
    assert "evaluate" not in run(installed / "objectmorpher", "--help", cwd=tmp_path)
    done = subprocess.run(
        [installed / "objectmorpher", "bench", "deform"], cwd=tmp_path, env=clean(),
        capture_output=True, text=True,
    )  # fmt: skip
    told = "bench is part of the research package, which is not installed"
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == f"objectmorpher: {told}: `pip install 'objectmorpher[research]'`\n"


@pytest.mark.slow
def test_both_packages_are_typed(installed, tmp_path):
    """The marks are in the wheel, and pyright takes the types of what is installed."""
    files = run(installed / "python", "-m", "pip", "show", "--files", "objectmorpher", cwd=tmp_path)
    for package in ("objectmorpher", "objectmorpher_core"):
        assert f"  {package}/py.typed" in files.splitlines()
    (tmp_path / "use.py").write_text(
        "import objectmorpher_core as om\n"
        "from objectmorpher.cli.plugin import usual_folder\n"
        "a: str = om.open('photo.jpg')\n"
        "b: str = usual_folder(3)\n"
    )
    done = subprocess.run(
        [sys.executable, "-m", "pyright", "--pythonpath", installed / "python", "use.py"],
        cwd=tmp_path, env=clean(), capture_output=True, text=True,
    )  # fmt: skip
    said = [line for line in done.stdout.splitlines() if " - error: " in line]
    assert sorted(re.findall(r"use\.py:(\d+)", "".join(said))) == ["3", "4", "4"], done.stdout


@pytest.mark.slow
def test_every_resource_is_inside(installed, tmp_path):
    names = [
        path.relative_to(ROOT).as_posix()
        for folder in ("shaders", "assets")
        for path in sorted((ROOT / folder).rglob("*"))
        if path.is_file()
    ]
    assert any(name.startswith("shaders/") for name in names)
    out = run(installed / "python", "-c", READ_RESOURCES, *names, cwd=tmp_path)
    assert out.strip() == str(len(names))


@pytest.mark.slow
def test_an_edit(installed, tmp_path):
    photo = ROOT / "assets" / "samples" / "coffee.jpg"
    run(
        installed / "objectmorpher", "edit", photo, "--click", "280,150", "--turn", "15,0,0",
        "-o", "out.png", cwd=tmp_path,
    )  # fmt: skip
    assert (tmp_path / "out.png").stat().st_size > 10_000


def test_the_page_of_a_package_index_has_no_link_that_leads_nowhere():
    text = (ROOT / "README.md").read_text("utf-8")
    relative = re.compile(r"\]\((?!https?://|#)")
    assert relative.search(text)
    bare = index_page.index_page(text, None, "0.1.0")
    assert not relative.search(bare) and "![" not in bare and "https://arxiv.org" in bare
    linked = index_page.index_page(text, "https://example.org/us/it/", "0.1.0")
    assert not relative.search(linked)
    assert "](https://example.org/us/it/raw/v0.1.0/docs/drag.webp)" in linked
    assert "](https://example.org/us/it/blob/v0.1.0/docs/install.md)" in linked
    assert linked.count("](") == text.count("](")


@pytest.mark.slow
def test_that_page_is_the_wheels(installed, tmp_path):
    said = run(
        installed / "python", "-c",
        "from importlib.metadata import metadata; print(metadata('objectmorpher').get_payload())",
        cwd=tmp_path,
    )  # fmt: skip
    assert said.startswith("# ObjectMorpher\n") and "](docs/" not in said
