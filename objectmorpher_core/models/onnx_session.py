"""The one place where onnxruntime is imported: with its telemetry off, on the best device.

From 1.29 on its official builds write a device's number and a queue of events (names of models,
hardware) beneath the user's cache and send them home. The variable is read once, when the library
is loaded, and keeps both from being made; `disable_telemetry_events` comes after the first event,
and is what the builds for Windows that trace by the system listen to.
https://github.com/microsoft/onnxruntime/blob/main/docs/Privacy.md
"""

from __future__ import annotations

import hashlib
import logging
import os
from collections import OrderedDict
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import cache
from pathlib import Path
from threading import Lock
from typing import Any, Generic, TypeVar

import numpy as np

from .device import DEVICE

log = logging.getLogger(__name__)

# Gives an ONNX file other inputs and outputs, without the `onnx` package.
#
# A file is one protobuf message: ModelProto.graph is field 7, and GraphProto's node, initializer,
# input, output and value_info are fields 1, 5, 11, 12 and 13 (onnx.proto3, IR version 3 and later).
# onnxruntime infers the shapes anew, but computes every node of a graph whatever is asked of it: we
# leave out the nodes and weights that the outputs do not need, and copy everything else as it is.

GRAPH, NODE, INITIALIZER, INPUT, OUTPUT, VALUE_INFO = 7, 1, 5, 11, 12, 13  # field numbers
TENSOR_NAME = 8  # of an initializer
NODE_INPUT, NODE_OUTPUT = 1, 2  # of a node
VARINT, EIGHT_BYTES, BYTES, FOUR_BYTES = 0, 1, 2, 5  # wire types
FLOAT = b"\x08\x01"  # TypeProto.Tensor.elem_type = FLOAT


def with_interface(model: bytes, images: str, *outputs: str) -> bytes:
    """`model` with the one input `images`, (n, c, h, w) of any size, and the `outputs`.

    `images` is the name of the model's input, `outputs` are those of any tensors inside: float32.
    What they do not need is left out.
    """
    sizes = b"".join(bytes_field(1, bytes_field(2, axis)) for axis in (b"n", b"c", b"h", b"w"))
    tensor = bytes_field(1, FLOAT + bytes_field(2, sizes))
    view = memoryview(model)
    parts: list[bytes | memoryview] = []
    for number, start, payload, end in _fields(view):
        if number != GRAPH:
            parts.append(view[start:end])
            continue
        body = _needed(view[payload:end], outputs)
        body.append(bytes_field(INPUT, bytes_field(1, images.encode()) + bytes_field(2, tensor)))
        body += [bytes_field(OUTPUT, bytes_field(1, name.encode())) for name in outputs]
        parts += [_head(GRAPH, sum(map(len, body))), *body]
    return b"".join(parts)  # the weights are copied here, once


def _needed(graph: memoryview, outputs: tuple[str, ...]) -> list[bytes | memoryview]:
    """The fields of a graph without its interface, and without what the `outputs` do not need."""
    fields = [f for f in _fields(graph) if f[0] not in (INPUT, OUTPUT, VALUE_INFO)]
    wanted = {name.encode() for name in outputs}
    kept: set[int] = set()
    for number, start, payload, end in reversed(fields):  # nodes stand after those they need
        if number != NODE:
            continue
        node = graph[payload:end]
        if wanted & _texts(node, NODE_OUTPUT):
            kept.add(start)
            wanted |= _texts(node, NODE_INPUT)
    return [
        graph[start:end]
        for number, start, payload, end in fields
        if (number != NODE or start in kept)
        and (number != INITIALIZER or wanted & _texts(graph[payload:end], TENSOR_NAME))
    ]


def _texts(message: memoryview, wanted: int) -> set[bytes]:
    """The texts of the field `wanted` of a message."""
    return {bytes(message[a:b]) for number, _, a, b in _fields(message) if number == wanted}


def _fields(message: memoryview) -> Iterator[tuple[int, int, int, int]]:
    """(field number, start, start of its payload, end) of every field of a message."""
    at = 0
    while at < len(message):
        start = at
        key, at = _varint(message, at)
        payload = at
        if key & 7 == VARINT:
            _, at = _varint(message, at)
        elif key & 7 == BYTES:
            size, payload = _varint(message, at)
            at = payload + size
        elif key & 7 in (EIGHT_BYTES, FOUR_BYTES):
            at += 8 if key & 7 == EIGHT_BYTES else 4
        else:
            raise ValueError(f"not an ONNX file: wire type {key & 7} at byte {start}")
        yield key >> 3, start, payload, at


def _varint(message: memoryview, at: int) -> tuple[int, int]:
    """A number in base 128, low digits first, and where it ends."""
    value = shift = 0
    while True:
        digit = message[at]
        at += 1
        value |= (digit & 127) << shift
        shift += 7
        if digit < 128:
            return value, at


def bytes_field(number: int, payload: bytes) -> bytes:
    """A field of bytes, text or another message."""
    return _head(number, len(payload)) + payload


def _head(number: int, size: int) -> bytes:
    """What stands before so many bytes of a field."""
    return as_varint(number << 3 | BYTES) + as_varint(size)


def as_varint(value: int) -> bytes:
    """A number that is not negative."""
    digits = bytearray()
    while True:
        value, digit = value >> 7, value & 127
        digits.append(digit | (128 if value else 0))
        if not value:
            return bytes(digits)


TELEMETRY_OFF = "ORT_DISABLE_TELEMETRY"
WATCH_EVERY = 0.02  # s


def open_session(network: Path | bytes, threads: int = 0, is_foreign: bool = False) -> Any:
    """An `onnxruntime.InferenceSession` of a file or of its bytes, or a stand-in. Costly.

    It runs on the GPU where the installed onnxruntime can use one, and otherwise on the CPU, with
    `threads` of one run; 0: one a core. Of a foreign file, warnings go unsaid. Raises
    onnxruntime's own kinds of exception.
    """
    onnxruntime = _runtime()

    def opened(provider: str, how: dict[str, str]) -> Any:
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        # A thread that waits leaves its core to whoever computes beside it: a photo takes a tenth
        # less time, and less of the processor.
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        if is_foreign or provider != CPU:
            options.log_severity_level = 3
        if provider == "DmlExecutionProvider":
            options.enable_mem_pattern = False  # which it cannot have
        providers = [(provider, how), (CPU, {})] if provider != CPU else [CPU]
        model = network if isinstance(network, bytes) else str(network)
        return onnxruntime.InferenceSession(model, options, providers=providers, enable_fallback=0)

    provider = chosen_provider(onnxruntime.get_available_providers())
    if provider == CPU:
        return opened(CPU, {})
    return _OnGpu(provider, lambda name: opened(name, PROVIDERS.get(name, {})))


CPU = "CPUExecutionProvider"
# Those of GPUs, the quickest first, with what keeps their numbers like the CPU's.
PROVIDERS = {
    "CUDAExecutionProvider": {"use_tf32": "0"},
    "DmlExecutionProvider": {},
    "CoreMLExecutionProvider": {"ModelFormat": "MLProgram", "MLComputeUnits": "CPUAndGPU"},
}
_useless: set[str] = set()  # providers that have failed in this process


def chosen_provider(available: list[str]) -> str:
    """What a network runs on, of onnxruntime's providers that are `available`.

    The CPU where the environment asks for it, as it does for PyTorch.
    """
    if os.environ.get(DEVICE) == "cpu":
        return CPU
    usable = (p for p in PROVIDERS if p in available and p not in _useless)
    return next(usable, CPU)


class _OnGpu:
    """A session that goes on on the CPU where the GPU fails: its driver is missing, it is full."""

    def __init__(self, provider: str, opened: Callable[[str], Any]) -> None:
        self._provider, self._opened = provider, opened
        try:
            self._session = opened(provider)
        except Exception as error:
            self._give_up(error)

    def run(self, outputs: list[str] | None, inputs: dict[str, Any], options: Any = None) -> Any:
        """As onnxruntime's; what was ended on purpose is not tried again."""
        try:
            return self._session.run(outputs, inputs, options)
        except Exception as error:
            if self._provider == CPU or (options is not None and options.terminate):
                raise
            self._give_up(error)
            return self._session.run(outputs, inputs, options)

    def _give_up(self, error: Exception) -> None:
        if self._provider not in _useless:
            log.info("Networks run on the CPU: %s failed: %s", self._provider, error)
        _useless.add(self._provider)
        self._provider = CPU
        self._session = self._opened(CPU)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._session, name)


def run_session(
    session: Any, outputs: list[str], inputs: dict[str, Any], watch: Callable[[], None]
) -> list[Any]:
    """The outputs (names) of one run. `watch` is called again and again meanwhile.

    What it raises is raised, and the run is over within one step of the network.
    """
    options = _runtime().RunOptions()
    running = _runner().submit(session.run, outputs, inputs, options)
    try:
        while not wait((running,), WATCH_EVERY).done:
            watch()
    except BaseException:
        options.terminate = True
        wait((running,))
        raise
    return running.result()


@cache
def _runner() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(thread_name_prefix="network")


def _runtime() -> Any:
    """The module. A user's own setting of the variable is replaced: we promise to all."""
    os.environ[TELEMETRY_OFF] = "1"
    import onnxruntime

    onnxruntime.disable_telemetry_events()
    return onnxruntime


# Answers of networks about pictures: begun before they are asked for, and kept for the next time.
#
# They are begun while modules are imported. Of the same photo they are asked for again by the next
# edit of a batch, by a photo that is opened twice, or where a fill is computed anew.

Answer = np.ndarray[Any, np.dtype[np.float32]]


class EarlyAnswers:
    """The last answers about pictures, and those that were begun; no picture is held on to."""

    def __init__(self, kept: int) -> None:
        """So many of them are `kept`."""
        self._kept, self._lock = kept, Lock()
        self._known: dict[bytes, Future[Answer]] = {}  # by the picture's digest, the oldest first

    def expect(self, picture: np.ndarray, compute: Callable[[], Answer]) -> Callable[[], None]:
        """From now on who asks about the picture waits until what is returned has been called."""
        begun: Future[Answer] = Future()
        self._keep(_digest(picture), begun)

        def run() -> None:
            try:
                begun.set_result(compute())
            except BaseException as error:
                begun.set_exception(error)

        return run

    def answer(
        self, picture: np.ndarray, compute: Callable[[], Answer], watch: Callable[[], None]
    ) -> Answer:
        """What is known or begun, or else what `compute` gives; the array is the caller's own.

        `watch` is called while one waits, at least once, and may end that by raising. What was
        begun and failed is computed anew, which tells whoever wants it the reason.
        """
        watch()
        key = _digest(picture)
        with self._lock:
            known = self._known.get(key)
        if known is not None:
            while not wait((known,), WATCH_EVERY).done:
                watch()
        if known is None or known.exception():
            known = Future()
            known.set_result(compute())
        self._keep(key, known)
        return known.result().copy()

    def _keep(self, key: bytes, answer: Future[Answer]) -> None:
        """It is the newest; the oldest one goes."""
        with self._lock:
            self._known.pop(key, None)
            self._known[key] = answer
            if len(self._known) > self._kept:
                del self._known[next(iter(self._known))]


def _digest(picture: np.ndarray) -> bytes:
    return hashlib.sha256(repr(picture.shape).encode() + picture.tobytes()).digest()


# The last looks of a network: to lift the same thing with another thickness needs no new one.

Look = TypeVar("Look")


class Looks(Generic[Look]):
    """What was seen last. It is known by the digest of the pixels, so no photo is held on to."""

    def __init__(self, kept: int = 1) -> None:
        self._lock, self._kept = Lock(), kept
        self._answers: OrderedDict[bytes, Look] = OrderedDict()

    def get(self, look: Callable[[], Look], *seen: np.ndarray, about: str = "") -> Look:
        """Return the answer to what is `seen` and to `about`; `look` gives one that is new."""
        known = hashlib.sha256(f"{about} {[part.shape for part in seen]}".encode())
        for part in seen:
            known.update(np.ascontiguousarray(part).data)
        digest = known.digest()
        with self._lock:
            if digest not in self._answers:
                self._answers[digest] = look()
            while len(self._answers) > self._kept:
                self._answers.popitem(last=False)
            return self._answers[digest]
