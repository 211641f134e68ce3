"""Estimates as the terminal's tables and JSON have them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..evaluation.bootstrap import Estimate

Number = float | str | None  # as JSON has it: infinite is "inf", what is not there null


def cell(found: Estimate, format: str) -> str:
    """The value and, where it is known, its interval; "-" for what does not exist."""
    if math.isnan(found.value):
        return "-"
    if found.low is None or found.high is None:
        return f"{found.value:{format}}"
    return f"{found.value:{format}} [{found.low:{format}}, {found.high:{format}}]"


def number(value: float | None) -> Number:
    """Return a number for JSON, which has only finite ones."""
    if value is None or math.isnan(value):
        return None
    return value if math.isfinite(value) else "inf"


def numbers(found: Estimate) -> dict[str, Number]:
    """The value and its interval, for JSON."""
    return {"value": number(found.value), "low": number(found.low), "high": number(found.high)}


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """A line for each row, its columns as wide as their longest cell."""
    widths = [max(len(row[k]) for row in rows) + 2 for k in range(len(rows[0]))]
    return ["".join(f"{c:<{w}}" for c, w in zip(row, widths, strict=True)) for row in rows]
