"""What docs/model-measurements.md says that each network takes is counted; the registry agrees."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from objectmorpher_core import models
from objectmorpher_core.model_sets import PIPELINES

for package in ("torch", "transformers", "diffusers"):
    pytest.importorskip(package)

DOCS = Path(__file__).parents[3] / "docs" / "estimates"
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def pages() -> Iterator[Any]:
    """docs/estimates/make_estimates.py"""
    import transformers

    level = transformers.utils.logging.get_verbosity()
    transformers.utils.logging.set_verbosity_error()
    sys.path.insert(0, str(DOCS))
    try:
        import make_estimates

        yield make_estimates
    finally:
        sys.path.remove(str(DOCS))
        transformers.utils.logging.set_verbosity(level)


def test_the_pages_table_is_what_is_counted(pages: Any) -> None:
    assert pages.in_page(pages.PAGE.read_text(encoding="utf-8")) == pages.table()


@pytest.mark.parametrize(
    ("id", "networks"),
    [
        ("sam-vit-base", ("sam-vit-base",)), ("sam-vit-large", ("sam-vit-large",)),
        ("sam-vit-huge", ("sam-vit-huge",)), ("depth-anything-v2-small", ("depth",)),
        ("dinov2-with-registers-large", ("dino",)),
        ("pixelhacker", ("pixelhacker", "pixelhacker-vae")),
        ("triposplat", ("dino3", "klein-vae", "triposplat-flow", "triposplat-decoder")),
        ("moebius", ("moebius", "pixelhacker-vae")),
        ("qwen-image-edit-2511", ("qwen", "qwen-text", "qwen-vae")),
        ("flux2-klein-4b", ("klein", "klein-text", "klein-vae")),
    ],
)  # fmt: skip
def test_the_registrys_parameters_are_those_of_the_networks(
    pages: Any, id: str, networks: tuple[str, ...]
) -> None:
    counted = sum(pages._count(name) for name in networks)
    assert models.hub_model(id).parameters == pytest.approx(counted / 1e6, abs=3, rel=1e-3)


def test_what_the_refiners_plan_with_is_what_is_counted(pages: Any) -> None:
    qwen, klein = (PIPELINES[family][1] for family in ("qwen-image-edit", "flux2-klein"))
    names = ("qwen", "qwen-text", "qwen-vae", "klein", "klein-vae")
    for planned, name in zip((*qwen, *klein), names, strict=True):
        assert planned == pytest.approx(pages._count(name) / 1e6, rel=5e-3)


def test_the_parts_of_trellis_are_counted_as_published(pages: Any) -> None:
    import json

    for model in ("trellis", "cupid"):
        told = json.loads((pages.KEYS / f"{model}_keys.json").read_text(encoding="utf-8"))
        for name, part in told["parts"].items():
            assert pages._count(name) == part["parameters"], name
