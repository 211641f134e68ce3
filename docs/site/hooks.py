"""Makes pages that are read in the repository good pages of a site, too.

A link to a file that is no part of the site (a source, a test) becomes its name. A formula becomes
MathML, which browsers draw without a script.
"""

from __future__ import annotations

import re
from pathlib import Path, PurePosixPath
from typing import Any

from latex2mathml.converter import convert

FORMULA = re.compile(r"^\$\$(.+?)\$\$$", re.M | re.S)
LINK = re.compile(r"(?<!!)\[([^\]]*)\]\(([^)#\s]+)(#[^)\s]*)?\)")
OF_THE_SITE = {".md", ".jpg", ".png", ".svg", ".json"}


def on_page_markdown(markdown: str, page: Any, config: Any, **_: Any) -> str:
    """Called by mkdocs with the text of each page."""
    folder = Path(page.file.abs_src_path).parent
    root = Path(config["docs_dir"]).resolve()

    def kept(match: re.Match[str]) -> str:
        text, target = match[1], match[2]
        if "://" in target:
            return match[0]
        path = (folder / target).resolve()
        is_inside = root in path.parents and path.suffix in OF_THE_SITE
        return match[0] if is_inside else _named(text, PurePosixPath(target))

    return FORMULA.sub(lambda found: convert(found[1], display="block"), LINK.sub(kept, markdown))


def _named(text: str, target: PurePosixPath) -> str:
    """The link's words, and which file they are about where they do not say it."""
    name = str(target).lstrip("./")
    return text if target.name in text else f"{text} (`{name}`)"
