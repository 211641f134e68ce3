"""The ways to deform that are compared, each made of the library's parts, and their figures."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from models import Model

from objectmorpher_core.base.arrays import F64
from objectmorpher_core.deform.arap import ArapSolver, iterate
from objectmorpher_core.deform.binding import bind
from objectmorpher_core.deform.deformer import FAITHFUL_ITERATIONS, Deformer, Strain, measure_strain
from objectmorpher_core.deform.graph import build_graph
from objectmorpher_core.deform.skinning import Motion, Skinned, skin_faithful
from objectmorpher_core.document.model import Handle, LiftedObject, Pose
from objectmorpher_core.document.settings import DeformSettings

REPEATS = 5
DRAG_STEPS = 60
FAITHFUL = DeformSettings(is_faithful=True)

Handles = tuple[Handle, ...]


@dataclass(frozen=True, eq=False)
class Method:
    """A deformer, and what is done otherwise than by it."""

    name: str
    build: Callable[[LiftedObject], Deformer]
    solve: Callable[[Deformer, Handles], Pose]
    skin: Callable[[Deformer, F64, Pose], Skinned]


def _built(**settings) -> Callable[[LiftedObject], Deformer]:
    return lambda lifted: Deformer(lifted, DeformSettings(**settings))


def with_papers_links(lifted: LiftedObject) -> Deformer:
    """Our deformer on the graph that the paper's rule gives."""
    deformer = Deformer(lifted, DeformSettings())
    deformer.graph = build_graph(deformer.points, FAITHFUL)
    deformer.binding = bind(lifted.gaussians.means, deformer.points, deformer.graph)
    deformer._solver = ArapSolver(deformer.points, deformer.graph.weights)
    return deformer


def _solve(deformer: Deformer, handles: Handles) -> Pose:
    return deformer.solve(handles).pose


def _hinged(deformer: Deformer, handles: Handles) -> Pose:
    """Pins hold a place, not a turn."""
    return _solve(deformer, tuple(replace(h, turn=None) if h.is_pin else h for h in handles))


def _three_iterations(deformer: Deformer, handles: Handles) -> Pose:
    deformer.prepare(handles)
    rotations = deformer.rest().rotations
    minimum = iterate(deformer._solver, rotations, FAITHFUL_ITERATIONS)
    return Pose(minimum.positions, minimum.rotations)


def _stepwise(deformer: Deformer, handles: Handles) -> Pose:
    """As in a drag: three iterations a step, each from where the last one ended."""
    pose = deformer.rest()
    for step in range(1, DRAG_STEPS + 1):
        share = step / DRAG_STEPS
        on_the_way = tuple(
            replace(h, target=h.point + share * (h.target - h.point),
                    turn=None if h.turn is None else share * h.turn)
            for h in handles
        )  # fmt: skip
        pose = deformer.solve(on_the_way, start=pose).pose
    return pose


def _skin(deformer: Deformer, points: F64, pose: Pose) -> Skinned:
    return deformer.skin_points(points, pose)


def _skin_by_eq5(deformer: Deformer, points: F64, pose: Pose) -> Skinned:
    motion = Motion(deformer.points, pose.points, pose.rotations)
    binding = bind(points, deformer.points, deformer.graph)
    return skin_faithful(points, binding, motion, deformer.graph)


OURS = Method("Ours", _built(), _solve, _skin)
LAPLACIAN = Method("Laplacian instead of ARAP", _built(mode="laplacian"), _solve, _skin)
PAPERS_LINKS = Method("The paper's links", with_papers_links, _solve, _skin)
EUCLIDEAN = Method("Euclidean links", _built(links="euclidean"), _solve, _skin)
STEPS = Method("The paper, dragged in 60 steps", _built(is_faithful=True), _stepwise, _skin)
HINGES = Method("Pins that are hinges", _built(), _hinged, _skin)
THREE = Method("3 iterations from rest", _built(), _three_iterations, _skin)
EQ5 = Method("Eq. 5 skinning", _built(), _solve, _skin_by_eq5)
PAPER = Method("The paper as printed", _built(is_faithful=True), _solve, _skin)
METHODS = (OURS, LAPLACIAN, PAPERS_LINKS, EUCLIDEAN, HINGES, THREE, EQ5, PAPER, STEPS)


@dataclass(frozen=True, eq=False)
class Result:
    """What a method made of a task."""

    pose: Pose
    skinned: Skinned  # of the mesh's vertices
    normals: F64  # (N, 3) of the posed mesh
    energy: float  # x 1e-3, see README
    stretch: float
    squeeze: float
    volume: float  # %, change
    area: float  # %, change
    miss: float  # % of the diameter
    flipped: float  # % of the area
    milliseconds: float


def apply(method: Method, model: Model, handles: Handles, repeats: int = REPEATS) -> Result:
    """Solves, skins and measures."""
    mesh, lifted = model.mesh, model.lifted
    deformer = method.build(lifted)
    pose = method.solve(deformer, handles)
    skinned = method.skin(deformer, mesh.points, pose)
    most, least = mesh.stretches(skinned.points)
    clicked = method.skin(deformer, np.array([h.point for h in handles]), pose).points
    misses = np.linalg.norm(clicked - [h.target for h in handles], axis=1)
    return Result(
        pose=pose,
        skinned=skinned,
        normals=mesh.normals(skinned.points),
        energy=1e3 * float(strain_of(lifted, pose).energy.mean()),
        stretch=float(np.quantile(most, 0.999)),
        squeeze=float(np.quantile(least, 0.001)),
        volume=100 * (mesh.volume(skinned.points) / mesh.volume(mesh.points) - 1),
        area=100 * (mesh.area(skinned.points) / mesh.area(mesh.points) - 1),
        miss=100 * float(misses.max()) / lifted.diameter,
        flipped=100 * inside_out(model, skinned.points),
        milliseconds=_milliseconds(method, lifted, handles, repeats),
    )


def strain_of(lifted: LiftedObject, pose: Pose) -> Strain:
    """Strain of the posed control points on our links, with the rotations that fit them best."""
    deformer = OURS.build(lifted)
    solver = ArapSolver(deformer.points, deformer.graph.weights)
    rotations = solver.fit(pose.points, pose.rotations)[0]
    return measure_strain(deformer.points, deformer.graph.weights, Pose(pose.points, rotations))


def inside_out(model: Model, posed: F64) -> float:
    """Share of the surface whose turn differs by over a right angle from a smooth neighbour's."""
    mesh = model.mesh
    a, b, c = mesh.corners(posed)
    faces = np.cross(b - a, c - a)
    around = mesh.normals(posed)
    mean = sum(around[mesh.faces[:, k]] for k in range(3))
    area = np.linalg.norm(faces, axis=1)
    return float(area[(faces * mean).sum(1) < 0].sum() / area.sum())


def _milliseconds(method: Method, lifted: LiftedObject, handles: Handles, repeats: int) -> float:
    """Median of the solve from rest; the links are built and the handles' set is known.

    The thread's own time: what else the machine does is not in it.
    """
    if not repeats:
        return 0.0
    deformer = method.build(lifted)
    method.solve(deformer, handles)
    times = []
    for _ in range(repeats):
        start = time.thread_time()
        method.solve(deformer, handles)
        times.append(1e3 * (time.thread_time() - start))
    return float(np.median(times))
