"""The tables of docs/formats.md: what each format costs and keeps.

    python docs/formats/make_formats.py

Errors are of 20,000 Gaussians of an object one unit large, times of a million, medians of three.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from statistics import median
from typing import Any

import numpy as np
from scipy.spatial import KDTree

from objectmorpher_core.document.gaussians import Gaussians
from objectmorpher_core.splat_files import FORMATS

SMALL, LARGE, RUNS = 20_000, 1_000_000, 3


def main() -> None:
    small, large = shell(SMALL), shell(LARGE)
    print("| | position, x extent | scale | turn, degrees | opacity | colour |")
    print("|---|---|---|---|---|---|")
    for ending, form in FORMATS.items():
        print(f"| `{ending}` | {' | '.join(errors(form.decode(form.encode(small)), small))} |")
    print("\n| | bytes a Gaussian | read 1 M, s | write 1 M, s |\n|---|---|---|---|")
    for ending, form in FORMATS.items():
        data = form.encode(large)
        reading, writing = seconds(form.decode, data), seconds(form.encode, large)
        print(f"| `{ending}` | {len(data) / LARGE:.1f} | {reading:.2f} | {writing:.2f} |")


def shell(count: int) -> Gaussians:
    """Flat Gaussians on a bumpy ball one unit large, as an object's surface has them."""
    rng = np.random.default_rng(0)
    means = rng.normal(size=(count, 3))
    means /= 2 * np.linalg.norm(means, axis=1, keepdims=True)
    means *= 1 - 0.2 * np.abs(np.sin(9 * means[:, :1]))
    quats = rng.normal(size=(count, 4))
    quats /= np.linalg.norm(quats, axis=1, keepdims=True)
    size = 2 / np.sqrt(count)
    scales = size * np.array([1, 0.8, 0.15]) * np.exp(rng.normal(0, 0.2, (count, 3)))
    colors = 0.5 + 0.4 * np.sin(7 * means + rng.normal(0, 0.2, (count, 3)))
    parts = (means, quats, scales, rng.uniform(0.05, 1, count), colors)
    return Gaussians(*(part.astype(np.float32) for part in parts))


def errors(back: Gaussians, cloud: Gaussians) -> list[str]:
    """Median / largest of each value's error, as a row's cells."""
    # Formats store another order. Places alone may be closer together than a format's step.
    there, here = (np.column_stack([c.means, c.colors, c.opacities]) for c in (back, cloud))
    back = back.select(KDTree(there).query(here)[1])
    dots = (back.quats * cloud.quats).sum(1, keepdims=True)
    apart = np.linalg.norm(back.quats - np.sign(dots) * cloud.quats, axis=1)
    turn = np.degrees(4 * np.arcsin(np.minimum(apart / 2, 1)))
    found = {
        "position": np.linalg.norm(back.means - cloud.means, axis=1),
        "scale": np.abs(back.scales / cloud.scales - 1),
        "turn": turn,
        "opacity": np.abs(back.opacities - cloud.opacities),
        "colour": np.abs(back.colors - cloud.colors),
    }
    return [f"{np.median(e):.1g} / {e.max():.1g}" for e in found.values()]


def seconds(act: Callable[[Any], object], argument: object) -> float:
    taken = []
    for _ in range(RUNS):
        start = time.perf_counter()
        act(argument)
        taken.append(time.perf_counter() - start)
    return median(taken)


if __name__ == "__main__":
    main()
