"""`objectmorpher plugin`: puts the plug-in for another program where that looks for it."""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path

from objectmorpher_core.base.files import write_all

from ..system.resources import resource
from .terminal import UsageError

HOSTS = ("krita", "gimp", "blender", "photoshop", "comfyui")
NEXT = {
    "krita": "restart Krita, switch it on in Settings, Configure Krita, Python Plugin Manager, and"
    " restart once more; it is in Tools, Scripts",
    "gimp": "restart GIMP 3; it is in Filters, Edit in 3D with ObjectMorpher",
    "blender": "restart Blender 4.2 or newer, and switch it on in Edit, Preferences, Add-ons; it is"
    " in File, Import",
    "photoshop": "start `objectmorpher serve --web`, add this folder in Adobe's UXP Developer Tool,"
    " and load it; the panel is in Plugins",
    "comfyui": "restart ComfyUI; the nodes are under ObjectMorpher",
}
FOLDERS = {
    "comfyui": "PATH/TO/ComfyUI/custom_nodes", "photoshop": "FOLDER, where the panel is to lie",
    "blender": "PATH/TO/blender/VERSION/extensions/user_default",
}  # fmt: skip
EXECUTABLE = 0o755
PYTHONS = ("PYTHONPATH", "PYTHONHOME")  # of the program, not of the one that starts it: door.py


def add_plugin(parser: argparse.ArgumentParser) -> None:
    """The options of `objectmorpher plugin`."""
    parser.description = "Puts the plug-in where the other program looks for it (docs/plugins.md)."
    parser.add_argument("host", choices=HOSTS, metavar="HOST", help=", ".join(HOSTS))
    parser.add_argument("--folder", type=Path, metavar="FOLDER",
        help="of its plug-ins; default for krita, gimp and blender: the user's own")  # fmt: skip


def run_plugin(options: argparse.Namespace) -> None:
    host: str = options.host
    folder = options.folder or usual_folder(host)
    if folder is None:
        raise UsageError(f"which folder? add --folder {FOLDERS[host]}")
    if options.folder is not None and not folder.is_dir():
        raise UsageError(f"there is no folder {folder}")
    files = plugin_files(host)
    outputs = {folder / name: data for name, data in files.items()}
    for path in outputs:
        path.parent.mkdir(parents=True, exist_ok=True)
    write_all(outputs)
    if host == "gimp":
        (folder / "objectmorpher" / "objectmorpher.py").chmod(EXECUTABLE)
    sys.stdout.write(f"{folder}: {', '.join(files)}\nnow {NEXT[host]}\n")


def plugin_files(host: str) -> dict[str, bytes]:
    """The plug-in's files by their names below the folder of plug-ins."""
    source = resource("assets/plugins")
    own = source / host
    files = {
        path.relative_to(own).as_posix(): path.read_bytes()
        for path in sorted(own.rglob("*"))
        if path.is_file() and "__pycache__" not in path.parts
    }
    frozen = getattr(sys, "frozen", False)
    command = [sys.executable] if frozen else [sys.executable, "-P", "-m", "objectmorpher"]
    files["objectmorpher/door.py"] = (source / "door.py").read_bytes()
    own = {name: os.environ.get(name) for name in PYTHONS}
    beside = {"command": command, "environment": own}
    files["objectmorpher/objectmorpher.json"] = json.dumps(beside).encode()
    return files


def usual_folder(host: str) -> Path | None:
    """Where the user's own plug-ins of a program are, if that is known."""
    home = Path.home()
    if sys.platform == "win32":
        data = config = Path(os.environ.get("APPDATA") or home / "AppData" / "Roaming")
    elif sys.platform == "darwin":
        data = config = home / "Library" / "Application Support"
    else:
        data = Path(os.environ.get("XDG_DATA_HOME") or home / ".local" / "share")
        config = Path(os.environ.get("XDG_CONFIG_HOME") or home / ".config")
    blenders = sorted((config / "blender").glob("*.*"), key=_version)
    if host == "blender" and blenders:
        return blenders[-1] / "extensions" / "user_default"
    folders = {"krita": data / "krita" / "pykrita", "gimp": config / "GIMP" / "3.0" / "plug-ins"}
    return folders.get(host)


def _version(folder: Path) -> tuple[int, ...]:
    return tuple(int(part) for part in folder.name.split(".") if part.isdigit())
