"""Exported pages on servers of other kinds, and of small organs."""

from __future__ import annotations

import functools
import gzip
from collections.abc import Callable
from http.server import ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.web.conftest import Quiet

import viscera as vs
from viscera.viewer import Server, export

if TYPE_CHECKING:
    from tests.web.conftest import Viewer


class Compressing(Quiet):
    """Compresses on its way, so that nobody knows how much there will be."""

    protocol_version = "HTTP/1.1"

    def do_GET(self) -> None:
        path = Path(self.translate_path(self.path.split("?")[0]))
        path = path / "index.html" if path.is_dir() else path
        if not path.exists():
            self.send_error(404)
            return
        self.send_response(200)
        self.send_header("Content-Type", self.guess_type(path))
        self.send_header("Content-Encoding", "gzip")
        self.send_header("Transfer-Encoding", "chunked")
        self.end_headers()
        packed = gzip.compress(path.read_bytes(), 1)
        for start in range(0, len(packed), 65_536):
            part = packed[start : start + 65_536]
            self.wfile.write(b"%x\r\n%b\r\n" % (len(part), part))
        self.wfile.write(b"0\r\n\r\n")


def test_a_server_that_compresses(
    server: Server, touch: vs.Touch, look_at: Callable[..., Viewer], tmp_path: Path
) -> None:
    export(touch, tmp_path / "site", "Bar")
    handler = functools.partial(Compressing, directory=str(tmp_path / "site"))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as served:
        Thread(target=served.serve_forever, daemon=True).start()
        viewer = look_at(f"http://127.0.0.1:{served.server_address[1]}/")
        viewer.call("touch", (0.3, 0.05, 0.1), (0.0, 0.0, -0.01))
        expected = touch((0.3, 0.05, 0.1), (0.0, 0.0, -0.01)).force
        assert viewer.state["force"] == pytest.approx(expected.tolist(), rel=1e-5, abs=1e-6)
        assert viewer.complaints == []
        viewer.close()
        served.shutdown()


def test_a_small_organ_has_small_numbers(
    server: Server,
    bar: vs.Mesh,
    look_at: Callable[..., Viewer],
    file_server: Callable[[Path], str],
    tmp_path: Path,
) -> None:
    """A bar 8 mm long and as soft as brain, on a spring: no length is rounded to another, no force to none."""
    mesh = vs.mesh(0.02 * bar.points, bar.cells, bar.sets)
    held = vs.ElasticSupport("tip", 1e3)
    organ = vs.Organ(mesh, vs.NeoHookean(young=1e3, poisson=0.45), fixed="root", supports=[held])
    touch = organ.reduce(lambda x: x[:, 0] > 0.002, radius=0.0014, depth=0.00025, order=3)
    export(touch, tmp_path / "site", "Small")
    viewer = look_at(file_server(tmp_path / "site"))
    assert "up to 0.25 mm deep" in viewer.page.locator("header").inner_text()
    push = np.array([0.0, 0.0, -2e-6])
    viewer.call("touch", (0.006, 0.001, 0.002), push.tolist())
    expected = float(np.linalg.norm(touch((0.006, 0.001, 0.002), push).force))
    assert 1e-8 < expected < 5e-4
    shown = viewer.page.locator(".big .force").first.inner_text()
    assert float(shown) == pytest.approx(expected, rel=0.06)
    rows = viewer.page.locator(".orders tbody tr td:nth-child(2)").all_inner_texts()
    forces = [order["force"] for order in viewer.state["orders"]]
    assert [float(row) for row in rows] == pytest.approx(forces, rel=0.006)
    assert " at a depth of 0.0020 mm." in viewer.call("caption")
    assert "0.0020 mm" in viewer.page.get_by_role("region", name="readings").inner_text()
    link = viewer.call("hash")
    other = look_at(f"{viewer.page.url}#{link}")
    assert other.state["displacement"] == pytest.approx(push.tolist(), rel=1e-4)
    assert other.state["force"] == pytest.approx(viewer.state["force"], rel=1e-3)
    other.close()
    # Springs would not stiffen with the tissue.
    assert viewer.page.locator("label.stiffness").count() == 0
    viewer.call("touch", (0.006, 0.001, 0.002), [0.0, 0.0, -0.00027])
    assert "a depth of 0.27 mm exceeds the 0.25 mm" in viewer.page.locator(".warning.is-shown").inner_text()
    assert viewer.complaints == []
    viewer.close()
