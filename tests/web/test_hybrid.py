"""The hybrid start: the page steps the organ of a model until the model has arrived."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import viscera as vs
from viscera.viewer import Server, export, page, serve

if TYPE_CHECKING:
    from tests.web.conftest import Viewer

    Look = Callable[..., Viewer]

TOP = (0.3, 0.05, 0.1)
PUSH = (0.0, 0.002, -0.012)
# The model is under way until the test says that it has arrived, and as what.
GATE = """
const get = window.fetch;
const answer = new Promise((arrive) => (window.arrive = arrive));
window.fetch = async (url, ...more) => {
    const isModel = String(url).endsWith("organ.viscera");
    return (isModel && (await answer)) || get(url, ...more);
};
"""
SAYS = "(words) => viscera.tools.header.querySelector('p').innerText.endsWith(words)"
SETTLED = "() => { const [{ isSettled, force }] = viscera.state().specimens; return isSettled && force[2] < 0 }"


@pytest.fixture
def first(look_at: Look, touch: vs.Touch, server: Server) -> Iterator[Viewer]:
    """The page while the model is under way."""
    with serve(touch, "Bar", is_hybrid=True) as running:
        viewer = look_at(running.url, scripts=[GATE])
        yield viewer
        assert viewer.complaints == []
        viewer.close()


def header(viewer: Viewer) -> str:
    said: str = viewer.page.locator("header p").inner_text()
    return said


def test_the_organ_is_stepped_until_its_model_arrives(first: Viewer, touch: vs.Touch) -> None:
    assert first.state["place"] == "in this page"
    assert header(first).endswith("loading the reduced model")
    first.call("touch", TOP, PUSH)
    first.page.wait_for_function(SETTLED)
    stepped = first.state["specimens"][0]["force"]
    # The same organ in the same patch: the two differ by what the model leaves out, 1 % at the most here.
    reduced = touch(TOP, PUSH).force
    assert np.linalg.norm(np.subtract(stepped, reduced)) < 0.01 * np.linalg.norm(reduced)
    first.page.evaluate("() => viscera.stage.lookFrom([1, -1, 0.5])")
    first.page.evaluate("() => arrive()")
    first.page.wait_for_function(SAYS, arg="takes over when you let go")
    assert first.state["held"] is not None
    first.call("rest")
    first.page.wait_for_function("() => viscera.evaluator")
    assert header(first).startswith("reduced model")
    assert first.page.locator(".view").count() == 1
    assert first.page.evaluate("() => viscera.stage.camera.position.toArray()") == pytest.approx([1, -1, 0.5])
    first.call("touch", TOP, PUSH)
    assert np.allclose(first.state["force"], touch(first.state["point"], PUSH).force, rtol=1e-5, atol=1e-6)


def test_what_the_model_leaves_out_cannot_be_held(first: Viewer) -> None:
    seen = "([x, y]) => viscera.pointer.under(x, y) !== null"
    assert first.page.evaluate(seen, list(first.place(TOP)))
    assert not first.page.evaluate(seen, list(first.place((0.03, 0.05, 0.1))))


def test_without_its_model_the_organ_is_stepped_on(first: Viewer) -> None:
    first.page.evaluate("() => arrive(new Response('', { status: 404, statusText: 'Not Found' }))")
    first.page.wait_for_function(SAYS, arg="could not be loaded: organ.viscera: 404 Not Found")
    first.call("touch", TOP, PUSH)
    first.page.wait_for_function(SETTLED)


def test_a_model_that_does_not_arrive_is_named(first: Viewer) -> None:
    first.page.evaluate("() => arrive(Promise.reject(new TypeError('Failed to fetch')))")
    first.page.wait_for_function(
        SAYS,
        arg="could not be loaded: organ.viscera did not arrive; see that its server runs and is not blocked, "
        "then reload this page",
    )


def test_without_the_stepper_the_model_comes_alone(browser: Any, touch: vs.Touch, server: Server) -> None:
    with serve(touch, "Bar", is_hybrid=True) as running:
        tab = browser.new_page()
        faults: list[str] = []
        tab.on("pageerror", lambda error: faults.append(str(error)))
        tab.context.route("**/stepper.wasm", lambda route: route.abort())
        tab.goto(running.url)
        tab.wait_for_function("() => window.viscera?.evaluator", timeout=60_000)
        said = tab.locator("header p").inner_text()
        assert " · the organ cannot be stepped by hands: stepper.wasm did not arrive; see that its server runs" in said
        assert tab.locator(".view").count() == 1
        assert faults == []
        tab.context.close()


def test_a_link_is_followed_by_the_model_itself(look_at: Look, touch: vs.Touch, server: Server) -> None:
    with serve(touch, "Bar", is_hybrid=True) as running:
        viewer = look_at(f"{running.url}#touch=300,50,100;0,2,-12")
        assert viewer.state["displacement"] == pytest.approx(PUSH)
        viewer.close()


def test_a_model_smaller_than_the_stepper_comes_alone(touch: vs.Touch, server: Server, tmp_path: Path) -> None:
    assert page.CASE not in export(touch, tmp_path / "small").files


def test_a_large_model_brings_the_stepper_along(
    touch: vs.Touch, server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(page, "stepping_bytes", lambda: 0)
    organ = touch.organ()
    fine = organ.reduce(lambda x: x[:, 0] > 0.1, radius=0.07, depth=0.025, order=4, tolerance=1e-5)
    assert {page.CASE, page.MODEL, *page.STEPPER} <= set(export(fine, tmp_path / "large").files)
    assert page.CASE not in page.single({**page.files(), page.MODEL: b""}, page.MODEL).decode()


def test_a_model_about_a_preload_is_not_stepped(bar: vs.Mesh, server: Server) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.45), fixed="root")
    hanging = organ.solve(gravity=(0, 0, -9.81), density=1000.0)
    touch = organ.reduce(lambda x: x[:, 0] > 0.25, radius=0.07, depth=0.01, order=2, start=hanging)
    with pytest.raises(vs.VisceraError, match="under a preload"):
        serve(touch, is_hybrid=True)
