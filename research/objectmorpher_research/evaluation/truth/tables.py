"""Means of a run, by category and method, with intervals, as text, CSV and JSON."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

from ..bootstrap import Estimate, mean_with_interval
from .methods import OURS, EditMethod
from .motions import IN_PLANE, SPATIAL
from .running import CaseRow
from .scores import FIGURES

GROUPS = {"3-D": SPATIAL, "in the plane": IN_PLANE}
ALL = "all"
COSTS = ("seconds", "cpu", "memory")


@dataclass(frozen=True)
class TruthTable:
    """Means over the cases of a category or of a group of them."""

    categories: tuple[str, ...]
    methods: tuple[str, ...]
    cells: Mapping[tuple[str, str, str], Estimate]  # by category, method, figure
    gains: Mapping[tuple[str, str, str], Estimate]  # ours less the method's, case by case


def build_table(
    rows: Sequence[CaseRow], methods: Mapping[str, EditMethod], seed: int = 0
) -> TruthTable:
    """A method that a rigid case leaves as ours is counts as ours there."""
    names = [name for name in methods if any(row.method == name for row in rows)]
    by_case: dict[str, dict[str, CaseRow]] = {}
    for row in rows:
        by_case.setdefault(row.case, {})[row.method] = row
    categories = tuple(dict.fromkeys(row.category for row in rows))
    chosen = {c: (c,) for c in categories} | GROUPS | {ALL: categories}
    cells: dict[tuple[str, str, str], Estimate] = {}
    gains: dict[tuple[str, str, str], Estimate] = {}
    for group, members in chosen.items():
        cases = [own for own in by_case.values() if next(iter(own.values())).category in members]
        if not cases:
            continue
        for name in names:
            own = [case.get(name) or case.get(OURS) for case in cases]
            for figure in (*FIGURES, *COSTS):
                values = [_value(row, figure) for row in own if row is not None]
                cells[group, name, figure] = mean_with_interval(values, seed)
                if name != OURS and figure in FIGURES:
                    pairs = [
                        _value(case[OURS], figure) - _value(row, figure)
                        for case, row in zip(cases, own, strict=True)
                        if row is not None and OURS in case
                    ]
                    gains[group, name, figure] = mean_with_interval(pairs, seed)
    kept = tuple(group for group in chosen if any(key[0] == group for key in cells))
    return TruthTable(kept, tuple(names), cells, gains)


def _value(row: CaseRow, figure: str) -> float:
    return float(getattr(row if figure in COSTS else row.score, figure))


def as_text(table: TruthTable, figure: str) -> str:
    """Return a table of a figure for the terminal: methods in lines, categories in columns."""
    width = max(12, *(len(c) + 2 for c in table.categories))
    head = f"{figure:<14}" + "".join(f"{c:>{width}}" for c in table.categories)
    lines = [head]
    for name in table.methods:
        cells = (table.cells.get((c, name, figure)) for c in table.categories)
        lines.append(f"{name:<14}" + "".join(f"{short(cell, figure):>{width}}" for cell in cells))
    return "\n".join(line.rstrip() for line in lines) + "\n"


def short(cell: Estimate | None, figure: str) -> str:
    """A mean as the tables print it."""
    if cell is None or math.isnan(cell.value):
        return "-"
    digits = {"psnr": 2, "outside": 1, "reach": 1, "memory": 0, "seconds": 1, "cpu": 1}
    return f"{cell.value:.{digits.get(figure, 3)}f}"


def interval(cell: Estimate | None, figure: str) -> str:
    """Its 95 % interval, or nothing."""
    if cell is None or cell.low is None or cell.high is None:
        return ""
    low, high = (short(Estimate(v), figure) for v in (cell.low, cell.high))
    return f"[{low}, {high}]"


def as_csv(rows: Sequence[CaseRow]) -> str:
    """A line for every method and case."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["case", "category", "method", *FIGURES, *COSTS, "shared"])
    for row in rows:
        figures = [_value(row, figure) for figure in (*FIGURES, *COSTS)]
        told = ["" if math.isnan(v) else f"{v:.6g}" for v in (*figures, row.shared)]
        writer.writerow([row.case, row.category, row.method, *told])
    return out.getvalue()


def as_json(rows: Sequence[CaseRow], table: TruthTable) -> dict[str, object]:
    """Everything as plain numbers; what is not there is null."""

    def plain(value: object) -> object:
        if isinstance(value, dict):
            return {key: plain(v) for key, v in value.items()}
        return None if isinstance(value, float) and not math.isfinite(value) else value

    def estimates(found: Mapping[tuple[str, str, str], Estimate]) -> list[object]:
        return [
            plain({"category": c, "method": m, "figure": f, **asdict(estimate)})
            for (c, m, f), estimate in found.items()
        ]

    return {
        "cases": [plain(asdict(row)) for row in rows],
        "means": estimates(table.cells),
        "ours_less_method": estimates(table.gains),
    }
