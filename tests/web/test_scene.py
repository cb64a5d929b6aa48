"""A scene in the browser: a hand on one organ moves another one, and rigid bodies and springs are drawn."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import viscera as vs
from viscera.cases.scene_case import SceneCase
from viscera.viewer import Server, serve_live
from viscera.viewer.stepped import radius

if TYPE_CHECKING:
    from tests.web.conftest import Viewer

    Look = Callable[..., Viewer]

SCENE = """
[organs.lower]
mesh = "bar.vtu"
units = "m"
fixed = "root"
material = {law = "NeoHookean", young = 1e5, poisson = 0.3}

[organs.upper]
mesh = "bar.vtu"
units = "m"
position = "(0, 0, 11) cm"
fixed = "root"
material = {law = "NeoHookean", young = 1e5, poisson = 0.3}

[[contacts]]
first = "lower"
second = "upper"

[[springs]]
first = "lower/tip"
point = [0.5, 0.05, 0.05]
stiffness = 20

[[bodies]]
shape = "HalfSpace"
position = [0, 0, "-5 cm"]

[[bodies]]
shape = "Sphere"
radius = "4 cm"
position = [0.2, -0.08, 0.1]
"""
TOP = (0.35, 0.05, 0.21)
# Waits until what a hand does has been answered and stands still.
STILL = """() => {
    const { isWaiting, hasWishes } = viscera.conversation;
    const [{ residual, isSettled }] = viscera.state().specimens;
    return viscera.frames > 0 && !isWaiting && !hasWishes && isSettled && residual < 1e-7;
}"""
# The mean colour of tissue over the nodes of each organ, as it is drawn.
COLOURS = """() => {
    const { surface, specimens: [{ body }] } = viscera;
    const colour = body.mesh.geometry.attributes.color;
    const sums = [[0, 0, 0, 0], [0, 0, 0, 0]];
    body.skin.nodes.forEach((node, v) => {
        const sum = sums[surface.organOf[node]];
        [colour.getX(v), colour.getY(v), colour.getZ(v), 1].forEach((x, i) => (sum[i] += x));
    });
    return sums.map(([r, g, b, n]) => [r / n, g / n, b / n]);
}"""
# Keeps of every frame whether it has settled, and whether it is marked as one that has not.
WATCH = """() => {
    const { conversation, specimens: [specimen] } = viscera;
    const { onFrame } = conversation;
    window.seen = [];
    conversation.onFrame = (numbers) => {
        onFrame(numbers);
        viscera.show();
        window.seen.push([specimen.facts.isSettled, specimen.root.classList.contains("is-unsettled")]);
    };
}"""
SHOW = "(isShown) => { viscera.specimens[0].surroundings.group.visible = isShown; }"


@pytest.fixture(scope="module")
def case(bar: vs.Mesh, tmp_path_factory: pytest.TempPathFactory) -> SceneCase:
    folder = tmp_path_factory.mktemp("scene")
    bar.write(folder / "bar.vtu")
    (folder / "scene.toml").write_text(SCENE)
    read = vs.case(folder / "scene.toml")
    assert isinstance(read, SceneCase)
    return read


@pytest.fixture(scope="module")
def page(look_at: Look, server: Server, case: SceneCase) -> Iterator[Viewer]:
    with serve_live(case, "Bars") as running:
        viewer = look_at(running.url)
        yield viewer
        assert viewer.complaints == []
        viewer.close()


def field_of(viewer: Viewer) -> np.ndarray[Any, Any]:
    """Displacement (s, 3) of the surface nodes [m]."""
    return np.reshape(viewer.state["specimens"][0]["field"], (-1, 3))


def test_a_drag_of_one_organ_moves_the_other(page: Viewer, case: SceneCase) -> None:
    scene = case.organ()
    page.page.wait_for_function(STILL)
    x, y = page.place(TOP)
    page.page.mouse.move(x, y)
    page.page.mouse.down()
    assert page.state["held"]["organ"] == "upper"
    page.page.mouse.move(x, y + 30, steps=6)
    page.page.wait_for_timeout(200)
    page.page.wait_for_function(STILL)
    page.shoot("scene")
    state = page.state
    assert state["place"] == "on this machine"
    held = state["held"]
    patch = scene.patch(held["point"], radius(scene), held["organ"])
    exact = scene.solve(displacement={patch: held["displacement"]}, steps=4)
    assert exact.is_converged
    size = np.abs(exact.displacement).max()
    assert size > 0.01
    assert field_of(page) == pytest.approx(exact.displacement[scene.mesh.surface_nodes], abs=1e-3 * size)
    lower = scene.of_node[scene.mesh.surface_nodes] == 0
    assert field_of(page)[lower, 2].min() < -1e-3  # nobody but the upper one touches it
    force = np.linalg.norm(exact.reaction(patch))
    label = page.page.locator(".force-label:visible")
    assert float(label.inner_text().removesuffix(" N")) == pytest.approx(force, rel=0.02)
    assert "upper: " in page.call("caption")
    page.page.mouse.up()
    page.page.wait_for_function(STILL)
    assert np.abs(field_of(page)).max() < 1e-3 * size


def test_what_has_not_settled_is_marked(page: Viewer) -> None:
    """A hand that jumps needs more frames than one; until it has arrived, its force is grey."""
    page.page.wait_for_function(STILL)
    page.page.evaluate(WATCH)
    page.call("touch", TOP, [0.0, 0.02, -0.04])
    page.page.wait_for_function("() => window.seen.length > 0 && window.seen.at(-1)[0]")
    marked = page.page.evaluate("() => window.seen")
    assert not marked[0][0]
    assert all(is_settled != is_marked for is_settled, is_marked in marked)
    page.call("reset")
    page.page.wait_for_function(STILL)
    assert np.abs(field_of(page)).max() < 1e-6


def test_organs_differ_in_colour(page: Viewer) -> None:
    lower, upper = np.array(page.page.evaluate(COLOURS))
    assert np.linalg.norm(lower - upper) > 0.05
    names = page.page.locator("header .organ")
    assert names.all_inner_texts() == ["lower", "upper"]
    said = page.page.locator("header p").text_content()
    assert re.match(r"lower, upper; \d+ surface nodes · ", said), "what a screen reader says runs nothing together"
    first, second = names.evaluate_all("(names) => names.map((at) => getComputedStyle(at, '::before').backgroundColor)")
    assert first != second


@pytest.mark.parametrize("point", [(0.2, -0.12, 0.1), (0.5, 0.2, -0.05), (0.45, 0.05, 0.05)],
                         ids=["sphere", "plate", "spring"])  # fmt: skip
def test_bodies_and_springs_are_drawn(page: Viewer, point: tuple[float, float, float]) -> None:
    page.page.wait_for_function(STILL)
    shown = page.colour_at(point)
    page.page.evaluate(SHOW, False)
    hidden = page.colour_at(point)
    page.page.evaluate(SHOW, True)
    assert np.abs(np.subtract(shown, hidden)).max() > 10


def test_what_a_body_hides_is_not_grasped(page: Viewer) -> None:
    page.page.wait_for_function(STILL)
    x, y = page.place((0.2, -0.12, 0.1))
    hit = "([x, y]) => viscera.pointer.under(x, y)?.organ ?? null"
    assert page.page.evaluate(hit, [x, y]) is None
    page.page.evaluate(SHOW, False)
    assert page.page.evaluate(hit, [x, y]) == 0
    page.page.evaluate(SHOW, True)


def test_a_bad_request_is_a_sentence_on_the_page(page: Viewer) -> None:
    page.page.evaluate("() => viscera.conversation.link.send(JSON.stringify({ grab: [9, 9, 9] }))")
    page.page.get_by_text("no free surface within").wait_for()
    page.call("reset")
    page.page.wait_for_function(STILL)


def test_what_cannot_be_held_is_let_go(page: Viewer) -> None:
    page.page.wait_for_function(STILL)
    page.call("touch", (0.0, 0.05, 0.16), [0.0, 0.0, 0.0])
    warning = page.page.locator(".warning.is-shown")
    warning.wait_for()
    assert warning.inner_text() == "the surface is fixed at the point (0, 50, 160) mm; take hold beside it"
    page.call("touch", TOP, [0.0, 0.0, 0.01])
    page.page.wait_for_function(STILL)
    assert warning.count() == 0
    force = page.state["specimens"][0]["force"]
    page.call("touch", (0.352, 0.05, 0.21), [0.0, 0.0, -0.01], 1)
    warning.wait_for()
    page.call("move", [0.0, 0.0, 0.01], 1)
    page.page.wait_for_function(STILL)
    assert warning.inner_text() == "both hands hold the same place; take hold elsewhere"
    assert [hand is not None for hand in page.state["hands"]] == [True, False]
    assert page.state["specimens"][0]["force"] == pytest.approx(force, rel=1e-3, abs=1e-6)
    page.call("rest")
    page.page.wait_for_function(STILL)


# Keeps all that a view says is the matter, from its first frame on.
LISTEN = """
let view;
window.said = [];
Object.defineProperty(window, "viscera", {
    get: () => view,
    set: (made) => {
        view = made;
        const say = made.speech.say.bind(made.speech);
        made.speech.say = (caption, trouble) => {
            if (trouble) window.said.push(trouble);
            say(caption, trouble);
        };
    },
});
"""


def test_an_example_anyone_can_open(look_at: Look, server: Server) -> None:
    """It comes to its gravity by frames that are cut and unstable, and no hand has done that."""
    example = vs.case(Path(__file__).resolve().parents[2] / "examples" / "scene.toml")
    with serve_live(example, "Scene") as running:
        viewer = look_at(running.url, scripts=[LISTEN])
        viewer.page.wait_for_function("() => viscera.state().specimens[0].isSettled")
        viewer.page.wait_for_timeout(1000)
        viewer.shoot("scene-example")
        assert viewer.page.locator("header .organ").all_inner_texts() == ["lower", "upper"]
        assert viewer.page.locator("header p").inner_text().endswith("loads of the case are not applied: force")
        assert viewer.page.evaluate("() => window.said") == []
        assert viewer.complaints == []
        viewer.close()
