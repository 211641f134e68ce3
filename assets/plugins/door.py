"""The way from another program to ObjectMorpher and back; it lies beside each plug-in.

The plug-in saves a picture, runs `command(PICTURE, BACK)` and waits. The window that opens has a
button "Send back", which writes the layers to BACK (OpenRaster) and closes; a window that is
closed without it writes nothing. Only Python's own library is needed.
"""

import json
import zipfile
from pathlib import Path
from xml.etree import ElementTree

BESIDE = Path(__file__).with_name("objectmorpher.json")  # where the program is
MOST = 1 << 30  # bytes of a layer's file


def program():
    """The command that starts ObjectMorpher, as a list."""
    try:
        return [str(word) for word in json.loads(BESIDE.read_text(encoding="utf-8"))["command"]]
    except (OSError, ValueError, KeyError):
        return ["objectmorpher"]


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
