"""What every lifter keeps to: the relief, generators of random weights, and a worker."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch", reason="TRELLIS needs torch")
pytest.importorskip("transformers", reason="TRELLIS needs transformers")

from objectmorpher_core import lift
from objectmorpher_core.base.progress import Cancelled, silent
from objectmorpher_core.document.model import SPLATTINGS, LiftSettings
from objectmorpher_core.lift.workers import file as worker_file
from objectmorpher_core.models import device
from objectmorpher_core.segment.matting.matte import build_matte
from tests.core.lift.trellis import tiny_trellis
from tests.core.lift.trellis.test_cupid_lifter import CUPID_PARTS, SHARED_PARTS
from tests.core.lift.triposplat import tiny_triposplat

pytestmark = pytest.mark.slow

WORKERS = Path(__file__).parents[4] / "packaging" / "workers"
NAMES = (*lift.BACKENDS, "card")
SETTINGS = LiftSettings(count=1500)


@pytest.fixture(scope="module", params=NAMES)
def lifter(request, tmp_path_factory):
    """With models of its own: those of random weights."""
    name = request.param
    root = tmp_path_factory.mktemp(name) / "models"
    if name == "trellis":
        tiny_trellis.write(root)
    elif name == "cupid":
        tiny_trellis.write_model(root / "cupid", CUPID_PARTS)
        tiny_trellis.write_encoder(root / "dinov2-with-registers-large")
        tiny_trellis.write_model(root / "trellis-image-large", SHARED_PARTS)
    with pytest.MonkeyPatch.context() as patch:
        if name == "triposplat":
            tiny_triposplat.bring(root / name, patch)
        patch.setenv("OBJECTMORPHER_CACHE", str(root.parent))
        patch.setenv(worker_file.FOLDER, str(WORKERS))
        patch.setenv(device.DEVICE, "cpu")
        yield lift.load(name)


@pytest.fixture(scope="module")
def whole(subject):
    pixels, camera, mask = subject
    return lift.LiftSubject(pixels, camera, mask, build_matte(pixels, mask, 12))


@pytest.fixture(scope="module")
def lifted(lifter, whole):
    """Its answer, and the steps that it told."""
    told = []
    before = whole.pixels.copy(), whole.mask.copy()
    found = lifter.lift(whole, SETTINGS, lambda share, note: told.append(share), 3)
    assert np.array_equal(before[0], whole.pixels) and np.array_equal(before[1], whole.mask)
    return found, told


def test_what_it_gives_is_whole_and_before_the_camera(lifter, lifted, whole):
    found, _ = lifted
    things, count = found.gaussians, len(found.gaussians)
    assert found.backend == lifter.name and count > 0 and found.splatting in SPLATTINGS
    arrays = things.means, things.quats, things.scales, things.opacities, things.colors
    assert all(np.isfinite(array).all() for array in arrays)
    assert (things.scales > 0).all() and np.allclose(np.linalg.norm(things.quats, axis=1), 1, 1e-4)
    assert things.opacities.min() >= 0 and things.opacities.max() <= 1
    assert found.texture.u0.shape == (count, 2)
    assert found.texture.visibility.shape == found.texture.solidity.shape == (count,)
    assert len(found.control_points) > 3 and np.isfinite(found.control_points).all()
    assert found.spacing > 0 and found.scale > 0
    world = found.world_points(found.body.means)
    assert (world[:, 2] > 0).all()
    middle = whole.camera.project(world).mean(0)
    rows, columns = np.nonzero(whole.mask)
    size = max(np.ptp(rows), np.ptp(columns))
    assert np.linalg.norm(middle - [columns.mean(), rows.mean()]) < size, "it lies at the mask"


def test_its_steps_go_from_nothing_to_one(lifted):
    told = lifted[1]
    assert len(told) > 2 and told == sorted(told) and told[0] >= 0 and told[-1] <= 1


def test_the_same_seed_gives_the_same_object(lifter, lifted, whole):
    again = lifter.lift(whole, SETTINGS, silent, 3)
    one, other = lifted[0], again
    for name in ("means", "quats", "scales", "opacities", "colors"):
        assert np.array_equal(getattr(one.gaussians, name), getattr(other.gaussians, name)), name
    assert np.array_equal(one.control_points, other.control_points)
    assert np.array_equal(one.world_from_object, other.world_from_object)


@pytest.mark.parametrize("share", [0.0, 0.5])
def test_it_can_be_cancelled(lifter, whole, share):
    def stop(fraction: float, note: str) -> None:
        if fraction >= share:
            raise Cancelled

    with pytest.raises(Cancelled):
        lifter.lift(whole, SETTINGS, stop, 0)
