"""What a desktop is told of the program agrees with the program, and with itself."""

from __future__ import annotations

import configparser
import hashlib
import json
import re
import runpy
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from xml.etree import ElementTree

import pytest

from objectmorpher import __version__
from objectmorpher.editor.filing import PHOTO_ENDINGS, SESSION_ENDING

ROOT = Path(__file__).parents[1]
LINUX = ROOT / "packaging" / "linux"
PACKAGES = ROOT / "packaging" / "linux_packages.py"
ID = "org.objectmorpher.ObjectMorpher"
SESSION_TYPE = "application/x-objectmorpher"
NAMESPACE = "{http://www.freedesktop.org/standards/shared-mime-info}"
ENDINGS = {"image/jpeg": ".jpg", "image/png": ".png", "image/tiff": ".tif", "image/webp": ".webp"}


def entry() -> configparser.SectionProxy:
    parser = configparser.ConfigParser(interpolation=None)
    parser.optionxform = str  # type: ignore[assignment]
    parser.read_string((LINUX / f"{ID}.desktop").read_text("utf-8"))
    return parser["Desktop Entry"]


def test_the_entry_names_files_that_are_there() -> None:
    assert entry()["Icon"] == ID
    assert (LINUX / f"{ID}.svg").is_file()
    assert entry()["Exec"] == "objectmorpher %F", "it opens several photos, each in a tab"
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["scripts"]
    assert "objectmorpher" in scripts


def test_every_system_and_the_page_know_the_program_by_one_id() -> None:
    spec = (ROOT / "packaging" / "objectmorpher.spec").read_text("utf-8")
    assert re.findall(r'bundle_identifier="([^"]+)"', spec) == [ID]
    assert f"application's id, `{ID}`" in (ROOT / "docs" / "install.md").read_text("utf-8")


def test_the_types_it_opens_are_those_that_the_program_opens() -> None:
    types = entry()["MimeType"].strip(";").split(";")
    assert SESSION_TYPE in types
    assert {ENDINGS[name] for name in types if name != SESSION_TYPE} <= set(PHOTO_ENDINGS)


def test_sessions_have_a_type() -> None:
    root = ElementTree.parse(LINUX / f"{ID}.xml").getroot()
    found = root.find(f"{NAMESPACE}mime-type")
    assert found is not None
    assert found.get("type") == SESSION_TYPE
    glob = found.find(f"{NAMESPACE}glob")
    assert glob is not None
    assert glob.get("pattern") == f"*{SESSION_ENDING}"


@pytest.mark.parametrize("address", [None, "https://example.org/us/it?a&b"])
def test_the_metadata_name_the_projects_page_only_where_it_has_one(
    address: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("OBJECTMORPHER_REPOSITORY", raising=False)
    if address:
        monkeypatch.setenv("OBJECTMORPHER_REPOSITORY", address)
    runpy.run_path(str(PACKAGES))["place_desktop_files"](tmp_path)
    root = ElementTree.parse(tmp_path / "metainfo" / f"{ID}.metainfo.xml").getroot()
    assert root.findtext("url[@type='homepage']") == address


def test_the_metadata_tell_this_version_and_the_licence() -> None:
    root = ElementTree.parse(LINUX / f"{ID}.metainfo.xml").getroot()
    assert root.findtext("id") == ID
    assert root.findtext("launchable") == f"{ID}.desktop"
    release = root.find("releases/release")
    assert release is not None
    assert release.get("version") == __version__
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    assert root.findtext("project_license") == project["license"]
    assert project["version"] == __version__


def test_the_installers_of_other_systems_name_sessions_too() -> None:
    for name in ("objectmorpher.spec", "windows/objectmorpher.wxs"):
        text = (ROOT / "packaging" / name).read_text("utf-8")
        assert re.search(re.escape(SESSION_ENDING.lstrip(".")) + r"\b", text), name


def test_the_manifests_of_winget_and_homebrew_hold_the_hashes_of_what_was_built(tmp_path) -> None:
    names = ("ObjectMorpher-9-x64.msi", "ObjectMorpher-9-arm64.dmg", "ObjectMorpher-9-x86_64.dmg")
    hashes = {}
    for number, name in enumerate(names):
        (tmp_path / name).write_bytes(bytes([number]) * 1000)
        hashes[name] = hashlib.sha256(bytes([number]) * 1000).hexdigest()
    command = [sys.executable, ROOT / "packaging" / "store_files.py", tmp_path, "--address"]
    subprocess.run([*command, "https://example.org/us/it/"], check=True)
    manifests = {}
    for path in tmp_path.glob("*.yaml"):
        lines = path.read_text("utf-8").splitlines()
        values = dict(re.findall(r"^[ -]*([A-Z]\w+): (.+)$", "\n".join(lines), re.M))
        assert values["PackageVersion"] == __version__ and values["ManifestVersion"]
        manifests[values["ManifestType"]] = values
    assert set(manifests) == {"version", "installer", "defaultLocale"}
    installer = manifests["installer"]
    assert installer["InstallerSha256"] == hashes[names[0]].upper()
    release = f"https://example.org/us/it/releases/download/v{__version__}/"
    assert installer["InstallerUrl"] == release + names[0]
    cask = (tmp_path / "objectmorpher.rb").read_text("utf-8")
    assert f'arm: "{hashes[names[1]]}"' in cask and f'intel: "{hashes[names[2]]}"' in cask
    assert 'arch arm: "arm64", intel: "x86_64"' in cask
    assert "depends_on arch" not in cask
    assert len(re.findall(r"\bdo$", cask, re.M)) == len(re.findall(r"^end$", cask, re.M)) == 1


def test_a_cask_of_one_image_says_for_which_macs_it_is(tmp_path: Path) -> None:
    (tmp_path / "ObjectMorpher-9-arm64.dmg").write_bytes(b"for the test")
    command = [sys.executable, ROOT / "packaging" / "store_files.py", tmp_path, "--address"]
    subprocess.run([*command, "https://example.org/us/it"], check=True)
    cask = (tmp_path / "objectmorpher.rb").read_text("utf-8")
    assert "  depends_on arch: :arm64\n" in cask and "x86_64" not in cask
    system = re.search(r'depends_on macos: ">= :(\w+)"', cask)
    spec = (ROOT / "packaging" / "objectmorpher.spec").read_text("utf-8")
    least = re.search(r'"LSMinimumSystemVersion": "(\d+)\.0"', spec)
    assert system is not None and least is not None
    assert {"monterey": "12", "ventura": "13", "sonoma": "14"}[system[1]] == least[1]


def test_the_flatpaks_manifest_unpacks_the_debian_package(tmp_path) -> None:
    """Its commands lay out /app as the package lays out /usr; its parts have the menu's id."""
    yaml = pytest.importorskip("yaml")
    if any(shutil.which(tool) is None for tool in ("dpkg-deb", "ar", "zstd")):
        pytest.skip("the tools that pack and unpack a Debian package are not there")
    place_desktop_files = runpy.run_path(str(PACKAGES))["place_desktop_files"]
    root, out = tmp_path / "root", tmp_path / "dist"
    program = root / "usr/lib/objectmorpher/objectmorpher"
    place_desktop_files(root / "usr/share")
    program.parent.mkdir(parents=True)
    program.write_text("#!/bin/sh\n")
    (root / "usr/bin").mkdir()
    (root / "usr/bin/objectmorpher").symlink_to("../lib/objectmorpher/objectmorpher")
    control = "Package: objectmorpher\nVersion: 9\nArchitecture: all\nMaintainer: us\n"
    (root / "DEBIAN").mkdir()
    (root / "DEBIAN/control").write_text(f"{control}Description: for the test\n")
    out.mkdir()
    package = out / "objectmorpher_9_all.deb"
    pack = ["dpkg-deb", "--root-owner-group", "-Zzstd", "--build", root, package]
    subprocess.run(pack, check=True, stdout=subprocess.DEVNULL)
    command = [sys.executable, ROOT / "packaging" / "store_files.py", out, "--address"]
    subprocess.run([*command, "https://example.org/us/it"], check=True)
    (path,) = out.glob("*.yml")
    manifest = yaml.safe_load(path.read_text("utf-8"))
    assert path.stem == manifest["id"] == ID and manifest["command"] == "objectmorpher"
    (module,) = manifest["modules"]
    (source,) = module["sources"]
    assert source["sha256"] == hashlib.sha256(package.read_bytes()).hexdigest()
    release = f"https://example.org/us/it/releases/download/v{__version__}/"
    assert source["url"] == release + package.name
    app = tmp_path / "app"
    shutil.copy(package, tmp_path / source["dest-filename"])
    for line in module["build-commands"]:
        line = re.sub(r"(?<= )/app\b", str(app), line)
        subprocess.run(["sh", "-c", line], cwd=tmp_path, check=True)
    assert (app / "bin/objectmorpher").read_text() == "#!/bin/sh\n"
    for part in (f"applications/{ID}.desktop", f"metainfo/{ID}.metainfo.xml"):
        assert (app / "share" / part).is_file(), part


@pytest.mark.parametrize(
    ("name", "options"),
    [
        (f"{ID}.desktop", ("desktop-file-validate", "--warn-kde")),
        (f"{ID}.metainfo.xml", ("appstreamcli", "validate", "--no-net")),
    ],
    ids=["entry", "metadata"],
)
def test_the_desktops_own_tools_take_the_files(
    name: str, options: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As they are in the packages of a project that has an address."""
    if shutil.which(options[0]) is None:
        pytest.skip(f"{options[0]} is not installed")
    monkeypatch.setenv("OBJECTMORPHER_REPOSITORY", "https://example.org/us/it?a&b")
    runpy.run_path(str(PACKAGES))["place_desktop_files"](tmp_path)
    (path,) = tmp_path.rglob(name)
    done = subprocess.run([*options, path], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_flatpak_builder_reads_the_manifest(tmp_path: Path) -> None:
    """It says again all that it has understood: no word of the manifest is lost on it."""
    yaml = pytest.importorskip("yaml")
    if shutil.which("flatpak-builder") is None:
        pytest.skip("flatpak-builder is not installed")
    (tmp_path / "objectmorpher_9_all.deb").write_bytes(b"for the test")
    command = [sys.executable, ROOT / "packaging" / "store_files.py", tmp_path, "--address"]
    subprocess.run([*command, "https://example.org/us/it"], check=True)
    show = ["flatpak-builder", "--show-manifest", f"{ID}.yml"]
    done = subprocess.run(show, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0 and done.stderr == "", done.stderr
    meant = yaml.safe_load((tmp_path / f"{ID}.yml").read_text("utf-8"))
    assert meant["modules"][0]["build-options"].pop("strip") is False  # as it is anyway
    assert json.loads(done.stdout) == meant


def test_the_workflows_run_what_there_is_on_three_systems() -> None:
    """Files and targets that they name exist; each package is run before it is kept."""
    folder = ROOT / ".github" / "workflows"
    text = {path.stem: path.read_text("utf-8") for path in folder.glob("*.yml")}
    assert set(text) == {"test", "packages"}
    for name in re.findall(r"\b(?:packaging|assets)[/\\][\w./\\-]+\w", "".join(text.values())):
        assert (ROOT / name.replace("\\", "/")).exists(), name
    assert (ROOT / ".ci" / "run").exists() and ".ci/run" in text["test"]
    for system in ("ubuntu-", "windows-", "macos-"):
        assert system in text["test"] and system in text["packages"]
    assert text["packages"].count("objectmorpher edit") == 2  # the recipes of the others do so, too
    for recipe in ("windows/build.ps1", "macos/build.sh"):
        assert " edit assets" in (ROOT / "packaging" / recipe).read_text("utf-8").replace("\\", "/")
