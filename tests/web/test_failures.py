"""The page where things go wrong: each fault is a sentence that can be read, or is got over."""

from __future__ import annotations

import base64
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

import viscera as vs
from viscera.cases.case import Case
from viscera.viewer import Server, export, page, serve_live
from viscera.viewer.live import live_case
from viscera.viewer.surface import surface_model

if TYPE_CHECKING:
    from tests.web.conftest import Viewer

    Look = Callable[..., Viewer]

TOP = (0.3, 0.05, 0.1)
SMALL = {"width": 390, "height": 600}
NO_WEBGL = """
const getContext = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
    return kind.startsWith("webgl") ? null : getContext.call(this, kind, ...more);
};
"""
# What lies at the middle of the page, shadow trees included.
IN_SIGHT = """() => {
    let found = document.elementFromPoint(innerWidth / 2, innerHeight / 2);
    while (found?.shadowRoot) found = found.shadowRoot.elementFromPoint(innerWidth / 2, innerHeight / 2);
    return found?.textContent ?? "";
}"""


@pytest.fixture
def tab(browser: Any, server: Server) -> Iterator[Any]:
    """A page of its own; the server's fixture skips where there is nothing to serve."""
    opened = browser.new_page(viewport=SMALL)
    yield opened
    opened.close()


def test_once_the_stepper_is_gone_no_force_is_a_settled_one(look_at: Look, server: Server, case: Case) -> None:
    with serve_live(case, "Bar", in_page=False) as running:
        viewer = look_at(running.url, viewport=SMALL)
        viewer.call("touch", TOP, (0, 0, -0.01))
        viewer.page.wait_for_function(
            "() => viscera.specimens[0].standing === 'sound' && viscera.specimens[0].size > 0"
        )
    viewer.page.get_by_text("The connection to the stepper is lost").first.wait_for()
    assert viewer.call("caption").endswith(" N, not settled.")
    assert viewer.page.evaluate("() => viscera.specimens[0].standing") == "unsettled"
    assert not viewer.page.evaluate("() => viscera.told.is_trusted")
    viewer.page.locator(".specimen.is-unsettled").wait_for()
    viewer.call("rest")
    viewer.call("touch", (0.4, 0.05, 0.05), (0, 0, -0.01))
    viewer.page.evaluate("() => viscera.touchMiddle()")
    assert viewer.state["held"] is None
    assert viewer.call("caption") == ""
    viewer.close()


def leb(number: int) -> bytes:
    """An unsigned number as WebAssembly writes it."""
    out = bytearray()
    while True:
        out.append(number & 0x7F | (0x80 if number > 0x7F else 0))
        number >>= 7
        if not number:
            return bytes(out)


def unleb(data: bytes, at: int) -> tuple[int, int]:
    """A number and where it ends."""
    value = shift = 0
    while True:
        byte = data[at]
        value |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if byte < 0x80:
            return value, at


def short_of_memory(module: bytes, pages: int) -> bytes:
    """The same WebAssembly module, whose memory grows by no more than so many pages of 64 KiB."""
    out, at = bytearray(module[:8]), 8
    while at < len(module):
        kind, start = module[at], at
        size, body = unleb(module, at + 1)
        at = body + size
        if kind != 5:
            out += module[start:at]
            continue
        assert module[body : body + 2] == b"\x01\x00"  # one memory without a limit
        least, end = unleb(module, body + 2)
        assert end == at
        limited = b"\x01\x01" + leb(least) + leb(least + pages)
        out += b"\x05" + leb(len(limited)) + limited
    return bytes(out)


def test_without_webgl_it_is_a_sentence(tab: Any, server: Server) -> None:
    tab.add_init_script(NO_WEBGL)
    tab.goto(server.url)
    tab.get_by_text("this browser offers no WebGL 2").wait_for()
    assert "switch on hardware acceleration" in tab.evaluate(IN_SIGHT)


def test_a_lost_context_comes_back(look_at: Look, server: Server) -> None:
    viewer = look_at(server.url, viewport=SMALL)
    before = viewer.colour_at(TOP)
    viewer.page.evaluate(
        """() => {
            window.context = viscera.stage.renderer.getContext().getExtension("WEBGL_lose_context");
            window.context.loseContext();
        }"""
    )
    warning = viewer.page.locator(".warning.is-shown")
    warning.wait_for()
    assert "graphics processor" in warning.inner_text()
    viewer.page.evaluate("() => window.context.restoreContext()")
    warning.wait_for(state="hidden")
    assert viewer.colour_at(TOP) == pytest.approx(before, abs=3)
    assert sum(before[:3]) > 90  # not nearly black
    viewer.close()


def test_opened_from_a_file_it_is_a_sentence(tab: Any, touch: vs.Touch, tmp_path: Path) -> None:
    export(touch, tmp_path, "Bar")
    tab.goto((tmp_path / "index.html").as_uri())
    tab.get_by_text("This page needs a web server").wait_for()
    assert "python -m http.server" in tab.evaluate("() => document.body.innerText")


def test_a_model_beyond_the_memory_is_a_sentence(tab: Any, touch: vs.Touch) -> None:
    files = page.files()
    script = files["viewer.js"].decode()
    [(start, encoded)] = re.findall(r"(data:application/wasm;base64,)([A-Za-z0-9+/=]+)", script)
    module = short_of_memory(base64.b64decode(encoded), pages=2)
    limited = script.replace(start + encoded, start + base64.b64encode(module).decode())
    model = surface_model(touch, "Bar")
    assert len(model) > 3 * 65536
    with Server({**files, "viewer.js": limited.encode(), page.MODEL: model}) as small:
        tab.goto(small.url)
        tab.get_by_text("more memory than this browser gives a page").wait_for()
        assert f"{len(model) / 1e6:.1f} MB" in tab.evaluate(IN_SIGHT)


def test_a_model_beyond_any_browser_is_not_fetched(tab: Any, server: Server) -> None:
    tab.add_init_script(
        """
        const fetched = window.fetch;
        window.fetch = async (...asked) => {
            const { body, status } = await fetched(...asked);
            return new Response(body, { status, headers: { "content-length": "5000000000" } });
        };
        """
    )
    tab.goto(server.url)
    tab.get_by_text("the model takes 5.0 GB").wait_for()


def test_a_case_beyond_the_memory_is_a_sentence(tab: Any, case: Case) -> None:
    files = page.stepping_files()
    module = short_of_memory(files["stepper.wasm"], pages=1)
    stepped = live_case(case, "Bar")
    with Server({**files, "stepper.wasm": module, page.CASE: stepped.data}) as small:
        tab.goto(small.url)
        tab.get_by_text("more memory than this browser gives a page").wait_for()


@pytest.mark.parametrize("missing", ["WebAssembly", "Worker", "WebSocket"])
def test_what_the_browser_does_not_offer_is_named(tab: Any, server: Server, case: Case, missing: str) -> None:
    tab.add_init_script(f"delete window.{missing};")
    with serve_live(case, "Bar", in_page=missing != "WebSocket") as running:
        tab.goto(running.url)
        tab.get_by_text(f"this browser offers no {missing}").wait_for()
        assert "allow it for this page, or use a newer browser" in tab.evaluate(IN_SIGHT)


def test_a_cut_stepper_is_a_sentence(tab: Any, server: Server, case: Case) -> None:
    files = page.stepping_files()
    cut = files["stepper.wasm"][:100_000]
    with Server({**files, "stepper.wasm": cut, page.CASE: live_case(case, "Bar").data}) as running:
        tab.goto(running.url)
        tab.get_by_text("stepper.wasm is cut or damaged; load this page again").wait_for()


def test_an_exported_page_without_its_script_is_a_sentence(
    tab: Any, touch: vs.Touch, tmp_path: Path, file_server: Callable[[Path], str]
) -> None:
    export(touch, tmp_path, "Bar")
    script = tmp_path / "page.js"
    whole = script.read_bytes()
    for part in (whole[:-100], b""):
        script.write_bytes(part)
        tab.goto(file_server(tmp_path))
        tab.get_by_text("This page cannot start: page.js is missing beside it, or cut.").wait_for()
        assert tab.locator(".loading").count() == 0
    script.unlink()
    tab.goto(file_server(tmp_path))
    tab.get_by_text("page.js is missing beside it, or cut. Load the page again").wait_for()
