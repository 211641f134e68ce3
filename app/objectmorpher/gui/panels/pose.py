"""The Pose tool's settings."""

from __future__ import annotations

from imgui_bundle import imgui

from objectmorpher_core.deform.rigidity import Rigidity, rigidity_of
from objectmorpher_core.document.model import EditObject

from ...canvas.painter import shown_now
from ...editor.editor import Editor
from ...editor.pose_view import PoseMode
from ...editor.view import Shown
from ...system.texts import t
from ..widgets.command_button import command_button
from ..widgets.segmented import Choice, segmented
from ..widgets.theme import Icon
from ..widgets.widgets import checkbox, gap, half_width, heading, note, tooltip
from .pose_handle import draw_handles, draw_numbers
from .pose_rig import draw_modes, draw_regions

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
    now = rigidity_of(thing.deform)
    presets: tuple[Choice[Rigidity | None], ...] = tuple(Choice(r, t(NAMES[r])) for r in Rigidity)
    chosen = segmented("rigidity", presets, now)
    if chosen is not None and chosen is not now:
        editor.rigging.set_rigidity(chosen)
    is_on = checkbox(t("Hold the far side still"), thing.has_auto_anchors)
    tooltip(t("With one handle, the part farthest from it is anchored by itself"))
    if is_on != thing.has_auto_anchors:
        editor.posing.set_auto_anchors(is_on)


def _draw_symmetry(editor: Editor) -> None:
    heading(t("Symmetry"))
    pose, mirroring = editor.view.pose, editor.posing.mirroring
    pose.is_mirrored = checkbox(t("Drag the mirrored point too"), pose.is_mirrored)
    if pose.is_mirrored and not mirroring.is_found():
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
