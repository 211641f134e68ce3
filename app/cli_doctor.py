"""`objectmorpher doctor`: what each stage would use on this machine, and what would help."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict

from . import __version__


def run_doctor(options: argparse.Namespace) -> None:
    """`objectmorpher doctor [--json]`"""
    from objectmorpher_core import doctor, models

    machine, stages = doctor.look_at_machine(), doctor.look_at_stages()
    if options.is_json:
        told = {"version": __version__, "machine": asdict(machine), "models": str(models.folder())}
        told["stages"] = [asdict(stage) for stage in stages]
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
    for stage in stages:
        lines += ["", f"{stage.name}: {stage.uses}, {stage.why}"]
        lines += [f"  not {name}: {reason}" for name, reason in stage.others]
        lines += [f"  better with: {stage.better}"] if stage.better else []
    sys.stdout.write("\n".join(lines) + "\n")
