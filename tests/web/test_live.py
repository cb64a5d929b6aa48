"""A case in the browser: the page drives the stepper of this machine, or its own in a worker."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import viscera as vs
from viscera.case import Case, read_case
from viscera.viewer import Server, export_case, page, serve_live

if TYPE_CHECKING:
    from tests.web.conftest import Viewer

    Look = Callable[..., Viewer]
    Offer = Callable[[Path], str]

CASE = """
mesh = "bar.vtu"
units = "m"
fixed = "root"
material = {law = "NeoHookean", young = 1e5, poisson = 0.45}
"""
TIP = (0.35, 0.05, 0.1)
FACTS = 8
# Talks to a worker of its own as the page does, one request after the other.
CONVERSATION = """async (requests) => {
    const worker = new Worker("stepper.js", { type: "module" });
    const answer = () => new Promise((resolve, reject) => {
        worker.onmessage = ({ data }) => resolve(typeof data === "string" ? data : [...new Float32Array(data)]);
        worker.onerror = ({ message }) => reject(new Error(message));
    });
    const bytes = await (await fetch("organ.case")).arrayBuffer();
    worker.postMessage(bytes);
    const answers = [await answer()];
    for (const request of requests) {
        worker.postMessage(request);
        answers.push(await answer());
    }
    worker.terminate();
    return answers;
}"""


@pytest.fixture(scope="module")
def case(bar: vs.Mesh, tmp_path_factory: pytest.TempPathFactory) -> Case:
    folder = tmp_path_factory.mktemp("case")
    bar.write(folder / "bar.vtu")
    (folder / "bar.toml").write_text(CASE)
    return read_case(folder / "bar.toml")


@pytest.fixture(scope="module", params=["in this page", "on this machine"])
def live(request: pytest.FixtureRequest, look_at: Look, server: Server, case: Case) -> Iterator[Viewer]:
    with serve_live(case, "Bar", in_page=request.param == "in this page") as running:
        viewer = look_at(running.url)
        assert viewer.state["place"] == request.param
        yield viewer
        assert viewer.complaints == []
        viewer.close()


@pytest.fixture(scope="module")
def steps(
    look_at: Look, file_server: Offer, server: Server, case: Case, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Viewer]:
    """The exported page of the case on Python's own file server, which knows nothing of Viscera."""
    folder = tmp_path_factory.mktemp("live-site")
    export_case(case, folder, "Bar")
    viewer = look_at(file_server(folder), color_scheme="dark")
    yield viewer
    assert viewer.complaints == []
    viewer.close()


@pytest.fixture(scope="module")
def organ(bar: vs.Mesh) -> vs.Organ:
    return vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.45), fixed="root")


def settle(live: Viewer) -> None:
    """Wait until the organ stands still."""
    live.page.wait_for_function(
        """() => {
            const { specimens, frames } = window.viscera.state();
            return frames > 3 && specimens.every(({ residual }) => residual < 1e-8);
        }"""
    )


def test_a_drag_steps_the_organ(live: Viewer, bar: vs.Mesh, organ: vs.Organ) -> None:
    x, y = live.place(TIP)
    live.page.mouse.move(x, y)
    live.page.mouse.down()
    live.page.mouse.move(x + 10, y + 30, steps=4)
    live.page.wait_for_timeout(100)
    settle(live)
    state = live.state
    live.shoot(f"case-{state['place'].split()[-1]}")
    clock = live.page.locator(".clock")
    for k in range(40):  # a rate needs frames in a row; on a slow machine the drag may have been drawn in two
        live.page.mouse.move(x + 10, y + 30 - k % 3)
        live.page.wait_for_timeout(50)
        words, rate = clock.inner_text(), live.state["frame"]["rate"]
        if "frames/s" in words and rate > 0:
            break
    live.page.mouse.up()
    patch = organ.patch(state["held"]["point"], 0.1 * bar.diagonal)
    exact = organ.solve(displacement={patch: state["held"]["displacement"]})
    [specimen] = state["specimens"]
    shown = np.reshape(specimen["field"], (-1, 3))
    size = np.abs(exact.displacement).max()
    assert shown == pytest.approx(exact.displacement[bar.surface_nodes], abs=1e-5 * size)
    assert specimen["force"] == pytest.approx(exact.reaction(patch), abs=1e-5 * np.linalg.norm(exact.reaction(patch)))
    assert rate > 0
    assert "frames/s" in words


def test_two_laws_side_by_side(live: Viewer) -> None:
    live.page.get_by_role("button", name="one organ, or two laws in the same hand").click()
    live.call("setGravity", [0, 0, -9.81])
    live.call("touch", TIP, [0.0, 0.0, -0.05])
    live.page.wait_for_timeout(200)
    settle(live)
    live.shoot("laws")
    state = live.state
    assert state["laws"] == ["NeoHookean", "Linear"]
    neo, linear = (np.reshape(specimen["field"], (-1, 3)) for specimen in state["specimens"])
    apart = np.linalg.norm(neo - linear, axis=1).max()
    assert apart > 0.01 * np.abs(neo).max()
    # Both hold the same hand: each has an arrow with its own force.
    shown = live.page.locator(".force-label:visible").all_inner_texts()
    forces = [float(np.linalg.norm(specimen["force"])) for specimen in state["specimens"]]
    assert [float(text.removesuffix(" N")) for text in shown] == pytest.approx(forces, rel=1e-2)
    assert f"{1000 * apart:.1f} mm" in live.page.locator(".contrast").inner_text()
    live.page.get_by_label("law").first.select_option("Corotated")
    settle(live)
    assert live.state["laws"] == ["Corotated", "Linear"]
    assert live.state["held"] == state["held"]
    assert np.linalg.norm(live.state["specimens"][0]["force"]) > 0
    live.call("rest")
    live.page.get_by_role("button", name="one organ, or two laws in the same hand").click()
    live.call("setGravity", [0, 0, 0])
    settle(live)


def test_the_keyboard_takes_hold(live: Viewer) -> None:
    live.call("focus")
    press = live.page.keyboard.press
    press("Enter")
    held = live.state["held"]
    assert held is not None
    press("ArrowUp")
    assert live.state["held"]["displacement"][2] > held["displacement"][2]
    press("c")
    assert live.page.locator(".legend").is_visible()
    press("c")
    press("?")
    assert live.page.locator(".help").is_visible()
    press("?")
    press("Escape")
    assert live.state["held"] is None
    settle(live)


def test_frames_in_the_page_are_those_of_python(steps: Viewer, bar: vs.Mesh, organ: vs.Organ) -> None:
    """Frame by frame, on the way to equilibrium, not only there."""
    hand = organ.patch(TIP, 0.1 * bar.diagonal)
    pushes = [(0.0, 0.0, -0.02), (0.0, 0.0, -0.02), (0.01, 0.02, -0.04), (0.01, 0.02, -0.04)]
    gravity = (0.0, 0.0, -5.0)
    requests: list[dict[str, Any]] = [{"gravity": gravity}, {"grab": TIP, "move": pushes[0]}]
    requests += [{"move": push} for push in pushes[1:]]
    hello, *frames = steps.page.evaluate(CONVERSATION, [json.dumps(request) for request in requests])
    assert json.loads(hello)["name"] == "Bar"
    stepper = organ.stepper(density=1000.0)
    exact = [stepper.frame(gravity=gravity), *(stepper.frame({hand: push}, gravity=gravity) for push in pushes)]
    for numbers, frame in zip(frames, exact, strict=True):
        assert numbers[0] == 1
        shown = np.reshape(numbers[1 + FACTS :], (-1, 3))
        size = np.abs(frame.displacement).max()
        assert shown == pytest.approx(frame.displacement[bar.surface_nodes], abs=1e-5 * size)
        assert numbers[5] == frame.taken
    force = exact[-1].reaction(hand)
    assert frames[-1][1:4] == pytest.approx(force, abs=1e-5 * np.linalg.norm(force))


def test_what_cannot_be_followed_is_a_sentence_in_the_page(steps: Viewer) -> None:
    requests = ["not JSON", '{"laws": ["Rubber"]}', '{"grab": [100, 0, 0]}', "{}"]
    _, *answers, frame = steps.page.evaluate(CONVERSATION, requests)
    sentences = [json.loads(answer)["error"] for answer in answers]
    for sentence, words in zip(sentences, ["JSON object", "no law is called", "no free surface"], strict=True):
        assert words in sentence
    assert frame[0] == 1


def test_an_exported_case_steps_without_viscera(steps: Viewer) -> None:
    steps.call("touch", TIP, [0.0, 0.0, -0.03])
    settle(steps)
    steps.shoot("case-dark")
    assert np.linalg.norm(steps.state["specimens"][0]["force"]) > 0


def test_a_damaged_case_is_a_sentence(browser: Any, case: Case) -> None:
    with Server({**page.stepping_files(), page.CASE: b"not a case"}) as damaged:
        tab = browser.new_page()
        tab.goto(damaged.url)
        tab.get_by_text("The organ cannot be shown: not a usable case").wait_for()
        tab.close()
