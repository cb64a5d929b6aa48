"""A small organ, its page on a server of this machine, and a real browser without a window.

Without Chromium or without the built page these tests are skipped, loudly; `make test-web` brings both.
"""

from __future__ import annotations

import functools
import shutil
from collections.abc import Callable, Iterator, Sequence
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

import viscera as vs
from viscera.cases.case import Case, read_case
from viscera.viewer import Server, page, serve, serve_live

BROWSERS = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
# A machine without a graphics card draws in software. Half of a page's time went into panels, shadows and smooth edges:
# the window is put together without graphics, and the organ is drawn with one sample for each two by two pixels.
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
FLAGS += ["--disable-gpu-compositing", "--webgl-antialiasing-mode=none"]
SCREEN: dict[str, Any] = {"viewport": {"width": 1100, "height": 720}, "device_scale_factor": 0.5}
CASE = """
mesh = "bar.vtu"
units = "m"
fixed = "root"
material = {law = "NeoHookean", young = 1e5, poisson = 0.45}
"""
SHOTS = Path(__file__).resolve().parents[2] / "out" / "viewer"


@pytest.fixture(scope="session")
def touch(bar: vs.Mesh) -> vs.Touch:
    """The bar, touchable but near its root, to a quarter of its thickness."""
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.45), fixed="root")
    return organ.reduce(lambda x: x[:, 0] > 0.1, radius=0.07, depth=0.025, order=4)


@pytest.fixture(scope="session")
def server(touch: vs.Touch) -> Iterator[Server]:
    try:
        page.files()
    except vs.VisceraError as error:
        pytest.skip(str(error))
    with serve(touch, "Bar") as running:
        yield running


@pytest.fixture(scope="session")
def launch() -> Iterator[Callable[..., Any]]:
    """Launches browsers without a window, with more flags than these."""
    playwright = pytest.importorskip("playwright.sync_api")
    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    if program is None:
        pytest.skip("no Chromium here; install the package chromium")
    with playwright.sync_playwright() as driver:
        running = []

        def start(*flags: str) -> Any:
            running.append(driver.chromium.launch(executable_path=program, args=[*FLAGS, *flags]))
            return running[-1]

        yield start
        for browser in running:
            browser.close()


@pytest.fixture(scope="session")
def browser(launch: Callable[..., Any]) -> Any:
    return launch()


class Quiet(SimpleHTTPRequestHandler):
    """A file server that keeps its log to itself."""

    def log_message(self, format: str, *args: Any) -> None:
        """Nothing."""


@pytest.fixture(scope="session")
def file_server() -> Iterator[Callable[[Path], str]]:
    """Offers a folder on Python's own file server, which knows nothing of Viscera; returns its address."""
    running = []

    def offer(folder: Path) -> str:
        handler = functools.partial(Quiet, directory=str(folder))
        running.append(ThreadingHTTPServer(("127.0.0.1", 0), handler))
        Thread(target=running[-1].serve_forever, daemon=True).start()
        return f"http://127.0.0.1:{running[-1].server_address[1]}/"

    yield offer
    for files in running:
        files.shutdown()
        files.server_close()


DRAWN = """(point) => {
    const { renderer, canvas } = viscera.stage;
    const { x, y } = viscera.project(point);
    const gl = renderer.getContext();
    viscera.stage.drawSharply();
    const ratio = renderer.getPixelRatio();
    const pixel = new Uint8Array(4);
    const place = [x, canvas.clientHeight - y].map((at) => Math.round(at * ratio));
    gl.readPixels(...place, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    return [...pixel];
}"""
"""The colour that is drawn at a point, with all pixels: a slow machine saves some."""


class Viewer:
    """A page with its view, and everything it complained about."""

    def __init__(self, browser: Any, url: str, scripts: Sequence[str] = (), **settings: Any) -> None:
        """Open an address with the settings of a device; scripts run before anything of the page."""
        self.page = browser.new_context(**{**SCREEN, **settings}).new_page()
        self.complaints: list[str] = []
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("console", self._listen)
        self.page.set_default_timeout(60_000)  # a busy machine draws in software for a while
        for script in scripts:
            self.page.add_init_script(script)
        self.page.goto(url)
        self.page.wait_for_function("() => window.viscera")

    def _listen(self, message: Any) -> None:
        if message.type in {"error", "warning"} and "GPU stall" not in message.text:
            self.complaints.append(message.text)

    def call(self, method: str, *arguments: object) -> Any:
        """Call a method of the page's view."""
        return self.page.evaluate("([method, args]) => window.viscera[method](...args)", [method, list(arguments)])

    @property
    def state(self) -> dict[str, Any]:
        """The state of the view in numbers."""
        found: dict[str, Any] = self.call("state")
        return found

    def wait_for(self, activity: str) -> None:
        """Wait, a minute at most, until this is what the view does."""
        for _ in range(3000):
            if self.state["activity"] == activity:
                return
            self.page.wait_for_timeout(20)
        raise AssertionError(f"the view is {self.state['activity']}, not {activity}, after a minute")

    def place(self, point: Any) -> tuple[float, float]:
        """Where a point [m] is on the screen."""
        at = self.call("project", list(map(float, point)))
        return at["x"], at["y"]

    def colour_at(self, point: Any) -> list[int]:
        """What is drawn at a point [m]: red, green, blue and opacity."""
        found: list[int] = self.page.evaluate(DRAWN, list(map(float, point)))
        return found

    def shoot(self, name: str) -> None:
        """Keep a picture."""
        SHOTS.mkdir(parents=True, exist_ok=True)
        self.page.screenshot(path=SHOTS / f"{name}.png")

    def close(self) -> None:
        self.page.context.close()


@pytest.fixture(scope="session")
def look_at(browser: Any) -> Callable[..., Viewer]:
    """Opens the view behind an address, with the settings of a device."""
    return functools.partial(Viewer, browser)


@pytest.fixture(scope="session")
def look_with_gpu(launch: Callable[..., Any]) -> Callable[..., Viewer]:
    """The same in a browser with WebGPU, in software."""
    return functools.partial(Viewer, launch("--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader"))


@pytest.fixture(scope="module")
def viewer(look_at: Callable[..., Viewer], server: Server) -> Iterator[Viewer]:
    """One page for a whole module; each test lets go at its end."""
    opened = look_at(server.url)
    yield opened
    opened.close()


@pytest.fixture(scope="module")
def case(bar: vs.Mesh, tmp_path_factory: pytest.TempPathFactory) -> Case:
    """The bar as a case file, to be stepped."""
    folder = tmp_path_factory.mktemp("case")
    bar.write(folder / "bar.vtu")
    (folder / "bar.toml").write_text(CASE)
    return read_case(folder / "bar.toml")


@pytest.fixture(scope="module", params=["in this page", "on this machine"])
def live(
    request: pytest.FixtureRequest, look_at: Callable[..., Viewer], server: Server, case: Case
) -> Iterator[Viewer]:
    """One page of the case for a whole module, which steps it itself or has it stepped."""
    with serve_live(case, "Bar", in_page=request.param == "in this page") as running:
        viewer = look_at(running.url)
        assert viewer.state["place"] == request.param
        yield viewer
        assert viewer.complaints == []
        viewer.close()


def settle(live: Viewer) -> None:
    """Wait until the organ stands still."""
    live.page.wait_for_function(
        """() => {
            const { isWaiting, hasWishes } = viscera.conversation;
            const { specimens, frames } = viscera.state();
            const isAnswered = frames > 0 && !isWaiting && !hasWishes;
            return isAnswered && specimens.every(({ residual }) => residual < 1e-8);
        }"""
    )
