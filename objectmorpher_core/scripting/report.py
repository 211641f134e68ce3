"""The figures of one edit."""

from __future__ import annotations

import contextlib
import re
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..compose.composite import Composite
from ..compose.order import holes
from ..compose.plate.plate import erased_beside
from ..deform.puppet import Puppet
from ..document.model import Document, EditObject, Placement
from ..raster.trust import trust_in

VERSION = 1
STAGES = (
    "load", "segment", "lift", "graph", "deform", "inpaint", "render", "refine", "save", "total",
)  # fmt: skip


@dataclass(frozen=True)
class Span:
    """When a stage ran, s of `time.perf_counter`."""

    stage: str
    begin: float
    end: float


class Stopwatch:
    """Seconds by stage."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = dict.fromkeys(STAGES, 0.0)
        self.spans: list[Span] = []
        self._start = time.perf_counter()

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Adds the time inside the block to a stage."""
        start = time.perf_counter()
        try:
            yield
        finally:
            end = time.perf_counter()
            self.seconds[name] += end - start
            self.spans.append(Span(name, start, end))

    def read(self) -> dict[str, float]:
        """Seconds by stage so far, with the total."""
        self.seconds["total"] = time.perf_counter() - self._start
        return {name: round(value, 4) for name, value in self.seconds.items()}


def build_report(
    document: Document,
    puppets: dict[int, Puppet],
    energies: dict[int, tuple[float, ...]],
    result: Composite,
    stopwatch: Stopwatch,
) -> dict[str, Any]:
    """`R.json` of the document's first lifted object, and a list of all where there are several.

    `puppets` of the lifted objects and the `energies` of their solves are by their indices.
    """
    width, height = document.photo.size
    first = min(puppets)
    used = dict(document.backends)
    shares, beside = result.shares, erased_beside(document, holes(document))
    report = {
        "version": VERSION,
        "photo": {"width": width, "height": height},
        **_of_object(document, first, puppets[first], energies.get(first, (0.0,))),
        "pixels": {
            "changed": result.changed,
            "outside_footprint_changed": result.outside_footprint_changed,
            "shadow": result.shadow,
            "beside": sum(piece.px for piece in beside),
            "beside_like_object": sum(piece.like_px for piece in beside),
            "from_photo": shares.from_photo,
            "from_lifter": shares.from_lifter,
            "from_inpainter": shares.from_inpainter,
            "from_refiner": shares.from_refiner,
            "from_paint": shares.from_paint,
        },
        "backends": {
            stage: used.get(stage, "none") for stage in ("segment", "lift", "inpaint", "refine")
        },
        "seconds": stopwatch.read(),
        "peak_memory_mb": peak_memory_mb(),
    }  # fmt: skip
    if len(document.objects) > 1:
        report["objects"] = [
            {"number": k + 1, "name": item.name, "role": role_of(document.objects, k)}
            | (
                _of_object(document, k, puppets[k], energies.get(k, (0.0,)))
                if k in puppets
                else {"object": {"mask_area_px": 0 if item.mask is None else int(item.mask.sum())}}
            )
            for k, item in enumerate(document.objects)
        ]
    return report


def role_of(objects: tuple[EditObject, ...], k: int) -> str:
    """What an object is to the edit."""
    item = objects[k]
    if item.lifted is None:
        return "stays in front" if item.stays_in_front else "selected"
    if not item.is_visible:
        return "removed"
    is_copy = any(other.lifted is item.lifted for other in objects[:k])
    return "copy" if is_copy else "edited" if item.is_moved else "at rest"


def _of_object(
    document: Document, k: int, puppet: Puppet, energies: tuple[float, ...]
) -> dict[str, Any]:
    """The figures of a lifted object.

    `reached` is where a handle's surface point is seen before the placement: handles deform
    first, and their targets are in the picture of that moment.
    """
    item = document.objects[k]
    lifted = item.lifted
    assert lifted is not None and item.mask is not None, "these are of a lifted object"
    camera = document.photo.camera
    handles = []
    for handle in item.handles:
        at = puppet.picture_of(handle.point, None, Placement())
        to = camera.project(lifted.world_points(handle.target))
        reached = puppet.picture_of(handle.point, item.pose, Placement())
        handles.append({
            "from": _px(at), "to": _px(to), "reached": _px(reached),
            "error_px": round(float(np.linalg.norm(reached - to)), 4),
        })  # fmt: skip
    trust = trust_in(puppet.posed(item.pose, item.placement))
    return {
        "trust": {
            "sign": trust.sign, "invented": round(trust.invented, 4),
            "astray": round(trust.astray, 4),
        },
        "object": {
            "mask_area_px": int(item.mask.sum()),
            "gaussians": len(lifted.body),
            "edge_gaussians": len(lifted.gaussians) - len(lifted.body),
            "control_points": len(lifted.control_points),
            "links": puppet.deformer.graph.link_count,
            "components": puppet.deformer.graph.component_count,
            "kind": lifted.kind or None,
        },
        "handles": handles,
        "energy": {
            "start": energies[0], "end": energies[-1], "iterations": max(len(energies) - 1, 0),
        },
    }  # fmt: skip


def taken_for(document: Document) -> str:
    """What the turned objects were recognised as, to be appended; empty where nothing plain is."""
    plain = {"round": "something round", "box": "a box", "flat": "something flat", "tube": "a tube"}
    told = [
        f"{item.name} taken for {plain[item.lifted.kind]}"
        for item in document.objects
        if item.lifted is not None and item.lifted.kind in plain and any(item.placement.turn)
    ]
    return f"; {', '.join(told)}" if told else ""


def provenance(result: Composite) -> str:
    """How much of the photo an edit changed, and where those pixels come from; no full stop."""
    if not result.changed:
        return "nothing changed"
    shares = result.shares
    parts = (
        (shares.from_photo, "the photo's own"),
        (shares.from_lifter, "the unseen side"),
        (shares.from_inpainter, "filled-in background"),
        (shares.from_paint, "painted"),
        (shares.from_refiner, "refined"),
    )
    named = ", ".join(f"{share:.0%} {name}" for share, name in parts if share >= 0.005)
    share = result.changed / result.pixels[..., 0].size
    return f"{share:.0%} of the photo changed (of these pixels {named})"


def peak_memory_mb() -> float:
    """Return the largest resident memory of this process so far, MB; 0 where it is unknown."""
    with contextlib.suppress(OSError):  # Linux; getrusage would count who started us, too
        found = re.search(r"^VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text("ascii"), re.M)
        if found:
            return round(int(found[1]) * 1024 / 1e6, 1)
    if sys.platform == "win32":
        return 0.0
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return round(peak / 1e6 if sys.platform == "darwin" else peak * 1024 / 1e6, 1)


def _px(xy: np.ndarray) -> list[float]:
    return [round(float(v), 3) for v in xy]
