"""`objectmorpher bench`: measures, on objects it makes itself. It reports and judges nothing."""

from __future__ import annotations

import os
from typing import Any

from .bodies import even_sphere, five_limbs, limb_handles
from .deform import BEND, bench_deform
from .machine import cpu_name

__all__ = ["BEND", "even_sphere", "five_limbs", "limb_handles", "run_bench"]


def run_bench(what: str, is_quick: bool) -> dict[str, Any]:
    """The figures of one benchmark (DESIGN section 6), ready for JSON."""
    gl_renderer = None
    if what == "render":
        from .render import bench_render

        rows, gl_renderer = bench_render(is_quick)
    elif what == "pipeline":
        from .pipeline import bench_pipeline

        rows = bench_pipeline(is_quick)
    else:
        rows = {"deform": bench_deform}[what](is_quick)
    machine = {"cpu": cpu_name(), "cores": os.cpu_count(), "gl_renderer": gl_renderer}
    return {"machine": machine, "rows": rows}
