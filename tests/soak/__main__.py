"""A working day in minutes: `python -m tests.soak [--edits 10000] [--every 100] [--chart F.svg]`.

Prints one line of JSON for each sample; exits with 1 where something grew or became slower.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import sys
import tempfile
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from tests import photos

from .judging import chart, problems, slower


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.soak", description=__doc__)
    parser.add_argument("--edits", type=int, default=10_000)
    parser.add_argument("--every", type=int, default=100, help="edits between two samples")
    parser.add_argument("--chart", type=Path, metavar="F.svg")
    options = parser.parse_args()
    samples = []
    with tempfile.TemporaryDirectory() as folder:
        os.environ["OBJECTMORPHER_DATA"] = folder
        from .session import REOPENED, Session

        photo = photos.saved("astronaut", Path(folder))
        session = Session(photo, photos.outlined("astronaut"), Path(folder))
        try:
            session.hundred()  # fills the caches
            hundreds = [session.hundred()]
            print(json.dumps(dataclasses.asdict(hundreds[0])), flush=True)
            for sample in session.samples(options.edits, options.every):
                print(json.dumps(dataclasses.asdict(sample)), flush=True)
                samples.append(sample)
                if sample.edits % REOPENED == 0:
                    hundreds.append(session.hundred())
                    print(json.dumps(dataclasses.asdict(hundreds[-1])), flush=True)
        finally:
            session.close()
    if options.chart:
        options.chart.write_text(chart(samples), encoding="utf-8")
    found = problems(samples) + slower(hundreds)
    print("\n".join(found))
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
