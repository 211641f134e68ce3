"""`objectmorpher models setup`: the build of PyTorch for a machine, and an environment that has it.

The packages are small ones made here, in a folder of wheels; pip, the environments and the
processes in them are real.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING

import numpy
import pytest

from objectmorpher_core.base import installation, torch_environment
from objectmorpher_core.models import ModelError, torch_setup
from objectmorpher_core.models.torch_setup import TorchMachine, build_for, parse_nvidia_smi
from tests.tree import PYTHONPATH, ROOT

if TYPE_CHECKING:
    from objectmorpher.worker.jobs import Jobs

LINUX, WINDOWS = ("Linux", "x86_64"), ("Windows", "AMD64")
BUILDS = {
    TorchMachine(*LINUX): "cpu",
    TorchMachine("Linux", "aarch64"): "cpu",
    TorchMachine(*WINDOWS): "cpu",
    TorchMachine("Darwin", "arm64"): "mps",
    TorchMachine(*LINUX, has_amd=True): "rocm6.4",
    TorchMachine(*WINDOWS, has_amd=True): "cpu",  # no such build
    TorchMachine(*LINUX, "580.65.06", "8.9"): "cu130",
    TorchMachine(*WINDOWS, "581.29", "12.0"): "cu130",
    TorchMachine(*LINUX, "570.172.08", "12.0"): "cu128",
    TorchMachine(*LINUX, "550.54.14", "8.6"): "cu126",
    TorchMachine(*LINUX, "580.65.06", "6.1"): "cu126",  # a card that newer builds have left
    TorchMachine(*LINUX, "535.10"): "cu126",  # a driver that does not say of which card
    TorchMachine(*LINUX, "550.54.14", "12.0"): "cpu",  # its CUDA does not know the card
    TorchMachine(*LINUX, "470.10", "8.6"): "cpu",
    TorchMachine(*LINUX, "580.65", "3.5"): "cpu",
    TorchMachine(*LINUX, "580.65", "8.9", has_amd=True): "cu130",
}


def test_each_machine_gets_the_newest_build_that_it_can_run() -> None:
    for machine, name in BUILDS.items():
        build = build_for(machine)
        assert build.name == name, machine
        assert build.index.endswith(name) or (name == "mps" and not build.index)
        assert 0 < build.download < build.disk
    assert "570 or newer" in build_for(TorchMachine(*LINUX, "550.54", "12.0")).why
    assert "528 or newer" in build_for(TorchMachine(*LINUX, "470.10", "8.6")).why
    for system, processor in (("Darwin", "x86_64"), ("Linux", "i686"), ("FreeBSD", "amd64")):
        with pytest.raises(ModelError):
            build_for(TorchMachine(system, processor))
    assert build_for(TorchMachine(*LINUX, "580.65", "8.9"), "cu126").name == "cu126"
    with pytest.raises(ModelError, match=r"rocm6\.4 is no build for Windows: cu130, cu128"):
        build_for(TorchMachine(*WINDOWS), "rocm6.4")


def test_what_the_driver_says_is_understood() -> None:
    two = "550.54.14, 6.1\n550.54.14, 8.9\n"
    assert parse_nvidia_smi(*LINUX, two) == TorchMachine(*LINUX, "550.54.14", "8.9")
    assert parse_nvidia_smi(*WINDOWS, "471.11, [N/A]\n").capability == ""
    assert parse_nvidia_smi(*LINUX, "No devices were found\n").driver == ""


def test_the_time_and_the_disk_are_those_of_the_build() -> None:
    small, large = (
        torch_setup.SetupPlan(Path(), "", build_for(TorchMachine(*LINUX), name), (), ("borrowed",))
        for name in ("cpu", "cu128")
    )
    assert small.disk < 2e9 < 5e9 < large.disk and small.minutes < large.minutes
    alone = torch_setup.SetupPlan(Path(), "", small.build, (), ())
    assert alone.disk - small.disk == torch_setup.MAIN_DISK


LEARNED = ("torch", "transformers", "diffusers", "accelerate", "bitsandbytes", "safetensors",
           "huggingface_hub", "peft")  # fmt: skip
TORCH = """
__version__ = "99.0"
class cuda:
    is_available = staticmethod(lambda: False)
class backends:
    class mps:
        is_available = staticmethod(lambda: False)
"""


def write_wheel(folder: Path, name: str, version: str, source: str) -> None:
    """A package of one module, which wants numpy as the true ones do."""
    about = f"{name}-{version}.dist-info"
    files = {
        f"{name}/__init__.py": source,
        f"{about}/METADATA": f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n"
        "Requires-Dist: numpy\n",
        f"{about}/WHEEL": "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
        f"{about}/RECORD": "",
    }
    with zipfile.ZipFile(folder / f"{name}-{version}-py3-none-any.whl", "w") as wheel:
        for path, text in files.items():
            wheel.writestr(path, text)


@pytest.fixture(scope="module")
def wheels(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheels")
    for name in LEARNED:
        write_wheel(folder, name, "99.0", TORCH if name == "torch" else "")
    return folder


@pytest.fixture(scope="module")
def main(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The Python of an environment with what the program needs, and without PyTorch."""
    folder = tmp_path_factory.mktemp("main") / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder], check=True)
    packages = torch_environment.packages_in(folder)
    for there in Path(numpy.__file__).parents[1].iterdir():
        if not there.name.startswith((*LEARNED, "__editable__", "objectmorpher", "_objectm")):
            (packages / there.name).symlink_to(there)
    return torch_environment.python_in(folder)


def run(main: Path, at: Path, *words: str, start: str = "") -> subprocess.CompletedProcess[str]:
    """The program in the Python `main`, with the environment in `at`."""
    code = f"import sys; {start}\nfrom objectmorpher.__main__ import main; sys.exit(main())"
    variables = {**os.environ, "PYTHONPATH": PYTHONPATH, torch_environment.VARIABLE: str(at)}
    command = [main, "-c", code, *words]
    return subprocess.run(command, env=variables, capture_output=True, text=True, timeout=120)


def packages_of(done: subprocess.CompletedProcess[str]) -> str:
    """The line of the doctor's report with the packages' versions."""
    assert done.returncode == 0, done.stderr
    return next(line for line in done.stdout.splitlines() if "numpy " in line)


@pytest.mark.slow
def test_an_environment_is_made_used_brought_up_to_date_and_removed(
    main: Path, wheels: Path, tmp_path: Path
) -> None:
    at = tmp_path / "learned"
    assert "torch" not in packages_of(run(main, at, "doctor"))
    asked = run(main, at, "models", "setup", "--build", "cu128")
    assert asked.returncode == 1 and "8.2 GB" in asked.stderr and "--yes" in asked.stderr
    refused = run(main, at, "models", "setup", "--undo")
    assert refused.returncode == 1 and not at.exists()

    setup = ("models", "setup", "--yes", "--build", "cpu", "--from", str(wheels))
    done = run(main, at, *setup)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("PyTorch 99.0: ")
    assert "torch 99.0" in packages_of(run(main, at, "doctor"))
    assert not (torch_environment.packages_in(at) / "numpy").exists(), "it is the program's own"

    newer = tmp_path / "newer"
    shutil.copytree(wheels, newer)
    write_wheel(newer, "torch", "100.0", TORCH)
    again = run(main, at, *setup[:-1], str(newer))
    assert again.stdout.startswith("PyTorch 100.0: "), again.stderr
    broken = tmp_path / "broken"
    broken.mkdir()
    failed = run(main, at, *setup[:-1], str(broken), "--build", "cu126")
    assert failed.returncode == 1 and "does not have" in failed.stderr
    assert len(failed.stderr.splitlines()) == 2  # what is going to be done, and why it was not
    assert "torch" not in packages_of(run(main, at, "doctor")), "a half of it is not used"

    assert run(main, at, "models", "setup", "--undo").returncode == 0
    assert not at.exists()


@pytest.mark.slow
def test_an_installers_copy_works_in_an_environment_of_another_python(
    wheels: Path, main: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    at = tmp_path / "learned"
    plan = torch_setup.SetupPlan(
        at, sys.executable, build_for(TorchMachine(*LINUX), "cpu"), LEARNED[1:],
        (str(torch_environment.packages_in(main.parents[1])),), wheels,
    )  # fmt: skip
    made = torch_setup.make(plan, lambda fraction, note: None)
    note = {**json.loads((at / torch_environment.NOTE).read_text()), "is_apart": True}
    (at / torch_environment.NOTE).write_text(json.dumps(note))
    assert made.torch == "99.0" and not made.is_apart

    frozen = run(main, at, "doctor", start="sys.frozen = True")
    assert "torch 99.0" in packages_of(frozen)

    helpers = str(ROOT / "tests" / "app")
    monkeypatch.syspath_prepend(helpers)
    monkeypatch.setenv(torch_environment.VARIABLE, str(at))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([PYTHONPATH, helpers]))
    monkeypatch.setattr(sys, "frozen", True, raising=False)
    import job_functions  # pyright: ignore[reportMissingImports]
    from objectmorpher.worker.jobs import Jobs

    jobs, answers, failures, cancelled = Jobs(), [], [], []

    def start(function: Callable, *arguments: object) -> None:
        jobs.start(
            "Test", function, *arguments, done=answers.append, failed=failures.append,
            cancelled=lambda: cancelled.append(True), kind=function.__name__,
        )  # fmt: skip

    start(job_functions.prefix)
    poll_until(jobs, lambda: bool(answers or failures))
    assert not failures
    assert answers[0] == f"{at} 99.0"
    start(job_functions.wait, 50.0)
    worker = jobs._worker
    assert worker is not None
    poll_until(jobs, lambda: jobs.current is not None and bool(jobs.current.note))
    jobs.cancel("wait", patience=50.0)
    poll_until(jobs, lambda: bool(cancelled))
    assert jobs._worker is worker, "it was asked to stop, not ended"
    jobs.close()
    assert not worker.stop.path.exists()


def poll_until(jobs: Jobs, is_reached: Callable[[], bool]) -> None:
    end = time.monotonic() + 40.0
    while not is_reached():
        assert time.monotonic() < end, "nothing came in time"
        jobs.poll()
        time.sleep(0.01)


def test_a_copy_that_has_pytorch_wants_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("torch")
    with pytest.raises(ModelError, match="PyTorch is here already"):
        torch_setup.plan(build_for(TorchMachine(*LINUX)))


def test_what_is_in_the_way_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    build = build_for(TorchMachine(*LINUX))
    own = torch_setup.SetupPlan(tmp_path, sys.executable, build, (), (), tmp_path)
    (tmp_path / "letter.txt").write_text("dear reader")
    with pytest.raises(ModelError, match="holds other files"):
        torch_setup.make(own, lambda fraction, note: None)
    assert (tmp_path / "letter.txt").exists()
    monkeypatch.setattr(shutil, "disk_usage", lambda at: shutil._ntuple_diskusage(10, 9, 1))
    with pytest.raises(ModelError, match="GB are free"):
        torch_setup.make(own, lambda fraction, note: None)
    monkeypatch.setattr(sys, "frozen", True, raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ModelError, match=r"a Python 3\.11 to 3\.14 with its venv module is needed"):
        torch_setup.plan(build)


def test_requirements_of_a_wheel_are_those_of_the_checkout(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines = installation.requirements("models")
    assert any(line.startswith("torch>=") for line in lines)
    told = [f"{line}{' and' if ';' in line else ';'} extra == 'models'" for line in lines]
    told += installation.requirements("")
    monkeypatch.setenv("OBJECTMORPHER_INSIDE", str(tmp_path))
    monkeypatch.setattr(metadata, "requires", lambda name: told)
    assert installation.requirements("models") == lines
