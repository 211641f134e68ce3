"""Makes the gallery anew: `python docs/gallery/make_gallery.py`, or `make gallery`.

Every .json beside this file is an edit script for `objectmorpher edit`. The edited photo is
written beside it as NAME.png, and the photo and the edit side by side as NAME-before-after.jpg.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from PIL import Image

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent.parent))

from objectmorpher.cli.parser import main  # noqa: E402

GAP = 8  # px of white between before and after
QUALITY = 92


def make(script: Path) -> int:
    """One edit; the command line's exit code."""
    after = script.with_suffix(".png")
    report = script.with_suffix(".report.json")
    code = main(["edit", "--script", str(script), "-o", str(after), "--report", str(report)])
    if code:
        return code
    figures = json.loads(report.read_text())
    report.unlink()
    before = Image.open(HERE / json.loads(script.read_text())["photo"]).convert("RGB")
    edited = Image.open(after).convert("RGB")
    width, height = before.size
    pair = Image.new("RGB", (2 * width + GAP, height), "white")
    pair.paste(before, (0, 0))
    pair.paste(edited, (width + GAP, 0))
    pair.save(script.with_name(f"{script.stem}-before-after.jpg"), quality=QUALITY)
    errors = [handle["error_px"] for handle in figures["handles"]]
    print(
        f"{script.stem:<20} {figures['seconds']['total']:5.1f} s   "
        f"from the photo {figures['pixels']['from_photo']:.0%}   "
        f"largest handle error {max(errors, default=0):.3f} px"
    )
    return 0


if __name__ == "__main__":
    sys.exit(max(make(script) for script in sorted(HERE.glob("*.json"))))
