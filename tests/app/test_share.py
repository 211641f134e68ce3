"""The web page of a session: it shows what the program shows, and follows a pointer."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from hands import ROOT
from objectmorpher.__main__ import main
from objectmorpher.server import share_page
from objectmorpher.server.share_page import LONGEST, MOST_BYTES, joined
from objectmorpher_core.session.file import save_session
from tests import shapes
from tests.browser import Browser, opened_browser

PHOTO = ROOT / "assets" / "samples" / "flower.jpg"
SAMPLES = sorted((ROOT / "assets" / "samples").glob("*.jpg"))
CANVAS = "document.getElementById('canvas')"
ALIKE = 2.0 / 255  # mean difference of two pictures: the page's are WebP files


@pytest.fixture(scope="module")
def folder(networks: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A flower that was turned and bent, its session, its picture and its page."""
    folder = tmp_path_factory.mktemp("share")
    told = ["--subject", "--handle", "384,192:420,170", "--turn", "12,0,0"]
    told += ["--session", str(folder / "flower.omorph")]
    assert main(["edit", str(PHOTO), "-o", str(folder / "flower.png"), *told]) == 0
    assert main(["share", str(folder / "flower.omorph"), "-o", str(folder / "page.html")]) == 0
    return folder


@pytest.fixture(scope="module")
def page(folder: Path) -> Iterator[Browser]:
    with opened_browser() as browser:
        browser.open((folder / "page.html").as_uri())
        browser.wait("window.objectmorpher && objectmorpher.isStill", "drawing")
        yield browser


def canvas(page: Browser) -> np.ndarray:
    """(H, W, 3) in [0, 1], what the page has drawn, px for px."""
    page.wait("objectmorpher.isStill", "coming to rest")
    url = page.run(f"return {CANVAS}.toDataURL('image/png')")
    picture = Image.open(io.BytesIO(base64.b64decode(url.partition(",")[2])))
    return np.asarray(picture.convert("RGB")) / 255


def on_screen(page: Browser, x: float, y: float) -> tuple[float, float]:
    """Where px of the photo are in the window."""
    left, top, width, photo = page.run(
        f"const box = {CANVAS}.getBoundingClientRect();"
        "return [box.left, box.top, box.width, objectmorpher.thing.data.size[0]]"
    )
    return left + x * width / photo, top + y * width / photo


def test_the_page_is_one_small_file_that_asks_for_nothing(tmp_path: Path) -> None:
    session, page = tmp_path / "s.omorph", tmp_path / "page.html"
    save_session(shapes.scene("ellipse").document(), session)
    assert main(["share", str(session), "-o", str(page)]) == 0
    text = page.read_text(encoding="utf-8")
    assert len(text) <= MOST_BYTES
    asked = re.findall(r"(?:src|href|url)\s*[=(]\s*[\"']?([^\"'\s>)]{1,12})", text)
    assert asked and all(place.startswith("data:image") for place in asked)
    assert "default-src 'none'" in text and "{{" not in text


@pytest.mark.slow
def test_it_begins_with_what_the_program_shows(page: Browser, folder: Path) -> None:
    assert (folder / "page.html").stat().st_size <= MOST_BYTES
    edited = np.asarray(Image.open(folder / "flower.png").convert("RGB")) / 255
    shown = canvas(page)
    assert shown.shape == edited.shape
    assert np.abs(shown - edited).mean() < ALIKE
    photo = np.asarray(Image.open(PHOTO).convert("RGB")) / 255
    assert np.abs(shown - photo).mean() > 3 * ALIKE  # it would be seen if nothing were posed


@pytest.mark.slow
def test_the_photo_is_there_while_the_button_is_held(page: Browser) -> None:
    photo = np.asarray(Image.open(PHOTO).convert("RGB")) / 255
    press = "document.getElementById('before').dispatchEvent(new PointerEvent('%s')); return 0"
    page.run(press % "pointerdown")
    assert np.abs(canvas(page) - photo).mean() < ALIKE
    page.run(press % "pointerup")


@pytest.mark.slow
def test_a_point_follows_the_pointer_and_reset_brings_all_back(page: Browser) -> None:
    first = canvas(page)
    start, end = on_screen(page, 300, 300), on_screen(page, 260, 330)
    page.drag(start, ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2), end)
    moved = canvas(page)
    (handle,) = page.run(
        "const t = objectmorpher.thing;"
        "return t.handles.map((h) => t.projected(t.world(h.point, h.g)))"
    )
    began = page.run("const t = objectmorpher.thing; return t.handles[0].grabbed")
    shift = np.subtract(handle, began)
    scale = (end[0] - start[0]) / -40
    wanted = np.subtract([round(v) for v in end], [round(v) for v in start]) / scale
    assert np.abs(shift - wanted).max() < 1  # px
    change = np.abs(moved - first).max(2)
    assert (change[280:360, 200:320] > 0.1).mean() > 0.2  # the flower
    assert change[:60].max() == 0  # the leaves above it
    page.run("document.getElementById('reset').click(); return 0")
    np.testing.assert_array_equal(canvas(page), first)


@pytest.mark.slow
def test_a_drag_beside_the_object_turns_it_and_does_not_bend_it(page: Browser) -> None:
    first = canvas(page)
    page.drag(on_screen(page, 40, 40), on_screen(page, 100, 40))
    turned = canvas(page)
    bend, yaw = page.run(
        "const t = objectmorpher.thing, d = t.data;"
        "const p = d.arrays.points, bend = Math.max(...t.points.map((v, k) => Math.abs(v - p[k])));"
        "const m = product(t.turn, inverse(d.turn));"
        "return [bend, Math.atan2(m[2], m[0]) * 180 / Math.PI]"
    )
    assert bend == 0 and yaw < -15  # what faces us goes to the right, with the hand
    assert np.abs(turned - first).max(2)[100:300, 180:450].mean() > 0.02
    page.run("document.getElementById('reset').click(); return 0")
    np.testing.assert_array_equal(canvas(page), first)


@pytest.mark.slow
def test_a_double_click_releases_a_point(page: Browser) -> None:
    place = on_screen(page, 320, 215)
    page.drag(place, place)
    assert page.run("return objectmorpher.thing.handles.length") == 1
    page.double_click(place)
    assert page.run("return objectmorpher.thing.handles.length") == 0
    page.run("document.getElementById('reset').click(); return 0")


def shared(photo: Path, folder: Path) -> bytes:
    """The page of a photo's subject, which was turned."""
    session, page = folder / f"{photo.stem}.omorph", folder / f"{photo.stem}.html"
    told = ["--subject", "--turn", "12,0,0", "--session", str(session)]
    assert main(["edit", str(photo), "-o", str(folder / "edited.png"), *told]) == 0
    assert main(["share", str(session), "-o", str(page)]) == 0
    return page.read_bytes()


def sides(page: bytes) -> tuple[int, int]:
    """Width and height of the photo in a page, px."""
    found = re.search(rb'"size":\[(\d+),(\d+)\]', page)
    assert found is not None
    return int(found[1]), int(found[2])


@pytest.mark.slow
@pytest.mark.usefixtures("networks")
@pytest.mark.parametrize("photo", SAMPLES, ids=lambda path: path.stem)
def test_pages_of_the_samples_are_small_and_whole(photo: Path, tmp_path: Path) -> None:
    page = shared(photo, tmp_path)
    assert 100_000 < len(page) <= MOST_BYTES == 8_000_000
    assert sides(page) == Image.open(photo).size


@pytest.mark.slow
@pytest.mark.usefixtures("networks")
@pytest.mark.parametrize(("megapixels", "grain"), [(24, 0), (6, 30)])
def test_a_page_of_many_megapixels_is_small_too(
    megapixels: int, grain: int, tmp_path: Path
) -> None:
    """`grain`, of 255: none, and more than WebP can make small."""
    side = round(1000 * (megapixels / 1.5) ** 0.5)
    wide = Image.open(PHOTO).resize((3 * side // 2, side), Image.Resampling.BICUBIC)
    pixels = np.asarray(wide).astype(np.float32)
    if grain:  # as large as a px of the page, which reducing the photo would take away otherwise
        coarse = np.random.default_rng(1).normal(0, 1, (1000, 1500, 3)).astype(np.float32)
        pixels += 2 * grain * coarse.repeat(2, 0).repeat(2, 1)
    photo = tmp_path / "large.jpg"
    Image.fromarray(np.clip(pixels, 0, 255).astype(np.uint8)).save(photo, quality=95)
    page = shared(photo, tmp_path)
    assert len(page) <= MOST_BYTES
    assert sides(page)[0] == LONGEST if not grain else sides(page)[0] <= LONGEST


def test_a_page_that_is_too_large_is_compressed_more(monkeypatch: pytest.MonkeyPatch) -> None:
    document = shapes.scene("ellipse").document()
    whole = share_page.encode_page(document, 0)
    monkeypatch.setattr(share_page, "MOST_BYTES", len(whole) - 1)
    smaller = share_page.encode_page(document, 0)
    assert len(smaller) < len(whole) and sides(smaller) == sides(whole)
    monkeypatch.setattr(share_page, "SIZES", (share_page.SIZES[0], (100, 80)))
    assert max(sides(share_page.encode_page(document, 0))) == 100


def test_parts_without_a_link_are_hung_on_the_nearest() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [5, 0, 0], [6, 0, 0.0]])
    links = np.zeros((4, 4))
    links[0, 1] = links[1, 0] = links[2, 3] = links[3, 2] = 2.0
    found = joined(points, csr_array(links))
    assert connected_components(found, directed=False)[0] == 1
    assert found[1, 2] == found[2, 1] == 2.0


def test_what_cannot_be_shared_is_said(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    session = tmp_path / "chosen.omorph"
    document = shapes.scene("ellipse").document()
    item = replace(document.objects[0], lifted=None)
    save_session(replace(document, objects=(item,)), session)
    assert main(["share", str(session), "-o", str(tmp_path / "p.html")]) != 0
    assert "nothing to drag" in capsys.readouterr().err
    assert not (tmp_path / "p.html").exists()
