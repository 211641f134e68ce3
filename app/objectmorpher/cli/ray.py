"""`--ray ADDRESS`: the option of the commands whose work can be spread over many machines."""

from __future__ import annotations

import argparse
from importlib.util import find_spec

from .terminal import UsageError

NEEDED = ("ray", "pyarrow", "pandas")


def add_ray(parser: argparse.ArgumentParser) -> None:
    """The option."""
    parser.add_argument(
        "--ray", metavar="ADDRESS",
        help="spread over a Ray cluster; local starts one here; default without Ray",
    )  # fmt: skip


def check_ray(options: argparse.Namespace) -> None:
    """Raises UsageError where it is asked for and cannot be had."""
    absent = [name for name in NEEDED if find_spec(name) is None]
    if options.ray is not None and absent:
        names = " and ".join(absent)
        raise UsageError(f"--ray needs {names}: `pip install 'objectmorpher[cluster]'`")
