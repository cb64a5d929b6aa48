"""A case in the browser, stepped on the page's graphics processor: WebGPU, here in software."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import viscera as vs
from viscera.cases.case import Case, read_case
from viscera.viewer import export_case, serve_live

if TYPE_CHECKING:
    from tests.web.conftest import Viewer

    Look = Callable[..., Viewer]
    Offer = Callable[[Path], str]

CASE = """
mesh = "cube.vtu"
units = "m"
fixed = "bottom"
element = "{element}"
material = {{law = "NeoHookean", young = 1e5, poisson = 0.45}}
"""
TOP = (0.05, 0.05, 0.1)
MOVE = (0.005, 0.01, -0.02)
# Drawing in software keeps the device waiting.
SMALL = {"width": 320, "height": 240}
# The worker's next commands find the device shut down.
LOSE = """() => {
    const begin = GPUDevice.prototype.createCommandEncoder;
    GPUDevice.prototype.createCommandEncoder = function (...settings) {
        this.destroy();
        return begin.apply(this, settings);
    };
}"""
SETTLED = """() => {
    const { isWaiting, hasWishes } = viscera.conversation;
    const { specimens, frames } = viscera.state();
    return frames > 0 && !isWaiting && !hasWishes && specimens.every(({ residual }) => residual < 1e-8);
}"""


def case_of(cube: vs.Mesh, folder: Path, element: str = "P1") -> Case:
    cube.write(folder / "cube.vtu")
    (folder / "cube.toml").write_text(CASE.format(element=element))
    return read_case(folder / "cube.toml")


def held(viewer: Viewer) -> list[dict[str, Any]]:
    """The organs once they have come to rest in a hand."""
    viewer.call("touch", TOP, MOVE)
    viewer.page.wait_for_function(SETTLED)
    found: list[dict[str, Any]] = viewer.state["specimens"]
    return found


def assert_same(found: list[dict[str, Any]], wanted: list[dict[str, Any]]) -> None:
    """Displacements and forces to 1e-5."""
    for one, other in zip(found, wanted, strict=True):
        for name in ("field", "force"):
            value, truth = np.array(one[name]), np.array(other[name])
            assert np.abs(truth).max() > 0.0
            assert np.abs(value - truth).max() < 1e-5 * np.abs(truth).max()


@pytest.mark.parametrize(
    ("element", "laws"),
    [("P1", ["Linear", "Corotated"]), ("P1 mean volume", ["MooneyRivlin"]), ("P2", ["SaintVenantKirchhoff"])],
)
def test_the_graphics_processor_of_the_page_steps_as_its_processor(
    look_with_gpu: Look, cube: vs.Mesh, tmp_path: Path, element: str, laws: list[str]
) -> None:
    """Quadratic cells have no kernels: their tangents are uploaded."""
    with serve_live(case_of(cube, tmp_path, element), "Cube", in_page=True) as running:
        on, off = (look_with_gpu(f"{running.url}?gpu={wish}", viewport=SMALL) for wish in ("always", "never"))
        assert "swiftshader" in on.state["device"]
        assert on.page.get_by_text(f"stepped in this page on {on.state['device']}").count() == 1
        assert off.state["device"] is None
        assert_same(held(on), held(off))
        # The laws change, and with them what is on the device.
        for viewer in (on, off):
            viewer.call("setLaws", laws)
        assert_same(held(on), held(off))
        assert "swiftshader" in on.state["device"]
        for viewer in (on, off):
            assert viewer.complaints == []
            viewer.close()


def test_a_device_that_is_lost_leaves_the_organ_to_the_processor(
    look_with_gpu: Look, cube: vs.Mesh, tmp_path: Path
) -> None:
    with serve_live(case_of(cube, tmp_path), "Cube", in_page=True) as running:
        on, off = (look_with_gpu(f"{running.url}?gpu={wish}", viewport=SMALL) for wish in ("always", "never"))
        assert_same(held(on), held(off))
        (worker,) = on.page.workers
        worker.evaluate(LOSE)
        on.call("move", [-x for x in MOVE])
        sentence = on.page.get_by_text("the graphics processor was lost")
        sentence.first.wait_for(state="attached")  # a narrow window has no room for it
        assert "the processor goes on" in sentence.first.text_content()
        on.page.wait_for_function(SETTLED)
        assert on.state["device"] is None
        off.call("move", [-x for x in MOVE])
        off.page.wait_for_function(SETTLED)
        assert_same(on.state["specimens"], off.state["specimens"])
        # It begins anew without.
        for viewer in (on, off):
            viewer.call("reset")
        assert_same(held(on), held(off))
        for viewer in (on, off):
            assert viewer.complaints == []
            viewer.close()


def test_software_in_place_of_a_device_is_not_chosen(look_with_gpu: Look, cube: vs.Mesh, tmp_path: Path) -> None:
    with serve_live(case_of(cube, tmp_path), "Cube", in_page=True) as running:
        viewer = look_with_gpu(running.url)
        assert viewer.state["device"] is None
        viewer.close()


@pytest.mark.parametrize(
    ("lacking", "reason"),
    [
        ("WebAssembly.Suspending = undefined;", "this browser has no JavaScript promise integration"),
        ("GPU.prototype.requestAdapter = async () => null;", "the browser offers none"),
        ("GPUAdapter.prototype.requestDevice = async () => { throw new Error('it is busy'); };", "it is busy"),
        (
            "Object.defineProperty(WorkerNavigator.prototype, 'gpu', { value: undefined });",
            "this browser has no WebGPU",
        ),
    ],
)
def test_a_browser_without_what_it_takes_steps_on_the_processor_and_says_why(
    look_with_gpu: Look, file_server: Offer, cube: vs.Mesh, tmp_path: Path, lacking: str, reason: str
) -> None:
    """The worker begins with what a lesser browser would have."""
    export_case(case_of(cube, tmp_path), tmp_path / "site", "Cube")
    worker = tmp_path / "site" / "stepper.js"
    worker.write_text(lacking + worker.read_text())
    viewer = look_with_gpu(f"{file_server(tmp_path / 'site')}?gpu=always", viewport=SMALL)
    assert viewer.state["device"] is None
    assert viewer.page.get_by_text(f"no graphics processor: {reason}").count() == 1
    assert held(viewer)[0]["isSettled"]
    assert viewer.complaints == []
    viewer.close()


def test_a_wish_that_is_none_is_named(look_with_gpu: Look, cube: vs.Mesh, tmp_path: Path) -> None:
    with serve_live(case_of(cube, tmp_path), "Cube", in_page=True) as running:
        viewer = look_with_gpu(f"{running.url}?gpu=fast", viewport=SMALL)
        assert viewer.page.get_by_text('"?gpu=fast" is unknown: always or never').count() == 1
        viewer.close()
        viewer = look_with_gpu(f"{running.url}?gpu=never", viewport=SMALL)
        assert viewer.page.get_by_text("graphics processor").count() == 0
        viewer.close()
