"""The window's side: jobs go to the server, come back here when it is lost, and nothing is lost."""

from __future__ import annotations

import os
import stat
import sys
import time
from dataclasses import replace
from pathlib import Path

import desk as desks
import numpy as np
import pytest
from desk import TOKEN, Desk
from same_values import same_values

from editor_steps import lift_ball
from objectmorpher.commands import run
from objectmorpher.editor.editor import Editor
from objectmorpher.editor.intents.computing import ADDRESS, TOKEN_FILE
from objectmorpher.editor.settings import HERE, SERVER, Settings, read_settings, write_settings
from objectmorpher.server.address import (
    Address,
    AddressError,
    Server,
    ServerLost,
    TokenError,
    TooMuch,
    fingerprint,
    make_token,
    read_token,
    write_token,
)
from objectmorpher.server.client import call
from objectmorpher.server.elsewhere import Elsewhere, Remote
from objectmorpher.server.front import Front
from objectmorpher.server.table import table
from objectmorpher.worker import job_functions
from objectmorpher_core.base.arrays import frozen
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.base.progress import silent
from objectmorpher_core.document.model import Click, LiftSettings, Matte, Prompt


@pytest.fixture
def fill() -> tuple:
    return desks.fill()


def plates(variants: tuple) -> list[bytes]:
    return [variant.plate.pixels.tobytes() for variant in variants]


def test_a_job_goes_to_the_server_and_answers_as_here(desk: Desk, fill: tuple) -> None:
    desk.ask(job_functions.fill_variants, *fill)
    desk.wait()
    assert desk.runner.asked == ["fill_variants"]
    here = job_functions.fill_variants(*fill, progress=silent)
    assert plates(desk.answers[0]) == plates(here)
    assert desk.said == []


def test_every_served_function_answers_as_here(desk: Desk, fill: tuple) -> None:
    from objectmorpher_core.compose.plate.repair import PlatePatch

    pixels, hole, choice, _ = fill
    assert desk.server is not None
    cover, colours = hole.astype(np.float32), pixels / np.float32(255)
    ball = frozen(np.where(hole[..., None], np.uint8(250), pixels))
    click = Prompt((Click(60.0, 45.0),))
    cutout = job_functions.Cutout(ball, Matte(0, 0, cover, colours), hole, None)
    camera = Camera.from_fov(120, 90)
    calls = {
        "read_photo": (ball, "grabcut"),
        "segment": (ball, click, job_functions.BackendChoice("grabcut")),
        "closer_look": (ball, click, job_functions.BackendChoice("grabcut")),
        "candidate": (ball, Prompt(), job_functions.BackendChoice("grabcut")),
        "lift": (job_functions.Cut(ball, camera, hole), job_functions.BackendChoice("auto"),
                 LiftSettings(1000)),
        "inpaint": (pixels, hole, choice),
        "fill_variants": fill,
        "repair": (PlatePatch(0, 0, pixels, cover), 2.0, choice),
        "take_shadow": (cutout, choice),
    }  # fmt: skip
    assert {*calls, "refine"} == set(table())  # which has tests of its own
    for name, arguments in calls.items():
        there = call(desk.server, name, arguments, silent)
        here = table()[name].function(*arguments, progress=silent)
        assert same_values(there, here), name


def test_what_a_server_does_not_do_is_done_here_and_the_rest_there(desk: Desk, fill: tuple) -> None:
    served = {name: row for name, row in table().items() if row.stage == "inpaint"}
    desk.front.close()
    desk.front = Front(("127.0.0.1", 0), TOKEN, desk.runner, served)
    desk.front.start()
    desk.server = Server(Address(*desk.front.address), TOKEN)
    for _ in range(2):
        desk.ask(job_functions.read_photo, fill[0], "grabcut")
        desk.wait()
    desk.ask(job_functions.fill_variants, *fill)
    desk.wait()
    assert len(desk.answers) == 3 and desk.said == [] and desk.errors == []
    assert desk.runner.asked == ["fill_variants"]


def test_what_is_too_large_for_a_server_does_not_lose_it() -> None:
    server, said = Server(Address("127.0.0.1", 1), TOKEN), []
    elsewhere = Elsewhere(lambda: server, lambda _, why: said.append(why))
    function = job_functions.fill_variants
    assert elsewhere.takes_back(function, TooMuch.__name__, "it takes less")
    assert not elsewhere.is_away(server) and said == []
    assert isinstance(elsewhere.placed(function), Remote), "the next may go there"
    assert elsewhere.takes_back(function, ServerLost.__name__, "it is gone")
    assert elsewhere.is_away(server) and said == ["it is gone"]


def test_what_is_not_worth_it_stays_here(desk: Desk, tmp_path: Path) -> None:
    mask = np.ones((4, 4), np.uint8)
    desk.ask(job_functions.write_coverage, mask, tmp_path / "m.png")
    desk.wait()
    assert (tmp_path / "m.png").exists()
    assert desk.runner.asked == []


def test_a_server_that_is_gone_is_said_once_and_the_work_is_done_here(
    desk: Desk, fill: tuple
) -> None:
    desk.front.close()
    for _ in range(2):
        desk.ask(job_functions.fill_variants, *fill)
        desk.wait()
    assert len(desk.answers) == 2
    assert desk.errors == []
    assert len(desk.said) == 1  # the second job did not even try
    assert "cannot be reached" in desk.said[0]


@pytest.mark.slow
def test_a_server_that_ends_in_the_middle_of_a_job_changes_nothing_but_the_time(
    desk: Desk, fill: tuple
) -> None:
    pixels, hole = np.tile(fill[0], (6, 6, 1)), np.zeros((540, 720), bool)
    hole[150:400, 200:500] = True  # seconds of work, so that it cannot be done before the end
    desk.ask(job_functions.fill_variants, pixels, hole, job_functions.BackendChoice("auto"), 3)
    end = time.monotonic() + 60
    while desk.jobs.current is None or desk.jobs.current.fraction < 0.1:
        assert time.monotonic() < end
        desk.jobs.poll()
        time.sleep(0.01)
    desk.front.close()
    desk.wait()
    assert len(desk.said) == 1
    assert len(desk.answers[0]) == 3
    assert desk.errors == []


def test_a_wrong_token_is_said_and_the_work_is_done_here(desk: Desk, fill: tuple) -> None:
    desk.server = Server(Address(*desk.front.address), make_token())
    desk.ask(job_functions.fill_variants, *fill)
    desk.wait()
    assert len(desk.answers) == 1
    assert "does not accept the token" in desk.said[0]
    assert desk.runner.asked == []


def test_a_request_at_fault_is_not_tried_again_here(desk: Desk, fill: tuple) -> None:
    desk.ask(job_functions.inpaint, *fill[:2], job_functions.BackendChoice("nobody"))
    desk.wait()
    assert "no inpainter" in desk.errors[0].sentence
    assert desk.errors[0].is_expected
    assert desk.said == []


def test_cancelling_a_job_over_there_is_as_here(desk: Desk, fill: tuple) -> None:
    wanted = fill[0], fill[1], job_functions.BackendChoice("auto"), 12
    desk.ask(job_functions.fill_variants, *wanted)
    while desk.jobs.current is None or desk.jobs.current.fraction == 0:
        desk.jobs.poll()
        time.sleep(0.01)
    pid = desk.jobs._worker.process.pid  # type: ignore[union-attr]
    desk.jobs.cancel()
    desk.wait()
    assert (desk.cancels, desk.answers, desk.errors, desk.said) == (1, [], [], [])
    assert desk.jobs._worker.process.pid == pid  # type: ignore[union-attr]  # it was heard in time


# The editor's choice


def test_the_editor_asks_nobody_unless_it_is_told_to(alone: Editor) -> None:
    assert alone.computing.server is None
    alone.computing.set_address("gpu.lan")
    alone.computing.set_token(TOKEN)
    assert alone.computing.server is None
    alone.computing.choose(SERVER)
    assert alone.computing.server == Server(Address("gpu.lan", 8717), TOKEN)
    assert alone.computing.is_open_to_all
    alone.computing.choose(HERE)
    assert alone.computing.server is None


def test_the_token_is_kept_for_its_owner_only_and_not_in_the_settings(
    alone: Editor, own_settings: Path
) -> None:
    alone.computing.set_token(TOKEN)
    path = own_settings / TOKEN_FILE
    if sys.platform != "win32":
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
    write_settings(own_settings / "settings.toml", alone.settings)
    assert TOKEN not in (own_settings / "settings.toml").read_text()
    again = Editor(Settings(compute=SERVER, server="https://gpu.lan/om"))
    again.shut_down()
    assert again.computing.server == Server(Address("gpu.lan", 443, "/om", True), TOKEN)
    assert TOKEN not in repr(again.computing.server)


def test_what_is_wrong_with_address_or_token_is_a_sentence(alone: Editor) -> None:
    alone.computing.choose(SERVER)
    alone.computing.set_address("gpu.lan")
    assert alone.computing.server is None
    assert "16 to 512" in alone.computing.trouble
    alone.computing.set_token("short")
    assert alone.message is not None
    assert alone.message.is_error
    alone.computing.set_token(TOKEN)
    alone.computing.set_address("ftp://gpu.lan")
    assert "address" in alone.computing.trouble


def test_the_connection_can_be_tried(alone: Editor, desk: Desk) -> None:
    computing = alone.computing
    computing.choose(SERVER)
    computing.set_token(TOKEN)
    computing.set_address("{}:{}".format(*desk.front.address))
    for wanted in ("is ready for: segment, lift, inpaint, refine", "does not accept the token"):
        computing.test()
        end = time.monotonic() + 60
        while computing.is_testing:
            assert time.monotonic() < end
            alone.poll()
            time.sleep(0.01)
        assert alone.message is not None
        assert wanted in alone.message.text
        computing.set_token(make_token())


def test_the_environment_names_a_server_for_one_start(
    own_settings: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(ADDRESS, "gpu.lan:99")
    monkeypatch.setenv("OBJECTMORPHER_TOKEN", TOKEN)
    editor = Editor(Settings())
    editor.shut_down()
    assert editor.computing.server == Server(Address("gpu.lan", 99), TOKEN)
    assert editor.settings == Settings()


def test_the_choice_is_kept(tmp_path: Path) -> None:
    settings = replace(Settings(), compute=SERVER, server="https://gpu.lan")
    write_settings(tmp_path / "s.toml", settings)
    assert read_settings(tmp_path / "s.toml") == settings


# Addresses and tokens


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("gpu.lan", Address("gpu.lan", 8717)),
        (" 10.0.0.2:99 ", Address("10.0.0.2", 99)),
        ("[::1]:99", Address("::1", 99)),
        ("http://gpu/", Address("gpu", 8717)),
        ("https://gpu/a/b/", Address("gpu", 443, "/a/b", True)),
    ],
)
def test_addresses_are_read_as_people_write_them(text: str, address: Address) -> None:
    assert Address.of(text) == address


@pytest.mark.parametrize(
    "text", ["", "ftp://x", "http://", "gpu:port", "gpu:99999", "http://me:word@gpu", "gpu?x=1"]
)
def test_what_is_no_address_is_refused(text: str) -> None:
    with pytest.raises(AddressError):
        Address.of(text)


def test_tokens_are_long_and_never_the_same() -> None:
    tokens = {make_token() for _ in range(100)}
    assert len(tokens) == 100
    assert min(map(len, tokens)) >= 40
    assert all(fingerprint(token) != fingerprint(token[:-1]) for token in tokens)


def test_a_token_file_is_never_readable_by_others_nor_written_through_a_link(
    tmp_path: Path,
) -> None:
    path, victim = tmp_path / "token", tmp_path / "victim"
    victim.write_text("precious")
    os.symlink(victim, path)
    write_token(path, TOKEN)
    assert victim.read_text() == "precious"
    assert read_token(path) == TOKEN
    write_token(path, "")
    assert read_token(path) == ""
    with pytest.raises(TokenError):
        write_token(path, "with spaces in it, and long")
    (tmp_path / "bad").write_bytes(b"\xff" * 40)
    with pytest.raises(TokenError):
        read_token(tmp_path / "bad")


@pytest.mark.slow
def test_the_whole_job_by_a_server_and_then_without_it(
    editor: Editor, desk: Desk, own_settings: Path
) -> None:
    """Select, lift, fill in: over there; undone, and the server ended: here, the same again."""
    token, before = editor.computing._token, editor.settings
    editor.computing.set_token(TOKEN)
    editor.computing.set_address("{}:{}".format(*desk.front.address))
    editor.computing.choose(SERVER)
    try:
        there = lift_ball(editor)
        assert {"segment", "lift", "inpaint"} <= set(desk.runner.asked)
        assert there.plate is not None
        desk.front.close()
        asked = len(desk.runner.asked)
        for _ in range(2):
            run(editor, "undo")
        assert editor.mask is None
        here = lift_ball(editor)
        assert len(desk.runner.asked) == asked
    finally:
        editor.computing._token, editor.settings = token, before
    assert same_values(here.objects[0].lifted, there.objects[0].lifted)
    assert here.plate is not None
    assert same_values(here.plate.pixels, there.plate.pixels)
