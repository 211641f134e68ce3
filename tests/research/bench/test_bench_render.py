"""`objectmorpher bench render`: what it reports, and that its peer is a fair one."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from objectmorpher.cli import parser as cli
from objectmorpher_core.document.model import Placement
from objectmorpher_core.raster import tiles
from objectmorpher_core.raster.reference import Picture3D
from objectmorpher_research.bench import gl
from objectmorpher_research.bench.classic_gl import ClassicViewer
from objectmorpher_research.bench.render import tiles_frame
from objectmorpher_research.bench.scenes import BenchScene, cloud_scene, lift_scene
from objectmorpher_research.bench.timing import seconds

CONTRACT = {"renderer", "gaussians", "width", "height", "sort_ms", "frame_ms"}
ALWAYS = CONTRACT | {"scene", "frame_least_ms", "first_frame_ms", "solve_ms"}
PARTS = {"project_ms", "bin_ms", "draw_ms"}
PEERS = {"gl", "classic-gl"}  # each where it runs
PIXEL = 3 / 255  # mean over the picture: 8 bits a blending, and quads that end at 3 sigma


@pytest.fixture
def context() -> Iterator[object]:
    """An OpenGL context without a window."""
    moderngl = pytest.importorskip("moderngl")
    try:
        context = moderngl.create_standalone_context(backend="egl")
    except Exception as error:
        pytest.skip(f"no OpenGL without a window here: {error}")
    yield context
    context.release()


def drawn(scene: BenchScene, frame: int = 0) -> Picture3D:
    """A frame by the tiles."""
    return tiles.render(scene.splats(frame), scene.texture, scene.camera, scene.puppet.camera)


@pytest.mark.slow
def test_the_report_has_the_keys_that_the_design_names(tmp_path: Path) -> None:
    file = tmp_path / "render.json"
    assert cli.main(["bench", "render", "--quick", "--json", str(file)]) == 0
    report = json.loads(file.read_text())
    assert set(report["machine"]) == {"cpu", "cores", "gl_renderer"}
    rows = report["rows"]
    assert {"tiles", "reference"} <= {row["renderer"] for row in rows}
    assert {row["renderer"] for row in rows} <= {"tiles", "reference"} | PEERS
    assert {row["scene"] for row in rows} == {"cloud", "lift"}
    has_gl = any(row["renderer"] in ("gl", "classic-gl") for row in rows)
    assert report["machine"]["gl_renderer"] or not has_gl
    for row in rows:
        assert set(row) >= ALWAYS | (PARTS if row["renderer"] == "tiles" else set())
        assert 0 < row["frame_least_ms"] <= row["frame_ms"]
        assert row["gaussians"] > 0 and row["width"] == row["height"] > 0
        assert row["sort_ms"] > 0 or row["renderer"] in ("tiles", "gl"), "what is layered is not"
    sorts = {row["scene"]: row["sort_ms"] for row in rows if row["renderer"] == "tiles"}
    assert sorts["cloud"] > 0 and sorts["lift"] == 0


def test_a_bench_that_is_not_known_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        cli.main(["bench", "pipelines"])
    assert "render" in capsys.readouterr().err


def test_without_opengl_its_rows_are_left_out(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        assert gl.Drawer(None).rows(cloud_scene(50, 32), gl.Effort(0.0, 1, 1)) == []
    assert not caplog.records, "that there is no OpenGL was told when it was looked for"


@pytest.mark.parametrize("made", [cloud_scene, lift_scene])
def test_every_frame_of_the_drag_is_another_picture_and_shows_the_object(
    made: Callable[[int, int], BenchScene],
) -> None:
    scene = made(600, 96)
    first, middle = drawn(scene, 0), drawn(scene, len(scene.poses) // 2)
    assert first.alpha.mean() > 0.05
    assert np.abs(first.color - middle.color).max() > 0.2


def test_half_the_size_is_the_same_view() -> None:
    scene = lift_scene(600, 96)
    large, small = drawn(scene), drawn(scene.sized(48))
    halved = large.alpha.reshape(48, 2, 48, 2).mean((1, 3))
    assert np.abs(halved - small.alpha).mean() < 0.01


def test_a_lift_covers_half_a_photo() -> None:
    scene = lift_scene(600, 96)
    alpha = tiles.render(
        scene.puppet.posed(None, Placement()), scene.texture, scene.camera, scene.puppet.camera
    ).alpha
    assert 0.45 < alpha.mean() < 0.55


def test_the_classic_viewer_draws_the_same_picture(context: object) -> None:
    """Else it would be no peer."""
    scene = cloud_scene(3000, 256)
    viewer = ClassicViewer(context, scene.posed_gaussians(), scene.camera)
    viewer.draw()
    gpu = np.frombuffer(viewer.picture.read(), np.uint8).reshape(256, 256, 4) / 255
    viewer.release()
    cpu = drawn(scene)
    expected = np.dstack([cpu.color, cpu.alpha])
    assert expected[..., 3].mean() > 0.05
    assert np.abs(gpu - expected).mean() < PIXEL / 3
    assert np.abs(gpu - expected).max() < 8 * PIXEL


def least(runs: list[Callable[[], object]], repeats: int) -> list[float]:
    """Least seconds of each, in turns: what else the machine does slows all of them."""
    for run in runs:
        run()
    taken = [[seconds(run) for run in runs] for _ in range(repeats)]
    return np.min(taken, axis=0).tolist()


@pytest.mark.slow
def test_the_tiles_are_three_times_as_fast_as_a_classic_viewer_on_software_opengl(
    context: object,
) -> None:
    info = context.info  # type: ignore[attr-defined]
    if "llvmpipe" not in info["GL_RENDERER"]:
        pytest.skip(f"OpenGL is drawn by {info['GL_RENDERER']}")
    scene = cloud_scene(100_000)
    viewer = ClassicViewer(context, scene.posed_gaussians(), scene.camera)

    def classic() -> None:
        viewer.draw()
        context.finish()  # type: ignore[attr-defined]

    ours, peer = least([lambda: tiles_frame(scene, 0), classic], 25)
    assert peer >= 3 * ours


@pytest.mark.slow
def test_three_times_the_gaussians_cost_at_most_four_times_the_frame() -> None:
    few, many = cloud_scene(100_000), cloud_scene(300_000)
    one, three = least([lambda: tiles_frame(few, 0), lambda: tiles_frame(many, 0)], 40)
    assert three <= 4 * one
