"""What users do first, each with a part of the program that compiles something.

`python first_jobs.py FOLDER` warms up and then does all of it in one process; it says, as JSON, how
many kernels the warm-up looked for, which others were asked for afterwards, and which for arrays
that differ only in whether they may be written to: `test_warm_up`.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from objectmorpher.canvas.shape import build_shape, rehearse
from objectmorpher.system.warm_up import warm_up
from objectmorpher.worker import job_functions
from objectmorpher.worker.job_functions import BackendChoice, Cut
from objectmorpher_core.base import kernel_files
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.progress import silent
from objectmorpher_core.deform.puppet import Puppet
from objectmorpher_core.document.model import (
    EditObject,
    Handle,
    LiftedObject,
    LiftSettings,
    Matte,
    Placement,
)
from objectmorpher_core.document.settings import DeformSettings
from objectmorpher_core.lift.registration.imported import ImportTarget
from objectmorpher_core.segment.mask_edit import feather
from objectmorpher_core.splat_files import encode
from tests.core.lift import registered
from tests.core.segment.truth_masks import truth_mask
from tests.photos import photo

COUNT = 12_000  # Gaussians: so many that a drag is drawn from fewer


def asked_for() -> set[str]:
    """Kernels, each with the types that it is called with, that numba looks for on the disk.

    Those of the calls that come; where there is no such file yet, it is compiled.
    """
    names, load = set[str](), kernel_files.files.load

    def noted(files: Any, key: Any) -> Any:
        names.add(f"{files._index_name} {key[0]}")
        return load(files, key)

    kernel_files.files.load = noted
    return names


def import_everything(folder: Path) -> None:
    """Surfels, blobs and a mesh are registered to a photo, and made ready to be dragged."""
    surfels, scene = registered.known_bracket()
    blobs = replace(surfels, scales=np.full_like(surfels.scales, surfels.scales.mean()))
    for name, gaussians in (("surfels.spz", surfels), ("blobs.ply", blobs)):
        (folder / name).write_bytes(encode(gaussians, folder / name))
    trimesh.creation.box([1, 0.6, 0.3]).export(folder / "box.glb")
    for name, depth, is_free in (
        ("surfels.spz", np.uint8, True),
        ("blobs.ply", np.uint16, False),
        ("box.glb", np.uint8, False),
    ):
        pixels = scene.pixels.astype(depth)
        place = ImportTarget(pixels, scene.camera, scene.mask, is_free)
        found, matte, lifted = job_functions.import_object(folder / name, place, 0, silent)
        camera = found.registration.best.camera
        get_ready(camera, matte, lifted)
        start = found.registration.best.world_from_object
        job_functions.fit_object(place, found.gaussians, start, 0, silent)


def lift_and_repair() -> None:
    """A cup, as the photo shows it and as somebody says that it is; and what is behind it."""
    for depth in (np.uint8, np.uint16):
        pixels = photo("coffee").astype(depth)
        pixels *= np.iinfo(depth).max // 255
        mask = truth_mask("coffee")
        camera = Camera.from_fov(pixels.shape[1], pixels.shape[0])
        nearness = np.zeros((40, 60), np.float32)
        nearness[10:20] = 0.1
        said = LiftSettings(
            COUNT, is_symmetric=True, back="continued", hidden=np.roll(mask, 200, 1),
            nearness=nearness,
        )  # fmt: skip
        for selection, shape in ((mask, LiftSettings(COUNT)), (feather(mask, 4), said)):
            cut = Cut(pixels, camera, selection)
            matte, lifted = job_functions.lift(cut, BackendChoice("auto"), shape, silent)
        get_ready(camera, matte, lifted)
        job_functions.inpaint(pixels, mask, BackendChoice("auto"), silent)
        pose_in_all_ways(lifted, camera)


def get_ready(camera: Camera, matte: Matte, lifted: LiftedObject) -> None:
    rehearse(build_shape(camera, EditObject("", matte=matte, lifted=lifted)), camera)


def pose_in_all_ways(lifted: LiftedObject, camera: Camera) -> None:
    first, last = lifted.control_points[0], lifted.control_points[-1]
    pin = Handle(len(lifted.control_points) - 1, last, last, is_pin=True)
    handles = (Handle(0, first, first + 0.1), pin)
    for settings in (
        DeformSettings(), DeformSettings("laplacian", "euclidean", is_splitting=True),
        DeformSettings(is_faithful=True), DeformSettings(stiffness=2.0, stretch_limit=1.2),
    ):  # fmt: skip
        puppet = Puppet(lifted, settings, camera)
        pose = puppet.deformer.solve(handles).pose
        puppet.deformer.strain(pose)
        puppet.posed(pose, Placement())


if __name__ == "__main__":
    names = asked_for()
    warm_up()
    warm = set(names)
    import_everything(Path(sys.argv[1]))
    lift_and_repair()
    alike = Counter(name.replace("readonly ", "") for name in names)
    twins = sorted(name for name, count in alike.items() if count > 1)
    print(json.dumps({"warm": len(warm), "others": sorted(names - warm), "twins": twins}))
