"""Two hands on a reduced model: with probes it answers both; else the page steps its organ."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.web.test_headset import EMULATOR, HEADSET, SIDES, SIGNS, UP, frames, in_room, point, pull, put_on

import viscera as vs
from viscera.viewer import Server, export, page, serve

if TYPE_CHECKING:
    from tests.web.conftest import Viewer

    Look = Callable[..., Viewer]

LEFT, RIGHT = (0.15, 0.0, 0.05), (0.37, 0.0, 0.05)
TELEPHONE: dict[str, Any] = {"viewport": {"width": 390, "height": 780}, "has_touch": True, "is_mobile": True}
SETTLED = """() => {
    const { isShown, conversation } = viscera.two.duet;
    const { isSettled, residual } = viscera.state().two;
    return isShown && !conversation.isWaiting && !conversation.hasWishes && isSettled && residual < 1e-6;
}"""

# Keeps where the probes of both hands go, and what they feel there: of one alone, or of two.
RECORD = """() => {
    const { evaluator } = viscera;
    window.felt = [];
    const told = ({ grip, force, error, trust }, center) => [center, grip, force, error, trust];
    const keep = (centers, felt) => window.felt.push(felt.map((each, k) => told(each, centers[k])));
    const [place, placePair] = [evaluator.place.bind(evaluator), evaluator.placePair.bind(evaluator)];
    evaluator.place = (center) => {
        const felt = place(center);
        keep([center], [felt]);
        return felt;
    };
    evaluator.placePair = (centers) => {
        const felt = placePair(centers);
        keep(centers, felt);
        return felt;
    };
}"""


class Fingers:
    """Fingers on the screen of a telephone."""

    def __init__(self, viewer: Viewer) -> None:
        self.viewer = viewer
        self.session = viewer.page.context.new_cdp_session(viewer.page)

    def __call__(self, kind: str, *places: tuple[float, float], first: int = 0) -> None:
        points = [{"x": x, "y": y, "id": first + k} for k, (x, y) in enumerate(places)]
        self.session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})


@pytest.fixture
def telephone(look_at: Look, server: Server) -> Iterator[Viewer]:
    if not page.can_step():
        pytest.skip("the page's stepper is not built; `make viewer` builds it")
    viewer = look_at(server.url, **TELEPHONE)
    viewer.call("setTool", "drag")
    yield viewer
    assert viewer.complaints == []
    viewer.close()


def exact(touch: vs.Touch, hands: list[dict[str, Any]]) -> list[Any]:
    """The forces by which the full organ answers the hands, in its own patches."""
    patches = [touch.patch(hand["point"]) for hand in hands]
    pushes = [hand["displacement"] for hand in hands]
    solved = touch.organ().solve(displacement=dict(zip(patches, pushes, strict=True)))
    return [solved.reaction(patch) for patch in patches]


def test_two_fingers_hold_the_organ_of_a_model(telephone: Viewer, touch: vs.Touch) -> None:
    viewer, fingers = telephone, Fingers(telephone)
    (x0, y0), (x1, y1) = viewer.place(LEFT), viewer.place(RIGHT)
    fingers("touchStart", (x0, y0))
    fingers("touchMove", (x0, y0 - 8))
    one = viewer.state
    assert one["two"] is None
    assert one["force"] == pytest.approx(touch(one["point"], one["displacement"]).force, rel=1e-5, abs=1e-6)
    # What answers the second one is loaded meanwhile.
    viewer.page.wait_for_function("() => viscera.hands === 2")
    fingers("touchStart", (x0, y0 - 8), (x1, y1))
    fingers("touchMove", (x0, y0 - 8), (x1, y1 + 40))
    viewer.page.wait_for_function(SETTLED)
    two = viewer.state["two"]
    viewer.shoot("two-hands")
    assert two["hands"][0]["displacement"] == one["displacement"]
    assert two["hands"][0]["displacement"][2] > 1e-3 > -1e-3 > two["hands"][1]["displacement"][2]
    for found, force in zip((two["force"], two["second"]), exact(touch, two["hands"]), strict=True):
        assert found == pytest.approx(force.tolist(), abs=1e-4 * np.linalg.norm(force))
    assert viewer.page.locator(".force-label:visible").count() == 2
    said = viewer.page.get_by_role("region", name="two hands")
    assert said.is_visible()
    assert "second hand" in said.inner_text()
    assert "without orders and without an estimated error" in said.inner_text()
    # What is stepped is coloured as the model is, by all that is known of it.
    painted = "() => [!viscera.two.duet.body.isTissue, ...viscera.two.duet.painter.values]"
    field = np.reshape(two["field"], (-1, 3))
    viewer.call("setColouring", "displacement")
    viewer.page.locator(".legend:visible").get_by_text("displacement [mm]").wait_for()
    is_painted, *values = viewer.page.evaluate(painted)
    assert is_painted
    assert values == pytest.approx(np.linalg.norm(field, axis=1).tolist(), rel=1e-3, abs=1e-6)
    viewer.call("setColouring", "strain")
    viewer.page.locator(".legend:visible").get_by_text("surface strain [%]").wait_for()
    is_painted, *values = viewer.page.evaluate(painted)
    assert is_painted
    assert max(values) > 1e-3
    viewer.call("setColouring", "error")
    viewer.page.wait_for_function("() => viscera.two.duet.body.isTissue")
    assert viewer.page.locator(".legend:visible").count() == 0
    viewer.call("setColouring", "tissue")
    # One lets go, the other holds on; then the model answers again.
    fingers("touchEnd", (x1, y1 + 40), first=1)
    viewer.page.wait_for_function("() => viscera.state().two.hands.filter(Boolean).length === 1")
    viewer.page.wait_for_function(SETTLED)
    after = viewer.state["two"]
    left = 0 if after["hands"][0] else 1
    assert after["hands"][left] == two["hands"][left]
    [force] = exact(touch, [after["hands"][left]])
    assert after[("force", "second")[left]] == pytest.approx(force.tolist(), abs=1e-4 * np.linalg.norm(force))
    fingers("touchEnd")
    viewer.page.wait_for_function("() => viscera.state().two === null && viscera.state().activity === 'rest'")
    assert said.is_hidden()
    # One finger again: by the model.
    fingers("touchStart", (x0, y0))
    fingers("touchMove", (x0, y0 - 8))
    after = viewer.state
    assert after["two"] is None
    assert after["force"] == pytest.approx(touch(after["point"], after["displacement"]).force, rel=1e-5, abs=1e-6)
    fingers("touchEnd")


def test_two_fingers_at_one_place_are_a_sentence_and_the_first_holds_on(telephone: Viewer, touch: vs.Touch) -> None:
    viewer, fingers = telephone, Fingers(telephone)
    x, y = viewer.place(RIGHT)
    fingers("touchStart", (x, y))
    fingers("touchMove", (x, y + 8))
    viewer.page.wait_for_function("() => viscera.hands === 2")
    fingers("touchStart", (x, y + 8), (x + 1, y + 8))
    warning = viewer.page.locator(".warning.is-shown")
    warning.wait_for()
    assert warning.inner_text() == "both hands hold the same place; take hold elsewhere"
    fingers("touchMove", (x, y + 16), (x + 1, y + 40))
    viewer.page.wait_for_function(SETTLED)
    two = viewer.state["two"]
    first = 0 if two["hands"][0] else 1
    assert two["hands"][1 - first] is None
    [force] = exact(touch, [two["hands"][first]])
    assert two[("force", "second")[first]] == pytest.approx(force.tolist(), abs=1e-4 * np.linalg.norm(force))
    assert warning.inner_text() == "both hands hold the same place; take hold elsewhere"
    # Pictures say so, too, and of which stiffness.
    viewer.call("setStiffness", 2)
    assert viewer.call("caption").endswith(f"Stiffness × 2.0. {warning.inner_text()}")
    # The organ has settled and sends no new forces: those that are there change.
    doubled = viewer.state["two"][("force", "second")[first]]
    assert doubled == pytest.approx((2.0 * force).tolist(), abs=2e-4 * np.linalg.norm(force))
    fingers("touchEnd")
    viewer.page.wait_for_function("() => viscera.state().two === null && viscera.state().activity === 'rest'")
    assert warning.count() == 0


def again(touch: vs.Touch, told: list[list[Any]]) -> list[vs.Felt]:
    """Takes probes in Python the way that those of the page went, compares all they feel, and gives the last it is."""
    alone, other = touch.probe(), touch.probe()
    both = vs.Probes([alone, other])
    size = max(np.linalg.norm(force) for step in told for _, _, force, *_ in step)
    felt: list[vs.Felt] = []
    for step in told:
        centers = [center for center, *_ in step]
        felt = [alone.place(centers[0])] if len(step) == 1 else [*both.place(centers)]
        assert [grip for _, grip, *_ in step] == [each.grip for each in felt]
        for (_, _, force, error, trust), each in zip(step, felt, strict=True):
            assert force == pytest.approx(each.force.tolist(), abs=1e-5 * size)
            assert error == pytest.approx(each.error_estimate, rel=1e-5)
            assert (trust == "trusted") == each.is_trusted
    return felt


def test_two_fingers_hold_a_probe_each(look_at: Look, server: Server, touch: vs.Touch) -> None:
    """The model answers both at once, by the numbers of Python."""
    viewer = look_at(server.url, **TELEPHONE)
    viewer.page.evaluate(RECORD)
    viewer.call("toggleProbe")
    fingers = Fingers(viewer)
    (x0, y0), (x1, y1) = viewer.place(LEFT), viewer.place(RIGHT)
    fingers("touchStart", (x0, y0))
    fingers("touchMove", (x0, y0 + 12))
    assert viewer.state["two"] is None
    fingers("touchStart", (x0, y0 + 12), (x1, y1))
    fingers("touchMove", (x0, y0 + 12), (x1, y1 + 16))
    fingers("touchMove", (x0, y0 + 14), (x1, y1 + 16))
    viewer.page.wait_for_function("(y) => viscera.pointer.holding.values().next().value.last.offsetY >= y", arg=y0 + 13)
    two, told = viewer.page.evaluate("() => [viscera.state().two, window.felt]")
    viewer.shoot("two-probes")
    assert [len(step) for step in told] == sorted(len(step) for step in told)
    felt = again(touch, told)
    assert [each.is_touching for each in felt] == [True, True]
    assert [hand["grip"] for hand in two["hands"]] == [each.grip for each in felt]
    expected = np.sum([each.displacement for each in felt], axis=0)[touch.surface_nodes]
    assert np.ravel(two["field"]) == pytest.approx(expected.ravel(), abs=1e-5 * np.abs(expected).max())
    said = viewer.page.get_by_role("region", name="two probes")
    assert said.is_visible()
    numbers = [float(words) for words in said.locator(".force").all_inner_texts()]
    assert numbers == pytest.approx([float(np.linalg.norm(each.force)) for each in felt], rel=0.01)
    assert viewer.page.locator(".force-label:visible").count() == 2
    assert viewer.page.get_by_role("region", name="readings").is_hidden()
    # Neither is put away while both hold on, and a lower order is one of both.
    viewer.call("toggleProbe")
    viewer.call("setOrder", 1)
    first = viewer.page.evaluate("() => viscera.state().two")
    assert [hand["center"] for hand in first["hands"]] == [hand["center"] for hand in two["hands"]]
    pushes = [(hand["point"], hand["displacement"]) for hand in two["hands"]]
    linear = np.sum([touch.surface_displacement(*push, order=1) for push in pushes], axis=0)
    assert np.ravel(first["field"]) == pytest.approx(linear.ravel(), abs=1e-5 * np.abs(linear).max())
    # Its forces are worth what they are: their distance from those of the highest order is an error, too.
    caption = viewer.call("caption")
    assert "by two probes, order 1." in caption
    for hand, (at, push), each in zip(first["hands"], pushes, felt, strict=True):
        force = touch(at, (0.0, 0.0, 0.0)).stiffness @ push
        assert hand["force"] == pytest.approx(force.tolist(), rel=1e-4, abs=1e-4 * np.linalg.norm(force))
        off = np.linalg.norm(force - each.force) / np.linalg.norm(each.force)
        assert hand["error_estimate"] == pytest.approx(each.error_estimate + off, rel=1e-3)
        if off > 0.05:
            assert not hand["is_trusted"]
            assert "Not trusted: " in caption
    told = viewer.page.evaluate("() => viscera.told")
    assert (told["force"], told["is_trusted"]) == (first["hands"][0]["force"], first["hands"][0]["is_trusted"])
    viewer.call("setOrder", touch.metadata["order"])
    # One lets go: the other one goes on alone, from where it is.
    fingers("touchEnd", (x0, y0 + 14))
    viewer.page.wait_for_function("() => viscera.state().two === null")
    alone = viewer.state
    assert said.is_hidden()
    assert viewer.page.get_by_role("region", name="readings").is_visible()
    assert alone["activity"] == "held"
    assert alone["probe"]["center"] in [hand["center"] for hand in two["hands"]]
    assert np.linalg.norm(alone["force"]) > 0
    fingers("touchEnd")
    viewer.page.wait_for_function("() => viscera.state().activity === 'rest'")
    assert viewer.complaints == []
    viewer.close()


def test_a_file_that_knows_no_case_has_two_probes(look_at: Look, touch: vs.Touch, tmp_path: Path) -> None:
    export(touch, tmp_path / "bar.html", "Bar")
    viewer = look_at((tmp_path / "bar.html").as_uri(), **TELEPHONE)
    fingers, (x0, y0), (x1, y1) = Fingers(viewer), viewer.place(LEFT), viewer.place(RIGHT)
    viewer.call("toggleProbe")
    fingers("touchStart", (x0, y0))
    fingers("touchStart", (x0, y0), (x1, y1))
    fingers("touchMove", (x0, y0 + 8), (x1, y1 + 24))
    assert [hand["grip"] for hand in viewer.state["two"]["hands"]] == ["slides", "slides"]
    # Whatever moved the organ is over with Escape.
    viewer.call("rest")
    assert viewer.state["two"] is None
    assert viewer.page.locator(".force-label:visible").count() == 0
    fingers("touchEnd")
    assert viewer.complaints == []
    viewer.close()


def test_a_second_finger_beside_the_organ_turns_the_view(telephone: Viewer) -> None:
    viewer, fingers = telephone, Fingers(telephone)
    (x0, y0) = viewer.place(LEFT)
    fingers("touchStart", (x0, y0))
    viewer.page.wait_for_function("() => viscera.hands === 2")
    fingers("touchStart", (x0, y0), (x0, y0 - 130))
    assert viewer.page.evaluate("() => viscera.pointer.holding.size") == 0
    fingers("touchEnd")
    assert viewer.state["two"] is None


def test_a_second_finger_waits_while_what_answers_it_is_loaded(telephone: Viewer) -> None:
    viewer, fingers = telephone, Fingers(telephone)
    (x0, y0), (x1, y1) = viewer.place(LEFT), viewer.place(RIGHT)
    asked: list[Any] = []
    viewer.page.route("**/organ.case*", lambda route: asked.append(route))
    with viewer.page.expect_request("**/organ.case*"):
        fingers("touchStart", (x0, y0))
    fingers("touchMove", (x0, y0 - 8))
    one = viewer.state
    fingers("touchStart", (x0, y0 - 8), (x1, y1))
    fingers("touchMove", (x0, y0 - 8), (x1, y1 + 2))
    assert [viewer.state[name] for name in ("activity", "force", "two")] == ["held", one["force"], None]
    while not asked:
        viewer.page.wait_for_timeout(20)
    asked[0].continue_()
    # The finger that waited holds on from where it lies by now.
    viewer.page.wait_for_function("() => viscera.state().two !== null")
    fingers("touchMove", (x0, y0 - 8), (x1, y1 + 40))
    viewer.page.wait_for_function(SETTLED)
    first, second = viewer.state["two"]["hands"]
    assert first["displacement"] == one["displacement"]
    assert first["displacement"][2] > 1e-3 > -1e-3 > second["displacement"][2]
    fingers("touchEnd")
    viewer.page.wait_for_function("() => viscera.state().two === null && viscera.state().activity === 'rest'")


def test_where_one_finger_touches_a_second_waits_until_it_lets_go(
    look_at: Look, touch: vs.Touch, tmp_path: Path
) -> None:
    export(touch, tmp_path / "bar.html", "Bar")
    viewer = look_at((tmp_path / "bar.html").as_uri(), **TELEPHONE)
    fingers, (x0, y0), (x1, y1) = Fingers(viewer), viewer.place(LEFT), viewer.place(RIGHT)
    camera = "() => viscera.stage.camera.position.toArray()"
    seen = viewer.page.evaluate(camera)
    fingers("touchStart", (x0, y0))
    fingers("touchMove", (x0, y0 + 8))
    one = viewer.state
    fingers("touchStart", (x0, y0 + 8), (x1, y1))
    fingers("touchMove", (x0, y0 + 8), (x1, y1 + 4))
    held = ["held", one["point"], one["force"]]
    assert [viewer.state[name] for name in ("activity", "point", "force")] == held
    # A third one is nobody's, and does not take the place of the one that waits.
    fingers("touchStart", (x0, y0 + 8), (x1, y1 + 4), (x0, y0 - 130))
    assert [viewer.state[name] for name in ("activity", "point", "force")] == held
    fingers("touchEnd", (x0, y0 + 8))
    viewer.page.wait_for_function("(x) => viscera.state().point?.[0] > x", arg=0.5 * (LEFT[0] + RIGHT[0]))
    assert viewer.state["activity"] == "held"
    fingers("touchEnd")
    viewer.page.wait_for_function("() => viscera.state().activity === 'rest'")
    assert viewer.page.evaluate(camera) == pytest.approx(seen)
    assert viewer.complaints == []
    viewer.close()


def test_where_the_organ_cannot_be_stepped_one_finger_touches(look_at: Look, touch: vs.Touch, server: Server) -> None:
    gone = (
        "const get = fetch; window.fetch = (url, ...more) => get(String(url).replace('organ.case', 'gone'), ...more);"
    )
    with serve(touch, "Bar") as running:
        viewer = look_at(running.url, scripts=[gone], **TELEPHONE)
        fingers, (x0, y0), (x1, y1) = Fingers(viewer), viewer.place(LEFT), viewer.place(RIGHT)
        with viewer.page.expect_response("**/gone"):
            fingers("touchStart", (x0, y0))
        fingers("touchStart", (x0, y0), (x1, y1))
        state = viewer.state
        assert viewer.page.evaluate("() => viscera.hands") == 1
        assert state["two"] is None
        fingers("touchEnd")
        viewer.close()


def test_two_controllers_hold_the_organ_of_a_model(look_at: Look, server: Server, touch: vs.Touch) -> None:
    if not EMULATOR.exists() or not page.can_step():
        pytest.skip("no WebXR emulator or no stepper here; `npm --prefix viewer ci` and `make viewer` bring them")
    viewer = look_at(server.url, scripts=[EMULATOR.read_text(encoding="utf-8"), HEADSET])
    put_on(viewer)
    viewer.page.wait_for_function("() => viscera.hands === 2")
    diagonal = touch.metadata["diagonal"]
    held = {"left": (0.2, 0.05, 0.1), "right": (0.35, 0.05, 0.1)}
    moved = {"left": 0.004, "right": -0.008}  # along the organ's z, which is up in the room
    for side, place in held.items():
        target = in_room(viewer, place)
        point(viewer, target + 0.2 * UP, target, side)
        pull(viewer, 1, side)
    for side, height in moved.items():
        at = in_room(viewer, held[side]) + height * 0.6 / diagonal * UP
        point(viewer, at + 0.2 * UP, at, side)
    viewer.page.wait_for_function(SETTLED)
    frames(viewer)
    two = viewer.state["two"]
    sides = viewer.page.evaluate(SIDES)
    assert [hand["displacement"][2] for hand in two["hands"]] == pytest.approx([moved[s] for s in sides], abs=1e-4)
    forces = exact(touch, two["hands"])
    for found, force in zip((two["force"], two["second"]), forces, strict=True):
        assert found == pytest.approx(force.tolist(), abs=1e-4 * np.linalg.norm(force))
    signs = [words.split(" N · ") for words, _ in viewer.page.evaluate(SIGNS)]
    assert [worth for _, worth in signs] == ["settled", "settled"]
    sizes = [np.linalg.norm(force) for force in forces]
    assert [float(force) for force, _ in signs] == pytest.approx(sizes, rel=0.01)  # three digits are written
    for side in held:
        pull(viewer, 0, side)
    viewer.page.wait_for_function("() => viscera.state().two === null")
    assert viewer.complaints == []
    viewer.close()


def test_two_controllers_hold_a_probe_each(look_at: Look, server: Server, touch: vs.Touch) -> None:
    if not EMULATOR.exists():
        pytest.skip("no WebXR emulator here; `npm --prefix viewer ci` brings it")
    viewer = look_at(server.url, scripts=[EMULATOR.read_text(encoding="utf-8"), HEADSET])
    viewer.page.evaluate(RECORD)
    viewer.call("toggleProbe")
    put_on(viewer)
    diagonal = touch.metadata["diagonal"]
    held = {"left": (0.2, 0.05, 0.1), "right": (0.35, 0.05, 0.1)}
    for side, place in held.items():
        target = in_room(viewer, place)
        point(viewer, target + 0.2 * UP, target, side)
        pull(viewer, 1, side)
    # Whoever presses near the root takes the tip along, away from the other one.
    for side, depth in {"left": 0.008, "right": 0.016}.items():
        at = in_room(viewer, held[side]) - depth * 0.6 / diagonal * UP
        point(viewer, at + 0.2 * UP, at, side)
    frames(viewer)
    felt = again(touch, viewer.page.evaluate("() => window.felt"))
    assert [each.is_touching for each in felt] == [True, True]
    signs = [words.split(" N · ") for words, _ in viewer.page.evaluate(SIGNS)]
    sizes = [float(np.linalg.norm(each.force)) for each in felt]
    assert sorted(float(force) for force, _ in signs) == pytest.approx(sorted(sizes), rel=0.01)
    assert {worth for _, worth in signs} == {"trusted" if each.is_trusted else "not trusted" for each in felt}
    for side in held:
        pull(viewer, 0, side)
    viewer.page.wait_for_function("() => viscera.state().two === null")
    assert viewer.complaints == []
    viewer.close()
