"""Doors to other programs: the window sends layers back; Krita and ComfyUI's nodes take them.

Krita, GIMP 3 and Blender (as the package bpy) are the real ones, where they are installed. ComfyUI
hands its nodes tensors, which is done here. Where GIMP is older (Debian 12), and for Photoshop,
which no system of ours has, the plug-ins run against a stand-in for what they call.
"""

from __future__ import annotations

import base64
import importlib.util
import io
import json
import os
import shutil
import subprocess
import sys
import types
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from psd_tools import PSDImage

from editor_steps import CENTRE, HEIGHT, WIDTH
from gimp_stub import make_gimp
from hands import ROOT, opened
from objectmorpher.__main__ import main
from objectmorpher.cli.plugin import HOSTS, plugin_files
from objectmorpher.server.web_editor import WebServer
from objectmorpher_core.base.progress import silent
from objectmorpher_core.deform.puppet import puppet_of
from objectmorpher_core.document.model import Document, Placement
from objectmorpher_core.session.file import load_session
from test_window import screen_xy

PLUGINS = ROOT / "assets" / "plugins"
FLOWER = ROOT / "assets" / "samples" / "flower.jpg"
TURN = ("--subject", "--turn", "20,0,0")
IN_KRITA = """
import os, traceback
from krita import InfoObject, Krita
def run(*_):
    try:
        import objectmorpher
        Krita.instance().setBatchmode(True)
        document = Krita.instance().openDocument("photo.png")
        document.setBatchmode(True)  # no dialog asks how to write shown.png
        node = document.topLevelNodes()[0]
        objectmorpher.send(document, node, "sent.png")
        group = objectmorpher.bring_back(document, node, "back.ora")
        names = [child.name() for child in group.childNodes()]
        document.waitForDone()
        document.exportImage("shown.png", InfoObject())
        open("said.txt", "w").write("\\n".join(names))
    except BaseException:
        open("said.txt", "w").write(traceback.format_exc())
    os._exit(0)
"""


def pixels(path: Path) -> np.ndarray:
    return np.asarray(Image.open(path).convert("RGB")).astype(int)


@pytest.fixture(scope="module")
def edited(networks: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a photo, the same edited, and the layers that come back of it."""
    folder = tmp_path_factory.mktemp("door")
    Image.open(FLOWER).save(folder / "photo.png")
    told = [str(folder / "photo.png"), "-o", str(folder / "edited.png"), *TURN]
    assert main(["edit", *told, "--save-layers", str(folder / "back.ora")]) == 0
    return folder


@pytest.mark.slow
@pytest.mark.window
def test_the_window_sends_layers_back_and_closes(
    without_networks: dict[str, str], photo_path: Path, tmp_path: Path
) -> None:
    back = tmp_path / "back.ora"
    with opened(without_networks, photo_path, "--return", str(back)) as hands:
        hands.click(*screen_xy(*CENTRE))
        hands.choose("Lift object")
        hands.place("Drag a point on the object")
        hands.drag(screen_xy(*CENTRE), screen_xy(CENTRE[0] + 14, CENTRE[1] - 10))
        hands.place("Send back")
        hands.settle()  # the background is filled in
        hands.choose("Send back")
        hands.wait(back.exists, "sending back")
    with zipfile.ZipFile(back) as archive:
        merged = Image.open(io.BytesIO(archive.read("mergedimage.png")))
        assert "Object 1" in archive.read("stack.xml").decode()
    assert merged.size == (WIDTH, HEIGHT)
    changed = np.abs(np.asarray(merged.convert("RGB")).astype(int) - pixels(photo_path)).max(2) > 8
    assert changed.any() and not changed[:, :20].any()


@pytest.mark.parametrize("host", HOSTS)
def test_a_plugin_is_installed_with_the_way_to_this_program(host: str, tmp_path: Path) -> None:
    assert main(["plugin", host, "--folder", str(tmp_path)]) == 0
    for name, data in plugin_files(host).items():
        assert (tmp_path / name).read_bytes() == data
    door = module("door", tmp_path / "objectmorpher" / "door.py")
    said = subprocess.run([*door.program(), "--version"], capture_output=True, text=True)
    assert said.returncode == 0 and "objectmorpher" in said.stdout.lower()
    assert door.command("a.png", "b.ora")[-3:] == ["a.png", "--return", "b.ora"]


@pytest.mark.parametrize("host", ["krita", "blender"])
def test_the_program_is_started_where_the_host_has_a_python_of_its_own(
    host: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As Krita does it: its plug-ins, ours among them, come first on PYTHONPATH."""
    assert main(["plugin", host, "--folder", str(tmp_path)]) == 0
    door = module("door", tmp_path / "objectmorpher" / "door.py")
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}{os.pathsep}{os.environ.get('PYTHONPATH', '')}")
    monkeypatch.setenv("APPDIR", "/mounted")
    monkeypatch.setenv("LD_LIBRARY_PATH", os.pathsep.join(("/mounted/usr/lib", "/opt/own/lib")))
    command = [*door.program(), "--version"]
    shadowed = subprocess.run(command, capture_output=True, text=True)
    assert not shadowed.stdout.startswith("objectmorpher ")  # the plug-in has taken its name
    said = subprocess.run(command, env=door.environment(), capture_output=True, text=True)
    assert said.returncode == 0 and said.stdout.startswith("objectmorpher "), said.stderr
    assert door.environment()["LD_LIBRARY_PATH"] == "/opt/own/lib"


def test_a_folder_has_to_be_there_and_some_have_to_be_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["plugin", "comfyui"]) != 0
    assert "--folder PATH/TO/ComfyUI/custom_nodes" in capsys.readouterr().err
    assert main(["plugin", "krita", "--folder", str(tmp_path / "none")]) != 0
    assert "there is no folder" in capsys.readouterr().err


@pytest.mark.slow
def test_krita_sends_a_layer_and_shows_what_comes_back(edited: Path, tmp_path: Path) -> None:
    if shutil.which("kritarunner") is None or shutil.which("xvfb-run") is None:
        pytest.skip("needs Krita and xvfb-run")
    folder = tmp_path / ".local" / "share" / "krita" / "pykrita"
    folder.mkdir(parents=True)
    assert main(["plugin", "krita", "--folder", str(folder)]) == 0
    (folder / "driver.py").write_text(IN_KRITA)
    command = ["xvfb-run", "-a", "kritarunner", "-s", "driver", "-f", "run"]
    environment = {**os.environ, "HOME": str(tmp_path), "PYTHONPATH": str(folder)}
    for name in ("XDG_DATA_HOME", "XDG_CONFIG_HOME"):
        environment.pop(name, None)
    subprocess.run(command, cwd=edited, env=environment, timeout=600, capture_output=True)
    said = edited / "said.txt"
    if not said.exists():
        pytest.skip("Krita has no Python here (package python3-pyqt5)")
    assert said.read_text().splitlines()[0] == "Photo", said.read_text()
    np.testing.assert_array_equal(pixels(edited / "sent.png"), pixels(edited / "photo.png"))
    assert np.abs(pixels(edited / "shown.png") - pixels(edited / "edited.png")).max() <= 2


@pytest.mark.slow
def test_gimps_plugin_sends_a_layer_and_takes_what_comes_back(
    edited: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gimp = make_gimp(monkeypatch)
    plugin = module("gimp_plugin", PLUGINS / "gimp" / "objectmorpher" / "objectmorpher.py",
                    beside=PLUGINS)  # fmt: skip
    image = gimp.Image(640, 427)
    layer = gimp.Layer(np.asarray(Image.open(edited / "photo.png").convert("RGBA")))
    image.insert_layer(layer, None, 0)

    def program(command: list[str], env: dict[str, str], check: bool) -> None:
        """What a user would do in the window."""
        photo, back = command[-3], command[-1]
        np.testing.assert_array_equal(pixels(Path(photo)), pixels(edited / "photo.png"))
        shutil.copy(edited / "back.ora", back)

    monkeypatch.setattr(plugin.subprocess, "run", program)
    found = plugin.edit(gimp.Procedure(), None, image, [layer], None, None)
    assert found[0] == gimp.PDBStatusType.SUCCESS
    (group,) = [item for item in image.layers if item.children]
    assert image.layers.index(group) < image.layers.index(layer)  # above it
    assert group.children[-1].name == "Photo"
    assert np.abs(image.shown()[..., :3].astype(int) - pixels(edited / "edited.png")).max() <= 2
    refused = plugin.edit(gimp.Procedure(), None, image, [], None, None)
    assert refused[0] == gimp.PDBStatusType.EXECUTION_ERROR


IN_GIMP = """
import importlib.util, os, traceback
from gi.repository import Gimp, Gio
def run():
    spec = importlib.util.spec_from_file_location("plugin", os.environ["PLUGIN"])
    plugin = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(plugin)
    quietly = Gimp.RunMode.NONINTERACTIVE
    image = Gimp.file_load(quietly, Gio.File.new_for_path(os.path.abspath("photo.png")))
    layer = image.get_layers()[0]
    plugin.send(image, layer, os.path.abspath("sent.png"))
    group = plugin.bring_back(image, layer, "back.ora")
    names = [child.get_name() for child in group.get_children()]
    image.flatten()
    Gimp.file_save(quietly, image, Gio.File.new_for_path(os.path.abspath("shown.png")), None)
    return names
try:
    said = "\\n".join(run())
except BaseException:
    said = traceback.format_exc()
open("said-gimp.txt", "w").write(said)
"""


@pytest.mark.slow
def test_the_real_gimp_sends_a_layer_and_shows_what_comes_back(
    edited: Path, tmp_path: Path
) -> None:
    gimp = shutil.which("gimp-console-3.0")
    if gimp is None:
        pytest.skip("needs GIMP 3.0")
    assert main(["plugin", "gimp", "--folder", str(tmp_path)]) == 0
    shutil.copy(edited / "photo.png", tmp_path / "photo.png")
    shutil.copy(edited / "back.ora", tmp_path / "back.ora")
    plugin = str(tmp_path / "objectmorpher" / "objectmorpher.py")
    environment = {**os.environ, "HOME": str(tmp_path), "PLUGIN": plugin}
    for name in ("XDG_DATA_HOME", "XDG_CONFIG_HOME", "PYTHONPATH"):
        environment.pop(name, None)
    command = [gimp, "-i", "--batch-interpreter=python-fu-eval", "-b", IN_GIMP, "--quit"]
    done = subprocess.run(
        command, cwd=tmp_path, env=environment, timeout=600, capture_output=True, text=True
    )
    said = tmp_path / "said-gimp.txt"
    if not said.exists():
        pytest.skip(f"GIMP has no Python here (python3-gi, gir1.2-gimp-3.0): {done.stderr[-300:]}")
    assert said.read_text().splitlines()[-1] == "Photo", said.read_text()
    np.testing.assert_array_equal(pixels(tmp_path / "sent.png"), pixels(edited / "photo.png"))
    difference = np.abs(pixels(tmp_path / "shown.png") - pixels(edited / "edited.png"))
    assert difference.max() <= 2, difference.max()


IN_BLENDER = """
import sys
sys.path.insert(0, sys.argv[1])
import bpy
from bpy_extras.object_utils import world_to_camera_view
bpy.ops.wm.read_factory_settings(use_empty=True)
import objectmorpher
objectmorpher.register()
assert bpy.ops.import_scene.objectmorpher(filepath="bent.omorph") == {"FINISHED"}
scene = bpy.context.scene
bpy.context.view_layer.update()
(collection,) = [c for c in bpy.data.collections if "objectmorpher" in c]
pin, handle = sorted((o for o in collection.objects if o.type == "EMPTY"),
                     key=lambda o: o.empty_display_type)
for empty in (pin, handle):
    at = world_to_camera_view(scene, scene.camera, empty.location)
    print(at.x * 640, (1 - at.y) * 427)
handle.location.x -= 0.1
bpy.context.view_layer.update()
assert bpy.ops.objectmorpher.bend() == {"FINISHED"}
assert bpy.ops.export_scene.objectmorpher(filepath="moved.omorph") == {"FINISHED"}
(mesh,) = [o for o in collection.objects if o.type == "MESH"]
print(len(mesh.data.vertices), handle.location.x)
"""


@pytest.mark.slow
def test_blender_shows_a_sessions_handles_and_bends_its_object(tmp_path: Path) -> None:
    blender = os.environ.get("BLENDER_PYTHON")
    if blender is None:
        pytest.skip("BLENDER_PYTHON names no Python that has Blender (package bpy)")
    session = tmp_path / "bent.omorph"
    told = ["--subject", "--handle", "384,192:420,170", "--pin", "300,300"]
    told += ["-o", str(tmp_path / "bent.png"), "--session", str(session)]
    assert main(["edit", str(FLOWER), *told]) == 0
    assert main(["plugin", "blender", "--folder", str(tmp_path)]) == 0
    (tmp_path / "driver.py").write_text(IN_BLENDER)
    command = [blender, "driver.py", str(tmp_path)]
    environment = {**os.environ, "PYTHONPATH": f"{ROOT / 'app'}{os.pathsep}{ROOT}"}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    said = [line for line in done.stdout.splitlines() if line[:1].isdigit() and "|" not in line]
    assert done.returncode == 0 and len(said) == 3, done.stdout + done.stderr
    pin, handle, (vertices, x) = ([float(word) for word in line.split()] for line in said)
    np.testing.assert_allclose([pin, handle], [(300, 300), (420, 170)], atol=0.05)
    before, after = (load_session(tmp_path / name) for name in ("bent.omorph", "moved.omorph"))
    targets = [document.objects[0].handles for document in (before, after)]
    shift = targets[1][1].target - targets[0][1].target
    lifted = before.objects[0].lifted
    assert lifted is not None
    motion = lifted.world_from_object[:3, :3]
    np.testing.assert_allclose(motion @ shift, (-0.1, 0, 0), atol=1e-5)
    np.testing.assert_allclose(targets[1][0].target, targets[0][0].target, atol=1e-6)
    assert vertices > 1000 and 0 < x < 0.3
    assert (pixels(tmp_path / "moved.png") != pixels(tmp_path / "bent.png")).mean() > 0.01


@pytest.mark.slow
def test_photoshops_panel_sends_a_layer_and_takes_what_comes_back(tmp_path: Path) -> None:
    node = shutil.which("node")
    if node is None or int(subprocess.check_output([node, "--version"]).split(b".")[0][1:]) < 18:
        pytest.skip("needs Node.js 18 or newer")
    photo = Image.open(FLOWER).convert("RGBA")
    photo.save(tmp_path / "layer.png")
    assert main(["plugin", "photoshop", "--folder", str(tmp_path)]) == 0
    panel = tmp_path / "objectmorpher" / "main.js"
    panel.write_text(panel.read_text().replace(":8717", r":\d+"))  # any free port
    token = "a-token-of-this-test-only"
    server = WebServer(("127.0.0.1", 0), token, 1 << 24)
    server.start()
    try:
        stub = Path(__file__).with_name("photoshop_stub.js")
        command = [node, str(stub), str(panel), str(tmp_path), f"{server.url}/#token={token}"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            link = process.stdout.readline().strip()
            name = link.rpartition("edit=")[2]
            edit = server.find(name)  # what a user would do in the browser
            edit.select({"click": [[310, 230]]}, silent)
            edit.lift({}, silent)
            assert edit.lifted is not None
            edit.render(shown_pose(edit.lifted, yaw=20) | {"what": "layers"}, silent)
            told = json.loads(process.stdout.read())
    finally:
        server.close()
    assert link.startswith(f"{server.url}/#token={token}&edit=")
    assert told["layers"] == ["Above", ["ObjectMorpher", "Object", "Background"], "Mine"]
    assert told["open"] == 1 and "group above" in told["said"]
    back = PSDImage.open(tmp_path / "back.psd")
    assert next(iter(back)).name.startswith("Photo") and "Object 1" in {
        x.name for x in back.descendants()
    }
    merged = np.asarray(back.composite().convert("RGB")).astype(int)
    assert (np.abs(merged - np.asarray(photo.convert("RGB"))).max(2) > 30).mean() > 0.02


def shown_pose(document: Document, yaw: float) -> dict[str, Any]:
    """What the page in the browser says of an object that was turned."""
    item, camera = document.objects[0], document.photo.camera
    assert item.lifted is not None
    rest = puppet_of(item, camera).deformer.points.astype("<f4")
    quats = np.tile(np.array([1, 0, 0, 0], "<f4"), (len(rest), 1))
    world = Placement(turn=(yaw, 0, 0)).matrix(item.lifted, camera) @ item.lifted.world_from_object
    return {
        "points": base64.b64encode(rest.tobytes()).decode(),
        "quats": base64.b64encode(quats.tobytes()).decode(),
        "turn": world[:3, :3].ravel().tolist(), "shift": world[:3, 3].tolist(),
    }  # fmt: skip


@pytest.mark.slow
def test_comfyuis_nodes_select_lift_pose_render_and_save(tmp_path: Path) -> None:
    torch = pytest.importorskip("torch")
    nodes = module("comfy", PLUGINS / "comfyui" / "objectmorpher" / "__init__.py")
    kinds = nodes.NODE_CLASS_MAPPINGS
    assert set(kinds) == set(nodes.NODE_DISPLAY_NAME_MAPPINGS)
    photo = np.asarray(Image.open(FLOWER).convert("RGB"))
    image = torch.from_numpy(photo.astype(np.float32) / 255)[None]
    chosen, mask = run(kinds["ObjectMorpherSelect"], image=image, x=310.0, y=210.0)
    assert mask.shape == (1, 427, 640) and 0.1 < float(mask.mean()) < 0.5
    again, same = run(kinds["ObjectMorpherSelect"], image=image, x=0.0, y=0.0, mask=mask)
    assert torch.equal(same, mask)
    (lifted,) = run(kinds["ObjectMorpherLift"], object=again, thickness=1.0)
    (still,) = run(kinds["ObjectMorpherPose"], object=lifted)
    (posed,) = run(kinds["ObjectMorpherPose"], object=still, yaw=25.0)
    rendered, alpha, background = run(kinds["ObjectMorpherRender"], object=posed)
    assert rendered.shape == background.shape == image.shape and alpha.shape == mask.shape
    difference = (rendered - image).abs()[0].max(-1).values
    assert float(difference[mask[0] > 0.5].mean()) > 0.03 and float(difference[:60].max()) == 0
    (nothing, _, _) = run(kinds["ObjectMorpherRender"], object=still)
    assert float((nothing - image).abs().max()) < 1e-6
    for name in ("flower.ply", "flower.glb"):
        run(kinds["ObjectMorpherSaveSolid"], object=posed, file=str(tmp_path / name))
        assert (tmp_path / name).stat().st_size > 10_000
    assert chosen is not None


def run(kind: Any, **inputs: Any) -> Any:
    """As ComfyUI runs a node: the widgets' defaults where nothing is connected."""
    asked = kind.INPUT_TYPES()
    known = {**asked["required"], **asked.get("optional", {})}
    assert set(inputs) <= set(known)
    for name, (_, *widget) in asked["required"].items():
        if widget:
            inputs.setdefault(name, widget[0]["default"])
    found = getattr(kind(), kind.FUNCTION)(**inputs)
    assert len(found) == len(kind.RETURN_TYPES)
    return found


def module(name: str, path: Path, beside: Path | None = None) -> types.ModuleType:
    """A plug-in's module, from its file; `beside`: a folder whose modules it finds, too."""
    before = list(sys.path)
    sys.path[:0] = [] if beside is None else [str(beside)]
    try:
        spec = importlib.util.spec_from_file_location(name, path)
        assert spec is not None and spec.loader is not None
        found = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(found)
    finally:
        sys.path[:] = before
    return found
