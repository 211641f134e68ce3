"""Manifests for winget, Homebrew and Flatpak, of installers that are built.

    python packaging/store_files.py dist --address https://HOST/OWNER/NAME

It writes three .yaml files (for a pull request to winget-pkgs), `objectmorpher.rb` (a cask for a
tap) and `org.objectmorpher.ObjectMorpher.yml` (for flatpak-builder, which unpacks the Debian
package) into `dist`, with the hashes of the .msi, the .dmg files and the .deb that are there. The
address is the repository's, with assets at ADDRESS/releases/download/vVERSION/. None was submitted
yet, and no Flatpak was built; flatpak-builder reads the manifest.
"""

from __future__ import annotations

import argparse
import hashlib
import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
ID = "ObjectMorpher.ObjectMorpher"
SCHEMA = "1.6.0"  # of winget's manifests
ARCHITECTURES = {"arm64": "arm", "x86_64": "intel"}  # of a .dmg's name: what Homebrew calls it

VERSION_FILE = """\
PackageIdentifier: {id}
PackageVersion: {version}
DefaultLocale: en-US
ManifestType: version
ManifestVersion: {schema}
"""
INSTALLER_FILE = """\
PackageIdentifier: {id}
PackageVersion: {version}
InstallerType: wix
Scope: user
UpgradeBehavior: install
Commands:
- objectmorpher
FileExtensions:
- omorph
Installers:
- Architecture: x64
  InstallerUrl: {url}
  InstallerSha256: {sha256}
ManifestType: installer
ManifestVersion: {schema}
"""
LOCALE_FILE = """\
PackageIdentifier: {id}
PackageVersion: {version}
PackageLocale: en-US
Publisher: ObjectMorpher contributors
PackageName: ObjectMorpher
PackageUrl: {address}
License: {licence}
ShortDescription: {description}
Tags:
- photo-editing
- 3d
- gaussian-splatting
ManifestType: defaultLocale
ManifestVersion: {schema}
"""
CASK = """\
cask "objectmorpher" do
  arch {arches}

  version "{version}"
  sha256 {hashes}

  url "{address}/releases/download/v#{{version}}/ObjectMorpher-#{{version}}-#{{arch}}.dmg"
  name "ObjectMorpher"
  desc "{description}"
  homepage "{address}"

  {needs}depends_on macos: ">= :sonoma"

  app "ObjectMorpher.app"
  binary "#{{appdir}}/ObjectMorpher.app/Contents/MacOS/objectmorpher"

  zap trash: [
    "~/Library/Application Support/objectmorpher",
    "~/Library/Caches/objectmorpher",
  ]
end
"""
FLATPAK_ID = "org.objectmorpher.ObjectMorpher"
FLATPAK = """\
id: {id}
runtime: org.freedesktop.Platform
runtime-version: "24.08"
sdk: org.freedesktop.Sdk
command: objectmorpher
finish-args:
  - --share=ipc
  - --share=network  # models and servers, if they are asked for
  - --socket=x11
  - --device=dri
  - --filesystem=home
modules:
  - name: objectmorpher
    buildsystem: simple
    build-options:
      strip: false
      no-debuginfo: true
    build-commands:
      - ar x package.deb
      - mkdir -p package /app
      - tar --zstd -xf data.tar.zst -C package
      - cp -a package/usr/. /app/
    sources:
      - type: file
        url: {url}
        sha256: {sha256}
        dest-filename: package.deb
"""


def flatpak_manifest(package: Path, address: str, version: str) -> str:
    """The manifest that unpacks a .deb."""
    url = f"{address}/releases/download/v{version}/{package.name}"
    return FLATPAK.format(id=FLATPAK_ID, url=url, sha256=sha256_of(package))


def winget_files(msi: Path, address: str, project: dict[str, str]) -> dict[str, str]:
    """The manifests of a .msi, by their file names. `project` is the table of pyproject.toml."""
    known = {
        "id": ID, "schema": SCHEMA, "version": project["version"], "address": address,
        "licence": project["license"], "description": project["description"],
        "url": f"{address}/releases/download/v{project['version']}/{msi.name}",
        "sha256": sha256_of(msi).upper(),
    }  # fmt: skip
    files = {"": VERSION_FILE, ".installer": INSTALLER_FILE, ".locale.en-US": LOCALE_FILE}
    return {f"{ID}{part}.yaml": text.format(**known) for part, text in files.items()}


def cask(images: list[Path], address: str, project: dict[str, str]) -> str:
    """The cask of one or two .dmg files, whose names end in their architectures."""
    found = {re.sub(r".*-", "", image.stem): image for image in images}
    known = {ARCHITECTURES[name]: (name, found[name]) for name in ARCHITECTURES if name in found}
    hashes = [f'{brew}: "{sha256_of(image)}"' for brew, (_, image) in known.items()]
    return CASK.format(
        version=project["version"], address=address, description=project["description"],
        arches=", ".join(f'{brew}: "{name}"' for brew, (name, _) in known.items()),
        needs="" if len(known) > 1 else f"depends_on arch: :{found.popitem()[0]}\n  ",
        hashes=",\n         ".join(hashes) if len(hashes) > 1 else hashes[0].partition(" ")[2],
    )  # fmt: skip


def sha256_of(path: Path) -> str:
    """Of a file, hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def main() -> int:
    """Write what the installers in a folder allow; the exit code."""
    parser = argparse.ArgumentParser(description="Manifests for winget, Homebrew and Flatpak.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--address", required=True, help="of the repository, without a slash")
    options = parser.parse_args()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    address = options.address.rstrip("/")
    for msi in sorted(options.folder.glob("*.msi"))[:1]:
        for name, text in winget_files(msi, address, project).items():
            (options.folder / name).write_text(text, "utf-8")
    if images := sorted(options.folder.glob("*.dmg")):
        (options.folder / "objectmorpher.rb").write_text(cask(images, address, project), "utf-8")
    for package in sorted(options.folder.glob("*.deb"))[:1]:
        text = flatpak_manifest(package, address, project["version"])
        (options.folder / f"{FLATPAK_ID}.yml").write_text(text, "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
