"""The plain values of a pickle, without unpickling it: nothing is imported, called or executed.

The file's instructions are read one by one (`pickletools.genops`, which only splits them) and the
few that build plain values are carried out here on lists of our own: texts, numbers, lists, tuples,
dicts, and numpy arrays of numbers. A name of a class or function is only ever compared with the few
that numpy writes; any other one, and any other instruction, is refused.
"""

from __future__ import annotations

import io
import math
import pickletools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..error import EvaluationError

MOST_BYTES = 256 << 20
MOST_STEPS = 2_000_000
MOST_NUMBERS = 64_000_000  # in one array
MOST_DEPTH = 50

MULTIARRAY = ("numpy.core.multiarray", "numpy._core.multiarray")
ALLOWED = {  # every name that is understood, and what it stands for
    ("numpy", "ndarray"): "ndarray",
    ("numpy", "dtype"): "dtype",
    **{(module, "_reconstruct"): "reconstruct" for module in MULTIARRAY},
    **{(module, "scalar"): "scalar" for module in MULTIARRAY},
    **{(f"{module[:-11]}.numeric", "_frombuffer"): "frombuffer" for module in MULTIARRAY},
    ("_codecs", "encode"): "encode",
}
CONSTANTS = {
    "NONE": None, "NEWTRUE": True, "NEWFALSE": False, "EMPTY_LIST": list, "EMPTY_TUPLE": tuple,
    "EMPTY_DICT": dict,
}  # fmt: skip
LITERALS = {
    "INT", "BININT", "BININT1", "BININT2", "LONG", "LONG1", "LONG4", "FLOAT", "BINFLOAT",
    "SHORT_BINUNICODE", "BINUNICODE", "BINUNICODE8", "UNICODE", "SHORT_BINBYTES", "BINBYTES",
    "BINBYTES8", "BYTEARRAY8", "SHORT_BINSTRING", "BINSTRING", "STRING",
}  # fmt: skip
IGNORED = {"PROTO", "FRAME"}


@dataclass(eq=False)
class _Name:
    """A class or function that the file names; it is never looked up."""

    meaning: str


@dataclass(eq=False)
class _Dtype:
    """Of numbers; filled in by the state that follows."""

    code: str
    order: str = "="

    def numpy(self) -> np.dtype[Any]:
        if self.code[:1] not in "biuf" or not self.code[1:].isdigit():
            raise _Refused(f"an array of {self.code!r}")
        try:
            kind = np.dtype(self.code)
            return kind.newbyteorder(">") if self.order == ">" else kind
        except (TypeError, ValueError):
            raise _Refused(f"an array of {self.code!r}") from None


@dataclass(eq=False)
class _Array:
    """To be filled in by the state that follows."""

    values: np.ndarray | None = None


class _Refused(Exception):
    """What stands in the file that is no plain value."""


def read_plain(data: bytes) -> Any:
    """Read the pickle's plain values: dicts, lists, tuples, texts, bytes, numbers, numpy arrays.

    Raises EvaluationError: one sentence, without anything of the file having been carried out.
    """
    if len(data) > MOST_BYTES:
        raise EvaluationError(f"a pickle of more than {MOST_BYTES >> 20} MB is not read")
    try:
        return _plain(_Machine().run(pickletools.genops(io.BytesIO(data))), 0, {})
    except _Refused as refused:
        raise EvaluationError(f"the pickle holds more than plain values: {refused}") from None
    except (ValueError, IndexError, KeyError, TypeError, OverflowError, RecursionError) as error:
        raise EvaluationError("the pickle is damaged") from error


class _Machine:
    """The stack and the memo of the pickle's instructions."""

    def __init__(self) -> None:
        self.stack: list[Any] = []
        self.marks: list[int] = []  # heights of the stack
        self.memo: dict[int, Any] = {}
        self._left = MOST_BYTES  # that arrays may still be made of: one text can be used often

    def run(self, steps: Iterator[tuple[Any, Any, int | None]]) -> Any:
        for count, (code, argument, _) in enumerate(steps):
            if count > MOST_STEPS:
                raise _Refused("too many instructions")
            if code.name == "STOP":
                (value,) = self.stack
                return value
            self.step(code.name, argument)
        raise ValueError("it does not end")

    def step(self, name: str, argument: Any) -> None:
        stack = self.stack
        if name in IGNORED:
            return
        if name in LITERALS:
            stack.append(argument)
        elif name in CONSTANTS:
            made = CONSTANTS[name]
            stack.append(made() if callable(made) else made)
        elif name == "MARK":
            self.marks.append(len(stack))
        elif name in STEPS:
            STEPS[name](self)
        elif name in ("PUT", "BINPUT", "LONG_BINPUT"):
            self.memo[int(argument)] = stack[-1]
        elif name == "MEMOIZE":
            self.memo[len(self.memo)] = stack[-1]
        elif name in ("GET", "BINGET", "LONG_BINGET"):
            stack.append(self.memo[int(argument)])
        elif name == "GLOBAL":
            stack.append(_named(*str(argument).split(" ", 1)))
        else:
            raise _Refused(f"the instruction {name}")

    def since_mark(self) -> list[Any]:
        """Takes what lies above the last mark."""
        at = self.marks.pop()
        taken = self.stack[at:]
        del self.stack[at:]
        return taken

    def pop(self, count: int) -> list[Any]:
        if len(self.stack) - count < (self.marks[-1] if self.marks else 0):
            raise IndexError("the stack is empty")
        taken = self.stack[-count:]
        del self.stack[-count:]
        return taken

    def charge(self, values: tuple[Any, ...]) -> None:
        """Counts the bytes that something is made of."""
        self._left -= sum(len(v) for v in values if isinstance(v, str | bytes | bytearray))
        if self._left < 0:
            raise _Refused("more numbers than are read")


def _named(module: str, name: str) -> _Name:
    if (meaning := ALLOWED.get((module, name))) is None:
        raise _Refused(f"the name {module}.{name}"[:120])
    return _Name(meaning)


def _stack_global(machine: _Machine) -> None:
    module, name = machine.pop(2)
    machine.stack.append(_named(str(module), str(name)))


def _append(machine: _Machine, items: list[Any]) -> None:
    if not isinstance(machine.stack[-1], list):
        raise _Refused("an append to something else")
    machine.stack[-1].extend(items)


def _set(machine: _Machine, items: list[Any]) -> None:
    target = machine.stack[-1]
    if not isinstance(target, dict) or len(items) % 2:
        raise _Refused("items of something else")
    for key, value in zip(items[::2], items[1::2], strict=True):
        if not isinstance(key, str | int):
            raise _Refused("a key that is no text")
        target[key] = value


def _tuple(count: int) -> Any:
    return lambda machine: machine.stack.append(tuple(machine.pop(count)))


def _dict_of(machine: _Machine) -> None:
    items = machine.since_mark()
    machine.stack.append({})
    _set(machine, items)


def _reduce(machine: _Machine) -> None:
    called, arguments = machine.pop(2)
    if not isinstance(called, _Name) or not isinstance(arguments, tuple):
        raise _Refused("a call")
    machine.charge(arguments)
    machine.stack.append(CALLS[called.meaning](*arguments))


def _build(machine: _Machine) -> None:
    (state,) = machine.pop(1)
    target = machine.stack[-1]
    if not isinstance(state, tuple):
        raise _Refused("the state of an object")
    if isinstance(target, _Dtype):
        order = state[1]
        if order not in ("<", ">", "=", "|") or any(state[k] is not None for k in (2, 3, 4)):
            raise _Refused("an array of records")
        target.order = order
    elif isinstance(target, _Array):
        machine.charge(state)
        _, shape, dtype, is_columns, raw = state
        target.values = _array(raw, dtype, shape, "F" if is_columns else "C")
    else:
        raise _Refused("the state of an object")


def _array(raw: Any, dtype: Any, shape: Any, order: Any) -> np.ndarray:
    """(shape) numbers from bytes; what is claimed is compared with the bytes there are."""
    if not isinstance(raw, bytes | bytearray) or not isinstance(dtype, _Dtype):
        raise _Refused("an array of something else")
    if not isinstance(shape, tuple) or not all(type(n) is int and n >= 0 for n in shape):
        raise _Refused("an array without a shape")
    if len(shape) > 8 or math.prod(shape) > MOST_NUMBERS:
        raise _Refused("an array that is too large")
    kind = dtype.numpy()
    if len(raw) != math.prod(shape) * kind.itemsize:
        raise ValueError("an array of other bytes than it claims")
    return np.frombuffer(bytes(raw), kind).reshape(shape, order="F" if order == "F" else "C").copy()


def _scalar(dtype: Any, raw: Any) -> Any:
    return _array(raw, dtype, (), "C").item()


def _encode(text: Any, how: Any) -> bytes:
    """How bytes are written in pickles of protocol 2."""
    if not isinstance(text, str) or how not in ("latin1", "latin-1"):
        raise _Refused("an encoding")
    return text.encode("latin-1")


def _call_of_class(*_: Any) -> Any:
    raise _Refused("a class that is called")


CALLS: dict[str, Any] = {
    "reconstruct": lambda kind, *_: _Array(),
    "dtype": lambda code, *_: _Dtype(str(code)),
    "scalar": _scalar,
    "frombuffer": _array,
    "encode": _encode,
    "ndarray": _call_of_class,
}
STEPS: dict[str, Any] = {
    "STACK_GLOBAL": _stack_global,
    "REDUCE": _reduce,
    "BUILD": _build,
    "TUPLE1": _tuple(1), "TUPLE2": _tuple(2), "TUPLE3": _tuple(3),
    "TUPLE": lambda machine: machine.stack.append(tuple(machine.since_mark())),
    "LIST": lambda machine: machine.stack.append(machine.since_mark()),
    "DICT": _dict_of,
    "APPEND": lambda machine: _append(machine, machine.pop(1)),
    "APPENDS": lambda machine: _append(machine, machine.since_mark()),
    "SETITEM": lambda machine: _set(machine, machine.pop(2)),
    "SETITEMS": lambda machine: _set(machine, machine.since_mark()),
    "POP": lambda machine: machine.pop(1),
}  # fmt: skip


def _plain(value: Any, depth: int, done: dict[int, Any]) -> Any:
    """The value, once nothing but plain ones is found in it; `done` by id: shared stays shared."""
    if depth > MOST_DEPTH:
        raise _Refused("values within values within values")
    if isinstance(value, _Array):
        if value.values is None:
            raise ValueError("an array without numbers")
        return value.values
    if isinstance(value, dict | list | tuple):
        if id(value) not in done:
            if isinstance(value, dict):
                found: Any = {key: _plain(item, depth + 1, done) for key, item in value.items()}
            else:
                found = type(value)(_plain(item, depth + 1, done) for item in value)
            done[id(value)] = found
        return done[id(value)]
    if value is None or isinstance(value, str | bytes | bytearray | int | float | np.ndarray):
        return value
    raise _Refused("a class or function")
