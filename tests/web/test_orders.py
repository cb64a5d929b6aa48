"""What a lower order of the series is worth: its force, its errors and the verdict on them belong together."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import viscera as vs

if TYPE_CHECKING:
    from tests.web.conftest import Viewer

TOP = (0.3, 0.05, 0.1)
# So deep that order 1 is off by more than is allowed there, in force but not in shape.
PUSH = (0.0, 0.0, -0.008)
ORDERS = (1, 2, 3, 4)
# The words on a picture, line by line.
WRITTEN = """() => {
    const lines = [];
    const write = CanvasRenderingContext2D.prototype.fillText;
    CanvasRenderingContext2D.prototype.fillText = function (words, ...place) {
        lines.unshift(words);
        return write.call(this, words, ...place);
    };
    viscera.share.drawn();
    CanvasRenderingContext2D.prototype.fillText = write;
    return lines;
}"""


@pytest.fixture(autouse=True)
def letting_go(viewer: Viewer) -> Iterator[None]:
    yield
    viewer.call("rest")
    viewer.call("setOrder", 4)
    viewer.call("setStiffness", 1)
    assert viewer.complaints == []


def allowance(touch: vs.Touch) -> float:
    """Of the push: 1 % up to 5 % of the diagonal."""
    assert np.linalg.norm(PUSH) < 0.05 * touch.metadata["diagonal"]
    return 0.01


def off(touch: vs.Touch, point: Any, force: Any) -> float:
    """How far a force is from that of the model."""
    exact = touch(point, PUSH).force
    return float(np.linalg.norm(np.subtract(force, exact)) / np.linalg.norm(exact))


def test_the_stiffness_is_that_of_the_chosen_order(viewer: Viewer, touch: vs.Touch) -> None:
    step = 1e-5

    def told(what: str, push: Any) -> np.ndarray[Any, Any]:
        viewer.call("touch", TOP, list(map(float, push)))
        return np.array(viewer.state[what])

    for order in (1, 2, 4):
        viewer.call("setOrder", order)
        ends = [[told("force", np.add(PUSH, sign * step * axis)) for sign in (1, -1)] for axis in np.eye(3)]
        slope = np.transpose([(ahead - behind) / (2 * step) for ahead, behind in ends])
        stiffness = told("stiffness", PUSH).reshape(3, 3)
        assert stiffness == pytest.approx(slope, abs=1e-4 * np.abs(slope).max())
    viewer.call("setOrder", 1)
    linear = touch(viewer.state["point"], (0.0, 0.0, 0.0)).stiffness
    assert told("stiffness", PUSH).reshape(3, 3) == pytest.approx(linear, abs=1e-5 * np.abs(linear).max())
    assert f"{np.trace(linear) / 3:.0f} N/m" in viewer.page.locator(".readings dl").inner_text()


def test_the_force_of_linear_theory_is_not_trusted_for_that_of_the_highest(viewer: Viewer, touch: vs.Touch) -> None:
    viewer.call("touch", TOP, PUSH)
    point, best = viewer.state["point"], touch(viewer.state["point"], PUSH)
    assert best.is_trusted
    viewer.call("setOrder", 1)
    state, told = viewer.state, viewer.page.evaluate("() => viscera.told")
    linear = touch(point, (0.0, 0.0, 0.0)).stiffness @ PUSH
    assert state["force"] == pytest.approx(linear.tolist(), rel=1e-5, abs=1e-5)
    distance = off(touch, point, linear)
    assert state["orders"][0]["off"] < 0.05
    assert distance > allowance(touch)
    assert state["error_estimate"] == pytest.approx(best.error_estimate + distance, rel=1e-4)
    assert not state["is_trusted"]
    assert (told["force"], told["is_trusted"]) == (state["force"], False)
    # So it is shown: in red, with its own error, and why.
    shown = viewer.page.locator(".readings dl").inner_text()
    assert f"{100 * state['error_estimate']:.1f} %" in shown
    assert viewer.page.locator(".readings.is-doubtful").count() == 1
    warning = viewer.page.locator(".warning.is-shown").inner_text()
    assert "the force of linear theory" in warning
    viewer.call("setOrder", 4)
    assert viewer.page.evaluate("() => viscera.told.is_trusted")
    assert viewer.state["error_estimate"] == pytest.approx(best.error_estimate, rel=1e-5)
    assert viewer.page.locator(".readings.is-doubtful").count() == 0


def test_every_order_is_trusted_by_its_own_estimate(viewer: Viewer, touch: vs.Touch) -> None:
    viewer.call("touch", TOP, PUSH)
    estimates = []
    for order in ORDERS:
        viewer.call("setOrder", order)
        state = viewer.state
        assert state["error_estimate"] >= off(touch, state["point"], state["force"])
        assert state["is_trusted"] == (state["error_estimate"] <= allowance(touch))
        assert state["is_shape_trusted"] == (state["shape_error_estimate"] <= allowance(touch))
        assert viewer.page.evaluate("() => viscera.told.is_trusted") == state["is_trusted"]
        estimates.append(state["error_estimate"])
    assert estimates == sorted(estimates, reverse=True)


def test_the_curve_of_a_lower_order_is_shaded_where_it_is_not_trusted(viewer: Viewer, touch: vs.Touch) -> None:
    viewer.call("touch", TOP, PUSH)
    depths, trusted = viewer.page.evaluate("() => [viscera.touching.curves.depths, viscera.touching.curves.isTrusted]")
    point = viewer.state["point"]
    slope = touch(point, (0.0, 0.0, 0.0)).stiffness
    for depth, of_linear, of_best in zip(depths, trusted[0], trusted[3], strict=True):
        push = (0.0, 0.0, -depth)
        best = touch(point, push)
        assert of_best == best.is_trusted
        if depth == 0.0 or depth > 0.05 * touch.metadata["diagonal"]:
            continue
        distance = np.linalg.norm(slope @ push - best.force) / np.linalg.norm(best.force)
        assert of_linear == (best.is_trusted and best.error_estimate + distance <= 0.01)
    assert trusted[0].index(False) < trusted[0].count(True) + 2  # one shaded part, from some depth on
    assert not trusted[0][-1]


def test_a_picture_says_what_its_force_is_worth(viewer: Viewer) -> None:
    viewer.call("touch", TOP, PUSH)
    size = np.linalg.norm(viewer.state["force"])
    assert viewer.call("caption") == f"{size:.2f} N at a depth of 8.0 mm."
    viewer.call("setOrder", 1)
    viewer.call("setStiffness", 3)
    size = np.linalg.norm(viewer.state["force"])
    said = f"{size:.1f} N at a depth of 8.0 mm, order 1, stiffness × 3.0, not trusted."
    assert viewer.call("caption") == said
    assert " ".join(viewer.page.evaluate(WRITTEN)) == f"Bar · {said}"
    # What is heard says it once.
    assert "not trusted." not in viewer.page.evaluate("() => viscera.display.speech.summary.next")
    # Where there is less room, in lines, none of which is cut off.
    viewer.page.set_viewport_size({"width": 320, "height": 480})
    viewer.page.wait_for_function("() => viscera.stage.canvas.clientWidth === 320")
    lines = viewer.page.evaluate(WRITTEN)
    assert len(lines) > 1
    assert " ".join(lines) == f"Bar · {said}"
    viewer.page.set_viewport_size({"width": 1100, "height": 720})


# What a redrawn curve writes beside its axes, (text, right-aligned, x, y), and where its point is [px].
DRAWN = """() => {
    const { fillText, arc } = CanvasRenderingContext2D.prototype;
    const drawn = { ticks: [], point: null };
    CanvasRenderingContext2D.prototype.fillText = function (words, x, y) {
        drawn.ticks.push([Number(words), this.textAlign === "right", x, y]);
        return fillText.call(this, words, x, y);
    };
    CanvasRenderingContext2D.prototype.arc = function (x, y, ...more) {
        drawn.point = [x, y];
        return arc.call(this, x, y, ...more);
    };
    viscera.display.readings.redraw();
    Object.assign(CanvasRenderingContext2D.prototype, { fillText, arc });
    drawn.ticks = drawn.ticks.filter(([value]) => !Number.isNaN(value));
    return drawn;
}"""


@pytest.mark.parametrize("part", [0.5, 1.3])
@pytest.mark.parametrize("order", [1, 4])
def test_the_point_of_the_curve_is_where_the_touch_is(viewer: Viewer, touch: vs.Touch, part: float, order: int) -> None:
    """Also beyond the depth that the model is made for, and where a lower order has the larger force."""
    viewer.call("setOrder", order)
    viewer.call("touch", TOP, (0.0, 0.0, -part * touch.depth))
    drawn, force = viewer.page.evaluate(DRAWN), np.linalg.norm(viewer.state["force"])
    depths = np.array([[x, value] for value, is_force, x, _ in drawn["ticks"] if not is_force])
    forces = np.array([[y, value] for value, is_force, _, y in drawn["ticks"] if is_force])
    for at, ticks, expected in zip(drawn["point"], (depths, forces), (1e3 * part * touch.depth, force), strict=True):
        assert np.polyval(np.polyfit(ticks[:, 0], ticks[:, 1], 1), at) == pytest.approx(expected, rel=1e-3)
    # The curve goes through it.
    known = viewer.page.evaluate(
        "(k) => [viscera.touching.curves.depths, viscera.touching.curves.forces[k]]", order - 1
    )
    assert np.interp(part * touch.depth, *known) == pytest.approx(force, rel=1e-2)
