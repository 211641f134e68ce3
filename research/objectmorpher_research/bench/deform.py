"""`objectmorpher bench deform`: solver and skinning."""

from __future__ import annotations

from itertools import cycle
from typing import Any

import numpy as np

from objectmorpher_core.deform.deformer import Deformer
from objectmorpher_core.document.model import Handle, Pose
from objectmorpher_core.document.settings import DeformSettings

from .bodies import even_sphere, five_limbs, limb_handles
from .timing import ms, times

GAUSSIANS = 100_000
QUICK_GAUSSIANS = 5_000
REPEATS, QUICK_REPEATS = 100, 5
FRAME, LARGE_FRAME = 0.010, 0.016  # s, the budget of a default frame; with more than 512 nodes
COLD = 9  # bends from rest, each in one frame; the first, which loads what is compiled, is not one
PEER_VERTICES = 642
STEPS = 60  # of a drag
BEND = 90.0  # degrees


def bench_deform(is_quick: bool) -> list[dict[str, Any]]:
    """Solver and skinning on a body with five limbs, one of which is bent by a right angle."""
    gaussians = QUICK_GAUSSIANS if is_quick else GAUSSIANS
    repeats = QUICK_REPEATS if is_quick else REPEATS
    sizes = (512,) if is_quick else (512, 1024, 2048)
    cases = [("faithful", 512)] + [("default", nodes) for nodes in sizes]
    rows = [_row(mode, nodes, gaussians, repeats) for mode, nodes in cases]
    peer = _libigl_row(repeats)
    return rows + ([peer] if peer else [])


def _row(mode: str, nodes: int, gaussians: int, repeats: int) -> dict[str, Any]:
    lifted = five_limbs(gaussians, nodes)
    deformer = Deformer(lifted, DeformSettings(is_faithful=mode == "faithful"))
    handles = limb_handles(lifted, BEND)
    frame_seconds = FRAME if nodes <= 512 else LARGE_FRAME
    deformer.prepare(handles)
    cold = [
        deformer.solve(handles, start=deformer.rest(), seconds=frame_seconds)
        for _ in range(COLD + 1)
    ]
    converged = _converged(deformer, handles, cold[-1].pose)
    gap = float(np.median([c.energies[-1] for c in cold[1:]])) / converged - 1
    there = [limb_handles(lifted, BEND * step / STEPS) for step in range(STEPS)]
    drag, pose = cycle([*there, *reversed(there)]), deformer.rest()

    def frame() -> None:
        """Compute one frame of a drag that goes to and fro."""
        nonlocal pose
        pose = deformer.solve(next(drag), start=pose, seconds=frame_seconds).pose

    frames = times(frame, repeats)
    sets = [handles[:-1], handles]

    def change_set() -> None:
        sets.reverse()
        deformer.prepare(sets[0])

    skins = times(lambda: deformer.skin_gaussians(cold[-1].pose), max(repeats // 5, 3))
    return {
        "mode": mode,
        "nodes": len(deformer.points),
        "links": deformer.graph.link_count,
        "handles": len(handles),
        "solve_ms": ms(np.median(frames)),
        "solve_p99_ms": ms(np.percentile(frames, 99)),
        "set_handles_ms": ms(np.median(times(change_set, max(repeats // 5, 3)))),
        "energy_gap": round(gap, 6),
        "skin_ms": ms(np.median(skins)),
        "gaussians": len(lifted.gaussians),
    }


def _converged(deformer: Deformer, handles: tuple[Handle, ...], start: Pose) -> float:
    """The energy from which nothing more is gained."""
    energies = [np.inf]
    for _ in range(20):
        solution = deformer.solve(handles, start=start)
        start = solution.pose
        energies.append(solution.energies[-1])
        if energies[-1] > energies[-2] * (1 - 1e-9):
            break
    return float(min(energies))


def _libigl_row(repeats: int) -> dict[str, Any] | None:
    """Three iterations of libigl on a sphere, where it is installed."""
    try:
        import igl  # type: ignore[import-not-found]
    except ImportError:
        return None
    vertices, faces = even_sphere(PEER_VERTICES)
    held = np.argsort(vertices[:, 2])[[0, 1, 2, 3, -1, -2, -3, -4]].astype(np.int32)
    data = igl.ARAPData()
    data.max_iter = 3
    igl.arap_precomputation(vertices, faces, 3, held, data)
    targets = vertices[held] + np.where(vertices[held, 2:] > 0, [[0.5, 0.0, 0.2]], 0.0)
    solves = times(lambda: igl.arap_solve(targets, data, vertices.copy()), repeats)
    return {
        "mode": "libigl", "nodes": len(vertices), "links": 3 * len(faces) // 2,
        "handles": len(held), "solve_ms": ms(np.median(solves)),
        "solve_p99_ms": ms(np.percentile(solves, 99)),
    }  # fmt: skip
