"""The Compose tool's settings: background, shadow, light, edge."""

from __future__ import annotations

from dataclasses import replace

from imgui_bundle import ImVec2, imgui

from objectmorpher_core import compose
from objectmorpher_core.base.rotations import wrapped
from objectmorpher_core.document.bounds import (
    MODES,
    MOST_BLUR,
    MOST_EXPOSURE,
    MOST_SATURATION,
    MOST_SHARPNESS,
)
from objectmorpher_core.document.settings import (
    LEAST_FEATHER,
    MOST_FEATHER,
    MOST_SHADOW,
    USUAL_SHARES,
)

from ...commands import run
from ...commands.compose import not_moved
from ...editor.editor import Editor
from ...editor.view import Composed, PaintWith
from ...system.texts import sentence, t
from ...worker.job_functions import Variant
from ..widgets.segmented import Segment, draw_method, segmented
from ..widgets.theme import RADIUS, theme
from ..widgets.widgets import (
    GAP,
    LABEL_WIDTH,
    SIDE,
    Emphasis,
    FieldChange,
    Number,
    button,
    checkbox,
    command_button,
    dial,
    drawn_button,
    half_width,
    heading,
    note,
    number_field,
    pictures,
    rule,
    take,
    tooltip,
)
from ..window.landmarks import mark
from .select import draw_brush_fields, draw_decontaminate, draw_radius

MIXED = dict(zip(MODES, ("Normal", "Multiply", "Screen", "Soft light"), strict=True))
REFINERS = {"none": "None", "harmonise": "Harmonise"}
DEGREES = 72.0  # points, width of the direction's field
THUMB_SHAPE = 3 / 4  # height of a thumbnail by its width


def draw_compose(editor: Editor) -> None:
    if not editor.is_lifted:
        note(f"{editor.why_no_shape}.")
        return
    _draw_background(editor)
    rule()
    _draw_paint(editor)
    rule()
    _draw_finish(editor)  # before those to which it adds fields
    rule()
    _draw_shadow(editor)
    rule()
    _draw_light(editor)
    rule()
    draw_network(editor)
    rule()
    _draw_edge(editor)


def _draw_background(editor: Editor) -> None:
    heading(t("Background"))
    objects = () if editor.document is None else editor.document.objects
    if all(item.is_visitor or item.lifted is None for item in objects):
        note(t("It is the photo itself: what comes from another photo leaves no hole."))
        return
    is_bare = checkbox(t("Show it alone"), editor.view.compose.is_bare)
    tooltip(t("Without the objects, to repair it by painting (B)"))
    if is_bare != editor.view.compose.is_bare:
        run(editor, "bare")
    if (trouble := editor.composing.trouble) is not None:
        note(trouble)
    draw_method(editor, "inpaint")
    half = half_width()
    command_button(editor, "fill_again", width=half)
    imgui.same_line()
    command_button(editor, "variants", width=half)
    _draw_variants(editor)
    if is_bare and editor.document is not None and editor.document.plate is not None:
        _draw_brush(editor)


def _draw_brush(editor: Editor) -> None:
    """What a drag on the background does."""
    compose_view = editor.view.compose
    choices = tuple(Segment(way, t(way.value)) for way in Composed)
    compose_view.drag = segmented("composed", choices, compose_view.drag)
    if compose_view.drag is Composed.TAKE:
        draw_radius(editor)
        command_button(editor, "forget_sources", width=-1)
        note(t("Drag from a good spot to where the background should look like it. Alt-click "
               "removes an arrow."))  # fmt: skip
        return
    draw_brush_fields(editor)
    note(t("Paint over what looks wrong: it is filled in again. Alt brings the photo back."))


def _draw_variants(editor: Editor) -> None:
    """Thumbnails; the one that is shown has the accent's edge.

    The one that is pointed at, or whose key is held, is seen large in the picture.
    """
    variants = editor.composing.variants
    if not variants:
        return
    looked_at = _held_variant(len(variants))
    room = imgui.get_content_region_avail().x
    width = (room - (len(variants) - 1) * theme.pt(GAP)) / len(variants)
    for k, variant in enumerate(variants):
        if k:
            imgui.same_line(0, theme.pt(GAP))
        if _draw_variant(editor, k, variant, ImVec2(width, width * THUMB_SHAPE)):
            looked_at = k
    editor.composing.compare_variant(looked_at)
    note(t("Hold Shift+1, 2 or 3, or point at one, to see it large. Click to choose."))


def _held_variant(count: int) -> int | None:
    """Index of the variant whose key is held with Shift, or None."""
    io = imgui.get_io()
    keys = (imgui.Key._1, imgui.Key._2, imgui.Key._3)[:count]
    if io.want_text_input or not io.key_shift:
        return None
    return next((k for k, key in enumerate(keys) if imgui.is_key_down(key)), None)


def _draw_variant(editor: Editor, k: int, variant: Variant, size: ImVec2) -> bool:
    """A thumbnail that a click chooses; whether it is pointed at."""
    start, draw = imgui.get_cursor_screen_pos(), imgui.get_window_draw_list()
    end = ImVec2(start.x + size.x, start.y + size.y)
    if drawn_button(f"##variant{k}", size):
        editor.composing.choose_variant(variant)
    is_hovered = imgui.is_item_hovered()
    tooltip(t("Variant {number}", number=k + 1))
    texture, zero, one = pictures.texture(variant.thumb), ImVec2(0, 0), ImVec2(1, 1)
    white, corner = theme.u32("#FFFFFF"), theme.pt(RADIUS - 2)
    draw.add_image_rounded(texture, start, end, zero, one, white, corner)
    is_chosen = editor.document is not None and editor.document.plate is variant.plate
    if is_chosen or is_hovered:
        role = "accent" if is_chosen else "secondary"
        draw.add_rect(start, end, theme.u32(role), corner, thickness=theme.pt(2))
    return is_hovered


def _draw_shadow(editor: Editor) -> None:
    heading(t("Shadow"))
    if (reason := not_moved(editor)) is not None:
        note(f"{reason}.")
        return
    if editor.old_shadows.offer is None:
        command_button(editor, "take_shadow", width=-1)
    else:
        _draw_offer(editor)
    shadow, preview = editor.chosen.shadow, editor.composing.preview_shadow
    number = Number(t("Strength"), "%.0f %%", 0.5, 5.0, low=0.0, high=100.0)
    change = number_field(number, 100 * shadow.strength)
    changed = replace(shadow, strength=change.value / 100)
    take(editor, change, lambda: preview(changed), t("Shadow's strength"))
    if shadow.strength == 0 and not change.is_changed:
        note(t("Raise Strength to add a shadow on the ground."))
        return
    shares = (
        (Number(t("Length"), "%.2f ×", 0.005, 0.1, 0.6, 0.0, MOST_SHADOW), "length", 1.0),
        (Number(t("Softness"), "%.0f %%", 0.5, 5.0, 40.0, 0.0, 100.0), "softness", 100.0),
        (Number(t("Contact"), "%.0f %%", 0.5, 5.0, 70.0, 0.0, 100.0), "contact", 100.0),
    )
    for number, name, unit in shares:
        change = number_field(number, unit * getattr(shadow, name))
        changed = replace(shadow, **{name: change.value / unit})
        take(editor, change, lambda changed=changed: preview(changed), t("Shape of shadow"))
    usual, ground = editor.composing.usual_ground, shadow.ground
    number = Number(t("Ground"), "%.0f°", 0.5, 5.0, usual, 0.0, 90.0)
    change = number_field(number, usual if ground is None else ground)
    tooltip(t("How steeply you look down on the ground: 0° along it, 90° from above"))
    ground = None if change.value == usual else change.value
    changed = replace(shadow, ground=ground)
    take(editor, change, lambda: preview(changed), t("Ground of shadow"))
    _draw_direction(editor)
    is_on = bool(editor.document and editor.document.depth is not None)
    if editor.models.has_depth or is_on:
        if checkbox(t("Falls on walls and steps"), is_on) != is_on:
            editor.composing.toggle_depth()
        tooltip(t("As the depth model sees them in the photo, not on plain ground alone"))


def _draw_offer(editor: Editor) -> None:
    """What is outlined on the photo goes along, or stays."""
    note(t("The photo shows outlined what would go along."))
    if button(t("Take it along"), Emphasis.PRIMARY_SMALL, width=-1):
        editor.old_shadows.accept()
    if button(t("Leave it in the photo"), width=-1):
        editor.old_shadows.refuse()


def _draw_direction(editor: Editor) -> None:
    """Name, dial, and the number beside it."""
    shadow, top = editor.chosen.shadow, imgui.get_cursor_pos_y()
    drop = theme.pt((SIDE - 28) / 2)
    imgui.set_cursor_pos_y(top + drop)
    imgui.align_text_to_frame_padding()
    imgui.text_colored(theme.vec("secondary"), t("Falls to"))
    imgui.same_line(theme.pt(LABEL_WIDTH))
    imgui.set_cursor_pos_y(top)
    change = dial("direction", shadow.direction, t("Where the shadow falls; Shift: steps of 15°"))
    changed = replace(shadow, direction=change.value)
    take(editor, change, lambda: editor.composing.preview_shadow(changed), t("Turn shadow"))
    imgui.same_line(0, theme.pt(12))
    imgui.set_cursor_pos_y(top + drop)
    imgui.align_text_to_frame_padding()
    imgui.set_next_item_width(theme.pt(DEGREES))
    is_changed, turned = imgui.drag_float("##degrees", change.value, 0.5, 0.0, 0.0, "%.0f°")
    mark(t("Falls to"))
    is_done = imgui.is_item_deactivated_after_edit()
    if is_changed or is_done:
        change = FieldChange(wrapped(turned), is_changed, is_done)
        changed = replace(shadow, direction=change.value)
        take(editor, change, lambda: editor.composing.preview_shadow(changed), t("Turn shadow"))
    imgui.set_cursor_pos_y(top + theme.pt(SIDE + 4))
    imgui.dummy(ImVec2(0, 0))


def _draw_light(editor: Editor) -> None:
    heading(t("Light"))
    if (reason := not_moved(editor)) is not None:
        note(f"{reason}.")
        return
    choices = tuple(Segment(name, t(REFINERS.get(name, name))) for name in compose.REFINERS)
    editor.composing.choose_refiner(segmented("refiner", choices, editor.composing.refiner))
    if editor.composing.refiner == "none":
        note(t("Harmonise gives the object the light of its new place and of how it is turned."))
        return
    item, preview = editor.chosen, editor.composing.preview_share
    labels = t("Place"), t("Turning"), t("Grain"), t("Focus")
    for label, (name, usual) in zip(labels, USUAL_SHARES.items(), strict=True):
        number = Number(label, "%.0f %%", 0.5, 5.0, 100 * usual, 0.0, 100.0)
        change = number_field(number, 100 * getattr(item, name))
        take(editor, change, lambda n=name, c=change: preview(n, c.value / 100), t("Adjust light"))
    note(t("Light around its new place; light that stays where it was while it turns."))
    note(t("Grain: the photo's own, where moving the object has smoothed it."))
    note(t("Focus: nearer or farther, as blurred as the photo is there."))


def _draw_finish(editor: Editor) -> None:
    heading(t("Object"))
    finish, preview = editor.chosen.finish, editor.composing.preview_finish
    rows = (
        (Number(t("Opacity"), "%.0f %%", 0.5, 5.0, 100.0, 0.0, 100.0), "opacity", 100.0),
        (Number(t("Exposure"), "%+.2f", 0.01, 0.25, 0.0, -MOST_EXPOSURE, MOST_EXPOSURE),
         "exposure", 1.0),
        (Number(t("Warmth"), "%+.0f", 0.5, 5.0, 0.0, -100.0, 100.0), "warmth", 100.0),
        (Number(t("Saturation"), "%.0f %%", 0.5, 5.0, 100.0, 0.0, 100 * MOST_SATURATION),
         "saturation", 100.0),
        (Number(t("Sharpness"), "%.0f %%", 0.5, 5.0, 0.0, 0.0, 100 * MOST_SHARPNESS),
         "sharpness", 100.0),
        (Number(t("Blur"), "%.1f px", 0.05, 0.5, 0.0, 0.0, MOST_BLUR), "blur", 1.0),
    )  # fmt: skip
    for number, name, unit in rows:
        change = number_field(number, unit * getattr(finish, name))
        changed = replace(finish, **{name: change.value / unit})
        take(editor, change, lambda changed=changed: preview(changed), t("Look of object"))
    choices = [Segment(mode, t(label)) for mode, label in MIXED.items()]
    mode = segmented("blend mode", choices, finish.blend_mode)
    if mode != finish.blend_mode:
        preview(replace(finish, blend_mode=mode))
        editor.commit(t("Blend mode"))
    note(t("Exposure in stops; warmth from blue to amber; blur in pixels of the photo."))


def _draw_paint(editor: Editor) -> None:
    heading(t("Paint"))
    view = editor.view.compose
    is_painting = checkbox(t("Paint on the object"), view.is_painting)
    tooltip(t("What you paint sticks to the object, on its photo and on its invented sides"))
    if is_painting != view.is_painting:
        run(editor, "paint")
    if view.is_painting:
        choices = tuple(Segment(way, t(way.value)) for way in PaintWith)
        view.paint_with = segmented("paint with", choices, view.paint_with)
        if view.paint_with is PaintWith.COLOUR:
            imgui.set_next_item_width(-1)
            _, (r, g, b) = imgui.color_edit3("##ink", list(view.ink))
            mark(t("Colour"))
            view.ink = float(r), float(g), float(b)
            note(t("Ctrl-click takes a colour from the picture."))
        else:
            note(t("Ctrl-click where to clone from, then paint."))
        number = Number(t("Strength"), "%.0f %%", 0.5, 5.0, 100.0, 1.0, 100.0)
        view.strength = number_field(number, 100 * view.strength).value / 100
        draw_brush_fields(editor)
        note(t("Alt or right-drag erases paint."))
    command_button(editor, "unpaint", width=-1)


def _draw_edge(editor: Editor) -> None:
    heading(t("Edge"))
    number = Number(t("Blend"), "%.2f ×", 0.005, 0.25, 1.0, LEAST_FEATHER, MOST_FEATHER)
    change = number_field(number, editor.opened.feather)
    preview = editor.composing.preview_feather
    take(editor, change, lambda: preview(change.value), t("Blend of edge"))
    note(t("How wide the edit fades into the photo."))
    draw_decontaminate(editor)
    command_button(editor, "edge_brush", width=-1)


# The Compose tool's network, which makes the edit look as if it had been photographed.


def draw_network(editor: Editor) -> None:
    """Which network, its buttons, and how much of what it made is shown."""
    heading(t("AI refinement"))
    draw_method(editor, "refine")
    if (reason := editor.methods.why_not("refine")) is not None:
        note(f"{sentence(reason)}.")
        command_button(editor, "models", width=-1)
    if editor.refining.refined is None:
        command_button(editor, "refine", width=-1)
        note(t("Fits light, colour and edges of the edit; nothing outside it changes."))
        return
    half = half_width()
    command_button(editor, "refine", width=half)
    imgui.same_line()
    command_button(editor, "refine_again", width=half)
    number = Number(t("Amount"), "%.0f %%", 0.5, 5.0, 100.0, 0.0, 100.0)
    change = number_field(number, 100 * editor.refining.refined.strength)
    preview = editor.refining.preview_strength
    take(editor, change, lambda: preview(change.value / 100), t("Amount of refinement"))
    command_button(editor, "unrefine", width=-1)
    note(t("It is removed as soon as you change the edit."))
