"""Limits on what is read: all in one file, all in the docs."""

from __future__ import annotations

import re
from pathlib import Path

from objectmorpher_core.base import limits

DOCS = Path(__file__).parents[2] / "docs" / "reliability-tests.md"


def test_the_docs_list_every_limit_with_its_value() -> None:
    told = dict(
        re.findall(r"^\| `([A-Z_]+)` \| ([\d,]+) \|", DOCS.read_text(encoding="utf-8"), re.M)
    )
    known = {name: f"{value:,}" for name, value in vars(limits).items() if name.isupper()}
    assert told == known
