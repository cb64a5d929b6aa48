"""The viewer's server: who is answered, who is not, and that nothing a stranger sends disturbs it."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from websockets.sync.server import ServerConnection

import viscera as vs
from viscera.viewer import Server, export, page, serve
from viscera.viewer.server import FAREWELL, MOST_CONNECTIONS

FILES = {"index.html": b"<p>an organ</p>", "viewer.js": b"let organ", "organ.viscera": b"\0\1\2"}


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with Server(FILES) as running:
        yield running


def get(url: str, **headers: str) -> tuple[int, bytes]:
    request = urllib.request.Request(url, headers={name.replace("_", "-"): value for name, value in headers.items()})
    try:
        with urllib.request.urlopen(request, timeout=10) as response:
            return response.status, response.read()
    except urllib.error.HTTPError as error:
        return error.code, error.read()


def send(server: Server, data: bytes, *, hangs_up: bool = False) -> bytes:
    """The answer to raw bytes; empty where the server hangs up, or where the stranger does so first."""
    with socket.create_connection(("127.0.0.1", server.port), timeout=10) as stranger:
        stranger.sendall(data)
        if hangs_up:
            stranger.shutdown(socket.SHUT_WR)
        parts = []
        try:
            while part := stranger.recv(65536):
                parts.append(part)
        except ConnectionResetError:
            pass
        return b"".join(parts)


def test_its_own_page_is_served(server: Server) -> None:
    for path, content in {"": FILES["index.html"], **FILES, "viewer.js?v=1": FILES["viewer.js"]}.items():
        assert get(server.url + path) == (200, content)


def test_an_address_without_its_last_stroke_leads_to_the_page(server: Server) -> None:
    """Else a browser would look for the files of the page beside its folder, and show nothing."""
    folder = urllib.parse.urlsplit(server.url).path
    for query in ("", "?gpu=never"):
        lines = f"GET {folder[:-1]}{query} HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n\r\n"
        answer = send(server, lines.encode()).decode()
        assert " 301 " in answer.splitlines()[0]
        assert f"\r\nLocation: {folder}{query}\r\n" in answer
    with urllib.request.urlopen(server.url[:-1], timeout=10) as response:
        assert (response.url, response.read()) == (server.url, FILES["index.html"])


def test_headers_keep_the_page_to_itself(server: Server) -> None:
    with urllib.request.urlopen(server.url, timeout=10) as response:
        headers = response.headers
    assert headers["Content-Type"] == "text/html; charset=utf-8"
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert headers["Referrer-Policy"] == "no-referrer"
    assert "default-src 'none'" in headers["Content-Security-Policy"]


@pytest.mark.parametrize(
    "host",
    ["evil.example", "evil.example:{port}", "", "localhost.evil.example", "127.0.0.1:", "x@localhost:1"],
)
def test_another_host_is_refused(server: Server, host: str) -> None:
    """A name that an attacker lets point to this machine does not reach the page."""
    assert get(server.url, Host=host.format(port=server.port))[0] == 421


@pytest.mark.parametrize("host", ["localhost:{port}", "localhost:8080", "LocalHost", "127.0.0.1:1", "[::1]:2222"])
def test_a_forwarded_port_reaches_the_page(server: Server, host: str) -> None:
    """Through a tunnel the page has another port, perhaps another name; the token is still asked for."""
    named = host.format(port=server.port)
    assert get(server.url, Host=named, Origin=f"http://{named}") == (200, FILES["index.html"])
    assert get(f"http://127.0.0.1:{server.port}/", Host=named)[0] == 403


def test_two_hosts_are_refused(server: Server) -> None:
    path = server.url.partition(f":{server.port}")[2]
    lines = f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\nHost: evil.example\r\n\r\n"
    assert b" 421 " in send(server, lines.encode()).split(b"\r\n")[0]


@pytest.mark.parametrize(
    "origin",
    [
        "https://evil.example",
        "null",
        "http://127.0.0.1:1",
        "https://127.0.0.1:{port}",
        "127.0.0.1:{port}",
        "",
        "http://",
    ],
)
def test_another_origin_is_refused(server: Server, origin: str) -> None:
    assert get(server.url, Origin=origin.format(port=server.port))[0] == 403


def test_its_own_origin_is_not(server: Server) -> None:
    assert get(server.url, Origin=f"http://127.0.0.1:{server.port}")[0] == 200


@pytest.mark.parametrize("path", ["", "index.html", "x/index.html", "{token}", "{token}x/", "%00/", "é/"])
def test_nothing_without_the_token(server: Server, path: str) -> None:
    token = server.url.rstrip("/").rpartition("/")[2]
    expected = 200 if path == "{token}" else 403
    wrong = path.format(token=token)
    base = f"http://127.0.0.1:{server.port}/"
    assert get(base + urllib.parse.quote(wrong, safe="/%"))[0] == expected


@pytest.mark.parametrize(
    "name", ["../pyproject.toml", "..%2f..%2fetc/passwd", "/etc/passwd", "static/viewer.js", "%2e%2e/"]
)
def test_no_other_file(server: Server, name: str) -> None:
    status, body = get(server.url + name)
    assert status == 404
    assert body == b"no such file\n"


def test_it_listens_on_this_machine_alone(server: Server) -> None:
    assert server.url.startswith("http://127.0.0.1:")
    assert server._server.socket.getsockname()[0] == "127.0.0.1"


@given(st.binary(max_size=300))
def test_noise_does_not_disturb_it(server: Server, noise: bytes) -> None:
    answer = send(server, noise + b"\r\n\r\n", hangs_up=True)
    assert b" 200 " not in answer.split(b"\r\n")[0]
    assert get(server.url)[0] == 200


@pytest.mark.parametrize(
    "request_line",
    [
        "POST {path} HTTP/1.1",
        "GET {path} HTTP/9.9",
        "GET {path}" + "x" * 20_000 + " HTTP/1.1",
        "GET http://evil.example{path} HTTP/1.1",
    ],
)
def test_odd_requests_are_refused(server: Server, request_line: str) -> None:
    path = server.url.partition(f":{server.port}")[2]
    lines = request_line.format(path=path) + f"\r\nHost: 127.0.0.1:{server.port}\r\n\r\n"
    assert b" 200 " not in send(server, lines.encode()).split(b"\r\n")[0]
    assert get(server.url)[0] == 200


def test_a_web_socket_is_refused(server: Server) -> None:
    path = server.url.partition(f":{server.port}")[2]
    lines = (
        f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
    )
    assert b" 101 " not in send(server, lines.encode()).split(b"\r\n")[0]


def test_a_stranger_who_says_nothing_blocks_nobody(server: Server) -> None:
    with socket.create_connection(("127.0.0.1", server.port)):
        assert get(server.url)[0] == 200


def test_a_page_that_reads_slowly_gets_all_of_a_file() -> None:
    large = bytes(20_000_000)  # more than the system's buffers hold
    with Server({"large.wasm": large}) as serving:
        path = urllib.parse.urlsplit(serving.url).path
        with socket.create_connection(("127.0.0.1", serving.port), timeout=20) as slow:
            slow.sendall(f"GET {path}large.wasm HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode())
            received = len(slow.recv(65536))
            time.sleep(4 * FAREWELL)
            while part := slow.recv(1 << 20):
                received += len(part)
    assert received > len(large)


def crowd(server: Server, count: int) -> list[socket.socket]:
    """So many strangers who connect and say nothing."""
    return [socket.create_connection(("127.0.0.1", server.port), timeout=10) for _ in range(count)]


def test_a_crowd_takes_few_threads_and_blocks_nobody() -> None:
    """The silent make room for whoever speaks, newcomers for what is open."""
    before = threading.active_count()
    with Server(FILES) as busy:
        strangers = crowd(busy, 300)
        assert get(busy.url)[0] == 200
        assert threading.active_count() - before <= 4 * MOST_CONNECTIONS
        for stranger in strangers:
            stranger.close()


def listen_for_ever(connection: ServerConnection) -> None:
    for _ in connection:
        pass


@pytest.mark.parametrize("strangers", [0, 20])
def test_closing_waits_for_nobody(strangers: int) -> None:
    """Neither a stranger who says nothing nor a page that does not answer the farewell holds it up for seconds."""
    with Server(FILES, live=listen_for_ever) as short:
        silent = crowd(short, strangers)
        path = short.url.partition(f":{short.port}")[2]
        page = socket.create_connection(("127.0.0.1", short.port), timeout=10)
        page.sendall(
            f"GET {path}live HTTP/1.1\r\nHost: 127.0.0.1:{short.port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Origin: http://127.0.0.1:{short.port}\r\n"
            "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
        )
        assert b" 101 " in page.recv(1000)
        began = time.perf_counter()
    assert time.perf_counter() - began < 5.0  # 10 s and more where it waits for them
    for stranger in (*silent, page):
        stranger.close()


def test_a_port_that_is_taken_is_a_sentence(server: Server) -> None:
    with pytest.raises(vs.VisceraError, match="choose another with --port"):
        Server(FILES, port=server.port)


@pytest.mark.parametrize("port", ["8000", 80.5, True, None, 99999, -1])
def test_what_is_no_port_is_a_sentence(port: Any) -> None:
    with pytest.raises(vs.VisceraError, match="port must be a whole number from 0 to 65535, got"):
        Server(FILES, port=port)


def test_what_was_never_run_closes_at_once() -> None:
    idle = Server(FILES)
    closing = threading.Thread(target=idle.close, daemon=True)
    closing.start()
    closing.join(timeout=10)
    assert not closing.is_alive()  # it waited for the end of what had never begun
    idle.close()
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.1", idle.port), timeout=2)
    with pytest.raises(vs.VisceraError, match="this server has been closed; make another one"):
        idle.run()
    with pytest.raises(vs.VisceraError, match="has been closed"), idle:
        pass


def test_only_a_model_has_the_page_of_a_model(bar: vs.Mesh, built: None, tmp_path: Path) -> None:
    organ: Any = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    sentence = r"must be a reduced model, such as organ.reduce\(...\), got Organ"
    with pytest.raises(vs.VisceraError, match=sentence):
        serve(organ)
    with pytest.raises(vs.VisceraError, match=sentence):
        export(organ, tmp_path / "site")


def test_closing_ends_every_thread() -> None:
    before = threading.active_count()
    with Server(FILES) as short:
        get(short.url)
    for thread in threading.enumerate():
        if thread is not threading.main_thread() and thread.name != "MainThread":
            thread.join(timeout=0.2)
    assert threading.active_count() <= before + 1
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.1", short.port), timeout=2)


@pytest.fixture(scope="module")
def model(bar: vs.Mesh, tmp_path_factory: pytest.TempPathFactory) -> Path:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    path = tmp_path_factory.mktemp("view") / "my_bar.viscera"
    organ.reduce(lambda x: (x[:, 2] == 0.1) & (x[:, 0] > 0.15), radius=0.07, depth=0.02, order=2).save(path)
    return path


@pytest.fixture
def built() -> None:
    try:
        page.files()
    except vs.VisceraError as error:
        pytest.skip(str(error))


def test_ctrl_c_closes_the_viewer(model: Path, built: None) -> None:
    words = [sys.executable, "-m", "viscera", "view", str(model), "--no-browser"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as viewer:
        assert viewer.stdout is not None
        url = viewer.stdout.readline().strip()
        assert get(url)[0] == 200
        viewer.send_signal(signal.SIGINT)
        out, errors = viewer.communicate(timeout=20)
    assert (viewer.returncode, errors) == (0, "")
    assert "the viewer is closed" in out


def test_a_browser_in_the_terminal_gets_the_page(model: Path, built: None, tmp_path: Path) -> None:
    """Such a browser returns when it is left, and the page was served only then."""
    browser, seen, left = (tmp_path / name for name in ("browser", "seen", "left"))
    browser.write_text(
        f"#!{sys.executable}\n"
        "import pathlib, sys, time, urllib.request\n"
        "status = urllib.request.urlopen(sys.argv[1], timeout=20).status\n"
        f"pathlib.Path({str(seen)!r}).write_text(str(status))\n"
        f"while not pathlib.Path({str(left)!r}).exists():\n"
        "    time.sleep(0.05)\n"
    )
    browser.chmod(0o755)
    words = [sys.executable, "-m", "viscera", "view", str(model)]
    with subprocess.Popen(words, stdout=subprocess.DEVNULL, env=os.environ | {"BROWSER": str(browser)}) as viewer:
        latest = time.monotonic() + 40
        while not seen.exists() and time.monotonic() < latest:
            time.sleep(0.05)
        viewer.send_signal(signal.SIGINT)
        code = viewer.wait(timeout=20)
        left.touch()
    assert (seen.read_text(), code) == ("200", 0)


def test_the_page_is_served_with_its_model(model: Path, built: None) -> None:
    from viscera.viewer import serve

    touch = vs.load(model)
    with serve(touch, "My bar") as running:
        status, data = get(running.url + page.MODEL)
        assert status == 200
        assert b"<script" in get(running.url)[1]
    shown = vs.reduced.touch.load_bytes(data)
    assert shown.metadata["user"]["name"] == "My bar"
