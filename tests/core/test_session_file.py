"""A saved document comes back equal, array by array; anything else is refused in one sentence."""

from __future__ import annotations

import dataclasses
import io
import json
import zipfile

import numpy as np
import pytest

from objectmorpher_core.base.camera import Camera
from objectmorpher_core.document import edits
from objectmorpher_core.document.gaussians import Gaussians
from objectmorpher_core.document.model import (
    Click,
    Document,
    EditObject,
    Handle,
    LiftedObject,
    Matte,
    Photo,
    PhotoTexture,
    Placement,
    Plate,
    Pose,
    Prompt,
)
from objectmorpher_core.document.rig import Rig, Seam
from objectmorpher_core.document.settings import DeformSettings, Hint
from objectmorpher_core.pictures.image import Picture, encode_picture, read_picture
from objectmorpher_core.session.file import (
    SessionError,
    decode_session,
    encode_session,
    save_session,
)
from objectmorpher_core.splat_files.splats.ply import decode_ply

COUNT, NODES = 200, 16


def lifted_object(random: np.random.Generator) -> LiftedObject:
    quats = random.normal(size=(COUNT, 4))
    quats /= np.linalg.norm(quats, axis=1, keepdims=True)
    gaussians = Gaussians(
        random.normal(size=(COUNT, 3)).astype(np.float32), quats.astype(np.float32),
        random.uniform(0.01, 0.1, (COUNT, 3)).astype(np.float32),
        random.uniform(0, 1, COUNT).astype(np.float32),
        random.uniform(0, 1, (COUNT, 3)).astype(np.float32),
    )  # fmt: skip
    texture = PhotoTexture(
        random.uniform(0, 99, (COUNT, 2)), random.uniform(size=COUNT), random.uniform(size=COUNT)
    )
    return LiftedObject(
        gaussians, texture, random.normal(size=(NODES, 3)), random.normal(size=(4, 4)),
        float(np.float64(1) / 3), "relief", "mip", up=(0.0, -0.6, -0.8),
    )  # fmt: skip


def full_document(photo: Picture, source: bytes) -> Document:
    """A document with something in every field."""
    random = np.random.default_rng(11)
    height, width = photo.pixels.shape[:2]
    mask = np.zeros((height, width), bool)
    mask[20:80, 30:90] = True
    matte = Matte(
        10, 15, random.uniform(size=(70, 90)).astype(np.float32),
        random.uniform(size=(70, 90, 3)).astype(np.float32),
    )  # fmt: skip
    edited = EditObject(
        "Cat", Prompt((Click(40.25, 50.5), Click(5.0, 6.0, False)), (1.0, 2.0, 90.0, 91.5), True),
        mask, matte, lifted_object(random),
        (Handle(3, random.normal(size=3), random.normal(size=3)),
         Handle(5, random.normal(size=3), random.normal(size=3), True, random.normal(size=3), 0.5)),
        False, DeformSettings("laplacian", "euclidean", True, 0.7, 1.6, True),
        Rig((Seam([0, 1], [2]), Seam([3], [4], True)), ([0, 2], [1, 4]), [5],
            random.uniform(0.5, 2.0, NODES), random.normal(size=(1, 3))),
        Pose(random.normal(size=(NODES, 3)), random.normal(size=(NODES, 3, 3))),
        Placement((0.1, -7.0), 1e-17, (15.0, 0.1 + 0.2, -3.0), 1.5), False,
    )  # fmt: skip
    only_clicked = EditObject("Näse", Prompt((Click(1.0, 2.0),)))
    plate = Plate(12, 14, photo.pixels[14:90, 12:95] ^ 1, mask[14:90, 12:95], "patchmatch")
    return Document(
        Photo(photo, Camera.from_fov(width, height, 47.11), source, "a photo.PNG"),
        (edited, only_clicked), plate, (("segment", "dino"), ("inpaint", "patchmatch")), 12345,
        hints=(Hint((3.0, 0.1 + 0.2), (20.5, 30.0), 7.25),),
    )  # fmt: skip


@pytest.fixture(params=[8, 16])
def document(request, chelsea) -> Document:
    pixels = chelsea[:120, :140]
    if request.param == 16:
        pixels = pixels.astype(np.uint16) * 200 + 7
    source = encode_picture(Picture(pixels, pixels[..., 0]), "png")
    return full_document(read_picture(source), source)


def assert_equal(got, expected, where="document"):
    """Same types, same values, arrays bit for bit."""
    assert type(got) is type(expected), where
    if isinstance(expected, np.ndarray):
        assert got.dtype == expected.dtype, where
        assert got.shape == expected.shape, where
        assert got.tobytes() == expected.tobytes(), where
        assert not got.flags.writeable, where
    elif dataclasses.is_dataclass(expected):
        for f in dataclasses.fields(expected):
            assert_equal(getattr(got, f.name), getattr(expected, f.name), f"{where}.{f.name}")
    elif isinstance(expected, tuple):
        assert len(got) == len(expected), where
        for k, (a, b) in enumerate(zip(got, expected, strict=True)):
            assert_equal(a, b, f"{where}[{k}]")
    else:
        assert got == expected, where


def test_round_trip(document):
    assert_equal(decode_session(encode_session(document)), document)


def test_a_name_that_is_not_utf_8_comes_back_and_others_stay_readable(document):
    """Linux lets any bytes name a file; Python reads each odd one as half of a surrogate pair."""
    photo = dataclasses.replace(document.photo, name="caf\udce9.png")
    named = dataclasses.replace(document, photo=photo)
    data = encode_session(named)
    assert_equal(decode_session(data), named)
    text = members_of(data)["document.json"].decode("utf-8")
    assert '"caf\\udce9.png"' in text and '"Näse"' in text


def test_copies_are_copies_again(document):
    """What only has the same mask is none."""
    other = dataclasses.replace(document.objects[0].lifted, doubt=0.5)
    document = edits.duplicate(edits.duplicate(document, 0), 0)
    last = dataclasses.replace(document.objects[-1], lifted=other)
    data = encode_session(document.with_object(len(document.objects) - 1, last))
    loaded = decode_session(data)
    own, _, copy, alien = loaded.objects
    assert copy.mask is own.mask and copy.lifted is own.lifted and copy.matte is own.matte
    assert alien.mask is own.mask and alien.lifted is not own.lifted
    assert encode_session(loaded) == data


def test_a_fresh_document(chelsea):
    source = encode_picture(Picture(chelsea), "jpg")
    picture = read_picture(source)
    document = Document(Photo(picture, Camera.from_fov(451, 300), source, "chelsea.jpg"))
    back = decode_session(encode_session(document))
    assert_equal(back, document)
    assert back.photo.source == source


def test_a_photo_without_a_file_is_stored_as_png(chelsea):
    document = Document(Photo(Picture(chelsea), Camera.from_fov(451, 300), b"", "made"))
    back = decode_session(encode_session(document))
    np.testing.assert_array_equal(back.photo.pixels, chelsea)


def test_the_same_document_gives_the_same_bytes(document):
    data = encode_session(document)
    assert encode_session(document) == data
    assert encode_session(decode_session(data)) == data


def test_other_programs_can_read_the_parts(document):
    with zipfile.ZipFile(io.BytesIO(encode_session(document))) as archive:
        assert archive.testzip() is None
        gaussians = decode_ply(archive.read("objects/0/gaussians.ply"))
        arrays = np.load(io.BytesIO(archive.read("arrays.npz")), allow_pickle=False)
        assert archive.read("photo/photo.png") == document.photo.source
    lifted = document.objects[0].lifted
    np.testing.assert_array_equal(gaussians.means, lifted.gaussians.means)
    np.testing.assert_array_equal(arrays["objects/0/pose/points"], document.objects[0].pose.points)


def test_saving_replaces_the_file(document, tmp_path):
    path = tmp_path / "edit.omorph"
    path.write_bytes(b"before")
    save_session(document, path)
    assert_equal(decode_session(path.read_bytes()), document)


def members_of(data: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def zipped(members: dict[str, bytes]) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return out.getvalue()


def with_head(data: bytes, change) -> bytes:
    """The session with document.json changed."""
    members = members_of(data)
    head = json.loads(members["document.json"])
    change(head)
    return zipped(members | {"document.json": json.dumps(head).encode()})


def with_array(data: bytes, path: str, array: np.ndarray) -> bytes:
    """The session with another array, its hash made right."""
    import hashlib

    members = members_of(data)
    arrays = dict(np.load(io.BytesIO(members["arrays.npz"])))
    out = io.BytesIO()
    np.savez(out, **(arrays | {path: array}))
    members["arrays.npz"] = out.getvalue()

    def change(head):
        head["sha256"]["arrays.npz"] = hashlib.sha256(out.getvalue()).hexdigest()

    return with_head(zipped(members), change)


def test_fields_that_older_sessions_lack_get_their_default(document):
    def change(head):
        del head["document"]["seed"], head["document"]["objects"][0]["is_visible"]

    back = decode_session(with_head(encode_session(document), change))
    assert back.seed == 0
    assert back.objects[0].is_visible


SPOILED = {
    "empty": (lambda d: b"", "not a zip file"),
    "text": (lambda d: b"hello", "not a zip file"),
    "cut": (lambda d: d[: len(d) // 2], "not a zip file, is damaged or ends early"),
    "flipped bit": (lambda d: d[:5000] + bytes([d[5000] ^ 8]) + d[5001:], "damaged"),
    "another zip": (lambda d: zipped({"readme": b"x"}), "not a session"),
    "newer": (lambda d: with_head(d, lambda h: h.update(version=7)), r"newer version \(7\)"),
    "no version": (lambda d: with_head(d, lambda h: h.pop("version")), "no valid version"),
    "member gone": (
        lambda d: zipped({k: v for k, v in members_of(d).items() if k != "plate/hole.png"}),
        r"plate/hole.png is missing",
    ),
    "other mask": (
        lambda d: zipped(members_of(d) | {"objects/0/mask.png": b"x"}),
        r"objects/0/mask.png is not what was saved",
    ),
    "unlisted member": (
        lambda d: with_head(d, lambda h: h["sha256"].pop("plate/hole.png")),
        r"damaged at document.plate.hole",
    ),
    "traversal": (lambda d: zipped(members_of(d) | {"../x": b""}), "forbidden name"),
    "absolute": (lambda d: zipped(members_of(d) | {"/etc/x": b""}), "forbidden name"),
    "NaN in an array": (
        lambda d: with_array(d, "objects/0/pose/points", np.full((NODES, 3), np.nan)),
        "not finite",
    ),
    "wrong shape": (
        lambda d: with_array(d, "objects/0/pose/points", np.zeros((3, 3))),
        r"pose is \(3, 3\), expected \(16, 3\)",
    ),
    "pickle": (
        lambda d: with_array(d, "objects/0/pose/points", np.array([{}], dtype=object)),
        "no array",
    ),
    "NaN in the tree": (
        lambda d: with_head(d, lambda h: h["document"].update(seed=float("nan"))),
        "document.json is damaged",
    ),
    "wrong type": (
        lambda d: with_head(d, lambda h: h["document"].update(seed="x")),
        "damaged at document.seed",
    ),
    "no name": (
        lambda d: with_head(d, lambda h: h["document"]["objects"][0].pop("name")),
        r"damaged at document.objects.0.name",
    ),
    "handle beyond": (
        lambda d: with_head(
            d, lambda h: h["document"]["objects"][0]["handles"][0].update(control_point=NODES)
        ),
        "control point 16 of 16",
    ),
    "unknown splatting": (
        lambda d: with_head(
            d, lambda h: h["document"]["objects"][0]["lifted"].update(splatting="star")
        ),
        "splatting is 'star', not one of",
    ),
    "plate outside": (
        lambda d: with_head(d, lambda h: h["document"]["plate"].update(left=100)),
        "not inside the photo",
    ),
    "nested": (
        lambda d: zipped({"document.json": b"[" * 100_000}),
        "document.json is damaged",
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", SPOILED)
def test_bad_sessions_give_one_sentence(kind, document):
    spoil, sentence = SPOILED[kind]
    with pytest.raises(SessionError, match=sentence) as caught:
        decode_session(spoil(encode_session(document)))
    assert "\n" not in str(caught.value)


def test_values_beyond_numbers_are_not_saved(document):
    pose = Pose(np.full((NODES, 3), np.inf), np.zeros((NODES, 3, 3)))
    broken = dataclasses.replace(document.objects[0], pose=pose)
    with pytest.raises(SessionError, match="objects/0/pose/points holds values"):
        encode_session(document.with_object(0, broken))


def test_a_coverage_that_is_not_the_masks_is_refused(document):
    item = document.objects[0]
    coverage = np.where(item.mask, np.uint8(200), np.uint8(30))
    soft = dataclasses.replace(item, coverage=coverage, found=~item.mask)
    good = dataclasses.replace(document, objects=(soft, document.objects[1]))
    back = decode_session(encode_session(good)).objects[0]
    np.testing.assert_array_equal(back.coverage, coverage)
    np.testing.assert_array_equal(back.found, ~item.mask)
    for bad in ({"coverage": 255 - coverage}, {"coverage": coverage / 255}, {"found": coverage}):
        objects = (dataclasses.replace(soft, **bad), document.objects[1])
        with pytest.raises(SessionError):
            decode_session(encode_session(dataclasses.replace(document, objects=objects)))


def test_a_level_that_does_not_exist_is_refused(document):
    item = document.objects[0]
    strange = dataclasses.replace(item.prompt)
    object.__setattr__(strange, "level", "planet")
    objects = (dataclasses.replace(item, prompt=strange), document.objects[1])
    with pytest.raises(SessionError, match="level is 'planet'"):
        decode_session(encode_session(dataclasses.replace(document, objects=objects)))
