"""A peer: gsplat's own torch functions, where torch and gsplat are installed.

They project on the CPU; its rasteriser needs CUDA, so that these rows tell of the projection and
the sort alone.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from .scenes import BenchScene
from .timing import Effort, measure

NAME = "gsplat-torch"
NOTE = "projection and sort only, of what is not skinned: its rasteriser needs CUDA"


def rows(scene: BenchScene, effort: Effort) -> list[dict[str, Any]]:
    """The scene's Gaussians projected, where that is possible and they are a plain cloud."""
    if scene.name != "cloud":
        return []
    try:
        import torch  # type: ignore[import-not-found]
        from gsplat.cuda import _torch_impl as gsplat  # type: ignore[import-not-found]
    except ImportError:
        return []
    gaussians, camera = scene.posed_gaussians(), scene.camera
    means, quats, scales = (
        torch.from_numpy(np.array(values))
        for values in (gaussians.means, gaussians.quats, gaussians.scales)
    )
    intrinsics = [[camera.focal, 0, camera.cx], [0, camera.focal, camera.cy], [0, 0, 1]]
    views, lenses = torch.eye(4)[None], torch.tensor(intrinsics, dtype=torch.float32)[None]

    def project(_: int) -> Any:
        covariances, _precisions = gsplat._quat_scale_to_covar_preci(quats, scales, True, False)
        return gsplat._fully_fused_projection(
            means, covariances, views, lenses, camera.width, camera.height
        )

    def sort(_: int) -> Any:
        return torch.argsort(means[:, 2])

    effort = replace(effort, least=min(effort.least, 3))  # it takes seconds
    with torch.inference_mode():
        projecting, sorting = measure(project, effort), measure(sort, effort)
        both = measure(lambda k: (project(k), sort(k)), effort)
    return [scene.row(NAME, both, sorting, project_ms=projecting) | {"note": NOTE}]
