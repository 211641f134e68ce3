"""Values on the wire: they come back as they went; what lies is refused before it costs memory."""

from __future__ import annotations

import io
import json
import pickle
import tracemalloc
import zipfile
from typing import Any

import numpy as np
import pytest
from same_values import same_values

from objectmorpher.server.fitting import is_sound
from objectmorpher.server.message import (
    LARGE,
    MessageError,
    MissingError,
    decode,
    encode,
    name_of,
)
from objectmorpher.server.table import table, types
from objectmorpher.worker.job_functions import BackendChoice, Cut
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.document.model import Click, LiftSettings, Matte, Plate, Prompt
from objectmorpher_core.document.settings import Hint
from objectmorpher_core.segment import Found
from tests.tree import over

RANDOM = np.random.default_rng(3)
PHOTO = RANDOM.integers(0, 255, (20, 30, 3)).astype(np.uint8)
MASK = PHOTO[..., 0] > 100
CAMERA = Camera.from_fov(30, 20)
VALUES = [
    None, True, -3, 2.5, 1e-300, "ä€😀", (), (1, (2, "x")), [1, [2]], PHOTO, MASK,
    np.zeros((0, 3), np.float32), np.float64(0.1), RANDOM.normal(size=(3, 4)),
    (MASK, RANDOM.normal(size=5), PHOTO.astype(np.uint16)), np.asfortranarray(PHOTO[..., 0]),
    Prompt((Click(1.5, 2.0), Click(3.0, 1.0, False)), (0.0, 0.0, 9.0, 9.0), level="part"),
    Cut(PHOTO, CAMERA, MASK), LiftSettings(hidden=MASK, horizon=3.5),
    BackendChoice("auto", 7, (Hint((1.0, 2.0), (3.0, 4.0), 5.0),)),
    Matte(-2, 3, MASK.astype(np.float32), PHOTO / np.float32(255)),
    Plate(0, 0, PHOTO, MASK, "patchmatch", painted=None),
]  # fmt: skip


def body(header: Any, data: bytes = b"") -> bytes:
    """A message that says whatever one likes."""
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    return len(text).to_bytes(8, "little") + text + data


def entry(shape: Any, offsets: Any, dtype: Any = "U8", tree: Any = {"array": 0}) -> dict:  # noqa: B006
    array = {"dtype": dtype, "shape": shape, "data_offsets": offsets}
    return {"__metadata__": {"tree": json.dumps(tree)}, "0": array}


def only_tree(tree: Any) -> bytes:
    return body({"__metadata__": {"tree": json.dumps(tree)}})


@pytest.mark.parametrize("value", VALUES, ids=lambda v: type(v).__name__)
def test_a_value_comes_back_as_it_went(value: Any) -> None:
    assert same_values(decode(encode(value, types()).body, types()), value)


def test_arrays_come_back_read_only_and_aligned() -> None:
    arrays = (MASK[:3, :3], RANDOM.normal(size=3), PHOTO)
    for array in decode(encode(arrays, types()).body, types()):
        assert not array.flags.writeable
        assert array.flags.aligned


def test_a_message_is_a_safetensors_file() -> None:
    safetensors = pytest.importorskip("safetensors.numpy")
    arrays = safetensors.load(encode((PHOTO, RANDOM.normal(size=4)), types()).body)
    np.testing.assert_array_equal(arrays["0"], PHOTO)


def test_large_arrays_travel_beside_the_message_by_their_content() -> None:
    large = RANDOM.integers(0, 255, (LARGE,)).astype(np.uint8)
    message = encode((large, 1, large.copy()), types(), is_split=True)
    assert len(message.blobs) == 1
    assert len(message.body) < 1000
    with pytest.raises(MissingError) as caught:
        decode(message.body, types())
    assert set(caught.value.digests) == set(message.blobs)
    assert same_values(decode(message.body, types(), message.blobs), (large, 1, large))


class Evil:
    def __reduce__(self) -> tuple:
        raise AssertionError("it was pickled")


def test_what_has_no_form_is_not_sent() -> None:
    for value in (Evil(), {"a": 1}, b"bytes", np.array([None]), np.array(["x"])):
        with pytest.raises(TypeError):
            encode(value, types())
    with pytest.raises(ValueError, match="JSON"):
        encode(float("nan"), types())


def npz(**arrays: Any) -> bytes:
    out = io.BytesIO()
    np.savez(out, **arrays)
    return out.getvalue()


def bomb() -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("a.npy", b"\0" * 10_000_000)
    return out.getvalue()


HOSTILE = {
    "nothing": b"",
    "few bytes": b"\x01\x02",
    "a huge header": (1 << 62).to_bytes(8, "little") + b"{}",
    "no JSON": body(b"{nope"),
    "not a table": body([1, 2]),
    "no tree": body({"__metadata__": {}}),
    "deep JSON": body(b"[" * 100_000),
    "a deep tree": only_tree(json.loads('{"tuple": [' * 200 + "1" + "]}" * 200)),
    "a bare list": only_tree([1, 2]),
    "an unknown branch": only_tree({"call": "os.system"}),
    "a mixed branch": only_tree({"tuple": [], "list": []}),
    "an unknown type": only_tree({"data": "Path", "fields": {}}),
    "a type that is a list": only_tree({"data": ["Camera"], "fields": {}}),
    "a module": only_tree({"data": "os", "fields": {"system": "id"}}),
    "a private field": only_tree({"data": "Click", "fields": {"x": 1, "y": 2, "__class__": 3}}),
    "a missing field": only_tree({"data": "Click", "fields": {"x": 1}}),
    "a field of another type": only_tree(
        {"data": "Click", "fields": {"x": "1", "y": 2, "is_foreground": True}}
    ),
    "a level that is none": only_tree(
        {"data": "Prompt",
         "fields": {"clicks": {"tuple": []}, "box": None, "is_subject": False, "level": "x"}}
    ),
    "an array that is not there": only_tree({"array": 7}),
    "an array by a text": only_tree({"array": "0"}),
    "a number that is none": body({"__metadata__": {"tree": "NaN"}}),
    "a size that lies": body(entry([1 << 40], [0, 4]), b"abcd"),
    "a product past 64 bits": body(entry([1 << 32, 1 << 32], [0, 0])),
    "an axis below zero": body(entry([-1, -4], [0, 4]), b"abcd"),
    "a size that is a fraction": body(entry([4.0], [0, 4]), b"abcd"),
    "a size that is a truth": body(entry([True, 4], [0, 4]), b"abcd"),
    "an empty array of a huge axis": body(entry([0, 1 << 60], [0, 0])),
    "offsets that overlap": body(
        {**entry([4], [0, 4]), "1": {"dtype": "U8", "shape": [4], "data_offsets": [2, 6]}},
        b"abcdef",
    ),
    "offsets after the end": body(entry([4], [4, 8]), b"abcd"),
    "bytes that nobody owns": body(entry([4], [0, 4]), b"abcdefgh"),
    "objects": body(entry([1], [0, 8], "O"), b"\0" * 8),
    "a dtype that is a list": body(entry([1], [0, 8], ["<f8"]), b"\0" * 8),
    "truths that are numbers": body(entry([2], [0, 2], "BOOL"), b"\x02\xff"),
    "too many axes": body(entry([1] * 40, [0, 1]), b"a"),
    "a pickle": pickle.dumps([1, 2, 3]),
    "an npz": npz(a=PHOTO),
    "an npz with a pickle": npz(a=np.array([{"x": 1}], dtype=object)),
    "a zip bomb": bomb(),
}  # fmt: skip


@over("name", HOSTILE)
def test_what_lies_is_refused_with_a_sentence_and_little_memory(name: str) -> None:
    tracemalloc.start()
    try:
        with pytest.raises(MessageError) as caught:
            decode(HOSTILE[name], types())
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert "\n" not in str(caught.value)
    assert peak < 10_000_000 + 40 * len(HOSTILE[name])


def test_random_damage_is_refused_or_changes_values_only() -> None:
    """Nothing but MessageError comes out of bytes that were changed at random."""
    good = encode((PHOTO[:4], Prompt((Click(1.0, 2.0),)), CAMERA), types()).body
    for _ in range(1500):
        bad = bytearray(good)
        for at in RANDOM.integers(0, 700, RANDOM.integers(1, 6)):
            bad[at % len(bad)] = RANDOM.integers(0, 256)
        try:
            decode(bytes(bad[: RANDOM.integers(1, len(bad) + 1)]), types())
        except MessageError:
            continue


LIFT = (Cut(PHOTO, CAMERA, MASK), BackendChoice("auto"), LiftSettings())
ASKED_WRONGLY = {
    "too few arguments": ("lift", LIFT[:2]),
    "another type": ("lift", (LIFT[0], "auto", LIFT[2])),
    "a mask of another size": ("lift", (Cut(PHOTO, CAMERA, MASK[:5]), *LIFT[1:])),
    "another photo's camera": ("lift", (Cut(PHOTO, Camera.from_fov(9, 9), MASK), *LIFT[1:])),
    "too many Gaussians": ("lift", (*LIFT[:2], LiftSettings(count=10**12))),
    "a hidden mask of another size": ("lift", (*LIFT[:2], LiftSettings(hidden=MASK[:3]))),
    "a photo of floats": ("read_photo", (PHOTO / 255.0, "auto")),
    "a photo without colours": ("read_photo", (PHOTO[..., 0], "auto")),
    "a mask of numbers": ("inpaint", (PHOTO, PHOTO[..., 0], BackendChoice("auto"))),
    "too many variants": ("fill_variants", (PHOTO, MASK, BackendChoice("auto"), 10**6)),
    "a flag for a number": ("fill_variants", (PHOTO, MASK, BackendChoice("auto"), True)),
}


@over("name", ASKED_WRONGLY)
def test_arguments_that_a_function_does_not_take_are_refused(name: str) -> None:
    function, arguments = ASKED_WRONGLY[name]
    with pytest.raises(MessageError):
        table()[function].checked(arguments)


def test_the_right_arguments_are_taken() -> None:
    assert table()["lift"].checked(LIFT) is LIFT


UNSOUND = {
    "a mask of another size": Found(MASK[:5], "x", None),
    "a plate beyond the photo": Plate(25, 0, PHOTO, MASK, "x"),
    "a plate with a hole of another size": Plate(0, 0, PHOTO, MASK[:5], "x"),
    "a plate of another depth": Plate(0, 0, PHOTO.astype(np.uint16), MASK, "x"),
    "colours of another size": Matte(0, 0, np.ones((4, 4)), np.ones((3, 4, 3))),
}


@pytest.mark.parametrize("name", UNSOUND)
def test_answers_whose_parts_do_not_fit_are_not_believed(name: str) -> None:
    assert not is_sound(UNSOUND[name], (PHOTO, MASK))
    assert not is_sound(("text", UNSOUND[name]), (Cut(PHOTO, CAMERA, MASK),))


def test_answers_whose_parts_fit_are_believed() -> None:
    answers = (Found(MASK, "x", 0.5), Plate(0, 0, PHOTO, MASK, "x"), "a text", None)
    assert all(is_sound(answer, (PHOTO, MASK)) for answer in answers)


def test_everything_served_is_a_job_function_by_its_own_name() -> None:
    from objectmorpher.worker import job_functions

    for name, row in table().items():
        assert getattr(job_functions, name) is row.function


def test_a_photo_has_one_name_with_every_click_and_another_photo_another():
    small = np.arange(300, dtype=np.uint8).reshape(10, 10, 3)
    large = np.zeros((1000, 400, 3), np.uint8)
    names = []
    for photo in (small, small + np.uint8(1), large, large + np.uint8(1)):
        for mask in (np.ones((1200, 1200), bool), np.zeros(3, bool)):
            message = encode((mask, photo), types(), is_split=True)
            names.append(name_of(decode(message.body, types(), message.blobs)[1], message.blobs))
            assert (photo.nbytes < LARGE) == (names[-1] not in message.blobs)
    assert names[::2] == names[1::2] and len(set(names)) == 4
