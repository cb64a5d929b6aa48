"""A case in the browser: the page drives the stepper of this machine, or its own in a worker."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.web.conftest import settle

import viscera as vs
from viscera.cases.case import Case
from viscera.viewer import Server, export_case, page, serve_live

if TYPE_CHECKING:
    from tests.web.conftest import Viewer

    Look = Callable[..., Viewer]
    Offer = Callable[[Path], str]

TIP = (0.35, 0.05, 0.1)
FACTS = 14
STEPS = 11
# Talks to a worker of its own as the page does, one request after the other.
CONVERSATION = """async (requests) => {
    const worker = new Worker("stepper.js", { type: "module" });
    const answer = () => new Promise((resolve, reject) => {
        worker.onmessage = ({ data }) => resolve(typeof data === "string" ? data : [...new Float32Array(data)]);
        worker.onerror = ({ message }) => reject(new Error(message));
    });
    const bytes = await (await fetch("organ.case")).arrayBuffer();
    worker.postMessage([bytes, null]);
    const answers = [await answer()];
    for (const request of requests) {
        worker.postMessage(request);
        answers.push(await answer());
    }
    worker.terminate();
    return answers;
}"""


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


# Drags the hand sideways, 60 times a second, and keeps the displacement that every frame was asked for, with its facts.
DRAG = """async ([point, step, moves]) => {
    const { link } = viscera;
    const [send, receive, record] = [link.send.bind(link), link.onMessage, []];
    let displacement = null;
    link.send = (request) => {
        displacement = JSON.parse(request).move ?? displacement;
        send(request);
    };
    link.onMessage = (data) => {
        const held = displacement;
        receive(data);
        const [{ facts }] = viscera.specimens;
        record.push([held, facts.force, facts.isSettled, facts.residual]);
    };
    viscera.touch(point, [0, 0, 0]);
    for (let k = 1; k <= moves; k++) {
        viscera.move(step.map((x) => k * x));
        await new Promise((next) => setTimeout(next, 16));
    }
    await new Promise((next) => setTimeout(next, 300));
    [link.send, link.onMessage] = [send, receive];
    return [viscera.held.point, record];
}"""
# Shows a frame whose forces have not settled, and lets no other one come.
UNSETTLED = """() => {
    const { link, conversation, specimens: [{ facts, field }] } = viscera;
    const numbers = [1, ...facts.force, 0.3, 1, 0, 1, 0, 0, 0, 1, 0, 0, 0, ...field];
    window.sending = link.send;
    link.send = () => {};
    window.again = () => conversation.receive(new Float32Array(numbers).buffer);
    window.again();
}"""
GO_ON = """() => {
    viscera.link.send = window.sending;
    viscera.conversation.isWaiting = false;
}"""


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
    live.page.get_by_role("button", name="Compare two laws").click()
    # The button has another name now, and is still the one that keys go to.
    live.page.keyboard.press("?")
    assert live.page.locator(".help").is_visible()
    live.page.keyboard.press("Escape")
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
    # Both hold the same hand: each has an arrow with its own force, and says which organ it is.
    labels = live.page.locator(".force-label:visible")
    assert labels.evaluate_all("(labels) => labels.map(({ dataset }) => dataset.side)") == ["left", "right"]
    shown = labels.all_inner_texts()
    forces = [float(np.linalg.norm(specimen["force"])) for specimen in state["specimens"]]
    assert [float(text.removesuffix(" N")) for text in shown] == pytest.approx(forces, rel=1e-2)
    assert f"{1000 * apart:.1f} mm" in live.page.locator(".contrast").inner_text()
    live.page.get_by_label("law").first.select_option("Corotated")
    settle(live)
    assert live.state["laws"] == ["Corotated", "Linear"]
    assert live.state["held"] == state["held"]
    assert np.linalg.norm(live.state["specimens"][0]["force"]) > 0
    live.call("rest")
    live.page.get_by_role("button", name="One organ").click()
    live.call("setGravity", [0, 0, 0])
    settle(live)


def test_several_laws_in_one_organ(look_at: Look, server: Server, bar: vs.Mesh, tmp_path: Path) -> None:
    """A bar of two laws, each in its own cells, stepped in the page from its case file."""
    mesh = bar.with_cell_sets(near=lambda x: x[:, 0] < 0.2, far=lambda x: x[:, 0] >= 0.2)
    laws = {"near": vs.NeoHookean(young=1e5, poisson=0.45), "far": vs.Yeoh(c10=3e3, c20=2e3, poisson=0.45)}
    organ = vs.Organ(mesh, laws, fixed="root")
    push = (0.0, 0.01, -0.04)
    with serve_live(organ.to_case(tmp_path / "pair.toml"), "Pair", in_page=True) as running:
        viewer = look_at(running.url)
        assert viewer.state["place"] == "in this page"
        assert viewer.state["laws"] == ["Several"]
        viewer.call("touch", TIP, push)
        settle(viewer)
        [specimen] = viewer.state["specimens"]
        assert viewer.complaints == []
        viewer.close()
    patch = organ.patch(TIP, 0.1 * bar.diagonal)
    exact = organ.solve(displacement={patch: push})
    size = np.abs(exact.displacement).max()
    shown = np.reshape(specimen["field"], (-1, 3))
    assert shown == pytest.approx(exact.displacement[bar.surface_nodes], abs=1e-5 * size)
    force = exact.reaction(patch)
    assert specimen["force"] == pytest.approx(force.tolist(), abs=1e-5 * np.linalg.norm(force))
    # One law in all cells answers otherwise.
    other = vs.Organ(mesh, laws["near"], fixed="root").solve(displacement={patch: push}).reaction(patch)
    assert np.linalg.norm(force - other) > 0.05 * np.linalg.norm(force)


def test_stress_as_colours(live: Viewer, bar: vs.Mesh, organ: vs.Organ) -> None:
    live.call("setLaws", ["NeoHookean"])
    live.call("setColouring", "stress")
    live.call("touch", TIP, [0.0, 0.01, -0.03])
    live.page.wait_for_function("() => viscera.state().specimens[0].stress.length > 0")
    settle(live)
    state = live.state
    patch = organ.patch(TIP, 0.1 * bar.diagonal)
    exact = organ.solve(displacement={patch: (0.0, 0.01, -0.03)}).von_mises("nodes")[bar.surface_nodes]
    stress = np.array(state["specimens"][0]["stress"])
    assert stress == pytest.approx(exact, abs=1e-4 * exact.max())
    legend = live.page.locator(".legend:visible")
    assert "von Mises stress [kPa]" in legend.inner_text()
    ticks = [float(text) for text in live.page.locator(".legend:visible .legend-ticks span").all_inner_texts()]
    assert np.allclose(np.diff(ticks), ticks[1])
    assert ticks[-1] >= 1e-3 * np.quantile(stress, 0.97)
    live.shoot(f"stress-{state['place'].split()[-1]}")
    # Nothing is uploaded that did not change.
    settle(live)
    uploads = (
        "() => ['position', 'color'].map((name) => viscera.specimens[0].body.mesh.geometry.attributes[name].version)"
    )
    before = live.page.evaluate(uploads)
    live.page.evaluate("() => viscera.show()")
    assert live.page.evaluate(uploads) == before
    live.call("setColouring", "tissue")
    live.call("rest")
    settle(live)


def test_two_fingers_act_at_once(look_at: Look, server: Server, case: Case, bar: vs.Mesh, organ: vs.Organ) -> None:
    with serve_live(case, "Bar", in_page=False) as running:
        viewer = look_at(running.url, viewport={"width": 390, "height": 780}, has_touch=True, is_mobile=True)
        cdp = viewer.page.context.new_cdp_session(viewer.page)

        def fingers(kind: str, *places: tuple[float, float]) -> None:
            points = [{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(places)]
            cdp.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

        before = viewer.page.evaluate("() => viscera.stage.camera.position.toArray()")
        (x0, y0), (x1, y1) = viewer.place((0.15, 0.0, 0.05)), viewer.place((0.37, 0.0, 0.05))
        fingers("touchStart", (x0, y0))
        fingers("touchStart", (x0, y0), (x1, y1))
        fingers("touchMove", (x0, y0 - 8), (x1, y1 + 12))
        settle(viewer)
        state = viewer.state
        viewer.shoot("two-fingers")
        patches = [organ.patch(hand["point"], 0.1 * bar.diagonal) for hand in state["hands"]]
        pushes = [hand["displacement"] for hand in state["hands"]]
        assert pushes[0][2] > 1e-3 > -1e-3 > pushes[1][2]
        exact = organ.solve(displacement=dict(zip(patches, pushes, strict=True)))
        [specimen] = state["specimens"]
        for name, patch in zip(("force", "second"), patches, strict=True):
            force = exact.reaction(patch)
            assert specimen[name] == pytest.approx(force.tolist(), abs=1e-4 * np.linalg.norm(force))
        labels = viewer.page.locator(".force-label:visible")
        assert labels.count() == 2
        assert viewer.page.evaluate("() => viscera.stage.camera.position.toArray()") == pytest.approx(before)
        # One lets go, the other holds on.
        held = [{"x": x1, "y": y1 + 12, "id": 1}]
        cdp.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": held})
        viewer.page.wait_for_function("() => viscera.state().hands.filter(Boolean).length === 1")
        settle(viewer)
        state = viewer.state
        left = 0 if state["hands"][0] else 1
        assert state["hands"][left]["displacement"] == pushes[left]
        force = organ.solve(displacement={patches[left]: pushes[left]}).reaction(patches[left])
        found = state["specimens"][0]["second" if left else "force"]
        assert found == pytest.approx(force.tolist(), abs=1e-4 * np.linalg.norm(force))
        fingers("touchEnd")
        viewer.page.wait_for_function("() => viscera.state().held === null")
        assert viewer.complaints == []
        viewer.close()


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
    press("c")
    assert live.page.locator(".legend").is_hidden()
    press("?")
    assert live.page.locator(".help").is_visible()
    press("?")
    press("Escape")
    assert live.state["held"] is None
    settle(live)


def test_frames_in_the_page_are_those_of_python(steps: Viewer, bar: vs.Mesh, organ: vs.Organ) -> None:
    """Iteration by iteration, as many as the page says that each of its frames took."""
    hand = organ.patch(TIP, 0.1 * bar.diagonal)
    pushes = [(0.0, 0.0, -0.02), (0.0, 0.0, -0.02), (0.01, 0.02, -0.04), (0.01, 0.02, -0.04)]
    gravity = (0.0, 0.0, -5.0)
    requests: list[dict[str, Any]] = [{"gravity": gravity}, {"grab": TIP, "move": pushes[0]}]
    requests += [{"move": push} for push in pushes[1:]]
    hello, *frames = steps.page.evaluate(CONVERSATION, [json.dumps(request) for request in requests])
    assert json.loads(hello)["name"] == "Bar"
    stepper = organ.stepper(density=1000.0)
    held: list[dict[Any, Any]] = [{}, *({hand: push} for push in pushes)]
    for numbers, places in zip(frames, held, strict=True):
        assert numbers[0] == 1
        for _ in range(int(numbers[STEPS])):
            frame = stepper.frame(places, gravity=gravity)
        shown = np.reshape(numbers[1 + FACTS :], (-1, 3))
        size = np.abs(frame.displacement).max()
        assert shown == pytest.approx(frame.displacement[bar.surface_nodes], abs=1e-5 * size)
        assert numbers[5] == frame.taken
    force = frame.reaction(hand)
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


def test_steps_do_not_wait_for_the_drawing(steps: Viewer) -> None:
    steps.call("rest")
    settle(steps)
    before = steps.state["frames"]
    steps.page.evaluate("() => viscera.stage.renderer.setAnimationLoop(null)")
    steps.call("touch", TIP, [0.01, 0.0, -0.03])
    steps.page.wait_for_function(
        """(before) => {
            const { frames, specimens: [{ isSettled, force }] } = viscera.state();
            return frames > before && isSettled && Math.hypot(...force) > 0;
        }""",
        arg=before,
    )
    steps.page.evaluate("() => viscera.stage.renderer.setAnimationLoop((time) => viscera.stage.frame(time))")


def test_what_has_not_settled_is_grey(steps: Viewer) -> None:
    steps.call("touch", TIP, [0.0, 0.0, -0.03])
    settle(steps)
    arrow = "() => viscera.specimens[0].grips[0].arrow.material.color.getHex()"
    label = steps.page.locator(".force-label:visible")
    label.wait_for()
    settled = steps.page.evaluate(arrow), label.evaluate("(label) => getComputedStyle(label).backgroundColor")
    steps.page.evaluate(UNSETTLED)
    steps.page.wait_for_selector(".specimen.is-unsettled .force")
    steps.page.wait_for_selector(".force-label.is-unsettled")
    unsettled = steps.page.evaluate(arrow), label.evaluate("(label) => getComputedStyle(label).backgroundColor")
    assert all(before != after for before, after in zip(settled, unsettled, strict=True))
    steps.page.evaluate(GO_ON)
    settle(steps)
    steps.page.wait_for_selector(".specimen:not(.is-unsettled) .force")
    steps.page.wait_for_selector(".force-label:not(.is-unsettled)")
    assert steps.page.evaluate(arrow) == settled[0]


def test_a_hand_at_rest_that_finds_no_balance_is_told_so(steps: Viewer) -> None:
    """It does not move too fast, and nobody is left with the force of before: who listens hears that there is none."""
    steps.call("touch", TIP, [0.0, 0.0, -0.03])
    settle(steps)
    warning, spoken = steps.page.locator(".warning"), steps.page.locator("[role=status]")
    caption = steps.call("caption")
    steps.page.evaluate(UNSETTLED)
    assert steps.call("caption").endswith(" N, not settled.")
    steps.page.evaluate("() => { for (let k = 0; k < 60; k++) window.again(); }")
    steps.page.locator(".warning", has_text="come to rest").wait_for()
    assert warning.inner_text() == "The organ does not come to rest here: ease the hand, or let go."
    assert steps.call("caption").endswith(": not settled.")
    steps.page.locator("[role=status]", has_text="not settled").wait_for(state="attached")
    assert " N" not in spoken.inner_text()
    steps.page.evaluate(GO_ON)
    settle(steps)
    steps.page.wait_for_selector(".warning:not(.is-shown)", state="attached")
    assert steps.call("caption") == caption


def test_a_picture_says_what_a_force_is_worth(steps: Viewer) -> None:
    steps.call("touch", TIP, [0.0, 0.0, -0.03])
    settle(steps)
    assert steps.call("caption").endswith(" N.")
    # Asked at once: the next frame has facts of its own.
    ask = "(facts) => { Object.assign(viscera.specimens[0].facts, facts); return viscera.caption(); }"
    assert steps.page.evaluate(ask, {"isUnstable": True}).endswith(" N, doubtful.")
    assert steps.page.evaluate(ask, {"isUnstable": True, "isSettled": False}).endswith(" N, not settled.")
    settle(steps)


def test_no_force_under_a_fast_hand_is_wrong_and_unmarked(steps: Viewer, bar: vs.Mesh, organ: vs.Organ) -> None:
    steps.call("rest")
    settle(steps)
    point, record = steps.page.evaluate(DRAG, [TIP, [0.0, 1.5e-3, 0.0], 40])  # 90 mm/s
    patch = organ.patch(point, 0.1 * bar.diagonal)
    settled = [(move, force) for move, force, is_settled, _ in record if move and any(move) and is_settled]
    assert len({tuple(move) for move, _ in settled}) > 5
    for move, force in settled:
        exact = organ.solve(displacement={patch: move}).reaction(patch)
        assert np.linalg.norm(force - exact) <= 0.02 * np.linalg.norm(exact)
    # At the end the hand stands still, and so does the organ.
    assert record[-1][2]


BOX = """(found) => {
    const { left, top, right, bottom } = found.getBoundingClientRect();
    return [left, top, right, bottom];
}"""
# The boxes around the organs at rest, from left to right.
ORGANS = """() => viscera.specimens.map(({ place, body }) => {
    const { rest } = viscera.surface;
    const points = [];
    for (let n = 0; n < rest.length; n += 3) {
        const at = place.position.clone().fromArray(rest, n).add(place.position);
        points.push(viscera.stage.project(at));
    }
    const [x, y] = ["x", "y"].map((axis) => points.map((point) => point[axis]));
    return [Math.min(...x), Math.min(...y), Math.max(...x), Math.max(...y)];
})"""


@pytest.mark.parametrize("size", [(760, 560), (390, 780)], ids=["cell", "telephone"])
def test_two_laws_on_a_small_surface(steps: Viewer, size: tuple[int, int]) -> None:
    width, height = size
    steps.call("rest")
    steps.page.get_by_role("button", name="Compare two laws").click()
    steps.page.set_viewport_size({"width": width, "height": height})
    steps.page.wait_for_function("(width) => viscera.stage.canvas.clientWidth === width", arg=width)
    steps.page.evaluate("async () => { for (let k = 0; k < 4; k++) await new Promise(requestAnimationFrame) }")
    steps.shoot(f"laws-{width}")
    readings = steps.page.locator(".readings")
    panel, organs = readings.evaluate(BOX), steps.page.evaluate(ORGANS)
    assert readings.evaluate("(panel) => panel.scrollWidth <= panel.clientWidth")
    for left, top, right, bottom in organs:
        assert 0 <= left < right <= width
        assert 0 <= top < bottom <= height
        assert right <= panel[0] or bottom <= panel[1]
    sections = [section.evaluate(BOX) for section in steps.page.locator(".specimen").all()]
    words = [section.inner_text() for section in steps.page.locator(".specimen .standing").all()]
    assert words == ["left", "right"]
    if height > width:
        # What belongs to the left organ stands at the left.
        assert sections[0][2] <= sections[1][0]
        assert organs[0][2] <= organs[1][2]
    else:
        assert sections[0][3] <= sections[1][1]
    steps.page.get_by_role("button", name="One organ").click()
    steps.page.set_viewport_size({"width": 1100, "height": 720})
    settle(steps)


def test_a_case_speaks_in_one_place(steps: Viewer) -> None:
    root = "document.querySelector('div[style]').shadowRoot"
    spoken = "[aria-live], [role=status], [role=alert], output"
    assert steps.page.evaluate(f"() => {root}.querySelectorAll({spoken!r}).length") == 1
