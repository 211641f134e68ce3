"""Which server is meant: its address and the word by which it knows us."""

from __future__ import annotations

from dataclasses import dataclass, field
from urllib.parse import urlsplit

PROTOCOL = 1  # version of what client and server say to each other
PORT = 8717  # of a server that does not say another
LOOPBACK = ("localhost", "127.0.0.1", "::1")


class AddressError(ValueError):
    """An address that leads nowhere; one sentence."""


class ServerLost(Exception):
    """The server is gone, slow, or does not serve us: what was asked is to be done here."""


class NotServed(Exception):
    """The server does not do that, and is there all the same; one sentence."""


class ServedError(ValueError):
    """The server ran the job, and the job failed as it would have here; one sentence."""


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
