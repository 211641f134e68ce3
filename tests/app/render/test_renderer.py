"""The renderer: moved objects by the GPU, and what happens where it cannot."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image, ImageCms

from objectmorpher.canvas.frame import Cache, build_frame
from objectmorpher.editor.view import ViewState
from objectmorpher.gui.window.scenes import splat_objects
from objectmorpher.render.scene import Scene, SplatObject
from objectmorpher_core.compose.composite import composite, straight_cutout
from objectmorpher_core.compose.plate.plate import plate_cover
from objectmorpher_core.document import edits
from objectmorpher_core.document.bounds import MODES
from objectmorpher_core.document.model import Document, Placement
from objectmorpher_core.document.settings import Finish, Shadow
from objectmorpher_core.pictures.screen_colours import screen_table
from objectmorpher_core.pipeline import make_plate
from tests import focussed, shapes
from tests.app.render.pictures import make_renderer, specified
from tests.tree import over

pytest_plugins = ["tests.app.render.gpu"]  # the fixtures

moderngl = pytest.importorskip("moderngl")

PIXEL = 3 / 255  # see test_splat_pass; and the window's 8 bits
SIZE = (shapes.WIDTH, shapes.HEIGHT)


@pytest.fixture
def renderer(context, monkeypatch):
    yield make_renderer(context, monkeypatch, "gl", SIZE)
    context.finish()


def _view() -> ViewState:
    view = ViewState()
    view.resize(SIZE, 1.0, SIZE)
    return view


def _scene(*objects: SplatObject) -> Scene:
    return Scene(np.zeros((SIZE[1], SIZE[0], 3), np.uint8), (0.0, 0.0, 0.0), objects=objects)


def _object(turn: tuple[float, float, float]) -> SplatObject:
    scene = shapes.scene("ellipse", 800)
    splats = scene.puppet.posed(None, Placement(turn=turn))
    return SplatObject(splats, scene.texture, scene.camera)


def _window_picture(renderer, scene: Scene, view: ViewState) -> np.ndarray:
    renderer.begin((0.0, 0.0, 0.0), SIZE)
    renderer.draw(scene, view, (0, 0, *SIZE))
    return renderer.read(SIZE).astype(np.float32) / 255


def test_the_window_shows_the_object_over_the_photo(renderer):
    view, item = _view(), _object((10.0, 20.0, 0.0))
    shown = _window_picture(renderer, _scene(item), view)
    camera = view.camera(item.camera)
    expected = specified(item.splats, item.texture, camera, item.camera)[..., :3]
    x0, y0, x1, y1 = _photo_box(view)
    inside = (slice(y0, y1), slice(x0, x1))
    assert expected[inside].any()
    assert np.abs(shown - expected)[inside].max() <= PIXEL


def _photo_box(view: ViewState) -> tuple[int, int, int, int]:
    """Canvas px that are wholly within the photo; nothing is drawn beyond it."""
    low, high = view.canvas_from_image(np.array([[0, 0], SIZE]))
    return int(low[0]) + 1, int(low[1]) + 1, int(high[0]), int(high[1])


def test_of_an_object_that_is_gone_nothing_stays_on_the_gpu(renderer):
    view = _view()
    _window_picture(renderer, _scene(_object((10.0, 20.0, 0.0))), view)
    assert len(renderer._splats().uploads) > 0
    _window_picture(renderer, _scene(), view)
    assert len(renderer._splats().uploads) == 0


def test_where_the_driver_cannot_the_processor_draws(renderer, monkeypatch, caplog):
    from objectmorpher.render import layered_pass

    def refuse(*_):
        raise moderngl.Error("the framebuffer is not complete\nand much else")

    view, scene = _view(), _scene(_object((10.0, 20.0, 0.0)))
    monkeypatch.setattr(layered_pass, "LayerTargets", refuse)
    assert renderer.kind == "gl"
    assert not _window_picture(renderer, scene, view).any()  # the photo alone, and no exception
    assert renderer.kind == "tiles"
    assert caplog.messages[-1].startswith("OpenGL cannot draw the object: the framebuffer is not")
    assert "\n" not in caplog.messages[-1]
    _window_picture(renderer, scene, view)  # nor is it tried again
    assert len(caplog.messages) == len(set(caplog.messages))


def test_an_error_of_the_driver_is_said(renderer, monkeypatch, caplog):
    """Such as one that is out of memory, or has lost its context."""
    monkeypatch.setattr(type(renderer._context), "error", property(lambda _: "GL_OUT_OF_MEMORY"))
    _window_picture(renderer, _scene(_object((0.0, 0.0, 0.0))), _view())
    assert renderer.kind == "tiles"
    assert "GL_OUT_OF_MEMORY" in caplog.text


def test_a_canvas_without_pixels_is_no_error(renderer):
    view = _view()
    view.width = 0
    renderer.draw(_scene(_object((10.0, 20.0, 0.0))), view, (0, 0, 0, SIZE[1]))
    assert renderer.kind == "gl"


@pytest.mark.parametrize("kind", ["tiles", "gl"])
def test_the_window_shows_shadow_and_light_as_they_are_exported(renderer, kind):
    inside = shapes.mask("ellipse")
    ramp = np.linspace(1.3, 0.5, shapes.WIDTH)[None, :, None]  # lit from the left
    pixels = np.clip(shapes.picture(inside) * ramp, 0, 255).astype(np.uint8)
    scene = shapes.lifted_scene(pixels, inside, 800)
    document = scene.document()
    dark = document.photo.pixels.copy()
    dark[:, 95:] //= 2
    picture = replace(document.photo.picture, pixels=dark)
    document = replace(document, photo=replace(document.photo, picture=picture))
    document = edits.set_plate(document, make_plate(dark, plate_cover(document), "telea"))
    place = Placement(move=(30.0, -8.0), scale=0.8, turn=(35.0, 0.0, 0.0))
    document = edits.set_share(edits.set_placement(document, 0, place), 0, "relight", 1.0)
    document = edits.set_shadow(document, 0, Shadow(strength=1.0, length=1.2))
    document = edits.set_feather(edits.set_share(document, 0, "harmony", 1.0), 1.5)
    document = edits.set_finish(document, 0, Finish(0.7, -0.3, 0.2, 0.5))
    cache, view = Cache(), _view()
    cache.frame_time = np.inf
    view.set_zoom(1.0, (80, 60), SIZE)
    view.left = view.top = 0.0
    frame = build_frame(document, view, cache, renderer=kind)
    layers = frame.layers if kind == "tiles" else ()
    objects = splat_objects(document, frame) if kind == "gl" else ()
    look = frame.objects[0].lit
    shown = Scene(
        document.photo.pixels, (0.0, 0.0, 0.0), document.plate,
        frame.shades, layers, objects, blend=frame.blend,
    )  # fmt: skip
    window = _window_picture(renderer, shown, view)
    exported = composite(document).pixels.astype(np.float32) / 255
    plain = composite(edits.set_shadow(document, 0, Shadow())).pixels.astype(np.float32) / 255
    assert np.abs(plain - exported).max() > 0.1  # there is a shadow
    assert max(look.gain) < 1  # and another light
    turned = composite(edits.set_share(document, 0, "relight", 0.0)).pixels.astype(np.float32) / 255
    assert np.abs(turned - exported).max() > 3 * PIXEL  # that stays while it turns
    assert np.abs(window - exported).mean() <= PIXEL


@over("finish", [Finish(0.8, 0.2, blend_mode=mode) for mode in MODES] + [
    Finish(sharpness=1.5), Finish(blur=1.5), Finish(0.9, blur=0.7, sharpness=2.0),
])  # fmt: skip
@over("kind", ["tiles", "gl"])
def test_the_window_shows_an_objects_finish_as_it_is_exported(renderer, kind, finish):
    document = shapes.scene("ellipse", 800).document()
    copy = replace(document.objects[0], name="Copy", placement=Placement(move=(24.0, 7.0)))
    document = replace(document, objects=(*document.objects, copy))
    document = edits.set_finish(document, 1, finish)
    plain = composite(edits.set_finish(document, 1, Finish())).pixels.astype(np.float32) / 255
    window, exported = _as_shown(renderer, document, kind), composite(document).pixels / 255
    inside = np.abs(exported - plain).max(2) > PIXEL
    assert finish.blend_mode == "normal" or inside.mean() > 0.1
    assert np.abs(window - exported).mean() <= PIXEL
    assert np.abs(window - exported)[inside].mean() <= PIXEL


def _as_shown(renderer, document: Document, kind: str) -> np.ndarray:
    """The photo px for px in the window."""
    cache, view = Cache(), _view()
    cache.frame_time = np.inf
    view.set_zoom(1.0, (80, 60), SIZE)
    view.left = view.top = 0.0
    frame = build_frame(document, view, cache, renderer=kind)
    layers = frame.layers if kind == "tiles" else ()
    objects = splat_objects(document, frame) if kind == "gl" else ()
    shown = Scene(
        document.photo.pixels, (0.0, 0.0, 0.0), frame.plate,
        frame.shades, layers, objects, blend=frame.blend,
    )  # fmt: skip
    return _window_picture(renderer, shown, view)


@pytest.mark.parametrize("zoom", [1.0, 0.5])
@pytest.mark.parametrize("kind", ["tiles", "gl"])
def test_the_window_shows_grain_as_it_is_exported(renderer, kind, zoom):
    inside = shapes.mask("ellipse")
    rng = np.random.default_rng(0)
    grey = np.where(inside, 150, 90)[..., None] + rng.normal(0, 9, (*inside.shape, 3))
    scene = shapes.lifted_scene(np.rint(grey).clip(0, 255).astype(np.uint8), inside, 800)
    place = Placement(move=(30.5, -8.0), scale=1.4)
    plain = edits.set_placement(scene.document(), 0, place)
    document = edits.set_share(plain, 0, "grain", 1.0)
    cache, view = Cache(), _view()
    cache.frame_time = np.inf
    view.set_zoom(zoom, (80, 60), SIZE)
    view.left = view.top = 0.0
    frame = build_frame(document, view, cache, renderer=kind)
    layers = frame.layers if kind == "tiles" else ()
    objects = splat_objects(document, frame) if kind == "gl" else ()
    blend = frame.blend
    shown = Scene(
        document.photo.pixels, (0.0, 0.0, 0.0), document.plate, (), layers, objects, blend=blend
    )
    window = _window_picture(renderer, shown, view)
    parts = int(1 / zoom)
    exported, smooth = (composite(d).pixels.astype(np.float32) / 255 for d in (document, plain))
    height, width = (n // parts * parts for n in exported.shape[:2])

    def small(picture):
        rows = picture[:height, :width].reshape(height // parts, parts, width // parts, parts, 3)
        return rows.mean((1, 3))

    cutout = straight_cutout(composite(document), np.dtype(np.uint8), document.photo.size)
    there = small(cutout[..., 3:].repeat(3, 2) == 255) == 1
    window = window[: height // parts, : width // parts]
    own, other = (np.abs(window - small(p))[there].mean() for p in (exported, smooth))
    # It is this grain, at this place; half as large the object is drawn anew, from a halved photo.
    assert own < (0.1 if zoom == 1 else 0.75) * other


@pytest.mark.parametrize("zoom", [1.0, 0.5])
@pytest.mark.parametrize("kind", ["tiles", "gl"])
def test_the_window_shows_focus_as_it_is_exported(renderer, kind, zoom):
    document = focussed.farther(focussed.scene(5.0), 1.8)
    cache, view = Cache(), ViewState()
    cache.frame_time = np.inf
    view.resize(SIZE, 1.0, document.photo.size)
    view.set_zoom(zoom, (80, 60), SIZE)
    view.left, view.top = (240.0, 120.0) if zoom == 1 else (160.0, 60.0)
    frame = build_frame(document, view, cache, renderer=kind)
    layers = frame.layers if kind == "tiles" else ()
    objects = splat_objects(document, frame) if kind == "gl" else ()
    look = frame.objects[0].lit
    assert look.blur > 1
    blend = frame.blend
    plate = document.plate
    shown = Scene(document.photo.pixels, (0, 0, 0), plate, (), layers, objects, blend=blend)
    window = _window_picture(renderer, shown, view)
    parts = int(1 / zoom)
    x, y = int(view.left), int(view.top)
    seen = np.s_[y : y + parts * window.shape[0], x : x + parts * window.shape[1]]
    sharp = edits.set_share(document, 0, "defocus", 0.0)

    def small(picture):
        rows = picture[seen].reshape(window.shape[0], parts, window.shape[1], parts, 3)
        return rows.mean((1, 3))

    soft, plain = (composite(d).pixels.astype(np.float32) / 255 for d in (document, sharp))
    there = np.abs(small(soft) - small(plain)).max(2) > 0.05
    assert there.sum() > 200
    own, other = (np.abs(window - small(p))[there].mean() for p in (soft, plain))
    assert own < 0.15 * other


def test_a_screen_is_told_the_photos_colours_and_nothing_else_changes(renderer):
    """A wide-gamut photo on a screen of sRGB, as Little CMS itself turns each pixel of it."""
    view, pixels = _view(), shapes.picture(shapes.mask("ellipse"))
    view.set_zoom(1.0, (80, 60), SIZE)
    view.left, view.top = -20.0, 0.0  # the photo begins 20 px from the canvas's left
    scene = Scene(pixels, (0.2, 0.3, 0.1))
    plain = _window_picture(renderer, scene, view)
    renderer.table = screen_table(wide_profile(), None)
    shown = _window_picture(renderer, scene, view)
    source = ImageCms.ImageCmsProfile(io.BytesIO(wide_profile()))
    wanted = ImageCms.profileToProfile(
        Image.fromarray(pixels), source, ImageCms.createProfile("sRGB"),
        ImageCms.Intent.RELATIVE_COLORIMETRIC, flags=ImageCms.Flags.BLACKPOINTCOMPENSATION,
    )  # fmt: skip
    assert np.abs(np.asarray(wanted).astype(int) - pixels).max() > 20
    gap = np.abs(shown[:, 20:] * 255 - np.asarray(wanted)[:, :-20])
    assert np.quantile(gap, 0.995) <= 2 and gap.max() < 10  # where colours are cut off
    assert np.array_equal(shown[:, :20], plain[:, :20])
    assert renderer.read_pixel(60, SIZE[1] - 1 - 40) == tuple(pixels[40, 40])  # as in the file
    assert screen_table(None, None) is None
    assert screen_table(wide_profile(), wide_profile()) is None
    assert screen_table(b"nonsense", None) is None


def wide_profile() -> bytes:
    """A made ICC profile whose primaries reach far beyond sRGB's."""
    srgb = bytearray(ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes())
    count = int.from_bytes(srgb[128:132], "big")
    places = {bytes(srgb[132 + 12 * k : 136 + 12 * k]): 136 + 12 * k for k in range(count)}
    primaries = {b"rXYZ": (0.61, 0.311, 0.019), b"gXYZ": (0.205, 0.626, 0.061)}
    white = (0.9642, 1.0, 0.8249)
    blue = tuple(w - r - g for w, r, g in zip(white, *primaries.values(), strict=True))
    for name, xyz in {**primaries, b"bXYZ": blue}.items():
        at = int.from_bytes(srgb[places[name] : places[name] + 4], "big")
        fixed = b"".join(round(v * 65536).to_bytes(4, "big", signed=True) for v in xyz)
        srgb[at + 8 : at + 20] = fixed
    srgb[84:100] = bytes(16)  # its digest
    return bytes(srgb)


# A picture in a window: written upright, from the bottom up for the shaders, and upright again.
COPY = """
import numpy as np
from objectmorpher.cli.options import WindowOptions
from objectmorpher.gui.window.glfw_window import open_window
import moderngl
from objectmorpher.render.renderer import KeptCanvas, RowCopy

SIZE, VIEWPORT = (96, 80), (10, 20, 64, 48)
handle = open_window(WindowOptions(size=SIZE, scale=1.0, frames=1))
context = moderngl.create_context(require=330)
rows = RowCopy.found()
assert rows is not None
kept, rng = KeptCanvas(context, rows), np.random.default_rng(0)
left, bottom, width, height = VIEWPORT
for is_sampled in (False, True, False, False):
    pixels = rng.integers(0, 256, (height, width, 4), np.uint8)
    if kept.buffer is None:
        kept.begin(SIZE, (0.2, 0.4, 0.6))
    kept.write(pixels, VIEWPORT, (0.2, 0.4, 0.6), is_sampled)
    kept.copy_to(context.screen)
    data = context.screen.read(viewport=(0, 0, *SIZE), components=3, alignment=1)
    shown = np.frombuffer(data, np.uint8)
    shown = shown.reshape(SIZE[1], SIZE[0], 3)[::-1]
    top = SIZE[1] - bottom - height
    there = np.s_[top : top + height, left : left + width]
    assert np.array_equal(shown[there], pixels[..., :3]), is_sampled
    around = np.ones(shown.shape[:2], bool)
    around[there] = False
    assert (shown[around] == (51, 102, 153)).all()
    assert kept.read_pixel(left + 3, bottom + 5) == tuple(pixels[height - 6, 3, :3])
"""


@pytest.mark.window
def test_a_picture_that_is_copied_into_a_window_arrives_as_it_is(
    window_environment: dict[str, str],
) -> None:
    ran = subprocess.run(
        [sys.executable, "-c", COPY], env=os.environ | window_environment,
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr
