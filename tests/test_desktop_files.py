"""What a desktop is told of the program agrees with the program, and with itself."""

from __future__ import annotations

import configparser
import re
import tomllib
from pathlib import Path
from xml.etree import ElementTree

from objectmorpher import __version__
from objectmorpher.editor.filing import PHOTO_ENDINGS, SESSION_ENDING

ROOT = Path(__file__).parents[1]
LINUX = ROOT / "packaging" / "linux"
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
    assert entry()["Exec"] == "objectmorpher %f"
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["scripts"]
    assert "objectmorpher" in scripts


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
