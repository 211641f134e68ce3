"""The Debian package and the AppImage, of a folder that is built."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
from pathlib import Path
from xml.sax.saxutils import escape

HERE = Path(__file__).resolve().parent
ID = "org.objectmorpher.ObjectMorpher"
ADDRESS = "OBJECTMORPHER_REPOSITORY"  # environment variable: where the project is, once it is known
LICENCE_LINE = "<project_license>Apache-2.0</project_license>"
NAME = "objectmorpher"
ICON_SIZES = (16, 24, 32, 48, 64, 128, 256)
DEBIAN = {"x86_64": "amd64", "aarch64": "arm64"}
# What draws is the system's own; the rest is what a window is opened with, which on Wayland is one
# of XWayland.
NEEDS = (
    "libc6 (>= {libc})", "libgl1", "libegl1", "libx11-6", "libxext6", "libstdc++6", "libgcc-s1",
    "libexpat1", "zlib1g", "libuuid1", "libxcursor1", "libxi6", "libxinerama1",
    "libxrandr2", "libxkbcommon0",
)  # fmt: skip
HELPS = ("zenity | kdialog",)  # file dialogs; without either the program draws its own
CONTROL = """\
Package: {name}
Version: {version}
Architecture: {architecture}
Maintainer: ObjectMorpher contributors <noreply@objectmorpher.invalid>
Installed-Size: {size}
Depends: {needs}
Recommends: {helps}
Section: graphics
Priority: optional
Description: edit photos by moving what is in them in 3D
 Open a photo, click an object, drag points on it in 3D while the picture
 follows your hand, save the edited photo. It runs on a laptop: no GPU, no
 account, no network needed.
"""
COPYRIGHT = """\
Format: https://www.debian.org/doc/packaging-manuals/copyright-format/1.0/
Upstream-Name: ObjectMorpher

Files: *
Copyright: The ObjectMorpher contributors
License: Apache-2.0

Files: /usr/lib/objectmorpher/_internal/*
Copyright: see /usr/lib/objectmorpher/third-party
License: see-third-party
 Each library's terms are in /usr/lib/objectmorpher/third-party.

License: Apache-2.0
 The full text is in /usr/share/common-licenses/Apache-2.0.
"""


def place_desktop_files(share: Path) -> None:
    """What a desktop is told of the program: entry, metadata, file type, icons."""
    from PIL import Image

    for source, folder in (
        (f"{ID}.desktop", "applications"),
        (f"{ID}.metainfo.xml", "metainfo"),
        (f"{ID}.xml", "mime/packages"),
        (f"{ID}.svg", "icons/hicolor/scalable/apps"),
    ):
        place(HERE / "linux" / source, share / folder / source)
    if address := os.environ.get(ADDRESS):
        metadata = share / "metainfo" / f"{ID}.metainfo.xml"
        page = f'{LICENCE_LINE}\n  <url type="homepage">{escape(address)}</url>'
        metadata.write_text(metadata.read_text("utf-8").replace(LICENCE_LINE, page), "utf-8")
    icon = Image.open(HERE.parent / "assets" / "icon.png").convert("RGBA")
    for size in ICON_SIZES:
        at = share / f"icons/hicolor/{size}x{size}/apps/{ID}.png"
        at.parent.mkdir(parents=True, exist_ok=True)
        icon.resize((size, size), Image.Resampling.LANCZOS).save(at)


def place(source: Path, target: Path) -> None:
    """A copy that everybody may read."""
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(source, target)
    target.chmod(0o644)


def build_deb(folder: Path, out: Path, version: str) -> Path:
    """The Debian package. It has no scripts: the system's own triggers see to menus and types."""
    root = out / "deb"
    shutil.rmtree(root, ignore_errors=True)
    shutil.copytree(folder, root / "usr/lib" / NAME, symlinks=True)
    (root / "usr/bin").mkdir(parents=True)
    (root / "usr/bin" / NAME).symlink_to(f"../lib/{NAME}/{NAME}")
    place_desktop_files(root / "usr/share")
    about = root / "usr/share/doc" / NAME
    about.mkdir(parents=True)
    (about / "copyright").write_text(COPYRIGHT, encoding="utf-8")
    size = sum(f.lstat().st_size for f in root.rglob("*") if f.is_file()) // 1024
    architecture = DEBIAN[platform.machine()]
    libc = os.confstr("CS_GNU_LIBC_VERSION") or "glibc 2.36"
    (root / "DEBIAN").mkdir()
    control = CONTROL.format(
        name=NAME, version=version, architecture=architecture, size=size,
        needs=", ".join(NEEDS).format(libc=libc.split()[1]), helps=", ".join(HELPS),
    )  # fmt: skip
    (root / "DEBIAN/control").write_text(control, encoding="utf-8")
    target = out / f"{NAME}_{version}_{architecture}.deb"
    command = ["dpkg-deb", "--root-owner-group", "-Zzstd", "-z9", "--threads-max=2", "--build"]
    subprocess.run([*command, str(root), str(target)], check=True, stdout=subprocess.DEVNULL)
    shutil.rmtree(root)
    return target


def build_appimage(folder: Path, out: Path, version: str) -> Path:
    """The AppImage; where its run-time (`APPIMAGE_RUNTIME`) is not given, what it would be given.

    An AppImage is a small program, the run-time of the AppImage project, followed by a squashed
    folder. Without the run-time the squashed folder is left: mount it, and start AppRun in it.
    """
    root = out / "ObjectMorpher.AppDir"
    shutil.rmtree(root, ignore_errors=True)
    shutil.copytree(folder, root / "usr/lib" / NAME, symlinks=True)
    share = root / "usr/share"
    place_desktop_files(share)
    place(HERE / "linux" / f"{ID}.desktop", root / f"{ID}.desktop")
    place(HERE / "linux" / f"{ID}.svg", root / f"{ID}.svg")
    (root / ".DirIcon").symlink_to(f"{ID}.svg")
    place(HERE / "linux" / "AppRun", root / "AppRun")
    (root / "AppRun").chmod(0o755)
    squashed = out / f"ObjectMorpher-{version}-{platform.machine()}.squashfs"
    squashed.unlink(missing_ok=True)
    subprocess.run(
        ["mksquashfs", str(root), str(squashed), "-root-owned", "-noappend", "-comp", "zstd",
         "-Xcompression-level", "12", "-processors", "2", "-no-progress", "-quiet"],
        check=True,
    )  # fmt: skip
    shutil.rmtree(root)
    runtime = os.environ.get("APPIMAGE_RUNTIME")
    if not runtime:
        print("APPIMAGE_RUNTIME names no run-time: the squashed folder is no AppImage yet")
        return squashed
    target = squashed.with_suffix(".AppImage")
    target.write_bytes(Path(runtime).read_bytes() + squashed.read_bytes())
    target.chmod(0o755)
    squashed.unlink()
    return target
