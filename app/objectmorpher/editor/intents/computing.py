"""The place where long jobs run: this computer, or the user's server."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...server.elsewhere import Elsewhere
from ...system.texts import t
from ...worker.requests import JobError
from ..settings import SERVER, settings_path
from ..view import Action

if TYPE_CHECKING:
    from ...server.address import Server
    from ...server.running import Offers
    from ..state import EditorState
    from ..tasks import Tasks

log = logging.getLogger(__name__)

ADDRESS = "OBJECTMORPHER_SERVER"  # names a server for this start, whatever the settings say
TOKEN_FILE = "server.token"  # beside the settings, mode 600
TEST, OFFERS = "test server", "ask server"  # kinds of chores


class Computing:
    """The user's choice, and the server that it means."""

    def __init__(self, editor: EditorState, tasks: Tasks) -> None:
        self._editor = editor
        self._tasks = tasks
        self.changed: Callable[[], None] = lambda: None  # another computer does the work now
        self._trouble = ""
        self._token: str | None = None  # None: not read yet
        self._known: tuple[tuple[str, str], Server | None] | None = None
        self._elsewhere = Elsewhere(lambda: self.server, self._say_lost)
        editor.jobs.elsewhere = self._elsewhere

    @property
    def is_elsewhere(self) -> bool:
        """Whether a server is chosen."""
        return bool(os.environ.get(ADDRESS)) or self._editor.settings.compute == SERVER

    @property
    def is_given(self) -> bool:
        """Whether the environment names the server, and not the settings."""
        return bool(os.environ.get(ADDRESS))

    @property
    def address(self) -> str:
        return os.environ.get(ADDRESS) or self._editor.settings.server

    @property
    def token(self) -> str:
        """Return the token by which the server knows the user; "" where there is none."""
        if self._token is None:
            self._token = _stored_token()
        return self._token

    @property
    def server(self) -> Server | None:
        """The server that jobs go to; None: they run here."""
        if not self.is_elsewhere:
            return None
        said = self.address, self.token
        if self._known is None or self._known[0] != said:
            self._known = said, self._understood(*said)
        return self._known[1]

    @property
    def reached(self) -> Server | None:
        """Return the server unless it is lost."""
        server = self.server
        return None if server is None or self._elsewhere.is_away(server) else server

    def ask_offers(self, done: Callable[[Offers], None]) -> None:
        """Ask the server for its backends; a server that does not answer counts as lost."""
        from ...server.client import hello
        from ...server.running import read_offers

        server = self.reached
        if server is not None:
            self._editor.chores.start(
                "Asking what the server can run", lambda progress: hello(server), kind=OFFERS,
                done=lambda told: done(read_offers(told.get("backends"))),
                failed=lambda error: self._elsewhere.lose(error.sentence), is_quiet=True,
            )  # fmt: skip

    @property
    def trouble(self) -> str:
        """Why the chosen server cannot be asked, one sentence; "" where it can."""
        return self._trouble if self.is_elsewhere and self.server is None else ""

    @property
    def is_open_to_all(self) -> bool:
        """Whether photos and the token would pass where others can read along."""
        server = self.server
        return server is not None and not server.address.is_private

    def choose(self, where: str) -> None:
        """`where`: HERE or SERVER, of the settings."""
        self._editor.settings = replace(self._editor.settings, compute=where)
        self._changed()

    def set_address(self, address: str) -> None:
        self._editor.settings = replace(self._editor.settings, server=address.strip())
        self._changed()

    def set_token(self, token: str) -> None:
        """Keeps the token in a file that only its owner may read."""
        from ...server.address import TokenError, write_token

        token = token.strip()
        try:
            write_token(_token_path(), token)
        except TokenError as error:
            self._editor.complain(str(error))
            return
        except OSError as error:
            self._editor.complain(f"{t('The token cannot be kept')}: {error.strerror or error}")
            return
        self._token = token
        self._changed()

    def test(self) -> None:
        """Asks the server who it is, and says so."""
        from ...server.client import hello

        editor, server = self._editor, self.server
        if server is None:
            editor.complain(self.trouble or t("No server is chosen"))
            return

        def accept(told: dict[str, Any]) -> None:
            self._elsewhere.try_again()
            stages = told.get("stages")
            names = ", ".join(str(s)[:20] for s in stages) if isinstance(stages, dict) else ""
            editor.say(t("{name} is ready for: {stages}", name=server.address, stages=names))

        def complain(error: JobError) -> None:
            editor.complain(error.sentence, action=Action(t("Retry"), self.test))

        editor.chores.start(
            t("Asking {name}", name=server.address), lambda progress: hello(server),
            kind=TEST, done=accept, failed=complain,
        )  # fmt: skip

    @property
    def is_testing(self) -> bool:
        return self._editor.chores.is_busy(TEST)

    def _changed(self) -> None:
        """What another server, or this computer, knows of the photo is another matter."""
        self._elsewhere.try_again()
        editor = self._editor
        self.changed()
        if editor.document is not None and not editor.is_lifted:
            self._tasks.read_photo(is_quiet=True)

    def _understood(self, address: str, token: str) -> Server | None:
        from ...server.address import Address, AddressError, Server, TokenError, check_token

        try:
            return Server(Address.of(address), check_token(token))
        except (AddressError, TokenError) as error:
            self._trouble = str(error)
            return None

    def _say_lost(self, server: Server, sentence: str) -> None:
        self._editor.say(
            t("{reason}; it goes on with this computer", reason=sentence),
            Action(t("Try the server again"), self.test),
        )


def _token_path() -> Path:
    return settings_path().with_name(TOKEN_FILE)


def _stored_token() -> str:
    """The environment's, or the file's; "" where there is none that can be used."""
    from ...server.address import VARIABLE, TokenError, read_token

    if given := os.environ.get(VARIABLE):
        return given
    try:
        return read_token(_token_path())
    except TokenError as error:
        log.warning("The server's token: %s", error)
        return ""
