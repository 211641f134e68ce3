"""Blender: the handles of an ObjectMorpher session as empties; the object bends as they move.

File > Import > ObjectMorpher session shows the photo through its camera, the object as a mesh and
each handle as an empty (a pin as a cube). "Bend" in the sidebar has ObjectMorpher bend the object
to where the empties are; File > Export > ObjectMorpher session saves that, and the picture.
"""

import json
import math
import subprocess
import tempfile
from pathlib import Path

import bpy
from bpy.props import StringProperty
from bpy_extras.io_utils import ExportHelper, ImportHelper
from mathutils import Matrix, Vector

from . import door

KEY = "objectmorpher"  # custom property: of the collection the session, of an empty its number
SIZE = 0.03  # of an empty, x its distance
# From the photo's axes (y down, z forward) to Blender's (z up, y forward).
FROM_PHOTO = Matrix(((1, 0, 0), (0, 0, 1), (0, -1, 0)))
TO_PHOTO = FROM_PHOTO.transposed()


def replay(session, folder, places=None, saved=None):
    """Has ObjectMorpher carry a session out; raises RuntimeError with its sentence."""
    folder = Path(folder)
    words = [*door.program(), "replay", str(session), "-o", str(folder / "edited.png")]
    words += ["--save-handles", str(folder / "handles.json"), "--save-mesh", str(folder / "o.glb")]
    if places is not None:
        (folder / "places.json").write_text(json.dumps(places), encoding="utf-8")
        words += ["--handles", str(folder / "places.json")]
    if saved is not None:
        words += ["--save-session", str(saved)]
    try:
        done = subprocess.run(
            words, env=door.environment(), capture_output=True, text=True, check=False
        )
    except OSError as error:
        raise RuntimeError(f"ObjectMorpher could not be started: {error}") from error
    if done.returncode:
        lines = done.stderr.strip().splitlines()
        raise RuntimeError(lines[-1] if lines else "ObjectMorpher ended without a word")
    return json.loads((folder / "handles.json").read_text(encoding="utf-8"))


def open_session(context, path):
    """Show a session as a collection of its own, which is returned."""
    with tempfile.TemporaryDirectory() as folder:
        told = replay(path, folder)
        collection = bpy.data.collections.new(Path(path).stem)
        context.scene.collection.children.link(collection)
        collection[KEY] = str(path)
        _add_camera(context, collection, told)
        for thing in told["objects"]:
            for number, handle in enumerate(thing["handles"]):
                _add_empty(collection, thing, number, handle)
        _show(context, collection, folder)
    return collection


def bend(context, collection, saved=None):
    """Bend the object of a session to where its empties are; raises RuntimeError."""
    with tempfile.TemporaryDirectory() as folder:
        told = replay(collection[KEY], folder, places_of(collection), saved)
        for thing in told["objects"]:
            for number, handle in enumerate(thing["handles"]):
                empty = _empties(collection)[f"{thing['number']}.{number}"]
                empty.location = FROM_PHOTO @ Vector(handle["place"])
        _show(context, collection, folder)
        if saved is not None:
            picture = Path(saved).with_suffix(".png")
            picture.write_bytes((Path(folder) / "edited.png").read_bytes())


def places_of(collection):
    """Where the empties of a session are, as `objectmorpher replay --handles` reads it."""
    found = {}
    for name, empty in sorted(_empties(collection).items(), key=lambda pair: _order(pair[0])):
        place = TO_PHOTO @ empty.matrix_world.translation
        handle = {"is_pin": empty.empty_display_type == "CUBE", "place": list(place)}
        found.setdefault(_order(name)[0], []).append(handle)
    return {"objects": [{"number": n, "handles": handles} for n, handles in found.items()]}


def _order(name):
    return tuple(int(number) for number in name.split("."))


def _empties(collection):
    empties = [thing for thing in collection.objects if thing.type == "EMPTY"]
    return {thing[KEY]: thing for thing in empties if KEY in thing}


def _add_empty(collection, thing, number, handle):
    kind = "pin" if handle["is_pin"] else "handle"
    empty = bpy.data.objects.new(f"{thing['name']} {kind} {number + 1}", None)
    empty.empty_display_type = "CUBE" if handle["is_pin"] else "SPHERE"
    empty.location = FROM_PHOTO @ Vector(handle["place"])
    empty.empty_display_size = SIZE * empty.location.length
    empty.show_in_front = True
    empty[KEY] = f"{thing['number']}.{number}"
    collection.objects.link(empty)


def _add_camera(context, collection, told):
    (width, height), seen = told["size"], told["camera"]
    data = bpy.data.cameras.new("Photo")
    data.sensor_fit, longest = "AUTO", max(width, height)
    data.angle = 2 * math.atan(longest / 2 / seen["focal"])
    data.shift_x = (width / 2 - seen["cx"]) / longest
    data.shift_y = (seen["cy"] - height / 2) / longest
    data.show_background_images = True
    camera = bpy.data.objects.new("Photo", data)
    camera.rotation_euler = (math.pi / 2, 0, 0)
    collection.objects.link(camera)
    context.scene.camera = camera
    context.scene.render.resolution_x, context.scene.render.resolution_y = width, height


def _show(context, collection, folder):
    """Show the object's mesh, and the edited photo behind it, as they are in a folder."""
    for thing in [thing for thing in collection.objects if thing.type == "MESH"]:
        bpy.data.objects.remove(thing, do_unlink=True)
    before = set(bpy.data.objects)
    bpy.ops.import_scene.gltf(filepath=str(Path(folder) / "o.glb"))
    for thing in set(bpy.data.objects) - before:
        for other in list(thing.users_collection):
            other.objects.unlink(thing)
        collection.objects.link(thing)
    image = bpy.data.images.load(str(Path(folder) / "edited.png"))
    image.pack()
    camera = next(thing for thing in collection.objects if thing.type == "CAMERA").data
    camera.background_images.clear()
    camera.background_images.new().image = image


class Failing:
    """What goes wrong is one sentence in Blender's status bar."""

    def execute(self, context):
        try:
            self.work(context)
        except (RuntimeError, OSError, ValueError, KeyError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}


class OpenSession(Failing, bpy.types.Operator, ImportHelper):
    """Show the photo, the object and the handles of an ObjectMorpher session"""

    bl_idname = "import_scene.objectmorpher"
    bl_label = "ObjectMorpher session"
    bl_options = {"UNDO"}  # noqa: RUF012 (as Blender has it)
    filename_ext = ".omorph"
    filter_glob: StringProperty(default="*.omorph", options={"HIDDEN"})

    def work(self, context):
        open_session(context, self.filepath)


class Bend(Failing, bpy.types.Operator):
    """Bend the object to where the empties are"""

    bl_idname = "objectmorpher.bend"
    bl_label = "Bend"
    bl_options = {"UNDO"}  # noqa: RUF012 (as Blender has it)

    def work(self, context):
        bend(context, shown_session(context))


class SaveSession(Failing, bpy.types.Operator, ExportHelper):
    """Save the session with its handles where the empties are, and the edited photo beside it"""

    bl_idname = "export_scene.objectmorpher"
    bl_label = "ObjectMorpher session"
    filename_ext = ".omorph"
    filter_glob: StringProperty(default="*.omorph", options={"HIDDEN"})

    def work(self, context):
        bend(context, shown_session(context), self.filepath)


class OBJECTMORPHER_PT_sidebar(bpy.types.Panel):
    """The button in the sidebar of the 3D view."""

    bl_label = "ObjectMorpher"
    bl_category = "ObjectMorpher"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"

    def draw(self, context):
        self.layout.operator(Bend.bl_idname)


def shown_session(context):
    """The collection of the session that is meant: the active object's, or the only one."""
    active = context.view_layer.objects.active
    own = [] if active is None else active.users_collection
    found = [c for c in (*own, *bpy.data.collections) if KEY in c]
    if not found:
        raise RuntimeError("No ObjectMorpher session is open: import one first.")
    return found[0]


CLASSES = (OpenSession, Bend, SaveSession, OBJECTMORPHER_PT_sidebar)


def _importing(menu, context):
    menu.layout.operator(OpenSession.bl_idname, text="ObjectMorpher session (.omorph)")


def _exporting(menu, context):
    menu.layout.operator(SaveSession.bl_idname, text="ObjectMorpher session (.omorph)")


def register():
    for kind in CLASSES:
        bpy.utils.register_class(kind)
    bpy.types.TOPBAR_MT_file_import.append(_importing)
    bpy.types.TOPBAR_MT_file_export.append(_exporting)


def unregister():
    bpy.types.TOPBAR_MT_file_import.remove(_importing)
    bpy.types.TOPBAR_MT_file_export.remove(_exporting)
    for kind in reversed(CLASSES):
        bpy.utils.unregister_class(kind)
