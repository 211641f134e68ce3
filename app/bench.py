"""`objectmorpher bench`: measures, on objects it makes itself. It reports and judges nothing."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable
from itertools import cycle
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull

from objectmorpher_core.arrays import F64
from objectmorpher_core.camera import Camera
from objectmorpher_core.deform.control_points import sample_control_points
from objectmorpher_core.deform.deformer import Deformer
from objectmorpher_core.document import DeformSettings, Handle, LiftedObject, PhotoTexture, Pose
from objectmorpher_core.gaussians import Gaussians
from objectmorpher_core.rotations import quats_along, turn_matrix

GAUSSIANS = 100_000
QUICK_GAUSSIANS = 5_000
REPEATS, QUICK_REPEATS = 100, 5
FRAME, LARGE_FRAME = 0.010, 0.016  # s, the budget of a default frame; with more than 512 nodes
COLD = 9  # bends from rest, each in one frame; the first, which loads what is compiled, is not one
LIMBS = 5
LENGTH, RADIUS = 0.5, 0.07  # of a limb
PEER_VERTICES = 642
STEPS = 60  # of a drag
BEND = 90.0  # degrees


def run_bench(what: str, is_quick: bool) -> dict[str, Any]:
    """The figures of one benchmark (DESIGN section 6), ready for JSON."""
    rows = {"deform": bench_deform}[what](is_quick)
    machine = {"cpu": _cpu(), "cores": os.cpu_count(), "gl_renderer": None}
    return {"machine": machine, "rows": rows}


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
        """One frame of a drag that goes to and fro."""
        nonlocal pose
        pose = deformer.solve(next(drag), start=pose, seconds=frame_seconds).pose

    frames = _times(frame, repeats)
    sets = [handles[:-1], handles]

    def change_set() -> None:
        sets.reverse()
        deformer.prepare(sets[0])

    skins = _times(lambda: deformer.skin_gaussians(cold[-1].pose), max(repeats // 5, 3))
    return {
        "mode": mode,
        "nodes": len(deformer.points),
        "links": deformer.graph.link_count,
        "handles": len(handles),
        "solve_ms": _ms(np.median(frames)),
        "solve_p99_ms": _ms(np.percentile(frames, 99)),
        "set_handles_ms": _ms(np.median(_times(change_set, max(repeats // 5, 3)))),
        "energy_gap": round(gap, 6),
        "skin_ms": _ms(np.median(skins)),
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


def five_limbs(count: int, nodes: int) -> LiftedObject:
    """Round limbs, open at their ends, in a plane around a ball: about `count` Gaussians."""
    rng = np.random.default_rng(0)
    each = count // (LIMBS + 1)
    points, normals = [], []
    for limb in range(LIMBS):
        angle = 2 * np.pi * limb / LIMBS
        axis = np.array([np.cos(angle), np.sin(angle), 0.0])
        side = np.array([-axis[1], axis[0], 0.0])
        around = rng.uniform(0, 2 * np.pi, each)
        along = rng.uniform(0.3 * LENGTH, LENGTH, each)
        normal = np.cos(around)[:, None] * side + np.sin(around)[:, None] * [0.0, 0.0, 1.0]
        points.append(along[:, None] * axis + RADIUS * normal)
        normals.append(normal)
    ball = rng.normal(size=(each, 3))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    means, outward = np.concatenate([*points, 0.18 * ball]), np.concatenate([*normals, ball])
    spacing = 0.01
    scales = np.tile(spacing * np.array([1, 1, 0.2], np.float32), (len(means), 1))
    grey = np.full((len(means), 3), 0.5, np.float32)
    solid = np.ones(len(means), np.float32)
    gaussians = Gaussians(
        means.astype(np.float32), quats_along(outward).astype(np.float32), scales, solid, grey
    )
    control_points = sample_control_points(gaussians.means, gaussians.opacities, nodes)
    world_from_object = np.eye(4)
    world_from_object[2, 3] = 3.0
    camera = Camera.from_fov(1024, 1024)
    u0 = camera.project(means + world_from_object[:3, 3]).astype(np.float32)
    seen = np.ones(len(means), np.float32)
    texture = PhotoTexture(u0, seen, seen)
    return LiftedObject(gaussians, texture, control_points, world_from_object, spacing, "bench")


def limb_handles(lifted: LiftedObject, degrees: float) -> tuple[Handle, ...]:
    """Two handles at the end of each limb; the first limb's are turned about its root."""
    points = lifted.control_points.astype(np.float64)
    chosen: list[Handle] = []
    turn = turn_matrix(0.0, 0.0, degrees)
    for limb in range(LIMBS):
        angle = 2 * np.pi * limb / LIMBS
        axis = np.array([np.cos(angle), np.sin(angle), 0.0])
        for up in (RADIUS, -RADIUS):
            tip = LENGTH * axis + [0.0, 0.0, up]
            node = int(((points - tip) ** 2).sum(1).argmin())
            root = 0.25 * axis
            target = points[node] if limb else root + turn @ (points[node] - root)
            if all(h.control_point != node for h in chosen):
                chosen.append(Handle(node, points[node], target, is_pin=limb > 0))
    return tuple(chosen)


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
    times = _times(lambda: igl.arap_solve(targets, data, vertices.copy()), repeats)
    return {
        "mode": "libigl", "nodes": len(vertices), "links": 3 * len(faces) // 2,
        "handles": len(held), "solve_ms": _ms(np.median(times)),
        "solve_p99_ms": _ms(np.percentile(times, 99)),
    }  # fmt: skip


def even_sphere(count: int) -> tuple[F64, np.ndarray]:
    """Vertices (count, 3) spread evenly over the unit sphere, and triangles between them."""
    k = np.arange(count) + 0.5
    height, angle = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    radius = np.sqrt(1 - height**2)
    vertices = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), height])
    faces = ConvexHull(vertices).simplices.astype(np.int64)
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = (normals * corners[:, 0]).sum(1) < 0
    faces[inward] = faces[inward, ::-1]
    return vertices, faces


def _times(run: Callable[[], Any], repeats: int) -> list[float]:
    run()  # whatever is done once
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        run()
        times.append(time.perf_counter() - start)
    return times


def _ms(seconds: Any) -> float:
    return round(1000 * float(seconds), 3)


def _cpu() -> str:
    """The processor's name as the system tells it."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            return next(x.split(":", 1)[1].strip() for x in file if x.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()
