"""Sessions: a document in a zip file (.omorph), so that reloading shows the same picture.

    document.json       version, every choice, and the SHA-256 of each other member
    photo/NAME          the opened file's own bytes
    objects/0/mask.png  masks, and the plate's pixels
    arrays.npz          every other array, exactly (never pickled)
    objects/0/*.ply     the Gaussians once more, for other programs; not read back

What is stored follows from the dataclasses of `document.py`: a new field there needs nothing here
but a default, which is what older sessions get. The same document gives the same bytes.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import IO, Any

import numpy as np

from ..base.arrays import same_values
from ..base.camera import Camera
from ..base.files import OutputError, reason_of, write_all
from ..base.limits import PICTURE_PIXELS, SESSION_DOCUMENT, SESSION_OBJECTS
from ..base.quoting import named, shown
from ..document.model import SELECTED, Document, EditObject, KeyPose, Photo
from ..document.paint import SIDE
from ..document.settings import LEAST_FEATHER, MOST_FEATHER
from ..pictures.image import ImageError, encode_picture, read_picture
from .tree import ArrayError, SessionError, TreeReader, TreeWriter, encode_tree, read_npy
from .zip import FilePieces, Member, Npy, Zip, digest, scratch_file, write_zip

__all__ = [
    "SessionError", "decode_session", "encode_session", "load_session", "read_session",
    "save_session",
]  # fmt: skip

VERSION = 1
FORMAT = "objectmorpher session"
DOCUMENT, ARRAYS = "document.json", "arrays.npz"
MOST_TEXTURE = 1 << 20  # px, how far from the photo's corner an object's texture may lie
MAX_HORIZON = 100  # x the photo's height, how far outside it the horizon may be
MOST_INVENTED = 16_000_000  # px of an object's pictures of its sides, and of further photos


def save_session(document: Document, path: Path) -> None:
    """Writes the session file, whole or not at all. Raises OutputError, SessionError."""
    try:
        with scratch_file(path.parent) as file:
            write_session(document, file, path.parent)
            write_all({path: FilePieces(file)})
    except OutputError:
        raise
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {reason_of(error)}") from error


def encode_session(document: Document) -> bytes:
    """The bytes of the document's session file. Raises SessionError for values beyond numbers."""
    file = io.BytesIO()
    write_session(document, file)
    return file.getvalue()


def write_session(document: Document, file: IO[bytes], folder: Path | None = None) -> None:
    """Write a session into an open file; `folder` has room for as much again where it is large.

    Raises SessionError, OSError.
    """
    from ..splat_files.splats.ply import encode_ply

    members: dict[str, Member] = {}
    photo = document.photo
    ending = PurePosixPath(photo.name).suffix.lower()
    source = f"photo/photo{ending if ending.isascii() and ending[1:].isalnum() else ''}"
    members[source] = photo.source or encode_picture(photo.picture, "png")
    writer = TreeWriter(skipped=(Photo,))
    tree = writer.tree(document, "")
    tree["photo"] = {
        "name": photo.name,
        "source": source,
        "camera": writer.tree(photo.camera, "camera"),
    }
    members |= writer.pictures
    for k, item in enumerate(document.objects):
        if item.lifted is not None:
            members[f"objects/{k}/gaussians.ply"] = encode_ply(item.lifted.gaussians)
    with scratch_file(folder) as arrays:
        write_zip(arrays, {f"{path}.npy": Npy(a) for path, a in writer.arrays.items()})
        members[ARRAYS] = FilePieces(arrays)
        head = {
            "format": FORMAT,
            "version": VERSION,
            "document": tree,
            "sha256": {name: digest(member) for name, member in members.items()},
        }
        text = encode_tree(head, indent=1, sort_keys=True)
        write_zip(file, {DOCUMENT: text} | members)


def decode_session(data: bytes) -> Document:
    """The document of a session file's bytes, equal to the saved one array by array.

    Raises SessionError: one sentence.
    """
    return read_session(io.BytesIO(data))


def load_session(path: Path) -> Document:
    """The document of a session file. Raises SessionError, which names the file, and OSError."""
    try:
        with path.open("rb") as file:
            return read_session(file)
    except SessionError as error:
        raise SessionError(f"{named(path.name)}: {error}") from error


def read_session(file: IO[bytes]) -> Document:
    """Read a session from an open file.

    Only what its document names is unpacked, member by member (docs/formats.md).
    """
    with Zip(file, "session") as archive:
        head = _head(archive)
        hashes = head.get("sha256")
        if not isinstance(hashes, dict):
            raise SessionError("the session's document.json is damaged: sha256 is missing")
        members = _Members(archive, hashes)
        members.demand(ARRAYS)
        with archive.inner(ARRAYS) as inner:
            members.check(ARRAYS)
            return build_document(head.get("document"), members, _Arrays(inner))


class _Members(Mapping[str, bytes]):
    """What document.json names, unpacked when it is asked for: nothing else ever is."""

    def __init__(self, archive: Zip, hashes: dict[str, Any]) -> None:
        self._archive, self._hashes = archive, hashes

    def __getitem__(self, name: str) -> bytes:
        if name not in self._hashes:
            raise KeyError(name)
        self.demand(name)
        data = self._archive.read(name)
        self._compare(name, data)
        return data

    def __contains__(self, name: object) -> bool:
        return name in self._hashes

    def __iter__(self) -> Iterator[str]:
        return iter(self._hashes)

    def __len__(self) -> int:
        return len(self._hashes)

    def demand(self, name: str) -> None:
        """Raises SessionError unless the member is there."""
        if name not in self._hashes or name not in self._archive.names:
            raise SessionError(f"the session is incomplete: {named(name)} is missing")

    def check(self, name: str) -> None:
        """Raises SessionError unless a member is as it was saved; it is not kept."""
        self._compare(name, self._archive.pieces(name))

    def _compare(self, name: str, data: bytes | Iterable[bytes]) -> None:
        if digest(data) != self._hashes[name]:
            raise SessionError(f"the session is damaged: {named(name)} is not what was saved")


class _Arrays(Mapping[str, np.ndarray]):
    """The arrays of arrays.npz by path, unpacked when they are asked for.

    Never a pickle, never a value beyond numbers.
    """

    def __init__(self, archive: Zip) -> None:
        self._archive = archive
        self._names = {name.removesuffix(".npy"): name for name in archive.names}
        self._known: dict[str, np.ndarray] = {}

    def __getitem__(self, path: str) -> np.ndarray:
        if path not in self._known:
            name = self._names[path]
            try:
                self._known[path] = read_npy(self._archive.read(name))
            except ArrayError as error:
                raise SessionError(f"the session is damaged: {named(name)} is {error}") from error
        return self._known[path]

    def __contains__(self, path: object) -> bool:
        return path in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


def build_document(
    tree: Any, members: Mapping[str, bytes], arrays: Mapping[str, np.ndarray]
) -> Document:
    """The document of document.json's tree; `members` hold the photo's file and the pictures.

    Raises SessionError where the parts do not fit each other.
    """
    reader = TreeReader(members, arrays)
    if not isinstance(tree, dict):
        raise SessionError("the session's document.json is damaged: document is missing")
    objects = tree.get("objects")
    if isinstance(objects, list) and len(objects) > SESSION_OBJECTS:
        raise SessionError(
            f"the session is damaged: {len(objects):,} objects are more than {SESSION_OBJECTS}"
        )
    photo = _photo(tree.get("photo"), members, reader)
    reader.most = max(reader.most, _most_carried(objects))
    reader.most_colours = max(reader.most, MOST_INVENTED)
    try:
        document = _with_copies(reader.value(Document, tree | {"photo": photo}, "document"))
        _check(document)
    except SessionError:
        raise
    except (ValueError, TypeError) as error:
        raise SessionError(f"the session is damaged: {error}") from error
    return document


def _head(archive: Zip) -> dict[str, Any]:
    """document.json, of this version."""
    if DOCUMENT not in archive.names:
        raise SessionError("the file is a zip archive but not a session: it has no document.json")
    try:
        text = archive.read(DOCUMENT, SESSION_DOCUMENT)
        head = json.loads(text, parse_constant=_refuse_constant)
    except SessionError:
        raise
    except (ValueError, RecursionError) as error:
        raise SessionError("the session's document.json is damaged") from error
    if not isinstance(head, dict) or head.get("format") != FORMAT:
        raise SessionError("the file is a zip archive but not a session")
    version = head.get("version")
    if not isinstance(version, int) or isinstance(version, bool) or version < 1:
        raise SessionError(f"the session has no valid version ({shown(version)})")
    if version > VERSION:
        raise SessionError(f"the session was made by a newer version ({shown(version)})")
    return head


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is not a number")


def _photo(tree: object, members: Mapping[str, bytes], reader: TreeReader) -> Photo:
    """The photo, its picture decoded from the original file's bytes, and no larger than it says."""
    name = tree.get("source") if isinstance(tree, dict) else None
    if not isinstance(tree, dict) or not isinstance(name, str) or name not in members:
        raise SessionError("the session is damaged: its photo is missing")
    camera = reader.value(Camera, tree.get("camera"), "photo.camera")
    reader.most = camera.width * camera.height
    source = members[name]
    try:
        picture = read_picture(source, reader.most)
    except ImageError as error:
        raise SessionError(f"the session's photo cannot be read: {error}") from error
    return Photo(picture, camera, source, reader.value(str, tree.get("name"), "photo.name"))


def _most_carried(objects: object) -> int:
    """Px of the largest other photo that objects say they come from: they may be as large."""
    most = 0
    for item in objects if isinstance(objects, list) else ():
        for name in ("lifted", "origin", "camera"):
            item = item.get(name) if isinstance(item, dict) else None
        if isinstance(item, dict):
            width, height = item.get("width"), item.get("height")
            if isinstance(width, int) and isinstance(height, int) and min(width, height) > 0:
                most = max(most, min(width * height, PICTURE_PIXELS))
    return most


def _with_copies(document: Document) -> Document:
    """Copies of an object share its mask, cut-out and shape, by which they are known as copies."""
    known: dict[bytes, np.ndarray] = {}
    objects: list[EditObject] = []
    for item in document.objects:
        if item.mask is not None:
            key = hashlib.sha256(item.mask.data).digest() + repr(item.mask.shape).encode()
            mask = known.setdefault(key, item.mask)
            item = item if mask is item.mask else replace(item, mask=mask)
        for other in objects:
            if item.lifted is not None and other.mask is item.mask:
                item = _sharing(item, other)
        objects.append(item)
    return replace(document, objects=tuple(objects))


def _sharing(item: EditObject, other: EditObject) -> EditObject:
    """`item` with the cut-out and the shape of `other` where they hold the same values."""
    if same_values(other.matte, item.matte):
        item = replace(item, matte=other.matte)
    if same_values(other.lifted, item.lifted):
        item = replace(item, lifted=other.lifted)
    return item


def _check(document: Document) -> None:
    """ValueError where the document's arrays do not fit each other."""
    width, height = document.photo.size
    camera = document.photo.camera
    _same("the camera", (camera.width, camera.height), (width, height))
    for item in document.objects:
        if item.mask is not None:
            _same("mask", item.mask.shape, (height, width))
        _check_coverage(item)
        if not 0 <= item.decontaminate <= 1:
            raise ValueError(f"an object's decontamination is {item.decontaminate:g}")
        if item.contaminated is not None and item.matte is not None:
            _same("an edge's colours", item.contaminated.shape, item.matte.foreground.shape)
        if item.matte is not None:
            _same("matte", item.matte.foreground.shape, (*item.matte.alpha.shape, 3))
            _near("matte", item.matte.box, _size_around(item, (width, height)))
        _check_paint(item)
        _check_lifted(item)
        if item.seen_from is not None and not 0 <= item.seen_from <= 90:
            raise ValueError(f"an object is seen from {item.seen_from:g} degrees above")
    if document.horizon is not None and abs(document.horizon) > MAX_HORIZON * height:
        raise ValueError(f"a horizon at {document.horizon:g} px is far outside the photo")
    if (depth := document.depth) is not None and (depth.ndim != 2 or not depth.size):
        raise ValueError(f"a depth map is {depth.shape}, not a number for each pixel")
    if (plate := document.plate) is not None:
        _same("plate", plate.pixels.shape, (*plate.hole.shape, 3))
        _inside("plate", plate.box, (width, height))
        if plate.pixels.dtype != document.photo.pixels.dtype:
            raise ValueError("the plate has another bit depth than the photo")
        if plate.painted is not None:
            _same("the plate's repairs", plate.painted.shape, plate.hole.shape)
    if (refined := document.refined) is not None:
        _same("refinement", refined.pixels.shape, (*refined.alpha.shape, 3))
        _inside("refinement", refined.box, (width, height))
        if refined.pixels.dtype != document.photo.pixels.dtype:
            raise ValueError("the refinement has another bit depth than the photo")
        if not 0 <= refined.strength <= 1:
            raise ValueError(f"a refinement's strength is {refined.strength:g}")
    _check_joining(document)


def _check_joining(document: Document) -> None:
    """Shadows, light and edges."""
    if not LEAST_FEATHER <= document.feather <= MOST_FEATHER:
        raise ValueError(f"the blend is {document.feather:g} times as wide as usual")
    for item in document.objects:
        item.shadow.check()
        item.finish.check()
        shares = {
            "harmony": item.harmony, "relighting": item.relight,
            "grain": item.grain, "defocus": item.defocus,
        }  # fmt: skip
        for name, value in shares.items():
            if not 0 <= value <= 1:
                raise ValueError(f"an object's {name} is {value:g}, not between 0 and 1")


def _check_coverage(item: EditObject) -> None:
    """A soft mask, what the edge brush found, and a prompt's answer belong to the mask."""
    if item.coverage is not None:
        if item.mask is None or item.coverage.dtype != np.uint8:
            raise ValueError("an object's coverage belongs to no mask")
        if not np.array_equal(item.coverage >= SELECTED, item.mask):
            raise ValueError("an object's coverage is not that of its mask")
    for of_photo in (item.found, item.mixed):
        shape = None if item.mask is None else item.mask.shape
        if of_photo is not None:
            _same("a part of a mask", (of_photo.shape, of_photo.dtype), (shape, np.dtype(bool)))


def _check_paint(item: EditObject) -> None:
    paint = None if item.matte is None else item.matte.paint
    if paint is None:
        return
    if item.lifted is None:
        raise ValueError("an object that is not lifted is painted")
    count = len(item.lifted.gaussians)
    _same("paint on Gaussians", paint.spots.shape, (count, 4))
    if paint.apart is not None:
        _same("paint apart", paint.apart.shape, (count,))
    for tile in paint.tiles:
        _same("paint", tile.rgba.shape, (SIDE, SIDE, 4))
        if max(abs(tile.left), abs(tile.top)) > MOST_TEXTURE or tile.left % SIDE or tile.top % SIDE:
            raise ValueError("paint lies where no texture is")


def _check_lifted(item: EditObject) -> None:
    lifted = item.lifted
    if lifted is None:
        if item.handles or item.pose is not None or not item.base.is_usual or item.keys:
            raise ValueError("an object that is not lifted has handles")
        return
    count, nodes = len(lifted.gaussians), len(lifted.control_points)
    _same("u0", lifted.texture.u0.shape, (count, 2))
    _same("visibility", lifted.texture.visibility.shape, (count,))
    _same("solidity", lifted.texture.solidity.shape, (count,))
    if (sides := lifted.sides) is not None:
        found = sides.at.shape, sides.slopes.shape, sides.zoom.shape, sides.pixels.shape[2:]
        _same("sides", found, ((count, 2), (count, 2, 3), (count,), (3,)))
    _same("control_points", lifted.control_points.shape, (nodes, 3))
    _same("world_from_object", lifted.world_from_object.shape, (4, 4))
    item.rig.check(nodes)
    for state in (item, *item.keys):
        _check_posed(state, nodes)
    for key in item.keys:
        replace(item.rig, held=key.held, shifts=key.shifts).check(nodes)


def _size_around(item: EditObject, size: tuple[int, int]) -> tuple[int, int]:
    """Width and height px of the photo that an object was cut out of. ValueError for nonsense."""
    if item.lifted is None or (origin := item.lifted.origin) is None:
        return size
    own = origin.camera
    numbers = (own.focal, own.cx, own.cy, *(origin.light or ()))
    if not np.isfinite(numbers).all() or own.focal <= 0 or min(own.width, own.height) < 1:
        raise ValueError("the camera of an object of another photo makes no sense")
    if min(origin.light or (0.0,)) < 0:
        raise ValueError("the light around an object of another photo is negative")
    return own.width, own.height


def _check_posed(state: EditObject | KeyPose, nodes: int) -> None:
    """Handles, poses and anchors are of an object of so many control points."""
    for handle in (*state.handles, *state.base.handles):
        _same("handle", (handle.point.shape, handle.target.shape), ((3,), (3,)))
        if not 0 <= handle.control_point < nodes:
            raise ValueError(f"a handle names control point {handle.control_point} of {nodes}")
        if handle.turn is not None:
            _same("a handle's turn", handle.turn.shape, (3,))
        if not handle.softness >= 0:
            raise ValueError(f"a handle's softness is {handle.softness:g}")
    for pose in (state.pose, state.base.pose):
        if pose is not None:
            _same("pose", pose.points.shape, (nodes, 3))
            _same("rotations", pose.rotations.shape, (nodes, 3, 3))
    anchors = state.base.anchors
    if anchors is not None and (
        anchors.ndim != 1 or not ((anchors >= 0) & (anchors < nodes)).all()
    ):
        raise ValueError(f"an anchor is none of the object's {nodes} control points")


def _same(what: str, found: tuple, expected: tuple) -> None:
    if found != expected:
        raise ValueError(f"{what} is {found}, expected {expected}")


def _inside(what: str, box: tuple[int, int, int, int], size: tuple[int, int]) -> None:
    if box[0] < 0 or box[1] < 0 or box[2] > size[0] or box[3] > size[1]:
        raise ValueError(f"the {what}'s box {box} is not inside the photo")


def _near(what: str, box: tuple[int, int, int, int], size: tuple[int, int]) -> None:
    """An object that the frame cuts goes on beyond it, by as much again at most."""
    width, height = size
    if box[0] < -width or box[1] < -height or box[2] > 2 * width or box[3] > 2 * height:
        raise ValueError(f"the {what}'s box {box} is not near the photo")
