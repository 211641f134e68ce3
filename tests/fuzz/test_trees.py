"""Any tree of values, as a script, settings or a message: read, or refused in a sentence."""

from __future__ import annotations

import json
import tempfile
from contextlib import suppress
from dataclasses import fields
from pathlib import Path
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from objectmorpher.editor.settings import Settings, read_settings, write_settings
from objectmorpher.server.message import MessageError, decode, encode
from objectmorpher.server.table import types
from objectmorpher_core.scripting.options import EditScript, ScriptError, script_from
from objectmorpher_core.scripting.script import parse_scripts
from tests.fuzz.checks import check_finite, check_same, check_sentence

PLAIN = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8)
TREES = st.recursive(
    PLAIN,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner),
    max_leaves=12,
)
OPTIONS = st.dictionaries(st.sampled_from([f.name for f in fields(EditScript)]), TREES, max_size=3)
TEXTS = st.text(max_size=20)
SENT = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.lists(inner, max_size=4).map(tuple),
    max_leaves=12,
)  # fmt: skip


@settings(deadline=None, max_examples=150)
@given(st.one_of(OPTIONS, TREES))
def test_scripts(tree: Any) -> None:
    try:
        for item in parse_scripts(json.dumps(tree)):
            check_finite(item.script)
    except ScriptError as error:
        check_sentence(str(error))


@settings(deadline=None, max_examples=150)
@given(OPTIONS)
def test_options_that_are_taken_are_taken_again(options: dict[str, Any]) -> None:
    with suppress(ScriptError):
        script = script_from(options)
        assert script.merged(script, options) == script


def _has_surrogates(value: Settings) -> bool:
    texts = (value.theme, *value.recent, *value.shortcuts.values())
    return any("\ud800" <= letter <= "\udfff" for text in texts for letter in text)


@settings(deadline=None, max_examples=50)
@given(
    st.builds(
        Settings, theme=TEXTS, scale=st.floats(-1e9, 1e9),
        quality=st.integers(), recent=st.lists(TEXTS, max_size=3).map(tuple),
        shortcuts=st.dictionaries(st.sampled_from(["save", "open", "undo"]), TEXTS),
    )
)  # fmt: skip
def test_settings_come_back_as_they_were_written(chosen: Settings) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "settings.toml"
        write_settings(path, chosen)
        again = read_settings(path)
        if not _has_surrogates(chosen):
            assert again == chosen
        write_settings(path, again)
        assert read_settings(path) == again
        assert len(again.recent) == len(chosen.recent)  # not the defaults


@settings(deadline=None, max_examples=150)
@given(SENT)
def test_messages_come_back_as_they_were_sent(value: Any) -> None:
    check_same(decode(encode(value, types()).body, types()), value)


@settings(deadline=None, max_examples=150)
@given(st.binary(max_size=200), st.integers(0, 1 << 64 - 1))
def test_bytes_that_are_no_message(data: bytes, length: int) -> None:
    for body in (data, length.to_bytes(8, "little") + data):
        try:
            decode(body, types())
        except MessageError as error:
            check_sentence(str(error))
