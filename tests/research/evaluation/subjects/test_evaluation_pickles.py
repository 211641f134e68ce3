"""Plain values are read out of pickles, and nothing of a pickle is ever carried out."""

from __future__ import annotations

import os
import pickle
import time
from collections import OrderedDict
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from objectmorpher_research.evaluation.error import EvaluationError
from objectmorpher_research.evaluation.subjects.plain_pickle import read_plain
from tests.tree import over

META = {
    "prompt": "a photo of a cat, ünïcode",
    "points": [[10, 20], (30.5, 40), [np.int64(5), np.float32(0.25)]],
    "mask": (np.arange(35).reshape(5, 7) % 3 * 100).astype(np.uint8),
    "more": {"none": None, "yes": True, "big": 2**70, "bytes": b"\x00\xff", "empty": ()},
}


class Calls:
    """Its pickle calls something when it is loaded."""

    def __init__(self, *called: object) -> None:
        self.called = called

    def __reduce__(self):
        return self.called[0], self.called[1:]


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_plain_values_come_back_in_every_protocol(protocol):
    told = dict(META) if protocol >= 2 else {k: v for k, v in META.items() if k != "more"}
    found = read_plain(pickle.dumps(told, protocol))
    expected = pickle.loads(pickle.dumps(told, protocol))
    assert np.array_equal(found.pop("mask"), expected.pop("mask"))
    assert found == expected


@over("kind", ["u1", "i8", ">f4", "f8", "b1", ">i2"])
@over("is_fortran", [False, True])
def test_arrays_keep_their_numbers(kind, is_fortran):
    values = (np.arange(24).reshape(2, 3, 4) % 2 * 100).astype(kind)
    array = np.asfortranarray(values) if is_fortran else values
    found = read_plain(pickle.dumps({"a": array, "part": array[:, 1]}))
    assert np.array_equal(found["a"], array) and np.array_equal(found["part"], array[:, 1])
    assert found["a"].dtype.kind == array.dtype.kind


def test_names_of_older_numpy_are_understood():
    """DragBench was written by numpy 1, whose module is numpy.core."""
    data = pickle.dumps(META["mask"], 2).replace(b"numpy._core", b"numpy.core")
    assert b"numpy.core.multiarray" in data
    assert np.array_equal(read_plain(data), META["mask"])


@pytest.mark.parametrize("protocol", [0, 2, 4])
@pytest.mark.parametrize(
    "value",
    [
        Calls(os.system, "touch {mark}"),
        Calls(eval, "open('{mark}', 'w')"),
        Calls(open, "{mark}", "w"),
        Calls(getattr, "text", "upper"),
        Calls(np.load, "{mark}"),
        Path("."), Fraction(1, 3), OrderedDict(a=1), np.float64, len, {1, 2}, np.array(["text"]),
        np.array([object()], object), np.zeros(2, [("a", "f4")]), np.datetime64("2020-01-01"),
    ],
    ids=lambda value: type(value).__name__,
)  # fmt: skip
def test_whatever_else_a_pickle_holds_is_refused(value, protocol, tmp_path):
    mark = tmp_path / "mark"
    if isinstance(value, Calls):
        value = Calls(*(v.format(mark=mark) if isinstance(v, str) else v for v in value.called))
    data = pickle.dumps({"points": [value]}, protocol)
    with pytest.raises(EvaluationError, match="more than plain values"):
        read_plain(data)
    assert not mark.exists()


@over(
    "data",
    [
        b"", b"nothing", b"\x80\x04.", b".", b"N", b"(.", b"}(K\x01.", b"\x80\x04]q\x00h\x05.",
        b"cos\nsystem\n(S'x'\ntR.", b"\x8c\x02os\x8c\x06system\x93.", b"ios\nsystem\n.",
        b"(S'x'\nios\nsystem\n.", b"Ppersistent\n.", b"\x82\x01.", b"B\xff\xff\xff\xff",
        b"K\x01K\x02.",
        b"\x80\x05\x96\xff\xff\xff\xff\xff\xff\xff\x7f", b"L" + b"9" * 9000 + b"L\n.",
        b"cnumpy\nndarray\n)R.", b"cnumpy\nndarray\n.", b"cnumpy\ndtype\n(S'u1'\ntR.", b"]]a0.",
        b"e.",
        b"K\x01K\x02a.", b"K\x01}b.", b"cnumpy\ndtype\n(S'O8'\ntR(K\x03S'|'\nNNNtb.",
    ],
)  # fmt: skip
def test_damaged_and_written_by_hand(data):
    with pytest.raises(EvaluationError):
        read_plain(data)


def test_every_prefix_and_flipped_byte_is_refused_or_plain():
    data = pickle.dumps(META, 4)
    rng = np.random.default_rng(0)
    changed = [data[:n] for n in range(len(data))]
    for _ in range(3000):
        flipped = bytearray(data)
        flipped[rng.integers(len(data))] = rng.integers(256)
        changed.append(bytes(flipped))
    count = 0
    for each in changed:
        try:
            read_plain(each)
        except EvaluationError:
            count += 1
    assert count > len(data)  # every prefix at least, but for none


def test_claims_are_compared_with_the_bytes_there_are():
    small = pickle.dumps(np.zeros((2, 2), np.uint8), 4)
    for claim in ((b"K\x02K\x02\x86", b"K\xffK\xff\x86"), (b"u1", b"f8"), (b"u1", b"O8")):
        assert claim[0] in small
        with pytest.raises(EvaluationError):
            read_plain(small.replace(*claim))


def test_sharing_and_nesting_do_not_blow_up():
    """Lists of the same list twice, 45 deep, would be 2^45 values; a list in itself has no end."""
    shared = b"]" + b"".join(
        b"]q" + bytes([k]) + b"(h" + bytes([k]) + b"h" + bytes([k]) + b"e" for k in range(3)
    )
    value: list = []
    for _ in range(45):
        value = [value, value]
    start = time.process_time()
    assert len(read_plain(pickle.dumps(value))) == 2
    assert time.process_time() - start < 5
    endless: list = []
    endless.append(endless)
    deep: list = []
    for _ in range(60):
        deep = [deep]
    for data in (shared + b".", pickle.dumps(endless), pickle.dumps(deep)):
        with pytest.raises(EvaluationError):
            read_plain(data)


def test_one_text_cannot_be_made_into_ever_more_arrays():
    """Of 8 MB, kept in the memo, and made an array of 100 times."""
    count = 1 << 23
    text = b"B" + count.to_bytes(4, "little") + bytes(count) + b"q\x00"
    shape = b"(J" + count.to_bytes(4, "little") + b"t"
    array = (
        b"cnumpy.core.numeric\n_frombuffer\n(h\x00cnumpy\ndtype\n(S'u1'\ntR" + shape + b"S'C'\ntR"
    )
    few = read_plain(b"\x80\x03" + text + b"](h\x00" + b"0" + array + b"e\x86.")
    assert len(few[1]) == 1 and len(few[1][0]) == count
    with pytest.raises(EvaluationError, match="more numbers"):
        read_plain(b"\x80\x03" + text + array * 100 + b".")
