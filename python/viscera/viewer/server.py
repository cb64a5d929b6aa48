"""The page on this machine alone: a server on 127.0.0.1 that knows a handful of files and a secret.

It is no file server: what it may answer lies in memory, under a path that begins with a random token. Requests that
name another host or come from another origin are refused, so that no page of the web can reach it, by rebinding a name
or otherwise.
"""

from __future__ import annotations

import hmac
import logging
import secrets
from collections.abc import Callable, Mapping
from http import HTTPStatus
from threading import Thread
from types import TracebackType

from websockets.datastructures import Headers
from websockets.http11 import Request, Response
from websockets.sync.server import ServerConnection
from websockets.sync.server import serve as listen

from viscera.case import Case
from viscera.errors import VisceraError
from viscera.touch import Touch
from viscera.viewer import page
from viscera.viewer.live import converse, live_case
from viscera.viewer.surface import surface_model

HOST = "127.0.0.1"
LONGEST_REQUEST = 4096
"""Of a page over its web socket [bytes]."""
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
        """Listen on a port, 0 for any that is free; raises `VisceraError` where it is taken.

        live: what talks with a page over a web socket, at the path `live`; no socket is opened without it.
        """
        self._files = dict(files)
        self._is_live = live is not None
        self._token = secrets.token_urlsafe(18)
        try:
            self._server = listen(
                live or _hang_up,
                HOST,
                port,
                process_request=self._answer,
                logger=_silent,
                open_timeout=10,
                max_size=LONGEST_REQUEST,
            )
        except (OSError, OverflowError) as error:
            raise VisceraError(f"port {port} of {HOST} cannot be used: {error}; choose another with --port") from error
        self.port: int = self._server.socket.getsockname()[1]
        self._hosts = {f"{name}:{self.port}" for name in (HOST, "localhost")}

    @property
    def url(self) -> str:
        """Address of the page, its secret included."""
        return f"http://{HOST}:{self.port}/{self._token}/"

    def run(self) -> None:
        """Serve until `close` or Ctrl-C."""
        try:
            self._server.serve_forever()
        finally:
            self.close()

    def close(self) -> None:
        """Stop listening; connections that are open are closed."""
        self._server.shutdown()

    def __enter__(self) -> Server:
        Thread(target=self._server.serve_forever, daemon=True).start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        hosts, origins = request.headers.get_all("Host"), request.headers.get_all("Origin")
        if len(hosts) != 1 or hosts[0] not in self._hosts:
            return _response(HTTPStatus.MISDIRECTED_REQUEST, b"this server answers to 127.0.0.1 alone\n")
        if any(origin.removeprefix("http://") not in self._hosts for origin in origins):
            return _response(HTTPStatus.FORBIDDEN, b"another origin\n")
        # Older versions of the library refuse every other method themselves.
        if getattr(request, "method", "GET") != "GET":
            return _response(HTTPStatus.METHOD_NOT_ALLOWED, b"only GET\n")
        token, _, name = request.path.partition("?")[0].removeprefix("/").partition("/")
        if not hmac.compare_digest(token.encode(errors="replace"), self._token.encode()):
            return _response(HTTPStatus.FORBIDDEN, b"open the address that viscera view printed\n")
        if self._is_live and name == "live":
            # A browser always names its origin here; what does not is no page of ours.
            return None if origins else _response(HTTPStatus.FORBIDDEN, b"no origin\n")
        name = name or "index.html"
        if name not in self._files:
            return _response(HTTPStatus.NOT_FOUND, b"no such file\n")
        return _response(HTTPStatus.OK, self._files[name], page.content_type(name))


def _hang_up(connection: ServerConnection) -> None:
    """Without anything to talk to no socket is opened: every request has been answered before."""
    connection.close()


def _response(status: HTTPStatus, body: bytes, content_type: str = "text/plain; charset=utf-8") -> Response:
    headers = Headers(
        {**HEADERS, "Content-Type": content_type, "Content-Length": str(len(body)), "Connection": "close"}
    )
    return Response(status.value, status.phrase, headers, body)


def serve_live(case: Case, name: str = "Organ", port: int = 0, *, in_page: bool | None = None) -> Server:
    """A server with the page on which a case is stepped in real time.

    in_page: whether the page steps it, or this machine; by default the page where the organ is small enough.
    """
    live = live_case(case, name)
    if live.fits_a_page if in_page is None else in_page:
        return Server({**page.stepping_files(), page.CASE: live.data}, port)
    return Server(page.live_files(), port, converse(live))


def serve(touch: Touch, name: str = "Organ", port: int = 0) -> Server:
    """A server with the page of a model; nothing is served before it is run or entered."""
    return Server({**page.files(), page.MODEL: surface_model(touch, name)}, port)
