"""Makes the pictures of docs/plugins.md anew: other programs at work with our plug-ins.

    python docs/plugins/make_plugins.py [gimp] [krita] [blender] [comfyui]

Each program is the real one, in a display of its own (Xvfb, openbox, xdotool): the plug-in is
installed by `objectmorpher plugin`, and everything is done by pointer and keys, in the program as
in the window that opens. A program that is not installed is left out. Debian 13 has GIMP 3, Krita 5
and Blender 4.3. COMFYUI names a folder with ComfyUI, and COMFYUI_PYTHON a Python that has both.
In Blender a script imports the session, and in ComfyUI one lays out the graph.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "app"), str(ROOT / "tests" / "app")]

import numpy as np  # noqa: E402
import platformdirs  # noqa: E402
from PIL import Image  # noqa: E402

from hands import Hands, window_environment, x_display  # noqa: E402
from tests.browser import opened_browser  # noqa: E402

SIZE = (1280, 800)  # px
FLOWER = ROOT / "assets" / "samples" / "flower.jpg"
WIDE, HIGH = 640, 427  # px
QUALITY = 80  # of WebP
PAUSE = 10.0  # s, in which another program, which says nothing of it, has done what it does
FRAMES = """<openbox_config xmlns="http://openbox.org/3.4/rc">
<theme><keepBorder>no</keepBorder></theme>
<applications><application class="*"><decor>no</decor></application></applications>
</openbox_config>"""


class Guest(Hands):
    """A user of another program, and of the window that its plug-in opens."""

    def window(self, name: str, by: str) -> str:
        """The number of the window whose title or class has `name` in it; waits for it."""
        found: list[str] = []

        def is_there() -> bool:
            found[:] = self.xdotool("search", "--onlyvisible", by, name).split()
            return bool(found)

        self.wait(is_there, f"showing {name}")
        return found[-1]

    def front(self, name: str, by: str = "--name") -> None:
        """Puts a window in front, as large as the screen."""
        number = self.window(name, by)
        self.xdotool("windowactivate", "--sync", number)
        self.xdotool("windowmove", number, 0, 0)
        self.xdotool("windowsize", "--sync", number, *SIZE)

    def type(self, text: str) -> None:
        """Types a text."""
        self.xdotool("type", "--delay", 30, text)
        time.sleep(1.0)

    def shoot(self, name: str) -> None:
        """Saves what the screen shows."""
        time.sleep(2.0)
        save(self.picture(), name)

    def edit_and_send_back(self, picture: str | None = None) -> None:
        """In our window: selects the flower, lifts and turns it, and sends it back."""
        self.front("layer.png")
        self.area("Photo")
        self.settle()
        self.click(*self.on_photo(310, 230, (WIDE, HIGH)))
        self.choose("Lift object")
        self.area("Drag a point on the object")
        start, end = (self.on_photo(*place, (WIDE, HIGH)) for place in ((384, 192), (424, 165)))
        self.drag(start, end)
        self.settle()
        self.choose("Tool: Place")
        x, y = self.place("Ring: yaw")
        self.drag((x, y), (x + 75, y))
        self.settle()
        if picture is not None:
            self.shoot(picture)
        self.choose("Send back")


def save(pixels: np.ndarray, name: str) -> None:
    """Writes a picture of the page."""
    path = HERE / f"{name}.webp"
    Image.fromarray(pixels[..., :3]).save(path, quality=QUALITY, method=6)
    print(path.name, path.stat().st_size)


@contextmanager
def home(host: str, *made: str) -> Iterator[tuple[dict[str, str], Path]]:
    """A display and a home with a photo and the plug-in: the environment, and the home's folder."""
    with tempfile.TemporaryDirectory() as name, x_display(*SIZE) as display:
        if display is None:
            raise SystemExit("no free X display was found")
        folder = Path(name)
        own = {"HOME": name, "XDG_CONFIG_HOME": f"{name}/.config", "LANG": "C.UTF-8"}
        own |= {"XDG_DATA_HOME": f"{name}/.local/share", "XDG_RUNTIME_DIR": name}
        own |= {"PYTHONPATH": f"{ROOT / 'app'}{os.pathsep}{ROOT}", "LIBGL_ALWAYS_SOFTWARE": "1"}
        own |= {"QT_QPA_PLATFORM": "xcb", "GDK_BACKEND": "x11", "NO_AT_BRIDGE": "1"}
        own |= {"XDG_CACHE_HOME": str(platformdirs.user_cache_path())}  # the models are there
        settings = 'dialogs = "built-in"\nmotion = "reduced"\ntheme = "dark"\n'
        environment = window_environment(display, folder, settings) | own
        Image.open(FLOWER).save(folder / "flower.png", icc_profile=None)
        for name in made:
            (folder / name).mkdir(parents=True)
        install = [sys.executable, "-m", "objectmorpher", "plugin", host]
        subprocess.run(install, env=environment, check=True, stdout=subprocess.DEVNULL)
        frames = folder / "openbox.xml"
        frames.write_text(FRAMES)
        manage = ["openbox", "--config-file", str(frames)]
        manager = subprocess.Popen(manage, env=environment, stderr=subprocess.DEVNULL)
        try:
            yield environment, folder
        finally:
            manager.terminate()
            manager.wait()


@contextmanager
def running(environment: dict[str, str], folder: Path, *program: str) -> Iterator[Guest]:
    """The user of a program."""
    with (folder / "log.txt").open("w") as log:
        process = subprocess.Popen(program, env=environment, cwd=folder, stdout=log, stderr=log)
        try:
            yield Guest(environment, process)
        except BaseException:
            print((folder / "log.txt").read_text()[-3000:])
            raise
        finally:
            process.kill()
            process.wait()


def gimp() -> None:
    """GIMP 3: the layer is sent, and a group of layers comes back."""
    with home("gimp") as (environment, folder):
        settings = folder / ".config" / "GIMP" / "3.0" / "gimprc"
        settings.write_text(
            '(show-welcome-dialog no)\n(config-version "3.0.4")\n(last-release-timestamp 0)\n'
            "(check-updates no)\n"
        )
        with running(environment, folder, "gimp", "--no-splash", "flower.png") as guest:
            guest.front("flower")
            guest.press("slash")  # GIMP's search of its menus
            guest.type("ObjectMorpher")
            guest.press("Down")
            guest.press("Return")
            guest.edit_and_send_back("window")
            guest.front("flower")
            time.sleep(PAUSE)
            guest.drag((1046, 413), (900, 413))  # the docks become wider
            guest.shoot("gimp")


def krita() -> None:
    """Krita 5: the same, and Krita goes on meanwhile."""
    with home("krita") as (environment, folder):
        settings = folder / ".config" / "kritarc"
        settings.parent.mkdir(exist_ok=True)
        settings.write_text("[python]\nenable_objectmorpher=true\n")
        with running(environment, folder, "krita", "--nosplash", "flower.png") as guest:
            guest.front("krita", "--class")
            time.sleep(PAUSE)
            guest.press("ctrl+Return")  # Krita's search of its menus
            guest.type("ObjectMorpher")
            guest.press("Return")
            guest.edit_and_send_back()
            guest.front("krita", "--class")
            time.sleep(PAUSE)
            guest.shoot("krita")


IN_BLENDER = """
import os
import bpy
os.chdir(os.environ["HOME"])
bpy.ops.preferences.addon_enable(module="bl_ext.user_default.objectmorpher")
bpy.context.preferences.view.show_splash = False
for thing in list(bpy.data.objects):
    bpy.data.objects.remove(thing)
def begin():
    (area,) = [a for a in bpy.context.screen.areas if a.type == "VIEW_3D"]
    window = bpy.context.window_manager.windows[0]
    with bpy.context.temp_override(window=window, area=area, region=area.regions[-1]):
        bpy.ops.import_scene.objectmorpher(filepath="flower.omorph")
        (space,) = area.spaces
        space.show_region_ui = True
        space.shading.type, space.shading.color_type = "SOLID", "TEXTURE"
        space.shading.light = "FLAT"
        space.region_3d.view_perspective = "CAMERA"
    open("imported", "w").close()
bpy.app.timers.register(begin, first_interval=3)
"""


def blender() -> None:
    """Blender: a session's handles as empties, and its object."""
    with home("blender", ".config/blender/4.3") as (environment, folder):
        (folder / "driver.py").write_text(IN_BLENDER)
        edit = [sys.executable, "-m", "objectmorpher", "edit", str(FLOWER), "--subject"]
        edit += ["--handle", "384,192:420,170", "--pin", "300,300", "-o", "bent.png"]
        edit += ["--session", "flower.omorph"]
        subprocess.run(edit, cwd=folder, env=environment, check=True, stdout=subprocess.DEVNULL)
        driver = str(folder / "driver.py")
        with running(environment, folder, "blender", "-P", driver) as guest:
            guest.front("Blender")
            guest.wait((folder / "imported").exists, "importing")
            guest.xdotool("mousemove", 500, 400)
            time.sleep(PAUSE)
            guest.click(1043, 275)  # the sidebar's tab
            guest.click(611, 337)  # the handle
            guest.xdotool("mousemove", 612, 337)
            guest.press("g")
            guest.xdotool("mousemove", 650, 320)
            guest.xdotool("mousemove", 655, 315)
            guest.click(655, 315)
            time.sleep(2.0)
            guest.click(900, 127)  # "Bend"
            time.sleep(3 * PAUSE)
            guest.shoot("blender")


STILL_POSE = dict.fromkeys(
    ("from_x", "from_y", "to_x", "to_y", "farther", "pitch", "roll", "move_x", "move_y"), 0
)
GRAPH = {
    "1": {"class_type": "LoadImage", "inputs": {"image": "flower.png"}},
    "2": {"class_type": "ObjectMorpherSelect", "inputs": {"image": ["1", 0], "x": 310, "y": 210}},
    "3": {"class_type": "ObjectMorpherLift", "inputs": {"object": ["2", 0], "thickness": 1}},
    "4": {
        "class_type": "ObjectMorpherPose",
        "inputs": {"object": ["3", 0], **STILL_POSE, "yaw": 25, "scale": 1},
    },
    "5": {"class_type": "ObjectMorpherRender", "inputs": {"object": ["4", 0]}},
    "6": {"class_type": "PreviewImage", "inputs": {"images": ["5", 0]}},
}
PLACES = {1: (0, 0), 2: (330, 0), 3: (330, 160), 4: (640, 0), 5: (330, 280), 6: (950, 0)}
LAID_OUT = """
const places = %s;
app.loadApiJson(%s, "flower");
for (const node of app.graph._nodes) {
  node.pos = places[node.id];
  if (node.id === 1) node.size = [300, 340];
  if (node.id === 6) node.size = [360, 340];
}
app.canvas.ds.scale = 0.88;
app.canvas.ds.offset = [90, 150];
app.graph.setDirtyCanvas(true, true);
app.queuePrompt(0, 1);
"""
CLOSE = "document.querySelectorAll('.p-dialog-mask, [role=dialog]').forEach((x) => x.remove())"


def answers(address: str) -> None:
    """Waits until a server does."""
    end = time.monotonic() + 300
    while True:
        try:
            with urllib.request.urlopen(address):
                return
        except OSError:
            if time.monotonic() > end:
                raise
            time.sleep(1.0)


def comfyui() -> None:
    """ComfyUI: a graph of our nodes, carried out."""
    folder, python = Path(os.environ["COMFYUI"]), os.environ["COMFYUI_PYTHON"]
    install = ["plugin", "comfyui", "--folder", str(folder / "custom_nodes")]
    environment = os.environ | {"PYTHONPATH": f"{ROOT / 'app'}{os.pathsep}{ROOT}"}
    subprocess.run([sys.executable, "-m", "objectmorpher", *install], env=environment, check=True)
    Image.open(FLOWER).save(folder / "input" / "flower.png")
    command = [python, "main.py", "--cpu", "--port", "8198", "--disable-api-nodes"]
    with subprocess.Popen(command, cwd=folder, env=environment) as server, opened_browser() as page:
        try:
            answers("http://127.0.0.1:8198")
            page.resize(SIZE[0], SIZE[1] + 143)
            page.open("http://127.0.0.1:8198")
            page.wait("!!(window.app && app.graph && app.canvas)", "opening")
            time.sleep(PAUSE)
            page.run(CLOSE)
            page.run(LAID_OUT % (json.dumps(PLACES), json.dumps(GRAPH)))
            page.wait("app.graph.getNodeById(6).imgs?.length > 0", "rendering")
            time.sleep(PAUSE)
            page.run(CLOSE)
            time.sleep(1.0)
            save(page.picture()[:470], "comfyui")  # below, there is nothing
        finally:
            server.kill()


def main() -> None:
    programs = {"gimp": gimp, "krita": krita, "blender": blender}
    there = [name for name in programs if shutil.which(name)]
    if "COMFYUI" in os.environ:
        there.append("comfyui")
    programs["comfyui"] = comfyui
    for name in sys.argv[1:] or there:
        programs[name]()


if __name__ == "__main__":
    main()
