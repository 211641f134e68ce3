"""The Pose tool's settings."""

from __future__ import annotations

from imgui_bundle import imgui

from objectmorpher_core.deform.rigidity import Rigidity, rigidity_of
from objectmorpher_core.document import EditObject
from objectmorpher_core.hold_edits import Stays, stays_of

from ...editor import Editor
from ...painter import shown_now
from ...pose_view import PoseMode
from ...texts import t
from ...view import Shown
from ..command_button import command_button
from ..segmented import Choice, segmented
from ..theme import Icon
from ..widgets import checkbox, gap, half_width, heading, note
from .pose_handle import draw_handles, draw_numbers
from .pose_rig import draw_modes, draw_regions

STAYS = {Stays.FAR: "Far side", Stays.ELSE: "All else", Stays.NOTHING: "Only pins"}
WHAT_STAYS = {
    Stays.FAR: "The part farthest from the first handle stays where it is",
    Stays.ELSE: "Only what is near a handle moves, everything else stays",
    Stays.NOTHING: "Nothing stays by itself: only pins and handles hold",
}
NAMES = {Rigidity.RIGID: "Rigid", Rigidity.NORMAL: "Normal", Rigidity.SOFT: "Soft"}


def draw_pose(editor: Editor) -> None:
    thing = editor.object
    if thing is None:
        return
    draw_modes(editor)
    if editor.view.pose.mode is PoseMode.DRAG:
        gap(8)
        draw_handles(editor)
        draw_numbers(editor)
    draw_regions(editor)
    gap(12)
    _draw_material(editor, thing)
    gap(12)
    _draw_symmetry(editor)
    _draw_overlays(editor)
    gap(12)
    half = half_width()
    command_button(editor, "reset_handles", t("All to rest"), half)
    imgui.same_line()
    command_button(editor, "reset_pose", f"{Icon.RESET}  {t('Reset pose')}", half)


def _draw_material(editor: Editor, thing: EditObject) -> None:
    heading(t("Rigidity"))
    now, held = rigidity_of(thing.deform), stays_of(thing)
    presets: tuple[Choice[Rigidity | None], ...] = tuple(Choice(r, t(NAMES[r])) for r in Rigidity)
    chosen = segmented("rigidity", presets, now)
    if chosen is not None and chosen is not now:
        editor.rigging.set_rigidity(chosen)
    gap(8)
    heading(t("What stays"))
    kinds = tuple(Choice(s, t(STAYS[s]), t(WHAT_STAYS[s])) for s in Stays)
    stays = segmented("stays", kinds, held)
    if stays is not held:
        editor.posing.set_stays(stays)


def _draw_symmetry(editor: Editor) -> None:
    heading(t("Symmetry"))
    mirroring = editor.posing.mirroring
    if checkbox(t("Drag the mirrored point too"), mirroring.is_on) != mirroring.is_on:
        mirroring.toggle()
    if mirroring.is_on and not mirroring.is_found():
        note(t("No mirror plane was found: an upright one through the middle is used."))
    gap(12)


def _draw_overlays(editor: Editor) -> None:
    heading(t("Show"))
    pose, view = editor.view.pose, editor.view
    pose.has_ring = checkbox(t("Rotation ring (R)"), pose.has_ring)
    pose.has_anchors = checkbox(t("Anchors"), pose.has_anchors)
    pose.has_regions = checkbox(t("Regions"), pose.has_regions)
    pose.has_influence = checkbox(t("Influence of the handle"), pose.has_influence)
    view.has_points = checkbox(t("Control graph"), view.has_points)
    is_strain = shown_now(editor.document, view) is Shown.STRAIN
    if checkbox(t("Strain"), is_strain) != is_strain:
        view.shown = Shown.COMPOSITE if is_strain else Shown.STRAIN
