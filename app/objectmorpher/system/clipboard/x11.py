"""The clipboard of X11, in a process of its own, through libX11.

    python -P x11.py read            writes "image/png\\n" or "text/uri-list\\n", and the bytes
    python -P x11.py own image/png   offers standard input until another program copies something

Large contents go in pieces both ways (ICCCM 2.7.2, INCR). This file imports nothing of its
package: an installed program runs it as a script. Whatever another program sends, or does not
send, ends this process and not the window.
"""

from __future__ import annotations

import ctypes
import select
import sys
import time
from ctypes import POINTER, Structure, Union, byref, c_char_p, c_int, c_long, c_ulong, c_void_p

WANTED = (
    "image/png", "image/tiff", "image/jpeg", "image/webp", "image/avif", "image/bmp",
    "text/uri-list",
)  # fmt: skip
PATIENCE = 10.0  # s that another program has for its answer
MOST = 1 << 30  # bytes of what is read
PIECE = 1 << 18  # bytes sent at a time; a larger answer goes in pieces
SELECTION_CLEAR, SELECTION_REQUEST, SELECTION_NOTIFY, PROPERTY_NOTIFY = 29, 30, 31, 28
PROPERTY_CHANGES = 1 << 22  # event mask
NEW_VALUE, DELETED = 0, 1  # state of a property
REPLACE, ANY_TYPE, ATOM = 0, 0, 4


class SelectionRequest(Structure):
    """Another program asks for the selection."""

    _fields_ = [
        ("type", c_int), ("serial", c_ulong), ("send_event", c_int), ("display", c_void_p),
        ("owner", c_ulong), ("requestor", c_ulong), ("selection", c_ulong), ("target", c_ulong),
        ("property", c_ulong), ("time", c_ulong),
    ]  # fmt: skip


class SelectionNotify(Structure):
    """The answer to such a request."""

    _fields_ = [
        ("type", c_int), ("serial", c_ulong), ("send_event", c_int), ("display", c_void_p),
        ("requestor", c_ulong), ("selection", c_ulong), ("target", c_ulong),
        ("property", c_ulong), ("time", c_ulong),
    ]  # fmt: skip


class PropertyNotify(Structure):
    """A property of a window was set or deleted."""

    _fields_ = [
        ("type", c_int), ("serial", c_ulong), ("send_event", c_int), ("display", c_void_p),
        ("window", c_ulong), ("atom", c_ulong), ("time", c_ulong), ("state", c_int),
    ]  # fmt: skip


class XEvent(Union):
    """Xlib's XEvent."""

    _fields_ = [
        ("type", c_int), ("request", SelectionRequest), ("notify", SelectionNotify),
        ("property", PropertyNotify), ("room", c_long * 24),
    ]  # fmt: skip


OnError = ctypes.CFUNCTYPE(c_int, c_void_p, c_void_p)


@OnError
def _ignored(_display: int, _error: int) -> int:
    """A requestor whose window is gone is no reason to end."""
    return 0


class Client:
    """A connection to the X server, with an invisible window."""

    def __init__(self) -> None:
        x = self.x = ctypes.CDLL("libX11.so.6")
        for name, result, arguments in (
            ("XOpenDisplay", c_void_p, [c_char_p]),
            ("XDefaultRootWindow", c_ulong, [c_void_p]),
            ("XCreateSimpleWindow", c_ulong, [c_void_p, c_ulong, *[c_int] * 4, *[c_ulong] * 3]),
            ("XInternAtom", c_ulong, [c_void_p, c_char_p, c_int]),
            ("XSelectInput", c_int, [c_void_p, c_ulong, c_long]),
            ("XConvertSelection", c_int, [c_void_p, *[c_ulong] * 5]),
            ("XSetSelectionOwner", c_int, [c_void_p, *[c_ulong] * 3]),
            ("XGetSelectionOwner", c_ulong, [c_void_p, c_ulong]),
            ("XChangeProperty", c_int, [c_void_p, c_ulong, c_ulong, c_ulong, c_int, c_int,
                                        c_void_p, c_int]),
            ("XGetWindowProperty", c_int, [c_void_p, c_ulong, c_ulong, c_long, c_long, c_int,
                                           c_ulong, *[POINTER(c_ulong)] * 1, POINTER(c_int),
                                           *[POINTER(c_ulong)] * 2, POINTER(c_void_p)]),
            ("XSendEvent", c_int, [c_void_p, c_ulong, c_int, c_long, POINTER(XEvent)]),
            ("XNextEvent", c_int, [c_void_p, POINTER(XEvent)]),
            ("XPending", c_int, [c_void_p]), ("XFlush", c_int, [c_void_p]),
            ("XConnectionNumber", c_int, [c_void_p]), ("XFree", c_int, [c_void_p]),
            ("XGetAtomName", c_void_p, [c_void_p, c_ulong]),
            ("XDeleteProperty", c_int, [c_void_p, c_ulong, c_ulong]),
        ):  # fmt: skip
            function = getattr(x, name)
            function.restype, function.argtypes = result, arguments
        self.display = x.XOpenDisplay(None)
        if not self.display:
            raise SystemExit("there is no X display")
        x.XSetErrorHandler(_ignored)
        root = x.XDefaultRootWindow(self.display)
        self.window = x.XCreateSimpleWindow(self.display, root, 0, 0, 1, 1, 0, 0, 0)
        x.XSelectInput(self.display, self.window, PROPERTY_CHANGES)
        self.clipboard, self.targets = self.atom("CLIPBOARD"), self.atom("TARGETS")
        self.incremental, self.place = self.atom("INCR"), self.atom("OBJECTMORPHER")

    def atom(self, name: str) -> int:
        return self.x.XInternAtom(self.display, name.encode(), 0)

    def event(self, end: float = float("inf")) -> XEvent | None:
        """Return the next event, or None where none comes before the time `end`."""
        while not self.x.XPending(self.display):
            left = None if end == float("inf") else end - time.monotonic()
            if left is not None and left <= 0:
                return None
            select.select([self.x.XConnectionNumber(self.display)], [], [], left)
        event = XEvent()
        self.x.XNextEvent(self.display, byref(event))
        return event

    # Reading

    def read(self) -> tuple[str, bytes] | None:
        """Return the kind and the bytes of the best that is offered, None where nothing is."""
        offered = self._convert(self.targets)
        if offered is None:
            return None
        size = ctypes.sizeof(c_ulong)
        atoms = (c_ulong * (len(offered) // size)).from_buffer_copy(
            offered[: len(offered) // size * size]
        )
        for name in WANTED:
            if self.atom(name) in list(atoms):
                data = self._convert(self.atom(name))
                if data:
                    return name, data
        return None

    def _convert(self, target: int) -> bytes | None:
        """The selection as `target`, put together where it comes in pieces."""
        now = 0
        self.x.XConvertSelection(self.display, self.clipboard, target, self.place, self.window, now)
        end = time.monotonic() + PATIENCE
        while True:
            event = self.event(end)
            if event is None:
                return None
            if event.type == SELECTION_NOTIFY and event.notify.target == target:
                break
        if not event.notify.property:
            return None
        kind, data = self._take()
        return self._pieces() if kind == self.incremental else data

    def _pieces(self) -> bytes | None:
        parts, total = [], 0
        while True:
            event = self.event(time.monotonic() + PATIENCE)
            if event is None:
                return None
            is_new = event.type == PROPERTY_NOTIFY and event.property.state == NEW_VALUE
            if not is_new or event.property.atom != self.place:
                continue
            piece = self._take()[1]
            total += len(piece)
            if total > MOST:
                return None
            if not piece:
                return b"".join(parts)
            parts.append(piece)

    def _take(self) -> tuple[int, bytes]:
        """Type and bytes of our property, which is deleted."""
        kind, form, count, after = c_ulong(), c_int(), c_ulong(), c_ulong()
        at = c_void_p()
        self.x.XGetWindowProperty(
            self.display, self.window, self.place, 0, MOST // 4, 1, ANY_TYPE, byref(kind),
            byref(form), byref(count), byref(after), byref(at),
        )  # fmt: skip
        if not at.value:
            return kind.value, b""
        size = ctypes.sizeof(c_ulong) if form.value == 32 else form.value // 8
        data = ctypes.string_at(at.value, count.value * size)
        self.x.XFree(at)
        return kind.value, data

    # Offering

    def own(self, kind: str, data: bytes) -> None:
        """Offer `data` until another program copies something."""
        self.x.XSetSelectionOwner(self.display, self.clipboard, self.window, 0)
        if self.x.XGetSelectionOwner(self.display, self.clipboard) != self.window:
            raise SystemExit("the clipboard is not given away")
        sys.stdout.write("owned\n")
        sys.stdout.flush()
        own, waiting = self.atom(kind), {}  # bytes sent, by window and property
        while True:
            event = self.event()
            assert event is not None
            if event.type == SELECTION_CLEAR:
                return
            if event.type == SELECTION_REQUEST:
                self._answer(event.request, own, data, waiting)
            elif event.type == PROPERTY_NOTIFY and event.property.state == DELETED:
                self._go_on((event.property.window, event.property.atom), own, data, waiting)

    def _answer(
        self, request: SelectionRequest, own: int, data: bytes, waiting: dict[tuple[int, int], int]
    ) -> None:
        place = request.property or request.target  # of very old programs
        if request.target == self.targets:
            atoms = (c_ulong * 2)(self.targets, own)
            self._change(request.requestor, place, ATOM, 32, atoms, 2)
        elif request.target == own and len(data) <= PIECE:
            self._change(request.requestor, place, own, 8, data, len(data))
        elif request.target == own:
            self.x.XSelectInput(self.display, request.requestor, PROPERTY_CHANGES)
            size = (c_ulong * 1)(len(data))
            self._change(request.requestor, place, self.incremental, 32, size, 1)
            waiting[request.requestor, place] = 0
        else:
            place = 0
        event = XEvent()
        event.notify = SelectionNotify(
            SELECTION_NOTIFY, 0, 1, self.display, request.requestor, request.selection,
            request.target, place, request.time,
        )  # fmt: skip
        self.x.XSendEvent(self.display, request.requestor, 0, 0, byref(event))
        self.x.XFlush(self.display)

    def _go_on(
        self, key: tuple[int, int], own: int, data: bytes, waiting: dict[tuple[int, int], int]
    ) -> None:
        """The next piece; an empty one says that it was the last."""
        if key not in waiting:
            return
        piece = data[waiting[key] : waiting[key] + PIECE]
        self._change(*key, own, 8, piece, len(piece))
        waiting[key] += len(piece)
        if not piece:
            del waiting[key]
        self.x.XFlush(self.display)

    def _change(
        self, window: int, place: int, kind: int, form: int, data: object, count: int
    ) -> None:
        self.x.XChangeProperty(self.display, window, place, kind, form, REPLACE, data, count)


def main() -> None:
    """What the command line says."""
    client = Client()
    if sys.argv[1] == "own":
        return client.own(sys.argv[2], sys.stdin.buffer.read())
    found = client.read()
    if found is not None:
        sys.stdout.buffer.write(found[0].encode() + b"\n" + found[1])


if __name__ == "__main__":
    main()
