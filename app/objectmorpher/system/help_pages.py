"""The tutorial and the how-to pages, which come with the program: nothing is fetched.

They are the Markdown of docs/. What a window has no use for is left out: pictures, links' targets
and the lines of tables that only draw them.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum
from functools import cache

from .resources import resource

FIRST = "tutorial"  # the page that is read first
ORDER = (  # of docs/howto
    "select", "bend", "place", "behind", "remove", "export", "share", "photos", "many", "splats",
    "sides", "offline", "accessibility", "trouble",
)  # fmt: skip
PICTURE = re.compile(r"!\[[^\]]*\]\([^)]*\)(\{[^}]*\})?")
LINK = re.compile(r"\[([^\]]*)\]\([^)]*\)")
MARKS = (r"\*\*(.+?)\*\*", r"(?<![\w*])\*([^*\s][^*]*)\*(?!\w)", r"`([^`]+)`")
ITEM = re.compile(r"^(?:[-*]|\d+\.) +")


class Kind(Enum):
    """What a part of a page is."""

    HEADING = "heading"
    TEXT = "text"
    ITEM = "item"
    CODE = "code"


@dataclass(frozen=True)
class Block:
    """One part of a page, without its marks."""

    kind: Kind
    text: str


@dataclass(frozen=True)
class Page:
    """A page of help."""

    name: str
    title: str
    blocks: tuple[Block, ...]


@cache
def pages() -> tuple[Page, ...]:
    """All pages, the tutorial first. Raises FileNotFoundError where they were not installed."""
    return tuple(_page(name) for name in (FIRST, *ORDER))


def _page(name: str) -> Page:
    path = "docs/tutorial.md" if name == FIRST else f"docs/howto/{name}.md"
    title, *blocks = blocks_of(resource(path).read_text(encoding="utf-8"))
    return Page(name, title.text, tuple(blocks))


def blocks_of(markdown: str) -> list[Block]:
    """A page's headings, paragraphs, items and code, in their order."""
    blocks: list[Block] = []
    for k, part in enumerate(re.split(r"^```\w*\n(.*?)^```$", markdown, flags=re.M | re.S)):
        if k % 2:
            blocks.append(Block(Kind.CODE, part.rstrip()))
        else:
            for paragraph in re.split(r"\n\s*\n", PICTURE.sub("", part)):
                blocks += _paragraph(paragraph.strip())
    return blocks


def _paragraph(text: str) -> list[Block]:
    if not text:
        return []
    if text.startswith("#"):
        line, _, rest = text.partition("\n")
        return [Block(Kind.HEADING, _plain(line.lstrip("# "))), *_paragraph(rest.strip())]
    if text.startswith("|"):
        rows = [row for row in text.splitlines() if set(row) - set("|-: ")]
        cells = ([_plain(cell.strip()) for cell in row.strip("|").split("|")] for row in rows)
        return [Block(Kind.ITEM, " · ".join(cell for cell in row if cell)) for row in cells]
    items = re.split(r"^(?=(?:[-*]|\d+\.) )", text, flags=re.M)
    return [
        Block(Kind.ITEM if ITEM.match(item) else Kind.TEXT, _plain(ITEM.sub("", item, count=1)))
        for item in items
        if item
    ]


def _plain(text: str) -> str:
    """One line without Markdown's marks."""
    text = LINK.sub(r"\1", " ".join(text.split()))
    for mark in MARKS:
        text = re.sub(mark, r"\1", text)
    return text
