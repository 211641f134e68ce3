"""Lets everything go wrong that can: `python -m tests.faults [--scenarios a,b] [--quick]`.

Prints one line of JSON for each scenario, and what is wrong; exits with 1 where something is.
`--power` cuts the power instead, `--states N` at most so many times after each operation.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import logging
import os
import sys

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import cv2

from .faults import FAULTS, inject
from .power import cut_power
from .scenarios import CARELESS, scenarios
from .tracer import missing

QUICK = ("I/O error", "disk full from there on", "read-only from there on", "short write",
         "killed")  # fmt: skip


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.faults", description=__doc__)
    parser.add_argument("--scenarios", default="", help="names, separated by commas")
    parser.add_argument("--quick", action="store_true", help="the most different faults only")
    parser.add_argument(
        "--most", type=int, help="operations of a scenario at which each fault comes"
    )
    parser.add_argument("--power", action="store_true", help="power cuts")
    parser.add_argument("--states", type=int, default=200, help="after each operation, at most")
    options = parser.parse_args()
    if reason := missing():
        print(json.dumps({"missing": reason}))
        return 0
    logging.disable(logging.CRITICAL)  # settings that cannot be written are logged
    cv2.setNumThreads(1)
    is_wrong = False
    for shift, scenario in enumerate(scenarios()):
        chosen = options.scenarios.split(",") if options.scenarios else []
        if scenario.name not in chosen and (chosen or scenario.name in CARELESS):
            continue
        if options.power:
            result = cut_power(scenario, options.states)
        else:
            result = inject(scenario, list(QUICK if options.quick else FAULTS), options.most, shift)
        is_wrong = is_wrong or bool(result.wrong)
        print(json.dumps(dataclasses.asdict(result)), flush=True)
    return int(is_wrong)


if __name__ == "__main__":
    sys.exit(main())
