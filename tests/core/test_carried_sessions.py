"""Objects of other photos in a session's file (`session/file.py`): which of them are refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from objectmorpher_core.base.camera import Camera
from objectmorpher_core.document.model import Document, EditObject, Matte, Origin, Photo
from objectmorpher_core.pictures.image import Picture
from objectmorpher_core.session.file import SessionError, decode_session, encode_session
from tests import shapes

HERE = 40, 30  # px, of the document's photo
THERE = 100, 80  # px, of the photo that the object comes from
CAMERA = Camera(90.0, 50.0, 40.0, *THERE)


def _document(origin: Origin | None, box: tuple[int, int, int, int] = (10, 10, 20, 20)) -> Document:
    """With one object, whose matte has this box."""
    x0, y0, x1, y1 = box
    shape = y1 - y0, x1 - x0
    matte = Matte(x0, y0, np.ones(shape, np.float32), np.ones((*shape, 3), np.float32))
    ball = shapes.ball(20)
    lifted = replace(shapes.lifted_cloud(ball, ball[:8]), origin=origin)
    item = EditObject("Ball", mask=np.zeros(HERE[::-1], bool), matte=matte, lifted=lifted)
    picture = Picture(np.zeros((*HERE[::-1], 3), np.uint8))
    return Document(Photo(picture, Camera.from_fov(*HERE), b"", "made"), (item,))


def _is_read(document: Document) -> bool:
    try:
        decode_session(encode_session(document))
    except SessionError:
        return False
    return True


@pytest.mark.parametrize("light", [(0.0, 0.0, 0.0), (0.2, 0.5, 0.9), (3.0, 2.0, 1.5), None])
def test_any_light_around_it_comes_back(light):
    origin = Origin("other.jpg", CAMERA, light)
    back = decode_session(encode_session(_document(origin))).objects[0].lifted
    assert back is not None and back.origin == origin


@pytest.mark.parametrize(
    "origin",
    [
        Origin("other.jpg", CAMERA, (0.2, -0.1, 0.3)),
        Origin("other.jpg", replace(CAMERA, focal=0.0)),
        Origin("other.jpg", replace(CAMERA, focal=-90.0)),
        Origin("other.jpg", replace(CAMERA, width=0)),
        Origin("other.jpg", replace(CAMERA, height=-80)),
    ],
    ids=str,
)
def test_a_camera_or_a_light_that_makes_no_sense_is_refused(origin):
    with pytest.raises(SessionError, match="of another photo"):
        decode_session(encode_session(_document(origin)))


@pytest.mark.parametrize("is_visitor", [False, True])
def test_a_matte_goes_as_far_beyond_its_own_photo_as_that_is_large(is_visitor):
    width, height = THERE if is_visitor else HERE
    origin = Origin("other.jpg", CAMERA) if is_visitor else None

    def is_taken(x: int, y: int) -> bool:
        """Whether a matte of this pixel alone is."""
        return _is_read(_document(origin, (x, y, x + 1, y + 1)))

    for x, y, way in ((-width, -height, -1), (2 * width - 1, 2 * height - 1, 1)):
        assert is_taken(x, y)
        assert not is_taken(x + way, y)
        assert not is_taken(x, y + way)


@pytest.mark.parametrize("size", [(400, 300), (1700, 30)])
def test_a_mask_may_be_as_large_as_the_photo_it_comes_from(size):
    """The photo that is here is smaller: a mask of the other one is read, whatever its shape."""
    camera = Camera(90.0, 50.0, 40.0, *size)
    document = _document(Origin("other.jpg", camera))
    item = document.objects[0]
    shape = replace(item.shape, hidden=np.ones(size[::-1], bool))
    document = document.with_object(0, replace(item, shape=shape))
    back = decode_session(encode_session(document)).objects[0].shape.hidden
    assert back is not None and back.shape == size[::-1] and back.all()
    home = document.with_object(0, replace(item, shape=shape, lifted=None, handles=()))
    with pytest.raises(SessionError, match="px"):
        decode_session(encode_session(home))
