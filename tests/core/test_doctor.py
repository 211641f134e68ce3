"""What doctor advises is of use on the machine that it is asked on."""

from __future__ import annotations

from pathlib import Path

import pytest

from objectmorpher_core import doctor
from objectmorpher_core.doctor import StageReport
from objectmorpher_core.models import device


@pytest.fixture
def bare(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A user who has no models and no workers."""
    monkeypatch.setenv("OBJECTMORPHER_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("OBJECTMORPHER_WORKERS", str(tmp_path / "workers"))


def stages() -> dict[str, StageReport]:
    return {stage.name: stage for stage in doctor.look_at_stages()}


@pytest.mark.usefixtures("bare")
def test_without_a_gpu_no_network_is_advised_that_would_take_hours(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv(device.DEVICE, "cpu")
    found = stages()
    assert found["refine"].better.startswith("a GPU of 12 GB")
    assert "trellis" not in found["lift"].better and "dinov2-vits14" in found["lift"].better
    assert "lama" in found["background"].better and "pixelhacker" not in found["background"].better


@pytest.mark.usefixtures("bare")
def test_with_a_gpu_what_needs_one_is_advised(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("torch")
    monkeypatch.setattr(device, "devices", lambda: ("cuda", "cpu"))
    found = stages()
    assert "models get trellis-image-large" in found["lift"].better
    assert found["refine"].better.startswith("`") and "flux2-klein-4b" in found["refine"].better


@pytest.mark.usefixtures("bare")
def test_every_stage_says_what_it_uses_and_why_each_other_way_is_not_there() -> None:
    for stage in stages().values():
        assert stage.uses and stage.why and stage.better, stage.name
        assert all(reason and "\n" not in reason for _, reason in stage.others), stage.name
