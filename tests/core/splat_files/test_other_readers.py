"""Other programs read what is written here, and theirs is read here: gsply and gaussforge.

Neither knows of axes: they hand out an .spz file's numbers as they stand (y up), so here they are
turned before they are compared. Neither has bounds for what our readers round, so both sides are
held to the rounding of one trip.

gsply's kernels run as the Python that they are: to compile them took 9 s, to run them on so few
Gaussians takes a tenth of one.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba.core import config

from objectmorpher_core.document.gaussians import Gaussians
from objectmorpher_core.splat_files import encode, read
from objectmorpher_core.splat_files.splats.ply import SH0, half_turned
from tests.core.splat_files.clouds import gaussians, matched, turn_between

with pytest.MonkeyPatch.context() as patch:
    patch.setattr(config, "DISABLE_JIT", True)
    gsply = pytest.importorskip("gsply", reason="gsply has no wheel for this machine")
gaussforge = pytest.importorskip("gaussforge", reason="gaussforge has no wheel for this machine")

SAME = 2e-5  # their float32 kernels against ours; measured 6e-6
CLOUD = gaussians(600)
STEP = 1 / 4096  # of an .spz position with 12 bits after the point, as both write


def theirs(data: Any) -> Gaussians:
    """gsply's arrays (log-scales, logits, harmonics) as ours."""
    colors = np.clip(0.5 + SH0 * data.sh0, 0, 1)
    opacities = 1 / (1 + np.exp(-data.opacities.reshape(-1).astype(np.float64)))
    parts = (data.means, data.quats, np.exp(data.scales), opacities, colors)
    return Gaussians(*(np.asarray(part).astype(np.float32) for part in parts))


def by_gsply(path: Path) -> Gaussians:
    return theirs(gsply.read_spz(path) if path.suffix == ".spz" else gsply.plyread(path))


def by_gaussforge(path: Path) -> Gaussians:
    """Its C++ decodes the file; what it writes as a plain .ply is read with gsply."""
    kind = "".join(path.suffixes)[1:]
    told = gaussforge.GaussForge().convert(path.read_bytes(), kind, "ply")
    assert "error" not in told, told
    plain = path.with_name("plain.ply")
    plain.write_bytes(told["data"])
    return theirs(gsply.plyread(plain))


def assert_same(one: Gaussians, other: Gaussians, step: float = 0.0) -> None:
    """The same values from two readers of one file."""
    one = matched(one, other)
    assert np.abs(one.means - other.means).max() <= step + SAME
    np.testing.assert_allclose(one.scales, other.scales, rtol=SAME * 10)
    np.testing.assert_allclose(one.opacities, other.opacities, atol=SAME)
    np.testing.assert_allclose(one.colors, other.colors, atol=SAME)
    np.testing.assert_allclose(one.covariances(), other.covariances(), atol=SAME, rtol=1e-3)


READERS: list[tuple[str, Callable[[Path], Gaussians]]] = [
    (".ply", by_gsply), (".compressed.ply", by_gsply), (".spz", by_gsply),
    (".ply", by_gaussforge), (".compressed.ply", by_gaussforge), (".spz", by_gaussforge),
    (".splat", by_gaussforge),
]  # fmt: skip


@pytest.mark.parametrize(("ending", "reader"), READERS)
def test_another_program_reads_from_our_file_what_we_read(ending, reader, tmp_path):
    path = tmp_path / f"ours{ending}"
    path.write_bytes(encode(CLOUD, path))
    other = reader(path)
    assert_same(half_turned(other) if ending == ".spz" else other, read(path))


@pytest.mark.parametrize(("ending", "reader"), READERS)
def test_another_program_sees_the_object_that_was_written(ending, reader, tmp_path):
    """Against the Gaussians themselves, to the format's precision: handedness, axes, order."""
    path = tmp_path / f"ours{ending}"
    path.write_bytes(encode(CLOUD, path))
    other = reader(path)
    other = matched(half_turned(other) if ending == ".spz" else other, CLOUD)
    assert np.abs(other.means - CLOUD.means).max() < 0.005
    assert turn_between(other, CLOUD).max() < 0.018
    assert np.abs(np.log(other.scales / CLOUD.scales)).max() < 0.033
    assert np.abs(other.colors - CLOUD.colors).max() < 0.005
    assert np.abs(other.opacities - CLOUD.opacities).max() < 0.003


def _written_by_gsply(path: Path, **how: Any) -> None:
    plain = path.with_name("source.ply")
    plain.write_bytes(encode(CLOUD, plain))
    data = gsply.plyread(plain)
    if path.suffix == ".spz":
        gsply.write_spz(path, data, **how)
    else:
        gsply.plywrite(path, data, **how)


@pytest.mark.parametrize(
    ("name", "how"),
    [("a.ply", {}), ("a.compressed.ply", {"compressed": True}), ("a.spz", {"version": 3}),
     ("a.spz", {"version": 4}), ("a.spz", {"version": 3, "fractional_bits": 18})],
)  # fmt: skip
def test_what_gsply_writes_is_read(name, how, tmp_path):
    path = tmp_path / name
    _written_by_gsply(path, **how)
    ours = read(path, is_flipped=path.suffix == ".spz")  # it writes y down even there
    assert_same(ours, by_gsply(path))
    assert turn_between(matched(ours, CLOUD), CLOUD).max() < 5e-3


@pytest.mark.parametrize(
    ("kind", "version"),
    [("ply", 3), ("compressed.ply", 3), ("splat", 3), ("spz", 2), ("spz", 3), ("spz", 4)],
)
def test_what_gaussforge_writes_is_read(kind, version, tmp_path):
    told = gaussforge.GaussForge().convert(
        encode(CLOUD, Path("a.ply")), "ply", kind, spz_version=version
    )
    assert "error" not in told, told
    path = tmp_path / f"theirs.{kind}"
    path.write_bytes(told["data"])
    ours = matched(read(path, is_flipped=kind == "spz"), CLOUD)  # it writes y down even there
    assert np.abs(ours.means - CLOUD.means).max() <= (0.005 if "." in kind else STEP)
    # version 2 derives w from three bytes: where w is near 0 that is coarse
    assert np.quantile(turn_between(ours, CLOUD), 0.99) < (0.15 if version == 2 else 0.02)
    assert turn_between(ours, CLOUD).max() < (0.3 if version == 2 else 0.02)
    assert np.abs(ours.colors - CLOUD.colors).max() < 0.005


def test_higher_harmonics_are_passed_over(tmp_path):
    """A degree-3 file of another program has the colour of its first coefficient."""
    rng = np.random.default_rng(1)
    plain = tmp_path / "source.ply"
    plain.write_bytes(encode(CLOUD, plain))
    source = gsply.plyread(plain)
    data = gsply.GSData.from_arrays(
        source.means, source.scales, source.quats, source.opacities, source.sh0,
        rng.normal(0, 0.2, (len(CLOUD), 15, 3)).astype(np.float32), format="ply",
    )  # fmt: skip
    for name in ("three.ply", "three.compressed.ply", "three.spz"):
        path = tmp_path / name
        if path.suffix == ".spz":
            gsply.write_spz(path, data)
        else:
            gsply.plywrite(path, data, compressed="compressed" in name)
        ours = matched(read(path, is_flipped=path.suffix == ".spz"), CLOUD)
        assert np.abs(ours.colors - CLOUD.colors).max() < 0.005, name
