"""The commands that this package adds to the program, which finds them by their entry points."""

from __future__ import annotations

from objectmorpher.cli.command_parser import Subcommand, lazily

BENCH = Subcommand(
    "bench", "measure, on objects it makes itself", lazily("bench", "add_bench", __name__),
    lazily("bench", "run_bench", __name__),
)  # fmt: skip
TRAIN = Subcommand(
    "train", "make the product's own networks", lazily("train", "add_train", __name__)
)
EVALUATE = Subcommand(
    "evaluate", "how good results are", lazily("evaluate", "add_evaluate", __name__)
)
