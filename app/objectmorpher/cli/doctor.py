"""`objectmorpher doctor`: what each stage would use on this machine, and what would help."""

from __future__ import annotations

import argparse
import json
import os
import sys
from dataclasses import asdict

from .. import __version__
from ..system.logs import log_path
from ..system.report import without_names

ANOTHER = "Another copy, with it, is made by the commands below; or a server of yours has it."


def run_doctor(options: argparse.Namespace) -> None:
    """`objectmorpher doctor [--json]`"""
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
        lines += ["", f"An installer brought this copy: PyTorch cannot be added to it. {ANOTHER}"]
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
