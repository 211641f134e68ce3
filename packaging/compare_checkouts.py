"""Compare what two checkouts of the program write, byte for byte.

    python packaging/compare_checkouts.py OLD NEW

Each is a folder in which `make run` or `make test` was called. Both do all edits of docs/gallery,
and NEW replays the sessions that OLD has written. A change of structure leaves every byte as it
was.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

GALLERY = Path("docs", "gallery")


def run(checkout: Path, *arguments: object) -> None:
    """Run the command line of `checkout`. Raises CalledProcessError."""
    has_package = (checkout / "app" / "objectmorpher").is_dir()
    command = [checkout / ".venv" / "bin" / "python", "-m"]
    command += ["objectmorpher" if has_package else "app", *arguments]
    subprocess.run([str(part) for part in command], cwd=checkout, check=True, capture_output=True)


def differences(old: Path, new: Path, folder: Path) -> list[str]:
    """Names of the pictures that differ; all are left in `folder`."""
    found = []
    for script in sorted((old / GALLERY).glob("*.json")):
        name = script.stem
        session = folder / f"{name}.omorph"
        pictures = [folder / f"{name}-{who}.png" for who in ("old", "new", "replayed")]
        run(old, "edit", "--script", script, "-o", pictures[0], "--session", session)
        run(new, "edit", "--script", script, "-o", pictures[1])
        run(new, "replay", session, "-o", pictures[2])
        before, *after = (picture.read_bytes() for picture in pictures)
        is_same = all(picture == before for picture in after)
        found += [] if is_same else [name]
        print(f"{name:<24} {'the same' if is_same else 'DIFFERENT'}", flush=True)
    return found


def main() -> int:
    """Return 1 where anything differs."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("old", type=Path, metavar="OLD")
    parser.add_argument("new", type=Path, metavar="NEW")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        return bool(differences(options.old.resolve(), options.new.resolve(), Path(folder)))


if __name__ == "__main__":
    sys.exit(main())
