"""Nothing under the GPL or AGPL is needed to run; locks hold hashes, and name no index."""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
LOCKS = sorted((ROOT / "packaging" / "locks").glob("*.txt"))
sys.path.append(str(ROOT / "packaging"))

import bundled  # noqa: E402
import licences  # noqa: E402

from objectmorpher.gui.widgets import theme  # noqa: E402

GCC = re.compile(r"GCC RUNTIME LIBRARY EXCEPTION", re.I)


@pytest.mark.parametrize(
    ("terms", "is_bad"),
    [
        ("GPL-3.0-only", True),
        ("GNU General Public License v3 (GPLv3)", True),
        ("GNU Affero General Public License v3", True),
        ("AGPL-3.0-or-later AND MIT", True),
        ("MIT; GNU General Public License v2 (GPLv2)", True),
        ("LGPL-2.1-or-later", False),
        ("GNU Lesser General Public License v3 (LGPLv3)", False),
        ("MIT OR GPL-2.0-only", False),
        ("GPL-3.0-or-later WITH GCC-exception-3.1", False),
        ("Apache-2.0 OR BSD-2-Clause", False),
    ],
)
def test_copyleft_is_recognised(terms: str, is_bad: bool) -> None:
    assert licences.is_copyleft(terms) == is_bad


def test_no_package_that_is_needed_to_run_is_under_the_gpl() -> None:
    found = [licences.licence_of(package) for package in licences.run_time()]
    assert len(found) >= 15
    assert [one.package for one in found if not one.terms] == []
    assert [(one.package, one.terms) for one in found if one.is_copyleft] == []


def test_what_is_not_needed_to_run_is_kept_out_of_the_installers() -> None:
    """Such as pytest, of which no licence would go along."""
    kept_out = set(bundled.strangers(package.name for package in licences.run_time()))
    assert {"pytest", "hypothesis"} <= kept_out
    assert {"numpy", "PIL", "cv2", "imgui_bundle", "markdown_it"} & kept_out == set()


def test_the_page_names_all_that_is_needed_to_run() -> None:
    page = licences.PAGE.read_text("utf-8")
    table = page[page.index(licences.START.format("run-time")) :]
    names = set(re.findall(r"^\| ([a-z0-9-]+) \|", table[: table.index("## ")], re.M))
    assert names - {"package"} == {package.name.lower() for package in licences.run_time()}


def test_every_font_and_photo_that_is_bundled_is_listed() -> None:
    page = licences.PAGE.read_text("utf-8")
    fonts = page[page.index("## Fonts and sample photos") :].lower()
    told = (ROOT / "assets" / "licences.txt").read_text("utf-8")
    named = {"chelsea": "cat", "coffee": "coffee cup"}
    for photo in (ROOT / "assets" / "samples").iterdir():
        assert f"samples/{photo.name}" in told
        assert re.search(rf"^\|[^|]*\b{named.get(photo.stem, photo.stem)}\b", fonts, re.M), photo
    for font in (theme.REGULAR, theme.BOLD, theme.ICONS):
        assert font.is_file(), "imgui-bundle comes with it"
        assert font.name in told
        assert re.match(r"[A-Z][a-z]+", font.stem)[0].lower() in fonts, font  # type: ignore[index]


def test_no_text_of_theirs_is_the_gpl_but_for_gccs_libraries() -> None:
    for one in map(licences.licence_of, licences.run_time()):
        for text in one.texts:
            said = text.read_text("utf-8", errors="replace")
            if re.search(r"^\s*GNU (AFFERO )?GENERAL PUBLIC LICENSE", said, re.M):
                assert GCC.search(said), f"{one.package}: {text.name}"


def test_the_texts_of_all_are_written(tmp_path) -> None:
    found = [licences.licence_of(package) for package in licences.run_time()]
    licences.write_texts(found, tmp_path)
    folders = [folder for folder in tmp_path.iterdir() if folder.is_dir()]
    assert len(folders) == len(found)
    assert [folder.name for folder in folders if not any(folder.iterdir())] == []


@pytest.mark.parametrize("lock", LOCKS, ids=lambda path: path.stem)
def test_a_lock_has_a_hash_for_all_and_names_no_index(lock: Path) -> None:
    text = lock.read_text("utf-8")
    entries = re.split(r"\n(?=[A-Za-z0-9])", text)[1:]
    assert len(entries) > 15
    assert [entry.split()[0] for entry in entries if "--hash=sha256:" not in entry] == []
    assert not re.search(r"https?:|file:|--(extra-)?index-url|--find-links|#.*\s/", text)


@pytest.mark.parametrize("lock", LOCKS, ids=lambda path: path.stem)
def test_a_lock_holds_what_the_project_asks_for(lock: Path) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    locked = dict(re.findall(r"^([A-Za-z0-9_.-]+)==([^\s;\\]+)", lock.read_text("utf-8"), re.M))
    for line in project["dependencies"]:
        need = Requirement(line)
        assert need.specifier.contains(locked[canonicalize_name(need.name)]), line
