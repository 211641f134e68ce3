"""The way from another program to ObjectMorpher and back; it lies beside each plug-in.

The plug-in saves a picture, runs `command(PICTURE, BACK)` in `environment()` and waits. The window
that opens has a button "Send back", which writes the layers to BACK (OpenRaster) and closes; a
window that is closed without it writes nothing. Only Python's own library is needed.
"""

import json
import os
import zipfile
from pathlib import Path
from xml.etree import ElementTree

BESIDE = Path(__file__).with_name("objectmorpher.json")  # where the program is
MOST = 1 << 30  # bytes of a layer's file
PYTHONS = ("PYTHONPATH", "PYTHONHOME")  # where a Python looks for its modules


def program():
    """The command that starts ObjectMorpher, as a list."""
    return [str(word) for word in _beside().get("command", ["objectmorpher"])]


def environment():
    """The environment in which it is started: the other program's, without its own Python.

    Krita puts its plug-ins first on PYTHONPATH, where this plug-in has ObjectMorpher's name. So
    these variables are as they were when the plug-in was installed.
    """
    found, installed = dict(os.environ), _beside().get("environment", {})
    for name in PYTHONS:
        found.pop(name, None)
        if installed.get(name):
            found[name] = installed[name]
    image = found.get("APPDIR")  # of the other program, where that is an AppImage
    if image and "LD_LIBRARY_PATH" in found:
        folders = found["LD_LIBRARY_PATH"].split(os.pathsep)
        found["LD_LIBRARY_PATH"] = os.pathsep.join(f for f in folders if not f.startswith(image))
    return found


def _beside():
    try:
        return json.loads(BESIDE.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}


def command(picture, back):
    """The command that edits a picture in the window."""
    return [*program(), str(picture), "--return", str(back)]


def layers(path):
    """The layers of an OpenRaster file from below.

    Of each its name, left, top, whether it is shown, how it is mixed, and its PNG file.
    """
    found = []
    with zipfile.ZipFile(path) as archive:
        stack = ElementTree.fromstring(archive.read("stack.xml")).find("stack")
        for entry in reversed(stack.findall("layer")):
            source = archive.getinfo(entry.get("src"))
            if source.file_size > MOST:
                raise ValueError(f"the layer {entry.get('name')} is too large")
            is_shown = entry.get("visibility", "visible") == "visible"
            place = int(entry.get("x", "0")), int(entry.get("y", "0"))
            how = entry.get("composite-op", "svg:src-over")
            found.append((entry.get("name"), *place, is_shown, how, archive.read(source)))
    return found
