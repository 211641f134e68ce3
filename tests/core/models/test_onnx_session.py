"""onnxruntime runs our networks and tells nobody: no number of this device, no event, no call."""

from __future__ import annotations

import logging
import os
import sys
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from objectmorpher_core.models import onnx_session
from objectmorpher_core.models.device import DEVICE
from tests.core.models.small_networks import brightness
from tests.faults import network
from tests.faults.tracer import missing
from tests.tree import PYTHONPATH

ROOT = Path(__file__).parents[3]
FIRST_THAT_TELLS = (1, 29)  # of onnxruntime's versions
OURS = """
import sys
from pathlib import Path
import numpy as np
from objectmorpher_core.models.depth_net import DepthNet
print(DepthNet(Path(sys.argv[1])).inverse_depth(np.zeros((70, 98, 3), np.uint8)).ndim)
"""
BARE = """
import sys
import numpy as np
import onnxruntime
session = onnxruntime.InferenceSession(sys.argv[1], providers=["CPUExecutionProvider"])
print(session.run(None, {"image": np.zeros((1, 3, 70, 98), np.float32)})[0].ndim)
"""


def run(code: str, home: Path, **more: str) -> tuple[list[str], list[network.Attempt]]:
    """The files that a program leaves in its fresh home, and its calls to the network.

    Of the environment nothing else is there: on machines of CI onnxruntime is silent by itself.
    """
    net = home.parent / "net.onnx"
    net.write_bytes(brightness())
    home.mkdir()
    environment = {"PATH": os.environ["PATH"], "HOME": str(home), "PYTHONPATH": PYTHONPATH}
    environment |= {"XDG_CACHE_HOME": str(home / "cache"), **more}
    command = [sys.executable, "-c", code, str(net)]
    status, said, tried = network.run(command, home, environment)
    assert status == 0, said
    return sorted(str(p.relative_to(home)) for p in home.rglob("*") if p.is_file()), tried


traced = pytest.mark.skipif(bool(missing()), reason=missing())


@traced
@pytest.mark.parametrize("setting", [{}, {"ORT_DISABLE_TELEMETRY": "0"}])
def test_a_network_is_run_and_nothing_is_left_or_sent(
    tmp_path: Path, setting: dict[str, str]
) -> None:
    assert run(OURS, tmp_path / "home", **setting) == ([], [])


@traced
@pytest.mark.skipif(
    tuple(int(n) for n in version("onnxruntime").split(".")[:2]) < FIRST_THAT_TELLS,
    reason="this onnxruntime keeps no records",
)
def test_an_onnxruntime_that_is_opened_elsewhere_is_found_out(tmp_path: Path) -> None:
    files, _ = run(BARE, tmp_path / "home")
    assert {Path(name).name for name in files} >= {"deviceid", "onnxruntime.db"}


def test_a_gpu_is_taken_where_onnxruntime_has_it_and_none_is_forbidden(monkeypatch) -> None:
    monkeypatch.setattr(onnx_session, "_useless", set())
    monkeypatch.delenv(DEVICE, raising=False)
    there = ["AzureExecutionProvider", onnx_session.CPU]
    assert onnx_session.chosen_provider(there) == onnx_session.CPU
    for name in reversed(onnx_session.PROVIDERS):  # each quicker than those before
        there.insert(0, name)
        assert onnx_session.chosen_provider(there) == name
    monkeypatch.setenv(DEVICE, "cpu")
    assert onnx_session.chosen_provider(there) == onnx_session.CPU


def test_networks_go_on_on_the_cpu_and_one_line_says_so(tmp_path, monkeypatch, caplog) -> None:
    """The GPU's driver is missing: onnxruntime cannot open the session there."""
    monkeypatch.setattr(onnx_session, "_useless", set())
    (tmp_path / "net.onnx").write_bytes(brightness())
    (provider, *_) = onnx_session.PROVIDERS

    def opened(name: str) -> Any:
        path = tmp_path / ("net.onnx" if name == onnx_session.CPU else "driver.so")
        return onnx_session._runtime().InferenceSession(str(path), providers=[onnx_session.CPU])

    x = np.random.default_rng(0).random((1, 3, 28, 42), np.float32)
    with caplog.at_level(logging.INFO, onnx_session.__name__):
        found = [onnx_session._OnGpu(provider, opened).run(None, {"image": x}) for _ in range(2)]
    wanted = onnx_session.open_session(tmp_path / "net.onnx").run(None, {"image": x})
    assert all(np.array_equal(a, b) for one in found for a, b in zip(one, wanted, strict=True))
    assert [r.message.split(":")[0] for r in caplog.records] == ["Networks run on the CPU"]
    assert onnx_session.chosen_provider([provider, onnx_session.CPU]) == onnx_session.CPU
