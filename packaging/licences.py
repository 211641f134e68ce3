"""Licences of what ObjectMorpher needs to run: a table, their texts, and whether each may be there.

    python packaging/licences.py                 the table
    python packaging/licences.py --texts FOLDER  and every licence's text, for an installer
    python packaging/licences.py --page          and docs/licences.md anew

It looks at the environment it runs in. What may not be there: the GPL and AGPL, but for parts with
the exception that GCC's run-time libraries have.
"""

from __future__ import annotations

import argparse
import re
import shutil
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

PROJECT = Path(__file__).parents[1] / "pyproject.toml"
PAGE = PROJECT.parent / "docs" / "licences.md"
# Those that people install; the others are for our own tests.
EXTRAS = ("models", "formats", "cluster", "research")
OWN = ("objectmorpher", "objectmorpher-research")
START, END = "<!-- {} -->\n", "<!-- end of {} -->\n"
TEXT = re.compile(r"(^|/)(LICEN[CS]E|COPYING|COPYRIGHT|NOTICE|AUTHORS)[^/]*$", re.I)
COPYLEFT = re.compile(r"(?<!L)(AGPL|GPL|Affero|(?<!Lesser )General Public License)", re.I)
LESSER = re.compile(r"LGPL|Lesser General Public|Library General Public", re.I)
GCC = re.compile(r"GCC[- ]exception|GCC Runtime Library Exception", re.I)


@dataclass(frozen=True)
class Licence:
    """What one package says of itself."""

    package: str
    version: str
    terms: str
    texts: tuple[Path, ...]

    @property
    def is_copyleft(self) -> bool:
        """Whether its terms are the GPL's or AGPL's, without GCC's exception."""
        return is_copyleft(self.terms)


def is_copyleft(terms: str) -> bool:
    """Whether some term is the GPL's or AGPL's; all that a choice (OR) offers must be that."""
    choices = re.split(r"\s+OR\s+", terms)
    return all(any(_is_bad(term) for term in re.split(r"\s+AND\s+|;", one)) for one in choices)


def _is_bad(term: str) -> bool:
    return bool(COPYLEFT.search(LESSER.sub("", term)) and not GCC.search(term))


def run_time(project: Path = PROJECT) -> list[Distribution]:
    """What a pyproject.toml's dependencies bring into this environment. Raises LookupError."""
    wanted = tomllib.loads(project.read_text(encoding="utf-8"))["project"]["dependencies"]
    found: dict[str, Distribution] = {}
    waiting = [Requirement(line) for line in wanted]
    while waiting:
        need = waiting.pop()
        name = canonicalize_name(need.name)
        if name in found or (need.marker and not need.marker.evaluate({"extra": ""})):
            continue
        try:
            found[name] = distribution(name)
        except PackageNotFoundError as error:
            raise LookupError(f"{name} is not installed here") from error
        waiting += [Requirement(line) for line in found[name].requires or ()]
    return [found[name] for name in sorted(found)]


def of_extras(project: Path = PROJECT) -> dict[str, list[Licence]]:
    """What each of EXTRAS asks for, those packages that are in this environment."""
    told = tomllib.loads(project.read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    found: dict[str, list[Licence]] = {}
    for extra in EXTRAS:
        try:
            others = [name for line in told[extra] for name in _others(Requirement(line).name)]
            found[extra] = [licence_of(distribution(name)) for name in others]
        except PackageNotFoundError as error:
            raise LookupError(f"{error.name} is not installed here") from error
    return found


def _others(name: str) -> list[str]:
    """A package's name; of one of our own, the names of those that it asks for."""
    if name not in OWN:
        return [name]
    asked = [Requirement(line).name for line in distribution(name).requires or ()]
    return [other for other in asked if other not in OWN]


def licence_of(package: Distribution) -> Licence:
    """By its expression, its classifiers or its words, the first of them that is there."""
    about = package.metadata
    name = canonicalize_name(about["Name"])
    prefix = "License :: OSI Approved"
    classes = [c for c in about.get_all("Classifier") or () if c.startswith(prefix)]
    named = "; ".join(c.split(" :: ")[-1] for c in classes if c != prefix)
    words = (about["License"] or "").strip().splitlines()
    terms = about["License-Expression"] or named or (words[0] if words else "")
    return Licence(name, package.version, terms, tuple(sorted(_texts(package))))


def _texts(package: Distribution) -> Iterator[Path]:
    for file in package.files or ():
        at = Path(str(package.locate_file(file)))
        if TEXT.search(file.as_posix()) and at.suffix not in (".py", ".pyc") and at.is_file():
            yield at


def write_texts(licences: list[Licence], folder: Path) -> None:
    """Each licence's texts into a folder of the package's name, and the table beside them."""
    for one in licences:
        own = folder / f"{one.package}-{one.version}"
        own.mkdir(parents=True, exist_ok=True)
        for number, text in enumerate(one.texts):
            same = [other for other in one.texts[:number] if other.name == text.name]
            shutil.copyfile(text, own / (f"{text.parent.name}-{text.name}" if same else text.name))
        if not one.texts and "Apache" in one.terms:  # the licence that is ours, too
            shutil.copyfile(PROJECT.with_name("LICENSE"), own / "LICENSE")
    (folder / "README.txt").write_text(table(licences) + "\n", encoding="utf-8")


def table(licences: list[Licence]) -> str:
    """One line a package."""
    rows = [(one.package, one.version, one.terms) for one in licences]
    widths = [max(len(row[i]) for row in rows) for i in (0, 1)]
    return "\n".join(f"{n:{widths[0]}}  {v:{widths[1]}}  {t}" for n, v, t in rows)


def in_page(licences: list[Licence]) -> str:
    """In Markdown."""
    lines = ["| package | licence |", "|---|---|"]
    lines += [f"| {one.package} | {one.terms} |" for one in licences]
    return "\n".join(lines) + "\n"


def write_page(page: Path = PAGE) -> None:
    """The tables of docs/licences.md between their marks. Raises LookupError."""
    tables = {"run-time": [licence_of(package) for package in run_time()], **of_extras()}
    text = page.read_text(encoding="utf-8")
    for name, licences in tables.items():
        start, end = text.index(START.format(name)), text.index(END.format(name))
        text = text[:start] + START.format(name) + in_page(licences) + text[end:]
    page.write_text(text, encoding="utf-8")


def main() -> int:
    """Prints the table; 1 where a licence may not be there."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--texts", type=Path, metavar="FOLDER")
    parser.add_argument("--page", action="store_true")
    options = parser.parse_args()
    licences = [licence_of(package) for package in run_time()]
    sys.stdout.write(table(licences) + "\n")
    if options.texts is not None:
        write_texts(licences, options.texts)
    if options.page:
        write_page()
    bad = [one.package for one in licences if one.is_copyleft or not one.terms]
    if bad:
        sys.stderr.write(f"may not be shipped, or says nothing: {', '.join(bad)}\n")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
