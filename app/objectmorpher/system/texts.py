"""Every sentence the window says, in the user's language.

The English text is its own key: `t("{count} handles", count=3)`. Translations are TOML tables in
assets/languages, one file a language, `"English" = "translation"`; what one lacks stays English.
`assets/languages/texts.txt` lists every text; a test keeps it complete.
"""

from __future__ import annotations

import logging
import re
import tomllib
from pathlib import Path

from .resources import resource

log = logging.getLogger(__name__)

ENGLISH = "en"
NAME = "English"  # the text whose translation is the language's own name
FILE_NAME = re.compile(r"[^.]*[^.\s]\.\w{1,8}\b")
ARTICLES = ("a", "an", "the", "this", "it", "no")  # of sentences that name a file later on
_texts: dict[str, str] = {}


def use_language(code: str) -> None:
    """Speaks `code` ("de") from now on; "en", or one that is not there, is English."""
    global _texts
    _texts = {}
    if code == ENGLISH:
        return
    try:
        path = resource(f"assets/languages/{code}.toml")
        found = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        log.warning("There is no usable translation %r (%s); English is used", code, error)
        return
    _texts = {key: text for key, text in found.items() if isinstance(text, str) and text}


def languages() -> dict[str, str]:
    """Names of the languages there are, in themselves, by code."""
    found = {ENGLISH: "English"}
    for path in sorted(resource("assets/languages").glob("*.toml")):
        try:
            name = tomllib.loads(path.read_text(encoding="utf-8")).get(NAME)
        except (OSError, ValueError):
            continue
        found[path.stem] = str(name or path.stem)
    return found


def t(text: str, **values: object) -> str:
    """`text` in the user's language, `{names}` in it replaced by `values`."""
    found = _texts.get(text, text)
    return found.format(**values) if values else found


def folder_of(path: Path) -> str:
    """The name of the folder that a file is in, as a message says where it went."""
    folder = path.absolute().parent
    return folder.name or str(folder)


def sentence(text: str) -> str:
    """Return a library's reason as a sentence with a capital. A file's name stays as it is."""
    is_name = FILE_NAME.match(text) and text.split(" ", 1)[0] not in ARTICLES
    return text if is_name else text[:1].upper() + text[1:]
