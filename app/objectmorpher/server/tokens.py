"""The word by which a server knows its users: made, kept for its owner only, compared."""

from __future__ import annotations

import hashlib
import hmac
import secrets
from pathlib import Path

from objectmorpher_core.base.files import make_folder, sync_folder, write_new

VARIABLE = "OBJECTMORPHER_TOKEN"
LEAST = 16  # characters
MOST = 512


class TokenError(ValueError):
    """A token that cannot be used; one sentence."""


def make_token() -> str:
    """256 random bits, as text that a URL or a shell takes as it is."""
    return secrets.token_urlsafe(32)


def check_token(token: str) -> str:
    """The token, if it is one: printable ASCII without spaces, long enough not to be guessed."""
    if not LEAST <= len(token) <= MOST:
        raise TokenError(f"a token has {LEAST} to {MOST} characters, not {len(token)}")
    if not all("!" <= c <= "~" for c in token):
        raise TokenError("a token is of letters, digits and signs, without spaces")
    return token


def is_same(a: str, b: str) -> bool:
    """Compare two tokens in a time that reveals neither where they differ nor how long they are."""
    return hmac.compare_digest(*(hashlib.sha256(t.encode()).digest() for t in (a, b)))


def read_token(path: Path) -> str:
    """The token in a file; "" where there is no file. Raises TokenError."""
    try:
        text = path.read_text(encoding="ascii", errors="replace").strip()
    except FileNotFoundError:
        return ""
    except OSError as error:
        raise TokenError(f"{path} cannot be read: {error.strerror or error}") from error
    return check_token(text)


def write_token(path: Path, token: str) -> None:
    """Writes the file, which only its owner may read from its first byte on (mode 600).

    Without a token the file is removed. Raises OSError, TokenError.
    """
    if not token:
        path.unlink(missing_ok=True)
        return
    check_token(token)
    make_folder(path.parent)
    # A link that someone has put in its place is replaced, not followed.
    write_new(path, [f"{token}\n".encode("ascii")], mode=0o600)
    sync_folder(path.parent)
