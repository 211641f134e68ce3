"""The one place where onnxruntime is imported: with its telemetry off.

From 1.29 on its official builds write a device's number and a queue of events (names of models,
hardware) beneath the user's cache and send them home. The variable is read once, when the library
is loaded, and keeps both from being made; `disable_telemetry_events` comes after the first event,
and is what the builds for Windows that trace by the system listen to.
https://github.com/microsoft/onnxruntime/blob/main/docs/Privacy.md
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache
from pathlib import Path
from typing import Any

TELEMETRY_OFF = "ORT_DISABLE_TELEMETRY"
WATCH_EVERY = 0.02  # s


def open_session(network: Path | bytes, threads: int = 0, is_foreign: bool = False) -> Any:
    """An `onnxruntime.InferenceSession` of a file or of its bytes, on the CPU. Costly.

    `threads` of one run; 0: one a core. Of a foreign file, warnings go unsaid. Raises
    onnxruntime's own kinds of exception.
    """
    onnxruntime = _runtime()
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    if is_foreign:
        options.log_severity_level = 3
    model = network if isinstance(network, bytes) else str(network)
    return onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])


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
