"""The documentation is true where a machine can tell: links, anchors, commands, names, examples."""

from __future__ import annotations

import argparse
import ast
import importlib.util
import itertools
import json
import re
import shlex
from functools import cache
from pathlib import Path
from types import ModuleType
from urllib.parse import unquote

import numpy as np
import pytest
from PIL import Image, ImageSequence

import objectmorpher_core as om
from objectmorpher.cli import parser as cli
from objectmorpher_core.scripting.options import script_from
from tests.tree import over

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = sorted([
    *DOCS.rglob("*.md"), ROOT / "README.md", ROOT / "CHANGELOG.md",
    *(ROOT / "packaging").rglob("*.md"), *(ROOT / "tests").rglob("*.md"),
])  # fmt: skip
FENCE = re.compile(r"^(```+|~~~+)(\w*)[^\n]*\n(.*?)^\1\s*$", re.M | re.S)
LINK = re.compile(r"!?\[(?:[^\[\]]|\[[^\]]*\])*\]\(\s*<?([^)\s>]+)>?(?:\s+\"[^\"]*\")?\s*\)")
OUTSIDE = ("https://", "http://", "mailto:")


def name_of(path: Path) -> str:
    return str(path.relative_to(ROOT))


every_page = over("page", PAGES)


@cache
def text_of(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def prose(page: Path) -> str:
    """Without code, in which brackets are no links."""
    return re.sub(r"(`+)[^`].*?\1", "", FENCE.sub("", text_of(page)), flags=re.S)


@cache
def anchors(page: Path) -> frozenset[str]:
    """Those of a page's headings, as the repository's pages and the site make them."""
    found: dict[str, int] = {}
    names = set()
    for heading in re.findall(r"^#{1,6}\s+(.+?)\s*#*$", FENCE.sub("", text_of(page)), re.M):
        plain = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "")
        slug = re.sub(r"[^\w\- ]", "", plain.lower()).replace(" ", "-")
        number = found[slug] = found.get(slug, -1) + 1
        names.add(slug if number == 0 else f"{slug}-{number}")
    return frozenset(names)


@every_page
def test_every_link_leads_somewhere(page):
    for link in LINK.findall(prose(page)):
        if link.startswith(OUTSIDE):
            continue
        path, _, anchor = unquote(link).partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), f"{name_of(page)} links to {link}"
        assert ROOT in target.parents, f"{link} is outside the repository"
        if anchor:
            assert target.suffix == ".md", link
            assert anchor in anchors(target), f"{name_of(page)} links to {link}"


def test_every_page_is_in_the_sites_navigation():
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    listed = re.findall(r"([\w/-]+\.md)\s*$", text[text.index("\nnav:") :], re.M)
    assert sorted(listed) == sorted(str(p.relative_to(DOCS)) for p in DOCS.rglob("*.md"))


@every_page
def test_every_picture_has_its_file_and_a_picture_is_no_larger_than_it_must_be(page):
    for link in re.findall(r"!\[[^\]]*\]\(([^)\s]+)\)", prose(page)):
        most = 3_000_000 if link.endswith(".webp") else 700_000  # a clip may be larger
        assert (page.parent / link).stat().st_size < most, link


def test_pictures_of_the_documentation_are_shown_somewhere():
    shown = {
        (page.parent / link).resolve()
        for page in PAGES
        for link in re.findall(r"\]\(([^)\s#]+\.(?:jpg|png|svg|webp))\)", text_of(page))
    }
    kept = [p for kind in ("jpg", "svg", "webp") for p in DOCS.rglob(f"*.{kind}")]
    assert [name_of(p) for p in kept if p not in shown] == []


def test_the_first_page_is_short_and_shows_a_drag():
    """At most 600 words, and as its first picture a clip of about eight seconds that moves."""
    page = ROOT / "README.md"
    assert len(text_of(page).split()) <= 600
    first = re.search(r"!\[[^\]]*\]\(([^)]+)\)", text_of(page))
    assert first is not None
    with Image.open(page.parent / first[1]) as clip:
        pictures, lasting = [], 0.0
        for frame in ImageSequence.Iterator(clip):
            pictures.append(np.asarray(frame.convert("RGB").resize((120, 80))).astype(int))
            lasting += frame.info["duration"] / 1000
    assert 6 <= lasting <= 10
    moved = [np.abs(b - a).max() > 20 for a, b in itertools.pairwise(pictures)]
    assert sum(moved) > 30


def typed(page: Path) -> list[str]:
    """What the page says to type, continued lines joined: code blocks that are no Python."""
    found: list[str] = []
    for _, kind, block in FENCE.findall(text_of(page)):
        if kind in ("", "sh", "bash", "console"):
            found += re.sub(r"\\\n\s*", "", block).splitlines()
    return [re.sub(r"\s+#.*", "", line).strip() for line in found]


def commands(page: Path) -> list[str]:
    """The same, and the commands that are named within a sentence, whole or not."""
    named = re.findall(r"(?<!`)`((?:objectmorpher|make) [^`]+)`(?!`)", text_of(page))
    return [*typed(page), *(" ".join(line.split()) for line in named)]


def parsed(line: str) -> str:
    """What the program's parser says about a command line; empty: it takes it."""
    words = shlex.split(line.partition(" > ")[0])[1:]
    if any(w in ("...", "…") for w in words) or "--help" in words:
        return ""
    try:
        is_command = bool(words) and words[0] in _parsers()
        if is_command:
            options = cli.build_parser().parse_args(cli._joined_negatives(words))
            if options.command in ("edit", "select"):
                said = {n: v for n, v in vars(options).items() if n in SCRIPT and v is not None}
                script_from(said)
        else:
            cli.parse_window(words)
    except (SystemExit, ValueError) as error:
        return str(error)
    return ""


SCRIPT = frozenset(vars(script_from({})))
UNFINISHED = re.compile(r"(?<![\w-])[A-Z]+\b|\[|…|\||<")  # it stands for what is to be said


@every_page
def test_every_whole_command_is_one_that_the_program_takes(page, capsys):
    for line in typed(page):
        if line.startswith("objectmorpher ") and not UNFINISHED.search(line):
            problem = parsed(line)
            assert not problem, f"{line}: {capsys.readouterr().err}"


@every_page
def test_every_command_and_option_that_is_named_exists(page):
    for line in commands(page):
        if not line.startswith("objectmorpher "):
            continue
        verb = line.split()[1]
        assert verb in _parsers() or "." in verb or re.match(r"[A-Z\[-]", verb), line
        known = (
            _options(verb)
            if verb in _parsers()
            else set(cli.window_parser()._option_string_actions)
        )
        assert set(re.findall(r"(?<=\s)--[a-z-]+", line)) <= known | {"--help", "--version"}, line


@cache
def _parsers() -> dict[str, argparse.ArgumentParser]:
    """The parser of each command."""
    actions = cli.build_parser()._actions
    return next(dict(a.choices) for a in actions if isinstance(a, argparse._SubParsersAction))


@cache
def _options(verb: str) -> frozenset[str]:
    """All that the command and those inside it know."""
    found: set[str] = set()
    parsers = [_parsers()[verb]]
    while parsers:
        for action in parsers.pop()._actions:
            found.update(action.option_strings)
            if isinstance(action, argparse._SubParsersAction):
                parsers += action.choices.values()
    return frozenset(found)


@every_page
def test_every_target_of_make_exists(page):
    targets = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), re.M))
    for line in commands(page):
        if re.match(r"make [a-z-]+(\s|$)", line):
            assert line.split()[1] in targets, line


@every_page
def test_every_file_that_is_named_exists(page):
    """`objectmorpher_core/deform/arap.py` and the like, in whole paths from the root."""
    tops = "objectmorpher_core|app|research|tests|docs|packaging|shaders|assets"
    for name in re.findall(rf"`((?:{tops})/[\w./-]*)`", FENCE.sub("", text_of(page))):
        assert (ROOT / name).exists(), name


def _module(script: Path) -> ModuleType:
    """What a script of the documentation defines."""
    spec = importlib.util.spec_from_file_location(script.stem, script)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", ["make_cli", "make_keys"])
def test_a_reference_is_what_the_program_says(name):
    script = DOCS / "reference" / f"{name}.py"
    module = _module(script)
    assert module.PAGE.read_text(encoding="utf-8") == module.page(), f"run {name_of(script)}"


def test_every_command_and_every_option_is_in_the_reference():
    text = text_of(DOCS / "reference" / "cli.md")
    for verb in _parsers():
        assert f"## objectmorpher {verb}\n" in text
        for option in _options(verb) - {"-h", "--help"}:
            assert f"`{option}`" in text, option


def test_the_librarys_reference_names_all_that_is_stable():
    text = text_of(DOCS / "reference" / "python-api.md")
    named = set(re.findall(r"^::: objectmorpher_core\.api\.(\w+)$", text, re.M))
    assert named == set(om.__all__) - {"__version__"}


@every_page
def test_python_on_a_page_names_what_there_is(page):
    for _, kind, block in FENCE.findall(text_of(page)):
        if kind != "python":
            continue
        tree = ast.parse(block)
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute):
                is_om = isinstance(node.value, ast.Name) and node.value.id == "om"
                assert not is_om or node.attr in om.__all__, node.attr


@pytest.mark.slow
def test_the_notebook_runs_and_shows_what_it_was_kept_with(tmp_path, monkeypatch):
    """It runs in a copy of its place, beside the sample photos, and saves only what it names."""
    runner = _module(DOCS / "examples" / "run_notebook.py")
    (tmp_path / "assets").symlink_to(ROOT / "assets")
    folder = tmp_path / "docs" / "examples"
    folder.mkdir(parents=True)
    monkeypatch.chdir(folder)
    notebook = json.loads(text_of(runner.NOTEBOOK))
    kept = [cell["outputs"] for cell in notebook["cells"] if cell["cell_type"] == "code"]
    shown = [found for _, found in runner.outputs(notebook)]

    def kinds(found):
        return [(o["output_type"], sorted(o.get("data", ()))) for o in found]

    assert list(map(kinds, shown)) == list(map(kinds, kept)), "run docs/examples/run_notebook.py"
    assert sum("image/jpeg" in o.get("data", ()) for found in kept for o in found) >= 3
    code = "".join("".join(c["source"]) for c in notebook["cells"] if c["cell_type"] == "code")
    promised = re.findall(r'save\(\s*"([\w.-]+)"', code)
    assert promised
    assert sorted(p.name for p in folder.iterdir()) == sorted(promised)
