"""Draws day.svg from day.jsonl: what a long session costs, over its edits.

`python -m tests.soak > docs/soak/day.jsonl` measures anew; `python docs/soak/make_soak.py` draws.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

HERE = Path(__file__).parent


def main() -> None:
    sys.path.insert(0, str(HERE.parents[1]))
    from tests.soak.judging import chart, problems, slower
    from tests.soak.session import Hundred, Sample

    lines = (HERE / "day.jsonl").read_text(encoding="utf-8").splitlines()
    told = [json.loads(line) for line in lines if line.startswith("{")]
    samples = [Sample(**values) for values in told if "files" in values]
    (HERE / "day.svg").write_text(chart(samples), encoding="utf-8")
    hundreds = [Hundred(**values) for values in told if "main" in values]
    print("\n".join(problems(samples) + slower(hundreds)) or "Nothing grew.")


if __name__ == "__main__":
    main()
