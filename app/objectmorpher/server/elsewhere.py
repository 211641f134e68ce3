"""Jobs on the user's server, or on this computer while the server is lost."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from objectmorpher_core.base.progress import Progress

if TYPE_CHECKING:
    from .address import Server

log = logging.getLogger(__name__)

AWAY = 60.0  # s that a lost server is left alone
LOST, NOT_SERVED = "ServerLost", "NotServed"  # names of JobErrors: the job is to be done here
TOO_LARGE = "TooMuch"  # so is this one, and the next may go there again


@dataclass(frozen=True)
class Remote:
    """A job function that asks a server; it runs in the worker, which waits for the answer."""

    function: Callable[..., Any]
    server: Server

    @property
    def __name__(self) -> str:
        return self.function.__name__

    def __call__(self, *arguments: Any, progress: Progress) -> Any:
        from .client import call

        return call(self.server, self.function.__name__, arguments, progress)


class Elsewhere:
    """The window's side: which server is chosen, and whether it was lost a moment ago."""

    def __init__(
        self, chosen: Callable[[], Server | None], tell: Callable[[Server, str], None]
    ) -> None:
        """`tell` says, in the status bar, that a server is lost and why."""
        self._chosen, self._tell = chosen, tell
        self._lost: Server | None = None
        self._until = 0.0  # s, monotonic
        self._not_served: set[tuple[Server, str]] = set()  # with names of functions

    def placed(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return the callable that the worker is to use for `function`."""
        server = self._chosen()
        if server is None or self.is_away(server):
            return function
        from .table import table

        served = table().get(function.__name__)
        is_served = served is not None and served.function is function
        is_refused = (server, function.__name__) in self._not_served
        return Remote(function, server) if is_served and not is_refused else function

    def takes_back(self, function: Callable[..., Any], name: str, sentence: str) -> bool:
        """Whether a job that failed with the error `name` is to be done here."""
        server = self._chosen()
        if name == NOT_SERVED and server is not None:
            log.info("%s; it is done here", sentence)
            self._not_served.add((server, function.__name__))
        elif name == LOST:
            self.lose(sentence)
        return name in (LOST, NOT_SERVED, TOO_LARGE)

    def is_away(self, server: Server) -> bool:
        return server == self._lost and time.monotonic() < self._until

    def lose(self, sentence: str) -> None:
        """The server gave no answer."""
        server = self._chosen()
        if server is not None:
            self._lost, self._until = server, time.monotonic() + AWAY
            self._tell(server, sentence)

    def try_again(self) -> None:
        """The server was found again, or another one chosen."""
        self._lost = None
        self._not_served.clear()
