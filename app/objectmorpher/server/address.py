"""Which server is meant: its address and the word by which it knows us."""

from __future__ import annotations

import hashlib
import secrets
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import urlsplit

from objectmorpher_core.base.files import make_folder, sync_folder, write_new

# The word by which a server knows its users: made, kept for its owner only, compared.

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


def fingerprint(token: str) -> bytes:
    """What of a token is compared: it reveals neither where two differ nor how long they are."""
    return hashlib.sha256(token.encode()).digest()


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


PROTOCOL = 1  # version of what client and server say to each other
PORT = 8717  # of a server that does not say another
LOOPBACK = ("localhost", "127.0.0.1", "::1")


class AddressError(ValueError):
    """An address that leads nowhere; one sentence."""


class ServerLost(Exception):
    """The server is gone, slow, or does not serve us: what was asked is to be done here."""


class NotServed(Exception):
    """The server does not do that, and is there all the same; one sentence."""


class TooMuch(Exception):
    """The server is there, but takes smaller requests only; says so in one sentence."""


class ServedError(ValueError):
    """The server ran the job, and the job failed as it would have here; one sentence."""


def url_at(host: str, port: int) -> str:
    """Return the URL of a server of ours."""
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"


@dataclass(frozen=True)
class Address:
    """The address of a server."""

    host: str
    port: int
    path: str = ""  # before the protocol's own, behind a reverse proxy
    is_safe: bool = False  # by https

    @staticmethod
    def of(text: str) -> Address:
        """Parse `gpu.lan`, `gpu.lan:8717`, `http://...` or `https://...`; raises AddressError."""
        whole = text.strip()
        whole = whole if "://" in whole else f"http://{whole}"
        try:
            parts = urlsplit(whole)
            port = parts.port
        except ValueError as error:
            raise AddressError(f"{text!r} is no address of a server") from error
        if parts.scheme not in ("http", "https") or not parts.hostname or parts.query:
            raise AddressError(f"{text!r} is no address of a server, as http://gpu.lan:{PORT} is")
        if parts.username is not None or parts.password is not None:
            raise AddressError("the token has a field of its own, it is not part of the address")
        is_safe = parts.scheme == "https"
        usual = 443 if is_safe else PORT
        return Address(parts.hostname, port or usual, parts.path.rstrip("/"), is_safe)

    @property
    def is_private(self) -> bool:
        """Whether nobody on the way reads along: by https, or on this very computer."""
        return self.is_safe or self.host in LOOPBACK

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"


@dataclass(frozen=True)
class Server:
    """An address, and a token that is never shown."""

    address: Address
    token: str = field(repr=False)
