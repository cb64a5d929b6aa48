"""The page, for this machine only: a server on 127.0.0.1 with a handful of files and a secret path.

It does not serve files of the disk: its answers are in memory, under a path that begins with a random token. Requests
that name another host or come from another origin are refused, so that no web page can reach it, by rebinding a name or
otherwise. This machine has several names, and a forwarded port has another number, so any port of any name is accepted.
"""

from __future__ import annotations

import contextlib
import hmac
import logging
import re
import secrets
import socket
from collections.abc import Callable, Mapping
from http import HTTPStatus
from threading import Lock, Thread
from types import TracebackType
from typing import Any

from websockets.datastructures import Headers
from websockets.http11 import Request, Response
from websockets.sync.server import ServerConnection
from websockets.sync.server import serve as listen

from viscera.cases.case import Case
from viscera.cases.scene_case import SceneCase
from viscera.errors import VisceraError
from viscera.quantity import Whole
from viscera.reduced.touch import Touch
from viscera.viewer import page
from viscera.viewer.hybrid import page_of
from viscera.viewer.live import converse, is_for_this_machine, live_case, require_for_a_page
from viscera.viewer.scene import live_scene
from viscera.viewer.surface import surface_model

HOST = "127.0.0.1"
PORT = Whole(0, 65535)
THIS_MACHINE = re.compile(r"(127\.0\.0\.1|localhost|\[::1\])(:\d{1,5})?", re.ASCII | re.IGNORECASE)
"""A `Host` that is this machine and no name of the web, with any port, since a tunnel has its own."""
LONGEST_REQUEST = 4096
"""Longest request of a page over its web socket [bytes]."""
MOST_CONNECTIONS = 32
"""Largest number of connections at once; each takes two threads, and a page with its files makes half a dozen."""
FAREWELL = 0.3
"""Wait for a page to confirm that its web socket is closed [s]."""
SLOWEST = 100e3
"""A page that takes fewer bytes of a file in a second is given up; pages far away are slow, and those that draw."""
HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self' 'unsafe-inline'; "
        "img-src 'self' blob: data:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}

# A broken request is its sender's affair; nothing of it belongs on the terminal.
_silent = logging.getLogger("viscera.viewer")
_silent.addHandler(logging.NullHandler())
_silent.propagate = False


class Server:
    """Serves files by name until it is closed; use it as a context, or call `run`."""

    def __init__(
        self, files: Mapping[str, bytes], port: int = 0, live: Callable[[ServerConnection], None] | None = None
    ) -> None:
        """Listen on a port, 0 for any that is free; raises `VisceraError` if it is taken.

        live: what talks with a page over a web socket, at the path `live`; no socket is opened without it.
        """
        self._files = dict(files)
        self._is_live = live is not None
        self._has_begun = False
        self._token = secrets.token_urlsafe(18)
        self._door = _door(port)
        self._server = listen(
            live or _hang_up,
            sock=self._door,
            process_request=self._answer,
            logger=_silent,
            open_timeout=10,
            close_timeout=FAREWELL,
            max_size=LONGEST_REQUEST,
        )
        self.port: int = self._door.getsockname()[1]

    @property
    def url(self) -> str:
        """Address of the page, its secret included."""
        return f"http://{HOST}:{self.port}/{self._token}/"

    def run(self) -> None:
        """Serve until `close` or Ctrl-C; raises `VisceraError` once it is closed."""
        self._begin()
        try:
            self._server.serve_forever()
        finally:
            self.close()

    def close(self) -> None:
        """Stop listening; connections that are open are closed."""
        self._door.turn_out(only_silent=True)
        if not self._has_begun:
            # The library waits for the end of what serves; behind a closed door that ends as soon as it begins.
            self._has_begun = True
            self._door.close()
            self._server.serve_forever()
        self._server.shutdown()
        self._door.turn_out()

    def __enter__(self) -> Server:
        self._begin()
        Thread(target=self._server.serve_forever, daemon=True).start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def _begin(self) -> None:
        if self._door.fileno() < 0:
            raise VisceraError("this server has been closed; make another one")
        self._has_begun = True

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        self._door.has_spoken(connection.socket)
        hosts, origins = request.headers.get_all("Host"), request.headers.get_all("Origin")
        if len(hosts) != 1 or not THIS_MACHINE.fullmatch(hosts[0]):
            return _response(HTTPStatus.MISDIRECTED_REQUEST, b"this server answers to 127.0.0.1 and localhost alone\n")
        if any(origin != f"http://{hosts[0]}" for origin in origins):
            return _response(HTTPStatus.FORBIDDEN, b"another origin\n")
        # Older versions of the library refuse every other method themselves.
        if getattr(request, "method", "GET") != "GET":
            return _response(HTTPStatus.METHOD_NOT_ALLOWED, b"only GET\n")
        path, mark, query = request.path.partition("?")
        token, slash, name = path.removeprefix("/").partition("/")
        if not hmac.compare_digest(token.encode(errors="replace"), self._token.encode()):
            return _response(HTTPStatus.FORBIDDEN, b"open the address that viscera view printed\n")
        if not slash:
            # From here a browser would look for the files of the page beside its folder.
            return _response(HTTPStatus.MOVED_PERMANENTLY, b"", Location=f"/{token}/{mark}{query}")
        if self._is_live and name == "live":
            # A browser always names its origin here; what does not is no page of ours.
            return None if origins else _response(HTTPStatus.FORBIDDEN, b"no origin\n")
        name = name or "index.html"
        if name not in self._files:
            return _response(HTTPStatus.NOT_FOUND, b"no such file\n")
        body = self._files[name]
        # The library counts the time that sending takes as part of the farewell.
        connection.close_timeout = FAREWELL + len(body) / SLOWEST
        return _response(HTTPStatus.OK, body, page.content_type(name))


class _Door(socket.socket):
    """The listening socket. If all places are taken, the connection that has been silent longest is closed."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._is_silent: dict[socket.socket, bool] = {}  # the guests in order of arrival
        self._is_closing = False
        self._lock = Lock()

    def accept(self) -> tuple[socket.socket, Any]:
        """The next connection; it is closed if there is no place for it."""
        guest, address = super().accept()
        with self._lock:
            self._is_silent = {other: silent for other, silent in self._is_silent.items() if other.fileno() >= 0}
            leaving = guest if self._is_closing else None
            if leaving is None and len(self._is_silent) >= MOST_CONNECTIONS:
                leaving = next((other for other, silent in self._is_silent.items() if silent), guest)
                self._is_silent.pop(leaving, None)
            if leaving is not guest:
                self._is_silent[guest] = True
        if leaving is not None:
            _part(leaving)
        return guest, address

    def has_spoken(self, guest: socket.socket) -> None:
        """Notes that a request has arrived on a connection."""
        with self._lock:
            if guest in self._is_silent:
                self._is_silent[guest] = False

    def turn_out(self, *, only_silent: bool = False) -> None:
        """Close all connections and accept no more."""
        with self._lock:
            self._is_closing = True
            leaving = [guest for guest, silent in self._is_silent.items() if silent or not only_silent]
        for guest in leaving:
            _part(guest)


def _door(port: int) -> _Door:
    """A listening socket at a port of this machine, 0 for any that is free."""
    port = PORT(port, "port")
    try:
        listening = socket.create_server((HOST, port), backlog=MOST_CONNECTIONS)
    except OSError as error:
        reason = error.strerror or error
        raise VisceraError(f"port {port} of {HOST} cannot be used: {reason}; choose another with --port") from error
    return _Door(listening.family, listening.type, listening.proto, fileno=listening.detach())


def _part(guest: socket.socket) -> None:
    """Wake the thread that reads from a connection; its connection ends here."""
    with contextlib.suppress(OSError):  # the guest went first
        guest.shutdown(socket.SHUT_RDWR)


def _hang_up(connection: ServerConnection) -> None:
    """Without anything to talk to no socket is opened: every request has been answered before."""
    connection.close()


def _response(
    status: HTTPStatus, body: bytes, content_type: str = "text/plain; charset=utf-8", **more: str
) -> Response:
    own = {"Content-Type": content_type, "Content-Length": str(len(body)), "Connection": "close"}
    headers = Headers({**HEADERS, **own, **more})
    return Response(status.value, status.phrase, headers, body)


def serve_live(case: Case | SceneCase, name: str = "Organ", port: int = 0, *, in_page: bool | None = None) -> Server:
    """A server with the page on which a case is stepped in real time.

    in_page: whether the page steps it, or this machine; by default the page, where it is built for that and the organ
        is small enough. This machine steps a scene, and an organ with elastic supports; raises `VisceraError` if the
        page should.
    """
    if in_page:
        require_for_a_page(case)
    if is_for_this_machine(case):
        files = page.live_files()  # before the work on the scene
        return Server(files, port, converse(live_scene(case, name)))
    live = live_case(case, name)
    if live.fits_a_page and page.can_step() if in_page is None else in_page:
        return Server({**page.stepping_files(), page.CASE: live.data}, port)
    return Server(page.live_files(), port, converse(live))


def serve(touch: Touch, name: str = "Organ", port: int = 0, *, is_hybrid: bool | None = None) -> Server:
    """A server with the page of a model; nothing is served before it is run or entered.

    is_hybrid: whether the page steps the organ until the model has arrived (`page_of`). It also steps it
        while two hands hold on, where it can.
    """
    return Server(page_of(touch, surface_model(touch, name), name, is_hybrid=is_hybrid, is_near=True), port)
