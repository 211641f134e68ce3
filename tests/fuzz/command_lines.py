"""Command lines as Hypothesis draws them: of every option that the parser knows."""

from __future__ import annotations

import argparse
import re
from functools import cache

from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from objectmorpher.cli.parser import build_parser

from .shapes_of_photos import KINDS, LARGE, SIDES

OUTPUTS = (
    "o.png", "o.jpg", "o.tif", "o.webp", "o.omorph", "o.ply", "o.splat", "o.spz", "o.ora",
    "o.webm", "o.gif", "o.json", "m.png", "no/where.png", "o.nothing",
)  # fmt: skip
PHOTOS = [
    *(name for name in SIDES if name not in LARGE), *KINDS, "deep.png", "deep.tif",
    "deep-alpha.png", "deep-grey.png", "broken.jpg", "empty.png", "text.png", "none.png",
]  # fmt: skip
FILES = ("p/plain-mask.png", "p/plain.png", "p/strip-mask.png", "p/text.png", "p/none.png", "p",
         "p/cloud.off", "/dev/null", "/dev/zero", "p/deep.png")  # fmt: skip
COMMANDS = [*["edit"] * 24, "select", "replay", "info", "convert", "batch", "bench", "models",
            "doctor", "edti", ""]  # fmt: skip
MASKS = ("", "", "", "-most", "-line", "-none")
ODD = (
    "0", "-0", "-1", "1", "0.5", "2", "10", "100", "1e-9", "1e9", "-1e9", "1e-300", "1e300",
    "1e400", "inf", "-inf", "nan", "1_0", "0x10", "٣", "", " ", "abc", "1" * 5000, "1.5", "65536",
    "2147483648", "18446744073709551616", "½",
)  # fmt: skip
WORDS = ("auto", "none", "telea", "patchmatch", "relief", "grabcut", "dino", "subject", "lama",
         "qwen", "harmonise", "arap", "laplacian", "geodesic", "euclidean", "mirrored",
         "continued", "yes", "no", "morph", "sway", "turn", "wat", "")  # fmt: skip
QUICK = (["--gaussians", "200", "--inpaint", "telea"],) * 5 + ([],)


def numbers() -> SearchStrategy[str]:
    """Ordinary and odd ones."""
    usual = st.integers(-5, 70).map(str)
    small = st.integers(0, 300).map(lambda n: str(n / 100))  # what most settings range over
    any_float = st.floats(allow_nan=False, allow_infinity=False).map(repr)
    whole = st.integers().map(str)
    return st.one_of(usual, usual, small, small, st.sampled_from(ODD), any_float, whole)


def joined(least: int, most: int) -> SearchStrategy[str]:
    """So many numbers with commas; now and then another count."""
    exact = st.lists(numbers(), min_size=least, max_size=most)
    return st.one_of(exact, exact, exact, st.lists(numbers(), max_size=6)).map(",".join)


def pairs(third: bool) -> SearchStrategy[str]:
    """X,Y:X2,Y2[,N]"""
    return st.tuples(joined(2, 2), joined(2, 3 if third else 2)).map(":".join)


@cache
def values() -> dict[str, SearchStrategy[str]]:
    """What an option takes, by its metavar; others take numbers."""
    files = st.sampled_from(FILES)
    outs = st.sampled_from(OUTPUTS)
    names = st.sampled_from(WORDS)
    known: dict[str, SearchStrategy[str]] = {
        "X,Y": joined(2, 2), "X0,Y0,X1,Y1": joined(4, 4), "DX,DY[,DZ]": joined(2, 3),
        "YAW[,PITCH,ROLL]": joined(1, 3), "POSE": names, "X,Y:X2,Y2[,DZ]": pairs(True),
        "X,Y:X2,Y2[,R]": pairs(True),
        "NAME": names, "KIND": names, "MODE": names, "auto|yes|no": names, "auto|none": names,
        "FILE[@X,Y]": st.one_of(files, st.tuples(files, joined(2, 2)).map("@".join)),
        "M.png": files, "FILE": outs, "FILE.ora": outs, "FILE.glb": outs, "R.json": outs,
        "S.omorph": outs,
        "EDIT.json": st.sampled_from(["p/script.json", "p/text.png", "p/none.json"]),
    }  # fmt: skip
    return known


@cache
def options_of(command: str) -> tuple[argparse.Action, ...]:
    """Those of a command, but for the one that says where its result goes."""
    parser = build_parser()
    words = next(a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
    return tuple(
        action
        for action in words.choices[command]._actions
        if action.option_strings and action.dest not in ("help", "out", "ray")
    )


def promised(action: argparse.Action) -> list[SearchStrategy[str]]:
    """The words that an option's help names, where it takes a word."""
    is_word = action.metavar in ("NAME", "KIND", "MODE") or "|" in str(action.metavar)
    named = [
        word for word in WORDS if word in re.findall(r"\w+", f"{action.metavar} {action.help}")
    ]
    return [st.sampled_from(named)] * 3 if is_word and named else []


@st.composite
def option(draw: st.DrawFn, command: str) -> list[str]:
    """One option with a value, now and then misspelt or without one."""
    action = draw(st.sampled_from(options_of(command)))
    name = draw(st.sampled_from([action.option_strings[-1]] * 90 + ["--nonsense", "-", "--"]))
    if action.nargs == 0:
        return [name]
    value = draw(st.one_of(values().get(str(action.metavar), numbers()), *promised(action)))
    return draw(st.sampled_from([[f"{name}={value}"]] * 24 + [[name, value], [name]]))


@st.composite
def photos(draw: st.DrawFn) -> tuple[str, list[str]]:
    """A photo and how its object is chosen."""
    pick = draw(st.integers(0, 199))
    name = LARGE[pick] if pick < len(LARGE) else draw(st.sampled_from(PHOTOS))
    stem = name.partition(".")[0]
    masks = stem if stem in SIDES else "plain"
    mask = ["--mask", f"p/{masks}-mask{draw(st.sampled_from(MASKS))}.png"]
    width, height = SIDES[masks]
    click = ["--click", f"{width // 2},{height // 2}"]
    chosen = draw(st.sampled_from([mask] * 8 + [click, ["--subject"], []]))
    return f"p/{name}" if "." in name else f"p/{name}.png", chosen


@st.composite
def command_lines(draw: st.DrawFn) -> list[str]:
    """A command line: mostly an edit of a photo that has up to four options more."""
    command = draw(st.sampled_from(COMMANDS))
    out = ["-o", draw(st.sampled_from(["o.png"] * 6 + ["o.jpg", "o.tif", "o.webp", "o.nothing"]))]
    few = st.lists(option(command) if command in WITH_OPTIONS else st.just(["--yes"]), max_size=4)
    more = [word for words in draw(few) for word in words]
    if command in ("edit", "select"):
        photo, chosen = draw(photos())
        extra: list[str] = []
        if command == "edit":
            moved = draw(st.sampled_from([["--move=5,3"], ["--scale=1.5"], ["--turn=20,0,0"], []]))
            extra = [*draw(st.sampled_from(QUICK)), *moved]
        return [command, photo, *out, *chosen, *extra, *more]
    if command == "replay":
        return [command, draw(st.sampled_from(["p/plain.png", "p/none.omorph", "p"])), *out, *more]
    files = st.sampled_from(["p/cloud.off", "p/plain.png", "p/script.json", "p/none", "list", "x"])
    return [command, *draw(st.lists(files, max_size=2)), *([] if command == "info" else out), *more]


WITH_OPTIONS = ("edit", "select", "replay", "info", "convert", "batch")
