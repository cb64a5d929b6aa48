"""A case in the browser, stepped on the page's graphics processor: WebGPU, here in software."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import viscera as vs
from viscera.case import Case, read_case
from viscera.viewer import serve_live

if TYPE_CHECKING:
    from tests.web.conftest import Viewer

    Look = Callable[..., Viewer]

CASE = """
mesh = "bar.vtu"
units = "m"
fixed = "root"
element = "{element}"
material = {{law = "{law}", young = 1e5, poisson = 0.45}}
"""
TIP = (0.35, 0.05, 0.1)
MOVE = (0.01, 0.02, -0.05)
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


def case_of(bar: vs.Mesh, folder: Path, law: str = "NeoHookean", element: str = "P1") -> Case:
    bar.write(folder / "bar.vtu")
    (folder / "bar.toml").write_text(CASE.format(law=law, element=element))
    return read_case(folder / "bar.toml")


def held(viewer: Viewer) -> dict[str, Any]:
    """The organ once it has come to rest in a hand."""
    viewer.call("touch", TIP, MOVE)
    viewer.page.wait_for_function(SETTLED)
    found: dict[str, Any] = viewer.state["specimens"][0]
    return found


def assert_same(found: dict[str, Any], wanted: dict[str, Any]) -> None:
    field, truth = np.array(found["field"]), np.array(wanted["field"])
    assert np.abs(field - truth).max() < 1e-5 * np.abs(truth).max()
    np.testing.assert_allclose(found["force"], wanted["force"], rtol=1e-5, atol=1e-5 * np.linalg.norm(wanted["force"]))


@pytest.mark.parametrize(
    ("law", "element"),
    [("NeoHookean", "P1"), ("Linear", "P1"), ("MooneyRivlin", "P1 mean volume"), ("NeoHookean", "P2")],
)
def test_the_graphics_processor_of_the_page_steps_as_its_processor(
    look_with_gpu: Look, bar: vs.Mesh, tmp_path: Path, law: str, element: str
) -> None:
    """P2 has no kernels: its tangents are uploaded."""
    with serve_live(case_of(bar, tmp_path, law, element), "Bar", in_page=True) as running:
        on, off = (look_with_gpu(f"{running.url}?gpu={wish}") for wish in ("always", "never"))
        assert "swiftshader" in on.state["device"]
        assert on.page.get_by_text(f"stepped in this page on {on.state['device']}").count() == 1
        assert off.state["device"] is None
        assert_same(held(on), held(off))
        # The laws change, and with them what is on the device.
        for viewer in (on, off):
            viewer.call("setLaws", ["Linear", law])
        assert_same(held(on), held(off))
        assert "swiftshader" in on.state["device"]
        for viewer in (on, off):
            assert viewer.complaints == []
            viewer.close()


def test_a_device_that_is_lost_leaves_the_organ_to_the_processor(
    look_with_gpu: Look, bar: vs.Mesh, tmp_path: Path
) -> None:
    with serve_live(case_of(bar, tmp_path), "Bar", in_page=True) as running:
        on, off = (look_with_gpu(f"{running.url}?gpu={wish}") for wish in ("always", "never"))
        assert_same(held(on), held(off))
        (worker,) = on.page.workers
        worker.evaluate(LOSE)
        on.call("move", [-x for x in MOVE])
        sentence = on.page.get_by_text("the graphics processor was lost")
        sentence.first.wait_for()
        assert "the processor goes on" in sentence.first.inner_text()
        on.page.wait_for_function(SETTLED)
        assert on.state["device"] is None
        off.call("move", [-x for x in MOVE])
        off.page.wait_for_function(SETTLED)
        assert_same(on.state["specimens"][0], off.state["specimens"][0])
        # It begins anew without.
        for viewer in (on, off):
            viewer.call("reset")
        assert_same(held(on), held(off))
        for viewer in (on, off):
            assert viewer.complaints == []
            viewer.close()


def test_software_in_place_of_a_device_is_not_chosen(look_with_gpu: Look, bar: vs.Mesh, tmp_path: Path) -> None:
    with serve_live(case_of(bar, tmp_path), "Bar", in_page=True) as running:
        viewer = look_with_gpu(running.url)
        assert viewer.state["device"] is None
        viewer.close()


@pytest.mark.parametrize(
    "lacking", ["WebAssembly.Suspending = undefined", "GPU.prototype.requestAdapter = async () => null"]
)
def test_a_browser_without_what_it_takes_steps_on_the_processor(
    look_with_gpu: Look, bar: vs.Mesh, tmp_path: Path, lacking: str
) -> None:
    """The worker begins with what a lesser browser would have."""
    replace = f"""
        const Whole = Worker;
        window.Worker = function (url) {{
            const source = `{lacking}; importScripts(${{JSON.stringify(new URL(url, location.href).href)}});`;
            return new Whole(URL.createObjectURL(new Blob([source])));
        }};
    """
    with serve_live(case_of(bar, tmp_path), "Bar", in_page=True) as running:
        viewer = look_with_gpu(f"{running.url}?gpu=always", [replace])
        assert viewer.state["device"] is None
        assert held(viewer)["isSettled"]
        assert viewer.complaints == []
        viewer.close()
