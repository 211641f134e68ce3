"""`objectmorpher serve`: this machine, or a cluster, computes for other desks."""

from __future__ import annotations

import argparse
import math
import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

from .idle_options import refuse_idle, said_on
from .terminal import UsageError

if TYPE_CHECKING:
    from ..server.cluster import Cluster, ClusterPlan
    from ..server.front import HttpServer, RequestLimits


def add_serve(parser: argparse.ArgumentParser) -> None:
    """The options of `objectmorpher serve`."""
    from ..server.address import PORT

    parser.description = (
        "Selects, lifts, inpaints and refines for the windows of other computers (docs/serve.md)."
        " Clients need the token, which is read from --token-file or OBJECTMORPHER_TOKEN, or else"
        " created and printed."
    )
    add = parser.add_argument_group("who may ask").add_argument
    add("--host", default="127.0.0.1", metavar="H", help="default: this computer only")
    add("--port", type=int, default=PORT, metavar="P", help=f"default {PORT}; 0: any free one")
    add("--token-file", type=Path, metavar="FILE", help="holds the token; created if missing")
    add("--max-body", type=int, default=512, metavar="MB", help="largest request, default 512")
    add("--web", action="store_true",
        help="the editor itself, in a browser; computed in this process")  # fmt: skip
    add = parser.add_argument_group("who computes").add_argument
    add("--alone", action="store_true",
        help="in this process, one job at a time, without Ray")  # fmt: skip
    add("--ray", metavar="ADDRESS", help="of a running Ray cluster; default: start one here")
    add("--stages", metavar="A,B", help="of segment, lift, inpaint and refine; default all of them")
    add("--replicas", metavar="MIN[,MAX]", default="1",
        help="processes per stage, growing with the queue; default 1")  # fmt: skip
    add("--cpus", type=float, default=1.0, metavar="N", help="per process, default 1")
    add("--gpus", type=float, metavar="N",
        help="per process; default: by the memory that its networks take")  # fmt: skip
    add("--store", type=int, metavar="MB", help="memory for Ray's objects; default Ray's own")


def run_serve(options: argparse.Namespace) -> None:
    """Serves until it is interrupted or ended."""
    from ..editor.settings import STAGES
    from ..server.cluster import ClusterPlan
    from ..server.front import RequestLimits
    from ..system.logs import show_log

    if options.web:
        _run_web(options)
        return
    stages = tuple(options.stages.split(",")) if options.stages else STAGES
    unknown = [stage for stage in stages if stage not in STAGES]
    if unknown:
        raise UsageError(f"there is no stage {unknown[0]!r}; there are {', '.join(STAGES)}")
    least, most = _range(options.replicas)
    _check_address(options)
    if options.gpus is not None and not 0 <= options.gpus < math.inf:
        raise UsageError("--gpus is a number of GPUs, or a share of one")
    if options.store is not None and options.store < 1:
        raise UsageError("--store is a number of MB above zero")
    refuse_idle("serve", said_on(options, options.parser))
    token, is_new = _token(options.token_file)
    if not options.alone and find_spec("ray") is None:
        raise UsageError("Ray is not installed: `pip install 'objectmorpher[cluster]'`, or --alone")
    store = None if options.store is None else options.store << 20
    plan = ClusterPlan(options.ray, stages, least, most, options.cpus, options.gpus, store=store)
    show_log()
    limits = RequestLimits(body=options.max_body << 20)
    with _naming_address(options):
        front = _front(options, stages, token, limits, plan)
    with _served(front):  # Ray sets handlers of signals when it starts, and has done so
        _greet(front.url, token if is_new else None, options)


def _front(
    options: argparse.Namespace, stages: tuple[str, ...], token: str, limits: RequestLimits,
    plan: ClusterPlan,
) -> HttpServer | Cluster:  # fmt: skip
    """Listens, in this process or in a cluster."""
    from ..server.cluster import Cluster, Door
    from ..server.front import Front
    from ..server.running import Alone
    from ..server.table import table

    if not options.alone:
        return Cluster(plan, Door(options.host, options.port, token, limits), table())
    served = {name: row for name, row in table().items() if row.stage in stages}
    front = Front((options.host, options.port), token, Alone(stages), served, limits)
    front.start()
    return front


@contextmanager
def _naming_address(options: argparse.Namespace) -> Iterator[None]:
    """Say which address it is that nobody can listen on."""
    try:
        yield
    except OSError as error:
        at, reason = f"{options.host}:{options.port}", error.strerror or str(error)
        raise OSError(f"cannot listen on {at}: {reason}") from error


def _run_web(options: argparse.Namespace) -> None:
    """Serves the editor to browsers until it is interrupted or ended."""
    from ..server.web_editor import WebServer
    from ..system.logs import show_log

    refuse_idle("serve", said_on(options, options.parser))
    _check_address(options)
    token, is_new = _token(options.token_file)
    show_log()
    with _naming_address(options):
        server = WebServer((options.host, options.port), token, options.max_body << 20)
    server.start()
    with _served(server):
        _greet(server.url, token if is_new else None, options)
        sys.stdout.write(
            f"open {server.url}/#token={token}\n" if is_new else f"open {server.url}\n"
        )
        sys.stdout.flush()


def _check_address(options: argparse.Namespace) -> None:
    if not 0 <= options.port < 65536:
        raise UsageError(f"--port is a number from 0 to 65535, not {options.port}")
    if options.max_body < 1 or not 0 < options.cpus < math.inf:
        raise UsageError("--max-body and --cpus are numbers above zero")


@contextmanager
def _served(server: HttpServer | Cluster) -> Iterator[None]:
    """Serve until the process is asked to end, once the body has run; then close."""
    stop = threading.Event()

    def end(number: int, frame: FrameType | None) -> None:
        stop.set()

    signal.signal(signal.SIGTERM, end)
    try:
        yield
        stop.wait()
    finally:
        server.close()


def _greet(url: str, token: str | None, options: argparse.Namespace) -> None:
    from ..server.address import LOOPBACK

    lines = [f"serving on {url}"]
    if token is not None:
        where = f", kept in {options.token_file}" if options.token_file else ""
        lines.append(f"token: {token}{where}")
    if options.host not in LOOPBACK:
        lines.append("plain HTTP: whoever is on the way can read the token and the photos;"
                     " put an HTTPS proxy or an SSH tunnel before it")  # fmt: skip
    sys.stdout.write("\n".join(lines) + "\n")
    sys.stdout.flush()


def _token(path: Path | None) -> tuple[str, bool]:
    """The token, and whether it was made just now."""
    from ..server.address import VARIABLE, check_token, make_token, read_token, write_token

    if path is not None:
        if kept := read_token(path):
            return kept, False
        token = make_token()
        write_token(path, token)
        return token, True
    if given := os.environ.get(VARIABLE):
        return check_token(given), False
    return make_token(), True


def _range(text: str) -> tuple[int, int]:
    words: Sequence[str] = text.split(",")
    if not 1 <= len(words) <= 2 or not all(word.isascii() and word.isdigit() for word in words):
        raise UsageError(f"--replicas is MIN or MIN,MAX, not {text!r}")
    least, most = int(words[0]), int(words[-1])
    if not 1 <= least <= most <= 256:
        raise UsageError(f"--replicas is from 1 to 256, the smaller first, not {text!r}")
    return least, most
