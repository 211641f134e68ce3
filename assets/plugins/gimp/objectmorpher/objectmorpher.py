#!/usr/bin/env python3
"""GIMP 3: sends the active layer to ObjectMorpher and brings its layers back as a group."""

import subprocess
import sys
import tempfile
from pathlib import Path

import gi

gi.require_version("Gimp", "3.0")
from gi.repository import Gimp, Gio, GLib  # noqa: E402

sys.path.insert(0, str(Path(__file__).parent))
import door  # noqa: E402

PROCEDURE = "plug-in-objectmorpher"
GROUP = "ObjectMorpher"
MIXED = {  # GIMP mixes by these in encoded colours, as the file means it; else in linear light
    "svg:src-over": "NORMAL_LEGACY", "svg:multiply": "MULTIPLY_LEGACY",
    "svg:screen": "SCREEN_LEGACY", "svg:soft-light": "SOFTLIGHT_LEGACY",
}  # fmt: skip


def send(image, layer, path):
    """Writes a layer, as large as the image, into a PNG file."""
    alone = Gimp.Image.new_with_precision(
        image.get_width(), image.get_height(), image.get_base_type(), image.get_precision()
    )
    copied = Gimp.Layer.new_from_drawable(layer, alone)
    alone.insert_layer(copied, None, 0)
    copied.resize_to_image_size()
    Gimp.file_save(Gimp.RunMode.NONINTERACTIVE, alone, Gio.File.new_for_path(str(path)), None)
    alone.delete()


def bring_back(image, layer, path):
    """Puts the layers of an OpenRaster file into a group above a layer; the group."""
    image.undo_group_start()
    group = Gimp.GroupLayer.new(image, GROUP)
    image.insert_layer(group, layer.get_parent(), image.get_item_position(layer))
    with tempfile.TemporaryDirectory() as folder:
        for number, (name, left, top, is_shown, how, data) in enumerate(door.layers(path)):
            file = Path(folder) / f"{number}.png"
            file.write_bytes(data)
            loaded = Gimp.file_load_layer(
                Gimp.RunMode.NONINTERACTIVE, image, Gio.File.new_for_path(str(file))
            )
            image.insert_layer(loaded, group, 0)  # above those before it
            loaded.set_name(name)
            loaded.set_offsets(left, top)
            loaded.set_visible(is_shown)
            loaded.set_mode(getattr(Gimp.LayerMode, MIXED.get(how, MIXED["svg:src-over"])))
    image.undo_group_end()
    Gimp.displays_flush()
    return group


def edit(procedure, run_mode, image, drawables, config, data):
    """What the menu entry does; GIMP waits until the window is closed."""
    success = Gimp.PDBStatusType.SUCCESS
    if len(drawables) != 1 or not isinstance(drawables[0], Gimp.Layer):
        return failed(procedure, "Choose one layer first.")
    with tempfile.TemporaryDirectory() as folder:
        picture, back = Path(folder) / "layer.png", Path(folder) / "back.ora"
        send(image, drawables[0], picture)
        try:
            subprocess.run(door.command(picture, back), env=door.environment(), check=False)
        except OSError as error:
            return failed(procedure, f"ObjectMorpher could not be started: {error}")
        if back.exists():
            bring_back(image, drawables[0], back)
    return procedure.new_return_values(success, GLib.Error())


def failed(procedure, text):
    """The answer of a procedure that could not do it."""
    error = GLib.Error.new_literal(Gimp.PlugIn.error_quark(), text, 0)
    return procedure.new_return_values(Gimp.PDBStatusType.EXECUTION_ERROR, error)


class ObjectMorpher(Gimp.PlugIn):
    """One entry in the menu Filters."""

    def do_query_procedures(self):  # GIMP's names
        return [PROCEDURE]

    def do_set_i18n(self, name):
        return False

    def do_create_procedure(self, name):
        procedure = Gimp.ImageProcedure.new(self, name, Gimp.PDBProcType.PLUGIN, edit, None)
        procedure.set_image_types("*")
        procedure.set_sensitivity_mask(Gimp.ProcedureSensitivityMask.DRAWABLE)
        procedure.set_menu_label("Edit in 3D with _ObjectMorpher…")
        procedure.add_menu_path("<Image>/Filters")
        procedure.set_documentation("Edit an object of the layer in 3D", None, name)
        return procedure


if __name__ == "__main__":
    Gimp.main(ObjectMorpher.__gtype__, sys.argv)
