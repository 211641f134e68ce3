"""Makes the installers: a folder with a program, and of it a Debian package and an AppImage.

    python packaging/build.py folder          dist/objectmorpher/
    python packaging/build.py deb appimage    and dist/*.deb, dist/*.AppImage

Run it by an environment that holds packaging/locks/packaging.txt; `make packages` makes one. It is
the Python of that environment that is shipped, with the system libraries of this machine: what is
built on an old system runs on a newer one, never the other way round.
"""

from __future__ import annotations

import argparse
import compileall
import os
import py_compile
import shutil
import subprocess
import sys
from pathlib import Path

PACKAGING = Path(__file__).resolve().parent
ROOT = PACKAGING.parent
sys.path[:0] = [str(ROOT / "app"), str(ROOT), str(PACKAGING)]

import bundled  # noqa: E402
import licences  # noqa: E402
import linux_packages  # noqa: E402

from objectmorpher import __version__  # noqa: E402
from objectmorpher_core.base.installation import BUILD, build_name  # noqa: E402

KINDS = {"deb": linux_packages.build_deb, "appimage": linux_packages.build_appimage}
NEEDED = {"deb": ("dpkg-deb", "dpkg"), "appimage": ("mksquashfs", "squashfs-tools")}


def build_folder(out: Path) -> Path:
    """The program's folder below `out`. Raises CalledProcessError, LookupError, SystemExit."""
    folder = out / "objectmorpher"
    for old in (folder, out / "third-party", out / "pyinstaller"):
        shutil.rmtree(old, ignore_errors=True)
    out.mkdir(parents=True, exist_ok=True)
    packages = licences.run_time()
    (out / BUILD).write_text(build_name(ROOT) + "\n", encoding="ascii")
    (out / "distributions.txt").write_text("\n".join(p.metadata["Name"] for p in packages))
    licences.write_texts([licences.licence_of(p) for p in packages], out / "third-party")
    write_icons(out)
    subprocess.run(
        [sys.executable, "-m", "PyInstaller", "--noconfirm", "--clean", "--log-level", "WARN",
         "--distpath", str(out), "--workpath", str(out / "pyinstaller"),
         str(PACKAGING / "objectmorpher.spec")],
        check=True, cwd=ROOT,
    )  # fmt: skip
    inside = folder / "_internal"
    shutil.copyfile(ROOT / "LICENSE", folder / "LICENSE")
    # Nobody writes bytecode into an installed folder, and its times say nothing.
    compileall.compile_dir(
        inside, quiet=1, force=True, stripdir=str(inside), workers=1,
        invalidation_mode=py_compile.PycInvalidationMode.UNCHECKED_HASH,
    )  # fmt: skip
    bundled.strip_symbols(inside)
    bundled.check(folder)
    if sys.platform == "linux":
        bundled.write_system_texts(folder, inside / "third-party")
    (folder / "third-party").symlink_to("_internal/third-party")
    return folder


def write_icons(out: Path) -> None:
    """The window's icon in the formats of Windows and macOS."""
    from PIL import Image

    icon = Image.open(ROOT / "assets" / "icon.png").convert("RGBA")
    icon.save(out / "icon.ico", sizes=[(n, n) for n in (16, 24, 32, 48, 64, 128, 256)])
    icon.save(out / "icon.icns")


def main() -> None:
    """Builds what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("kinds", nargs="+", choices=("folder", *KINDS))
    parser.add_argument("--out", type=Path, default=ROOT / "dist")
    options = parser.parse_args()
    for program, package in (NEEDED[kind] for kind in options.kinds if kind in NEEDED):
        if shutil.which(program) is None:
            parser.error(f"{program} is missing: sudo apt-get install {package}")
    out = options.out.resolve()
    os.umask(0o022)
    folder = out / "objectmorpher"
    if "folder" in options.kinds or not folder.is_dir():
        folder = build_folder(out)
        tell(folder)
    for kind in options.kinds:
        if kind in KINDS:
            tell(KINDS[kind](folder, out, __version__))


def tell(path: Path) -> None:
    """Its size."""
    files = path.rglob("*") if path.is_dir() else (path,)
    size = sum(f.stat().st_size for f in files if f.is_file() and not f.is_symlink())
    print(f"{path}: {size / 1e6:.0f} MB")


if __name__ == "__main__":
    main()
