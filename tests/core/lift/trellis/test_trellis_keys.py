"""The networks have the keys and shapes of the published weights, exactly."""

# ruff: noqa: E402 (nothing that needs torch can be imported before the skip)
from __future__ import annotations

import json
from pathlib import Path

import pytest

torch = pytest.importorskip("torch", reason="TRELLIS needs torch")

from objectmorpher_core.lift.trellis.parts import build

LISTS = [
    (list_["source"], name, part)
    for path in sorted(Path(__file__).parent.glob("*_keys.json"))
    for list_ in [json.loads(path.read_text(encoding="utf-8"))]
    for name, part in list_["parts"].items()
]


@pytest.mark.parametrize(("source", "name", "published"), LISTS, ids=[name for _, name, _ in LISTS])
def test_keys_and_shapes_are_the_published_ones(source, name, published):
    with torch.device("meta"):
        part = build(published["config"])
    blocks = range(published["config"]["args"].get("num_blocks", 0))
    wanted = {
        key.replace("*", str(block)): tuple(shape)
        for key, shape in published["shapes"].items()
        for block in (blocks if "*" in key else [0])
    }
    assert {key: tuple(t.shape) for key, t in part.state_dict().items()} == wanted
    assert len(wanted) == published["keys"]
    assert sum(p.numel() for p in part.parameters()) == published["parameters"]
