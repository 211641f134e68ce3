"""The picture of all views, docs/views.jpg."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from hands import ROOT, x_display

EDIT = "docs/gallery/astronaut-handles.json"  # what every view shows


def make(docs: Path) -> None:
    """Write it, of an edit of the gallery."""
    with tempfile.TemporaryDirectory() as folder, x_display(1440, 900) as display:
        assert display is not None, "no free X display was found"
        environment = os.environ | {
            "DISPLAY": display,
            "PYTHONPATH": f"{ROOT / 'app'}{os.pathsep}{ROOT}",
        }
        settings = Path(folder, "settings.toml")
        settings.write_text('dismissed = ["posing"]\n', encoding="utf-8")
        environment["OBJECTMORPHER_SETTINGS"] = str(settings)
        session = f"{folder}/edit.omorph"
        edit = ("-m", "objectmorpher", "edit", "--script", EDIT, "-o", f"{folder}/out.png")
        shots = ("tests/app/shoot_views.py", folder, session, "--montage", docs / "views.jpg")
        for arguments in ((*edit, "--session", session), shots):
            command = [sys.executable, *map(str, arguments)]
            subprocess.run(command, cwd=ROOT, env=environment, check=True)
