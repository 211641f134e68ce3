"""The document: everything that is saved and undone. Immutable; compare parts with `is`.

What a change invalidates is written once, in the `with_*` methods of `EditObject`:
photo -> everything; another mask -> matte, lifted, plate; lifted -> handles, pose. A mask that is
only refined leaves all of that as it is until the shape has been refitted to it. Placement,
handles and pose invalidate nothing that is stored.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, replace
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np

from ..base.arrays import F32, F64, I32, U8, Mask, Pixels, Selection, freeze, frozen
from ..base.camera import Camera
from ..base.rotations import turn_matrix
from ..pictures.image import Picture
from .bounds import BACKS, KINDS, LEAST_THICKNESS, MOST_THICKNESS, MOST_VIEWS
from .gaussians import Gaussians
from .paint import Paint
from .pose import UNHELD, Base, Handle, Pose
from .rig import Rig
from .settings import AS_IN_THE_PHOTO, DeformSettings, Finish, Hint, Refined, Shadow
from .sides import FurtherView, Sides


@dataclass(frozen=True, eq=False)
class Photo:
    """The opened photo: its upright pixels, its camera, and the very bytes of its file."""

    picture: Picture
    camera: Camera
    source: bytes  # the file as it was opened; a session carries it
    name: str  # file name without folder

    @property
    def pixels(self) -> Pixels:
        """(H, W, 3) upright RGB, u8 or u16."""
        return self.picture.pixels

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) px."""
        return self.picture.pixels.shape[1], self.picture.pixels.shape[0]


@dataclass(frozen=True)
class Click:
    """A point that belongs to the object, or does not."""

    x: float  # image px
    y: float
    is_foreground: bool = True


LEVELS = ("part", "object", "group")  # how much around a click is meant, from little to much
SELECTED = 128  # of 255: from this coverage on a pixel belongs to the mask


@dataclass(frozen=True)
class Prompt:
    """The user's prompt for the object that is meant. `is_subject` asks for the salient subject."""

    clicks: tuple[Click, ...] = ()
    box: tuple[float, float, float, float] | None = None  # x0, y0, x1, y1 px
    is_subject: bool = False
    level: str = "object"  # of LEVELS: what a click means

    def __post_init__(self) -> None:
        if self.level not in LEVELS:
            raise ValueError(f"a click's level is {self.level!r}, not one of {', '.join(LEVELS)}")

    @property
    def is_empty(self) -> bool:
        return not self.clicks and self.box is None and not self.is_subject


@dataclass(frozen=True)
class BesidePrompt(Prompt):
    """A prompt in a photo where other objects are already: what they cover is background.

    It is asked, and not kept with a document.
    """

    taken: Mask | None = field(default=None, compare=False)  # (H, W)
    digest: str = ""  # of `taken`: prompts are compared by it

    def __post_init__(self) -> None:
        super().__post_init__()
        packed = b"" if self.taken is None else np.packbits(self.taken).tobytes()
        object.__setattr__(self, "digest", hashlib.sha256(packed).hexdigest())


@dataclass(frozen=True, eq=False)
class Matte:
    """Soft cut-out of an object inside a crop of the photo; alpha is 0 outside the crop.

    The crop may reach past the photo's frame where the object does.
    `foreground` is the object's own colour, freed of the background, and continued beyond the
    object so that sampling near the edge never meets the background.
    """

    left: int  # px, crop's corner in the photo
    top: int
    alpha: F32  # (h, w) in [0, 1]
    foreground: F32  # (h, w, 3) sRGB in [0, 1], straight
    paint: Paint | None = None  # over it, where the artist has painted

    def __post_init__(self) -> None:
        freeze(self, alpha=np.float32, foreground=np.float32)

    @property
    def box(self) -> tuple[int, int, int, int]:
        """x0, y0, x1, y1 px of the crop in the photo."""
        height, width = self.alpha.shape
        return self.left, self.top, self.left + width, self.top + height

    @property
    def shown(self) -> F32:
        """(h, w, 3) the foreground with its paint."""
        if self.paint is None:
            return self.foreground
        return self.paint.over(self.foreground, self.left, self.top)


@dataclass(frozen=True, eq=False)
class PhotoTexture:
    """The photo's texture on each Gaussian."""

    u0: F32  # (N, 2) px, its rest mean in the photo
    visibility: F32  # (N,) in [0, 1], 1 = its surface was seen in the photo
    solidity: F32  # (N,) in [0, 1], its alpha where the matte cannot be carried along

    def __post_init__(self) -> None:
        freeze(self, u0=np.float32, visibility=np.float32, solidity=np.float32)


@dataclass(frozen=True)
class Origin:
    """The other photo that an object comes from: what of it has to be known where it is now."""

    photo: str  # file name without folder
    camera: Camera  # in whose frame the object was lifted; it carries that photo, by those px
    light: tuple[float, float, float] | None = None  # linear RGB around it; None: not known
    home: Placement | None = None  # where it came into this one; None: not known


GAUSSIANS = 16_000  # default count; the detail is in the photo, they only follow the shape


@dataclass(frozen=True, eq=False)
class LiftSettings:
    """The user's words about an object's shape; the defaults follow its picture."""

    count: int = GAUSSIANS
    thickness: float = 1.0  # x what the silhouette says
    is_standing: bool = True  # whether it is turned as its feet on the ground tell
    is_symmetric: bool | None = None  # left and right; None: as it looks
    back: str = "auto"  # of BACKS
    hidden: Mask | None = None  # (H, W) of the photo where something stands before the object
    nearness: F32 | None = None  # (h, w) x its size, towards the camera; stretched over the photo
    horizon: float | None = None  # px, the row of the photo it lies in; None: not known
    uses_depth: bool = True  # whether a depth network, where one is installed, may tell its relief
    trust: float = 1.0  # in the shape network, of [0, 1]; 0: the silhouette alone gives the shape
    kind: str = "auto"  # of KINDS: what it is
    views: tuple[FurtherView, ...] = ()  # further photos of it

    def __post_init__(self) -> None:
        if self.back not in BACKS:
            raise ValueError(f"a back is {self.back!r}, not one of {', '.join(BACKS)}")
        if self.kind not in KINDS:
            raise ValueError(f"a shape is {self.kind!r}, not one of {', '.join(KINDS)}")
        if not LEAST_THICKNESS <= self.thickness <= MOST_THICKNESS:
            raise ValueError(
                f"a thickness of {self.thickness:g} is not between {LEAST_THICKNESS:g} and"
                f" {MOST_THICKNESS:g}"
            )
        if not 0.0 <= self.trust <= 1.0:
            raise ValueError(f"a trust of {self.trust:g} is not between 0 and 1")
        if len(self.views) > MOST_VIEWS:
            raise ValueError(f"{len(self.views)} further photos are more than {MOST_VIEWS}")
        freeze(self, hidden=np.bool_, nearness=np.float32)


AS_SEEN = LiftSettings()

HAIR = 0.998  # opacity of a relief's strands of hair: all else of it has 1
# see raster/rules.py
SPLATTINGS = ("surface", "solid", "edged surface", "edged solid", "mip", "classic")


@dataclass(frozen=True, eq=False)
class LiftedObject:
    """An object lifted to 3D, registered to the photo."""

    gaussians: Gaussians
    texture: PhotoTexture
    control_points: F32  # (M, 3) object frame; saved, because handles name them by index
    world_from_object: F64  # (4, 4) similarity at rest: the registration to the photo
    spacing: float  # object units, mean distance of neighbouring Gaussians on the surface
    backend: str
    splatting: str = "surface"  # how its Gaussians become a picture: of SPLATTINGS
    # (N, 3) world: depth of the middle sheet on each Gaussian's ray, and how it changes per px of
    # the photo; what a change of the thickness leaves where it is. None: it has no such sheet.
    middle: F32 | None = None
    kind: str = ""  # of KINDS, what it was recognised as; empty: nobody looked
    likeness: float = 1.0  # in [0, 1], to the kind that it was said to be
    # x its size, how far its front is expected to be from where it was put; 0: nobody said
    doubt: float = 0.0
    stands: bool = False  # whether it was seen to stand on something
    # Object frame, unit: what is up where it stands; None: its shape does not say
    up: tuple[float, float, float] | None = None
    sides: Sides | None = None  # invented; None: what the photo does not show has plain colours
    origin: Origin | None = None  # None: the document's own photo

    def __post_init__(self) -> None:
        freeze(self, middle=np.float32, control_points=np.float32)
        freeze(self, world_from_object=np.float64)
        if self.up is not None and not abs(np.linalg.norm(self.up) - 1) < UNIT:
            raise ValueError(f"what is up is {self.up}, not a direction of the length 1")
        if self.splatting not in SPLATTINGS:
            raise ValueError(f"splatting is {self.splatting!r}, not one of {', '.join(SPLATTINGS)}")

    def photo_camera(self, here: Camera) -> Camera:
        """The camera of the photo that it carries, where that of the document's photo is `here`."""
        return here if self.origin is None else self.origin.camera

    @cached_property
    def diameter(self) -> float:
        """Largest distance between two control points, object units (paper's D_scene)."""
        p = self.control_points.astype(np.float64)
        squares = (p * p).sum(1)
        gaps = squares[:, None] + squares[None, :] - 2 * p @ p.T
        return float(np.sqrt(max(gaps.max(), 0.0)))

    @cached_property
    def body(self) -> Gaussians:
        """The Gaussians that are the object itself, neither its soft edge nor its hair."""
        return self.gaussians.select(self.is_body)

    @cached_property
    def is_body(self) -> Mask:
        """(N,) which Gaussians those are: all, where none is solid."""
        is_solid = self.texture.solidity > 0.5
        return is_solid & ~self.is_hair if is_solid.any() else np.ones(len(is_solid), bool)

    @cached_property
    def is_hair(self) -> Mask:
        """(N,) which Gaussians are strands on its sides."""
        is_relief = self.splatting.startswith("edged")
        return is_relief & (self.gaussians.opacities == np.float32(HAIR))

    @cached_property
    def scale(self) -> float:
        """World units per object unit."""
        return float(np.cbrt(np.linalg.det(self.world_from_object[:3, :3])))

    @cached_property
    def centre(self) -> F64:
        """(3,) world; centre of the bounding box in camera axes at rest."""
        points = self.world_points(self.gaussians.means[~self.is_hair])
        return frozen(0.5 * (points.min(0) + points.max(0)))

    def world_points(self, points: np.ndarray) -> F64:
        """Object-frame points (..., 3) in the world, at rest."""
        return points @ self.world_from_object[:3, :3].T + self.world_from_object[:3, 3]

    def object_points(self, points: np.ndarray) -> F64:
        """World points (..., 3) in the object frame, at rest."""
        shifted = points - self.world_from_object[:3, 3]
        return shifted @ np.linalg.inv(self.world_from_object[:3, :3]).T


UNMOVED = frozen(np.eye(4))
MOTIONS = 8  # of an object, that are remembered
_motions: WeakKeyDictionary[LiftedObject, dict[object, F64]] = WeakKeyDictionary()
UNIT = 1e-6  # by which the length of a direction may differ from 1


@dataclass(frozen=True)
class Placement:
    """The placement of the whole object: scale, then turn, then move."""

    move: tuple[float, float] = (0.0, 0.0)  # px, of the centre's picture
    depth: float = 0.0  # object diameters away from the camera
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)  # degrees: yaw, pitch, roll
    scale: float = 1.0

    @property
    def is_identity(self) -> bool:
        return self == Placement()

    def matrix(self, lifted: LiftedObject, camera: Camera) -> F64:
        """World-from-world motion (4, 4) of the object that was at rest.

        Raises ValueError where the object would pass behind the camera.
        """
        if self.is_identity:
            return UNMOVED
        known = _motions.setdefault(lifted, {})  # a frame asks a dozen times
        if (motion := known.get((self, camera))) is not None:
            return motion.copy()
        centre = lifted.centre
        if centre[2] <= 0:
            raise ValueError(
                "the object reaches behind the camera: a smaller field of view helps, or less"
                " thickness"
            )
        depth = centre[2] + self.depth * lifted.diameter * lifted.scale
        if depth <= 1e-3 * centre[2]:
            raise ValueError(f"a depth of {self.depth:g} diameters is behind the camera")
        target = camera.unproject(camera.project(centre) + np.array(self.move), depth)
        linear = turn_matrix(*self.turn) * self.scale
        motion = np.eye(4)
        motion[:3, :3] = linear
        motion[:3, 3] = target - linear @ centre
        if len(known) >= MOTIONS:
            known.clear()
        known[self, camera] = motion.copy()
        return motion


@dataclass(frozen=True, eq=False)
class KeyPose:
    """An object's pose and place at one moment of an animation."""

    handles: tuple[Handle, ...] = ()
    pose: Pose | None = None  # None: at rest
    placement: Placement = Placement()
    held: I32 | None = None  # the rig's, as shifts are
    shifts: F64 | None = None
    base: Base = field(default_factory=Base)


@dataclass(frozen=True, eq=False)
class EditObject:
    """An object of the photo with everything that was done to it."""

    name: str
    prompt: Prompt = Prompt()
    mask: Mask | None = None  # (H, W)
    matte: Matte | None = None
    lifted: LiftedObject | None = None
    handles: tuple[Handle, ...] = ()
    has_auto_anchors: bool = True
    deform: DeformSettings = field(default_factory=DeformSettings)
    rig: Rig = field(default_factory=Rig)
    pose: Pose | None = None  # None: at rest
    placement: Placement = Placement()
    is_visible: bool = True
    layer: int = 0  # in front of all of a lower one; within a layer the nearer, see compose.order
    coverage: U8 | None = None  # (H, W) where the edge was drawn soft; None: found in the photo
    found: Mask | None = None  # (H, W) what was found or drawn, where the mask was changed since
    shadow: Shadow = field(default_factory=Shadow)
    harmony: float = 0.0  # in [0, 1], how far it takes on the light of where it is now
    relight: float = 0.0  # in [0, 1], how far the light stays where it was while it turns
    grain: float = 0.0  # in [0, 1], how much of the photo's grain that it has lost it is given
    defocus: float = 0.0  # in [0, 1], how far it is as blurred as the photo at its new depth
    shape: LiftSettings = field(default_factory=LiftSettings)
    stays_in_front: bool = False  # covers what is edited, as it does in the photo
    # (H, W) what matte and lift are of, where the mask was refined since; None: they are up to date
    shaped: Selection | None = None
    base: Base = field(default_factory=Base)  # what the handles move it from
    is_held_around: bool = False  # whether a drag leaves all that is not near it where it is
    is_grounded: bool = False  # moving it slides it over the ground
    mixed: Mask | None = None  # (H, W) where the coverage was found in the photo by the edge brush
    decontaminate: float = 0.0  # in [0, 1], how far the background's colour is out of its edge
    # (h, w, 3) the matte's foreground before that; None: as it is
    contaminated: F32 | None = None
    keys: tuple[KeyPose, ...] = ()  # key poses of an animation, as many as the document has
    finish: Finish = AS_IN_THE_PHOTO
    is_locked: bool = False  # against changes by a slip
    # Degrees above it, from which one looks down on it; None: as its shape or the horizon says
    seen_from: float | None = None

    @property
    def found_matte(self) -> Matte | None:
        """Return the matte as it was found, with what its edge holds of the background's colour."""
        if self.matte is None or self.contaminated is None:
            return self.matte
        return replace(self.matte, foreground=self.contaminated)

    @property
    def grounded_shadow(self) -> Shadow:
        """Return its shadow on the ground that the artist says it stands on."""
        if self.seen_from is None or self.shadow.ground is not None:
            return self.shadow
        return replace(self.shadow, ground=self.seen_from)

    @property
    def footing(self) -> Base:
        """Return the pose from which the handles move the object, and the parts that stay."""
        if self.base.anchors is None and not self.has_auto_anchors:
            return replace(self.base, anchors=UNHELD.anchors)
        return self.base

    @property
    def is_visitor(self) -> bool:
        """Whether it comes from another photo; its mask is empty then."""
        return self.lifted is not None and self.lifted.origin is not None

    @property
    def matte_here(self) -> Matte | None:
        """Its matte, if that is of this photo."""
        return None if self.is_visitor else self.matte

    @property
    def hides_background(self) -> bool:
        """Whether the plate is to be filled in behind it: not behind what is only selected."""
        return self.matte_here is not None

    @property
    def is_floating(self) -> bool:
        """Whether it neither stands nor is on the ground: it is drawn after how far away it is."""
        return not (self.shape.is_standing or self.is_grounded)

    @property
    def is_moved(self) -> bool:
        """Whether the object is anywhere else than in the photo, or looks otherwise."""
        return self.lifted is not None and (
            self.is_visitor or self.pose is not None or not self.placement.is_identity
            or not self.is_visible or self.finish != AS_IN_THE_PHOTO or self.is_painted
        )  # fmt: skip

    @property
    def is_painted(self) -> bool:
        return self.matte is not None and self.matte.paint is not None

    @property
    def is_only_painted(self) -> bool:
        """Whether it is painted, and where it was in the photo."""
        is_there = self.pose is None and self.placement.is_identity and not self.is_visitor
        return self.is_painted and is_there

    @property
    def shown(self) -> LiftedObject | None:
        """Return its lift with the paint on its Gaussians; for the texture's see `Matte.shown`."""
        if self.lifted is None or self.matte is None or self.matte.paint is None:
            return self.lifted
        gaussians, texture, paint = self.lifted.gaussians, self.lifted.texture, self.matte.paint
        gaussians = replace(gaussians, colors=paint.on_spots(gaussians.colors))
        texture = replace(texture, visibility=paint.visible(texture.visibility))
        return replace(self.lifted, gaussians=gaussians, texture=texture)

    @property
    def selection(self) -> Selection | None:
        """The mask, soft where the artist made it so."""
        return self.mask if self.coverage is None else self.coverage

    def with_mask(
        self, selection: Selection | None, prompt: Prompt, found: Mask | None = None
    ) -> EditObject:
        """A new mask, or coverage: matte, lift, handles, pose and placement are gone."""
        mask, coverage = _mask_and_coverage(selection)
        return EditObject(
            self.name, prompt=prompt, mask=mask, coverage=coverage,
            found=None if found is None else frozen(found, np.bool_), deform=self.deform,
            shape=self.shape, stays_in_front=self.stays_in_front, mixed=self._still_mixed(coverage),
        )  # fmt: skip

    def with_refined_mask(
        self, selection: Selection, prompt: Prompt, found: Mask | None = None
    ) -> EditObject:
        """A refined mask, or coverage, of the same thing: all that was done to it stays.

        Its shape is of the older mask until it is refitted, see `shaped`.
        """
        mask, coverage = _mask_and_coverage(selection)
        return replace(
            self, prompt=prompt, mask=mask, coverage=coverage,
            found=None if found is None else frozen(found, np.bool_),
            shaped=self.selection if self.shaped is None else self.shaped,
            mixed=self._still_mixed(coverage),
        )  # fmt: skip

    def _still_mixed(self, coverage: U8 | None) -> Mask | None:
        """Where (H, W) the edge brush has found an edge that another `coverage` leaves as it is."""
        if self.mixed is None or self.coverage is None or coverage is None:
            return None
        if coverage.shape != self.mixed.shape:
            return None
        kept = self.mixed & (coverage == self.coverage)
        return frozen(kept) if kept.any() else None

    def with_lifted(
        self, matte: Matte, lifted: LiftedObject, shape: LiftSettings | None = None
    ) -> EditObject:
        """A new lift: handles, rig and poses named the old one's control points and are gone."""
        fresh = replace(
            self, handles=(), rig=Rig(), pose=None, base=Base(), keys=(),
            shape=shape or self.shape,
            contaminated=self.contaminated if matte is self.matte else None,
        )  # fmt: skip
        shaped = self.shaped if matte is self.matte else None
        return replace(fresh, matte=matte, lifted=lifted, stays_in_front=False, shaped=shaped)


def _mask_and_coverage(selection: Selection | None) -> tuple[Mask | None, U8 | None]:
    """A selection (H, W), bool or u8, as an object keeps it: the second one where it is soft."""
    if selection is None:
        return None, None
    if selection.dtype != np.uint8:
        return frozen(selection, np.bool_), None
    mask = frozen(selection >= SELECTED)
    return mask, frozen(selection) if (selection != mask * np.uint8(255)).any() else None


@dataclass(frozen=True, eq=False)
class Plate:
    """The photo without its objects: inpainted pixels, and where they are."""

    left: int  # px, crop's corner in the photo
    top: int
    pixels: Pixels  # (h, w, 3) the photo's bit depth
    hole: Mask  # (h, w) True where `pixels` are invented; elsewhere they are the photo's
    backend: str
    seed: int = 0  # of the last fill; each new one takes the next
    painted: Mask | None = None  # (h, w) repaired by hand: shown wherever something has moved

    def __post_init__(self) -> None:
        freeze(self, pixels=None, hole=np.bool_, painted=np.bool_)

    @property
    def box(self) -> tuple[int, int, int, int]:
        """x0, y0, x1, y1 px of the crop in the photo."""
        height, width = self.hole.shape
        return self.left, self.top, self.left + width, self.top + height


@dataclass(frozen=True, eq=False)
class Document:
    """Everything that is saved and undone."""

    photo: Photo
    objects: tuple[EditObject, ...] = ()
    plate: Plate | None = None  # None: not made yet for these masks
    backends: tuple[tuple[str, str], ...] = ()  # stage -> backend used
    seed: int = 0
    horizon: float | None = None  # px, row of the photo in which it is; None: the middle one
    feather: float = 1.0  # x the usual width over which the edit is blended into the photo
    hints: tuple[Hint, ...] = ()  # from where the plate is filled
    # (h, w) inverse depth, up to a factor and a shift, stretched over the photo; None: not known
    depth: F32 | None = None
    refined: Refined | None = None  # None: not asked for, or what it showed has changed since

    def with_object(self, k: int, changed: EditObject) -> Document:
        """Object `k` replaced; the plate stays only where what hides the background did.

        The refinement stays only where nothing that is seen has changed. A selection that is not
        cut out hides nothing, and is not seen.
        """
        was = EditObject("") if k == len(self.objects) else self.objects[k]
        is_alike = changed.hides_background is was.hides_background
        is_alike &= changed.mask is was.mask or not was.hides_background
        plate = self.plate if is_alike else None
        refined = self.refined if is_shown_alike(changed, was) else None
        objects = (*self.objects[:k], changed, *self.objects[k + 1 :])
        return replace(self, objects=objects, plate=plate, refined=refined)

    def with_backend(self, stage: str, name: str) -> Document:
        """Records which backend of a stage made what the document holds."""
        others = tuple((s, n) for s, n in self.backends if s != stage)
        return replace(self, backends=(*others, (stage, name)))


# Whether two edits look the same: then a refinement of one is one of the other, too.
# Of an object, what its picture depends on; what else changes leaves a refinement as it is.
SHOWN = (
    "mask", "coverage", "matte", "lifted", "pose", "placement", "is_visible", "layer", "shadow",
    "harmony", "relight", "grain", "defocus", "stays_in_front", "finish", "seen_from",
    "is_floating",
)  # fmt: skip


def is_shown_alike(one: EditObject, other: EditObject) -> bool:
    """Whether two objects look the same; arrays do only where they are one and the same.

    What is not cut out looks as the photo does.
    """

    def is_same(a: object, b: object) -> bool:
        is_plain = not isinstance(a, np.ndarray) and not isinstance(b, np.ndarray)
        return a is b or (is_plain and a == b)

    if one.matte is None and other.matte is None:
        return True
    return all(is_same(getattr(one, name), getattr(other, name)) for name in SHOWN)


def show_the_same(one: Document, other: Document) -> bool:
    """Whether a refinement of one edit is one of the other, too."""
    own, others = ([o for o in d.objects if o.matte is not None] for d in (one, other))
    alike = one.photo is other.photo, one.plate is other.plate, one.depth is other.depth
    alike = *alike, one.horizon == other.horizon, one.feather == other.feather
    return all(alike) and len(own) == len(others) and all(map(is_shown_alike, own, others))
