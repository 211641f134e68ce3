"""The main job on the command line and in the editor, as one program: `python main_job.py FOLDER`.

FOLDER holds photo.png, with an object at CENTRE; what is exported goes there, too.
`test_no_network` runs it where the network is refused.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from editor_steps import CENTRE, lift_ball, open_file, wait_for_jobs, wait_until
from objectmorpher.cli import parser as cli
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.settings import Settings, read_settings, settings_path, write_settings
from objectmorpher.editor.view import ToolName
from objectmorpher.tools.registry import TOOLS
from strokes import stroke
from tests.core.models.small_networks import brightness

AT = ",".join(str(round(n)) for n in CENTRE)


def on_the_command_line(folder: Path) -> None:
    """Everything that a user without a window asks for."""
    net = folder / "depth.onnx"
    net.write_bytes(brightness())
    photo, out, session = (str(folder / n) for n in ("photo.png", "line.png", "line.omorph"))
    for command in (
        ["models", "add", "depth", str(net)],  # so that onnxruntime runs
        ["models", "list"],
        ["doctor"],
        [
            "edit", photo, "-o", out, "--click", AT, "--gaussians", "2000", "--turn", "15,0,0",
            "--handle", f"{AT}:{round(CENTRE[0]) + 6},{round(CENTRE[1])}", "--pin", "90,105",
            "--refine", "harmonise", "--session", session,
        ],
        ["info", session],
    ):  # fmt: skip
        assert cli.main(command) == 0, command


def in_the_editor(folder: Path) -> None:
    """Open, select, lift, drag, harmonise, save, export; its worker does the long parts."""
    write_settings(settings_path(), Settings(gaussians=2000))
    editor = Editor(read_settings(settings_path()))
    editor.view.resize((720, 560), 1.0, None)
    open_file(editor, folder / "photo.png")
    lift_ball(editor)
    start = editor.view.canvas_from_image(np.array(CENTRE))
    stroke(editor, TOOLS[ToolName.POSE], start, start + (10, 4), start + (30, 10))
    assert editor.object is not None and editor.object.handles
    editor.composing.choose_refiner("harmonise")
    wait_for_jobs(editor)
    editor.filing.save_as(folder / "editor.omorph")
    editor.exporting.export_to(folder / "editor.png")
    exported = folder / "editor.png"
    wait_until(editor, lambda: exported.exists() and editor.jobs.is_idle)
    wait_for_jobs(editor)
    editor.shut_down()


def main() -> None:
    folder = Path(sys.argv[1])
    on_the_command_line(folder)
    in_the_editor(folder)


if __name__ == "__main__":
    main()
