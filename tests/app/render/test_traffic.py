"""What has not changed is not sent to the GPU again, and a frame is a few calls."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from objectmorpher.editor.view import ViewState
from objectmorpher.render.scene import Scene, SplatObject
from objectmorpher_core.deform.skinning import Skin
from objectmorpher_core.document.model import Placement
from objectmorpher_core.raster.posed import RestSplats
from objectmorpher_core.raster.rules import LAYERS
from tests import shapes
from tests.app.render.pictures import bent, make_renderer
from tests.app.render.traffic import recorded
from tests.tree import over

pytest_plugins = ["tests.app.render.gpu"]  # the fixtures

moderngl = pytest.importorskip("moderngl")

SIZE = (shapes.WIDTH, shapes.HEIGHT)
PHOTO = np.full((SIZE[1], SIZE[0], 3), 90, np.uint8)
LARGE = 1024  # bytes, from which an upload is no constant
NODE = 8 * 4  # bytes of a control point in the table of a pose
INDEX = 4  # bytes of a Gaussian in the order, ...
PAINT = 5 * 4  # ... and in the table of colours
CLOUD = 2  # calls: onto the screen, and into the picture
# The same, and of each layer its front, sums and pixels, what empties these, and what is left; the
# last one has no front and leaves nothing, the first is emptied without a call.
LAYERED = 2 + 3 * LAYERS - 1 + 2 * (LAYERS - 1) - 1 + LAYERS - 1


@pytest.fixture
def renderer(context, monkeypatch):
    yield make_renderer(context, monkeypatch, "gl", SIZE)
    context.finish()


def _view(zoom: float = 1.0) -> ViewState:
    view = ViewState()
    view.resize(SIZE, 1.0, SIZE)
    view.set_zoom(zoom, (80, 60), SIZE)
    return view


def _show(renderer, objects: list[SplatObject], view: ViewState) -> np.ndarray:
    renderer.begin((0.0, 0.0, 0.0), SIZE)
    renderer.draw(
        Scene(PHOTO, (0.0, 0.0, 0.0), objects=tuple(objects)), view, (0, 0, *SIZE)
    )  # fmt: skip
    return renderer.read(SIZE)


@cache
def _cloud() -> RestSplats:
    """A star as if a file had brought it: of plain colours."""
    lifted = shapes.scene("star", 600).lifted
    unseen = replace(lifted.texture, visibility=0 * lifted.texture.visibility)
    return RestSplats(replace(lifted, texture=unseen, splatting="classic"), shapes.camera())


def _object(largeness: float, is_cloud: bool) -> SplatObject:
    """Bent so far."""
    scene, pose = bent("star", 600 if is_cloud else 800, largeness)
    splats = scene.puppet.posed(pose, Placement(turn=(10.0, 20.0, 0.0)))
    if is_cloud:
        splats = replace(splats, rest=_cloud())
    assert splats.is_layered is not is_cloud
    return SplatObject(splats, scene.texture, scene.camera)


def test_two_frames_of_the_same_scene_send_everything_once(renderer):
    objects = [_object(0.5, is_cloud=True), _object(0.5, is_cloud=False)]
    with recorded() as traffic:
        first = _show(renderer, objects, _view())
        large = [upload for upload in traffic.uploads if len(upload[1]) >= LARGE]
        assert len(large) >= 8, "geometry, colours, bindings, the pose, the order and the photo"
        assert len(set(large)) == len(large)
        traffic.clear()
        second = _show(renderer, objects, _view(1.5))  # it is drawn, for the view is another
        assert traffic.draws >= CLOUD + LAYERED
        assert (first != second).any()
        assert traffic.uploads == []


@over("is_cloud", [True, False])
def test_a_frame_of_a_drag_sends_its_pose(renderer, is_cloud):
    """What lies beside the dragged object is not sent again either."""
    still = _object(1.0, not is_cloud)
    poses = [_object(largeness, is_cloud) for largeness in (0.5, 0.75, 1.0)]
    _show(renderer, [still, poses[0]], _view())
    for dragged in poses[1:]:
        with recorded() as traffic:
            _show(renderer, [still, dragged], _view())
        skin = dragged.splats.motion
        assert isinstance(skin, Skin)
        expected = [NODE * len(skin.motion.points)]
        if is_cloud:
            expected.append(INDEX * len(dragged.splats))
        assert sorted(traffic.sizes) == sorted(expected)
    with recorded() as traffic:
        _show(renderer, [still, poses[-1]], _view(1.5))
    assert traffic.uploads == []


def test_paint_sends_the_colours_alone(renderer):
    item = _object(0.5, is_cloud=False)
    _show(renderer, [item], _view())
    painted = replace(item, splats=item.splats.recoloured(np.zeros((len(item.splats), 3))))
    with recorded() as traffic:
        _show(renderer, [painted], _view())
    assert traffic.sizes == [PAINT * len(item.splats)]


@over("is_cloud", [True, False])
def test_an_object_is_a_few_calls(context, is_cloud):
    from objectmorpher.render.splat_pass import SplatPass

    item, own = _object(0.5, is_cloud), SplatPass(context)
    for _ in range(2):
        with recorded() as traffic:
            own.draw(item.splats, item.texture, item.camera, item.camera)
        assert traffic.draws == (CLOUD if is_cloud else LAYERED)
