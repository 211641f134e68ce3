"""The state of the view: zoom, pan, tool and toggles. It is neither saved nor undone.

Canvas px: the part of the window that shows the photo, x right, y down, from its left top corner,
in framebuffer px. Image px: the photo's own.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from objectmorpher_core.base.brush import Brush
from objectmorpher_core.base.camera import Camera

if TYPE_CHECKING:
    from objectmorpher_core.deform.puppet import SurfacePoint

# What the Pose tool does now, and which of its marks are shown: neither saved nor undone.


class PoseMode(Enum):
    """Effects of dragging over the object, in the order of the panel."""

    DRAG = "Drag"
    FREEZE = "Freeze"
    STIFFEN = "Stiffen"
    BODY = "Rigid group"
    CUT = "Cut"
    GLUE = "Glue"


BRUSHES = (PoseMode.FREEZE, PoseMode.STIFFEN, PoseMode.BODY)  # they paint with the round brush


@dataclass(eq=False)
class PoseView:
    """Mutable: the tool and its panel write it."""

    mode: PoseMode = PoseMode.DRAG
    stiffness: float = 4.0  # x the usual one, of what is painted with Stiffen
    has_ring: bool = True  # around the selected handle
    has_anchors: bool = True
    has_regions: bool = True
    has_influence: bool = False


BRUSH_SHARE = 0.03  # of a photo's side, the radius of a brush: 20 px in one of 700 px
MARGIN = 24.0  # points between the fitted photo and the canvas's edge
MIN_ZOOM, MAX_ZOOM = 0.02, 64.0  # canvas px per image px
PIXELS_FROM = 8.0  # canvas px per image px, from which on single pixels are looked at
STEEPEST = 89.0  # degrees that an orbit goes up or down
KEEP_VISIBLE = 48.0  # px of the photo that panning leaves on the canvas


class ToolName(Enum):
    """The tools, in the order of the tool strip."""

    SELECT = "Select"
    MASK = "Refine mask"
    POSE = "Pose"
    PLACE = "Place"
    LOOK = "Look"
    COMPOSE = "Compose"


# Tools that change the object itself, and not only what is around it.
CHANGING = frozenset({ToolName.SELECT, ToolName.MASK, ToolName.POSE, ToolName.PLACE})
MOVING = frozenset({ToolName.POSE, ToolName.PLACE})

USUAL_LEVEL = "object"  # what a click means, unless the artist says it


class SelectMode(Enum):
    """Ways to point at a thing with the Select tool."""

    CLICK = "Click"
    BOX = "Box"
    LASSO = "Lasso"


class Painted(Enum):
    """Things that the Mask tool's brush paints."""

    SELECTION = "Selection"
    EDGE = "Edge"
    DEPTH = "Depth"
    HIDDEN = "Hidden"


@dataclass(eq=False)
class Selecting:
    """Settings of the Select and the Mask tool."""

    mode: SelectMode = SelectMode.CLICK
    level: str = USUAL_LEVEL  # of document.LEVELS: what a new click means
    reach: float = 4.0  # px of the photo, by which an edge is moved, smoothed or softened
    is_erasing: bool = False  # the brush takes away
    painted: Painted = Painted.SELECTION


class Shown(Enum):
    """Pictures of the edit on the canvas, in the order of the View menu."""

    COMPOSITE = "Composite"
    OBJECT = "Object only"
    DEPTH = "Depth"
    NORMALS = "Normals"
    PROVENANCE = "Invented parts"
    STRAIN = "Strain"


class Popup(Enum):
    """Panels over the window, one at a time."""

    PALETTE = "Find a command…"
    HELP = "Tutorial and how-to…"
    SHORTCUTS = "Keyboard and pointer…"
    PREFERENCES = "Preferences…"
    ABOUT = "About ObjectMorpher"


@dataclass(frozen=True)
class Orbit:
    """The direction from which the object is looked at, degrees; it is the object that turns."""

    yaw: float = 0.0
    pitch: float = 0.0

    def turned(self, yaw: float, pitch: float) -> Orbit:
        """Farther by so much; never over the top."""
        return Orbit(self.yaw + yaw, float(np.clip(self.pitch + pitch, -STEEPEST, STEEPEST)))


class Composed(Enum):
    """Effects of a drag with the Compose tool on the background that is shown alone."""

    REPAIR = "Repair"
    TAKE = "Fill from"


class PaintWith(Enum):
    """Things that are painted on an object."""

    COLOUR = "Colour"
    CLONE = "Clone"


@dataclass(eq=False)
class ComposeView:
    """The view of the Compose tool."""

    is_bare: bool = False  # the background alone, without the objects
    drag: Composed = Composed.REPAIR
    is_painting: bool = False  # on the object, where the whole picture is shown
    paint_with: PaintWith = PaintWith.COLOUR
    ink: tuple[float, float, float] = (0.8, 0.1, 0.1)  # sRGB
    strength: float = 1.0  # in [0, 1], of the paint
    source: tuple[float, float] | None = None  # image px: from where is cloned


@dataclass(eq=False)
class ViewState:
    """Mutable: the tools and panels write it, the window reads it each frame."""

    width: int = 1  # canvas px
    height: int = 1
    scale: float = 1.0  # canvas px per point
    zoom: float = 1.0  # canvas px per image px
    left: float = 0.0  # image px at the canvas's left edge
    top: float = 0.0
    is_fitted: bool = True  # follows the canvas's size until the user zooms
    tool: ToolName = ToolName.SELECT
    is_before: bool = False  # X is held: the photo as it was
    is_proof: bool = False  # colours as a printer or another screen has them
    split: float | None = None  # share of the canvas left of the before/after line
    has_points: bool = False  # control points and links are shown
    has_history: bool = False  # the list of steps is shown
    wants_panel: bool | None = None  # the panel at the right; None: where there is room for it
    has_panel: bool = True  # whether that is so, as the window has it
    shown: Shown = Shown.COMPOSITE
    popup: Popup | None = None
    help_page: str = "tutorial"  # of system.help_pages, the one that Help shows
    orbit: Orbit | None = None  # of the Look tool; None: as the photo's camera sees it
    color: tuple[int, int, int] | None = None  # 8-bit sRGB shown under the pointer, if so near
    brush: Brush = field(default_factory=Brush)  # of every tool that paints
    usual_radius: float = Brush().radius  # px of the photo, of a brush that nobody has sized
    pose: PoseView = field(default_factory=PoseView)
    selecting: Selecting = field(default_factory=Selecting)
    compose: ComposeView = field(default_factory=ComposeView)

    @property
    def is_at_pixels(self) -> bool:
        """Whether single pixels of the photo are looked at."""
        return self.zoom >= PIXELS_FROM

    @property
    def place(self) -> tuple[float, ...]:
        """Return everything that a picture on the canvas depends on."""
        return (self.left, self.top, self.zoom, self.width, self.height)

    def canvas_from_image(self, xy: np.ndarray) -> np.ndarray:
        """Canvas px (..., 2) of image px (..., 2)."""
        return (np.asarray(xy, dtype=np.float64) - (self.left, self.top)) * self.zoom

    def canvas_box(self, low: ArrayLike, high: ArrayLike) -> tuple[float, float, float, float]:
        """Canvas px of the box between two corners, image px."""
        x0, y0, x1, y1 = self.canvas_from_image(np.array([low, high])).ravel().tolist()
        return x0, y0, x1, y1

    def image_from_canvas(self, xy: np.ndarray | tuple[float, float]) -> np.ndarray:
        """Image px (..., 2) of canvas px (..., 2)."""
        return np.asarray(xy, dtype=np.float64) / self.zoom + (self.left, self.top)

    def resize(self, size: tuple[int, int], scale: float, photo: tuple[int, int] | None) -> None:
        """The canvas is `size` px now; a fitted photo of `photo` px stays fitted."""
        if size == (self.width, self.height) and scale == self.scale:
            return
        centre = self.image_from_canvas((self.width / 2, self.height / 2))
        (self.width, self.height), self.scale = size, scale
        if photo is not None and self.is_fitted:
            self.fit(photo)
        else:
            self._centre_on(centre)

    def fit(self, photo: tuple[int, int]) -> None:
        """The whole photo, with a margin; a small photo is enlarged at most four times."""
        margin = 2 * MARGIN * self.scale
        across = max(self.width - margin, 1) / photo[0]
        down = max(self.height - margin, 1) / photo[1]
        self.zoom = float(np.clip(min(across, down, 4 * self.scale), MIN_ZOOM, MAX_ZOOM))
        self._centre_on(np.array(photo) / 2)
        self.is_fitted = True

    def suit_brush(self, photo: tuple[int, int]) -> None:
        """A brush that nobody has sized is as large as suits a photo of `photo` px."""
        usual = max(Brush().radius, float(round(BRUSH_SHARE * math.sqrt(photo[0] * photo[1]))))
        if self.brush.radius == self.usual_radius:
            self.brush = replace(self.brush, radius=usual)
        self.usual_radius = usual

    def set_zoom(self, zoom: float, around: tuple[float, float], photo: tuple[int, int]) -> None:
        """Magnifies so that the image point under canvas px `around` stays there."""
        fixed = self.image_from_canvas(around)
        self.zoom = float(np.clip(zoom, MIN_ZOOM, MAX_ZOOM))
        self.left, self.top = fixed - np.array(around) / self.zoom
        self.is_fitted = False
        self._keep_visible(photo)

    def pan(self, dx: float, dy: float, photo: tuple[int, int]) -> None:
        """Moves the picture by (dx, dy) canvas px."""
        self.left -= dx / self.zoom
        self.top -= dy / self.zoom
        self.is_fitted = False
        self._keep_visible(photo)

    def camera(self, photo_camera: Camera, box: tuple[int, int, int, int] | None = None) -> Camera:
        """The photo's camera seen through the canvas, or through `box` x0, y0, x1, y1 of it."""
        x0, y0, x1, y1 = box or (0, 0, self.width, self.height)
        left, top = self.left + x0 / self.zoom, self.top + y0 / self.zoom
        return photo_camera.windowed(left, top, x1 - x0, y1 - y0, self.zoom)

    def _centre_on(self, image_xy: np.ndarray) -> None:
        self.left, self.top = image_xy - np.array([self.width, self.height]) / 2 / self.zoom

    def _keep_visible(self, photo: tuple[int, int]) -> None:
        rest = KEEP_VISIBLE * self.scale / self.zoom
        self.left = float(np.clip(self.left, rest - self.width / self.zoom, photo[0] - rest))
        self.top = float(np.clip(self.top, rest - self.height / self.zoom, photo[1] - rest))


# Feedback of the editor: a sentence for the status line, and the thing under the pointer.


@dataclass(frozen=True)
class Action:
    """A button beside a message that does something about it."""

    label: str
    run: Callable[[], None]


@dataclass(frozen=True)
class StatusMessage:
    """A sentence for the status line."""

    text: str
    is_error: bool = False
    details: str = ""
    action: Action | None = None


@dataclass(frozen=True)
class Hover:
    """The thing under the pointer."""

    handle: int | None = None
    surface: SurfacePoint | None = None
    is_pin: bool = False  # a click would set a pin
    part: str | None = None  # of the Place tool's frame
    place: tuple[float, float] | None = None  # image px, where a click would select something
    other: int | None = None  # index of the object that a click would make the current one
