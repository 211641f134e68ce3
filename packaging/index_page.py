"""The README as a package index shows it: hatchling calls this when it builds.

An index resolves no relative link. Where the repository's address is known (`Source` under
`[project.urls]`, or OBJECTMORPHER_REPOSITORY), links lead there, to the tag of this version; until
then pictures are left out and other links become their words: nothing on the page is broken.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\((?!https?:|#)([^)\s]+)\)")
ADDRESS = "OBJECTMORPHER_REPOSITORY"  # environment variable


def index_page(text: str, address: str | None, version: str) -> str:
    """`text` (Markdown) with its relative links absolute, or undone where `address` is None."""

    def linked(found: re.Match[str]) -> str:
        mark, words, path = found.groups()
        if address is None:
            return "" if mark else words
        kind = "raw" if mark else "blob"
        return f"{mark}[{words}]({address.rstrip('/')}/{kind}/v{version}/{path})"

    return re.sub(r"\n{3,}", "\n\n", LINK.sub(linked, text))


class Hook(MetadataHookInterface):
    """Sets `readme`."""

    PLUGIN_NAME = "custom"

    def update(self, metadata: dict[str, Any]) -> None:
        """Called by hatchling with the `[project]` table."""
        text = (Path(self.root) / "README.md").read_text("utf-8")
        address = metadata.get("urls", {}).get("Source") or os.environ.get(ADDRESS)
        page = index_page(text, address, metadata["version"])
        metadata["readme"] = {"content-type": "text/markdown", "text": page}
