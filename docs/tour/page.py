"""docs/tour/README.md"""

from __future__ import annotations

from pathlib import Path

from guide import Caption, read_captions
from stories import STORIES

import first_use

HEAD = """# A tour of the window

Whole edits in the real window, every step by mouse and keyboard: `make tour` does them again and
takes the pictures anew. The pointer is drawn in afterwards, everything else is the window's own.
[How fast it answers](feel.md) was measured in the same window.
"""
FIRST = """## First use

From the start screen to an edited file, by somebody who only does what the window says:
{count} clicks and drags. `tests/app/test_first_use.py` does them and counts.

| | the window says | what is done |
|---|---|---|
"""


def write_page(folder: Path) -> None:
    captions = read_captions(folder)
    parts = [HEAD, _first_use()]
    for name, story in STORIES.items():
        if name in captions:
            parts += [f"## {story.about}\n", *map(_picture, captions[name])]
    (folder / "README.md").write_text("\n".join(parts), encoding="utf-8")


def _first_use() -> str:
    rows = [
        f"| {n} | {step.said} | {step.did} |\n" for n, step in enumerate(first_use.STEPS, start=1)
    ]
    return FIRST.format(count=len(first_use.STEPS)) + "".join(rows)


def _picture(caption: Caption) -> str:
    return f"**{caption.title}.** {caption.text}\n\n![{caption.title}]({caption.file})\n"
