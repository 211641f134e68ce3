"""What a server says that it can run: looked up there, offered in the window, not believed."""

from __future__ import annotations

import time
from typing import Any

import pytest
from desk import TOKEN, Desk

from hands import PATIENCE
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.settings import SERVER
from objectmorpher.server.client import hello
from objectmorpher.server.running import Offer, look_at_offers, read_offers
from objectmorpher_core import compose, segment


def test_a_server_tells_what_it_can_run(desk: Desk) -> None:
    assert desk.server is not None
    told = read_offers(hello(desk.server)["backends"])
    assert told == look_at_offers() and list(told) == ["segment", "lift", "inpaint", "refine"]
    assert told["segment"].auto == segment.load().name
    assert told["inpaint"].auto == compose.load().name
    able = {name for name in compose.BACKENDS if compose.missing(name) is None}
    assert set(told["inpaint"].able) == able
    assert all(offer.auto in offer.able for offer in told.values() if offer.auto)


def test_the_servers_backends_are_offered_and_those_here_when_it_is_gone(
    alone: Editor, desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    offers = {
        "lift": Offer("trellis", ("relief", "trellis", "sam3d")), "refine": Offer("", ()),
        "inpaint": Offer("lama", ("lama", "telea")),
    }  # fmt: skip
    monkeypatch.setattr(desk.runner, "offers", lambda: offers)
    computing, methods = alone.computing, alone.methods

    def wait(is_there: Any) -> None:
        end = time.monotonic() + PATIENCE
        while not is_there():
            assert time.monotonic() < end
            alone.poll()
            time.sleep(0.01)

    computing.choose(SERVER)
    computing.set_token(TOKEN)
    computing.set_address("{}:{}".format(*desk.front.address))
    wait(lambda: methods.taken("lift") == "trellis")
    why_not = {method.name: method.why_not for method in methods.of("lift")}
    assert list(why_not) == ["auto", "relief", "trellis", "cupid", "triposplat", "sam3d"]
    assert [name for name, reason in why_not.items() if reason] == ["cupid", "triposplat"]
    assert methods.taken("inpaint") == "lama"
    assert methods.why_not("refine") == "The server has no network for it"
    methods.choose("lift", "sam3d")
    assert methods.chosen("lift") == "sam3d"
    wait(lambda: methods.taken("segment") != "")  # of this computer: the server said nothing of it
    desk.front.close()
    computing.set_address("{}:{}".format(*desk.front.address) + "/gone")
    wait(lambda: methods.taken("lift") == "relief" and computing.reached is None)
    assert methods.chosen("lift") == "auto", "a worker that is not here"


def test_what_a_server_says_of_itself_is_not_believed() -> None:
    assert read_offers({"lift": {"auto": "relief", "able": ["relief"]}, "sing": {}}) == {
        "lift": Offer("relief", ("relief",))
    }
    for odd in (None, [], "lift", {"lift": 7}, {"lift": None}):
        assert read_offers(odd) == {}
    for able in (None, "relief", [7, "", "a\nb", "x" * 99], {"relief": 1}):
        assert read_offers({"lift": {"auto": "relief", "able": able}})["lift"] == Offer("", ())
    assert len(read_offers({"lift": {"able": [f"w{k}" for k in range(999)]}})["lift"].able) < 100
