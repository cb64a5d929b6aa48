"""The page in a real browser: its numbers are those of Python, its controls do what they say."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from numpy.typing import NDArray

import viscera as vs
from viscera import _core

if TYPE_CHECKING:
    from tests.web.conftest import Viewer

expect = pytest.importorskip("playwright.sync_api").expect
TOP = (0.3, 0.05, 0.1)
# Keeps what a probe feels at every place it comes to.
RECORD = """() => {
    const { evaluator } = viscera;
    const place = evaluator.place.bind(evaluator);
    window.felt = [];
    evaluator.place = (center) => {
        const felt = place(center);
        window.felt.push([center, felt.grip, felt.force, felt.decisive.ofContact]);
        return felt;
    };
}"""
# Lets seconds pass on a load path.
WALK = "(seconds) => window.viscera.stage.onFrame(seconds)"

# The same in frames of a tenth of a second.
STROLL = "(seconds) => { for (let gone = 0; gone < seconds; gone += 0.1) window.viscera.stage.onFrame(0.1); }"


@pytest.fixture(autouse=True)
def letting_go(viewer: Viewer) -> Iterator[None]:
    """Every test begins with an organ at rest, and none may make the page complain."""
    viewer.call("rest")
    viewer.call("setOrder", 4)
    viewer.call("setColouring", "tissue")
    yield
    assert viewer.complaints == []


def close(found: Any, expected: Any, tolerance: float = 1e-5) -> bool:
    """Whether two vectors agree relative to the second one's norm."""
    difference = np.asarray(found, float).ravel() - np.asarray(expected, float).ravel()
    return bool(np.linalg.norm(difference) <= tolerance * np.linalg.norm(expected))


def volume(points: NDArray[np.float64], triangles: NDArray[Any]) -> float:
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def test_the_page_is_there(viewer: Viewer) -> None:
    assert viewer.page.title() == "Bar · Viscera"
    assert viewer.page.locator("h1").inner_text() == "Bar"
    assert "neo-Hookean" in viewer.page.locator("header p").inner_text()
    assert viewer.state["activity"] == "rest"


def test_a_drag_moves_the_organ_by_the_numbers_of_python(viewer: Viewer, touch: vs.Touch) -> None:
    x, y = viewer.place(TOP)
    mouse = viewer.page.mouse
    mouse.move(x, y)
    mouse.down()
    mouse.move(x, y + 25, steps=4)
    held = viewer.state
    shown = viewer.page.locator(".force").inner_text()
    viewer.shoot("drag")
    mouse.up()
    assert held["activity"] == "held"
    point, push = held["point"], held["displacement"]
    assert np.linalg.norm(np.subtract(point, TOP)) < 1e-3
    assert push[2] < -1e-3  # in, along the normal of the upper face
    answer = touch(point, push)
    assert close(held["field"], touch.surface_displacement(point, push))
    assert close(held["force"], answer.force)
    assert close(held["stiffness"], answer.stiffness)
    assert held["error_estimate"] == pytest.approx(answer.error_estimate, rel=1e-5)
    assert held["is_trusted"] == answer.is_trusted
    assert float(shown) == pytest.approx(np.linalg.norm(answer.force), abs=0.006)


# Turns a wheel of lines or pages by so much, at a place.
ROLL = """([mode, by, clientX, clientY]) => viscera.stage.canvas.dispatchEvent(
    new WheelEvent("wheel", { deltaMode: mode, deltaY: by, clientX, clientY, cancelable: true }))"""


def test_the_wheel_pushes_in_by_tenths_of_the_depth(viewer: Viewer, touch: vs.Touch) -> None:
    x, y = viewer.place(TOP)
    mouse = viewer.page.mouse
    mouse.move(x, y)
    mouse.down()
    depths = [0.0]

    def roll(mode: int, by: float) -> float:
        """How far a turn of the wheel has moved the contact in [parts of the depth]."""
        viewer.page.evaluate(ROLL, [mode, by, x, y])
        depths.append(-viewer.state["displacement"][2] / touch.depth)
        return depths[-1] - depths[-2]

    assert [roll(mode, notch) for mode, notch in enumerate((100, 3, 1))] == pytest.approx([0.1, 0.1, 0.1], abs=1e-3)
    # Where the tool slips, nothing is turned that would have to be turned back.
    for _ in range(20):
        roll(0, 100)
    assert depths[-1] == pytest.approx(1.3, abs=1e-3)
    assert roll(0, -100) == pytest.approx(-0.1, abs=1e-3)
    for _ in range(40):
        roll(0, -100)
    assert depths[-1] == pytest.approx(-1.3, abs=1e-3)
    assert roll(0, 100) == pytest.approx(0.1, abs=1e-3)
    # A drag beyond the range is not undone by the wheel.
    mouse.move(x, y + 300, steps=2)
    deep = viewer.state["displacement"]
    roll(0, 100)
    assert viewer.state["displacement"] == pytest.approx(deep)
    mouse.up()


def test_letting_go_brings_the_organ_back(viewer: Viewer) -> None:
    x, y = viewer.place(TOP)
    viewer.page.mouse.move(x, y)
    viewer.page.mouse.down()
    viewer.page.mouse.move(x, y + 20, steps=2)
    viewer.page.mouse.up()
    viewer.wait_for("rest")
    viewer.page.wait_for_selector(".force-label", state="hidden")


def test_keys_do_not_move_what_a_hand_holds(viewer: Viewer) -> None:
    x, y = viewer.place(TOP)
    viewer.page.mouse.move(x, y)
    viewer.page.mouse.down()
    viewer.page.mouse.move(x, y + 20, steps=2)
    before = viewer.state["displacement"]
    for key in ("ArrowUp", "+", "Enter"):
        viewer.page.keyboard.press(key)
    assert viewer.state["displacement"] == before
    assert viewer.state["activity"] == "held"
    viewer.page.mouse.up()
    viewer.wait_for("rest")  # it stayed, as if it were kept


def test_a_kept_touch_stays(viewer: Viewer) -> None:
    viewer.call("setKeeping", True)
    x, y = viewer.place(TOP)
    viewer.page.mouse.move(x, y)
    viewer.page.mouse.down()
    viewer.page.mouse.move(x, y + 20, steps=2)
    viewer.page.mouse.up()
    assert viewer.state["activity"] == "kept"
    viewer.call("setKeeping", False)


def test_a_probe_presses_and_slides_by_the_numbers_of_python(viewer: Viewer, touch: vs.Touch) -> None:
    """Pressed in, then drawn along: the same probe in Python goes through the same centres."""
    viewer.page.evaluate(RECORD)
    viewer.page.keyboard.press("f")
    viewer.call("setKeeping", True)
    x, y = viewer.place(TOP)
    mouse = viewer.page.mouse
    mouse.move(x, y)
    mouse.down()
    mouse.move(x, y + 20, steps=4)
    pressed = viewer.state
    viewer.call("setTool", "drag")
    mouse.move(x + 20, y + 20, steps=4)
    mouse.up()
    slid = viewer.state
    viewer.shoot("probe")
    probe = touch.probe()
    found = viewer.page.evaluate("() => window.felt")
    felt = [probe.place(center) for center, *_ in found]
    assert [grip for _, grip, *_ in found] == [told.grip for told in felt]
    for (_, _, force, of_contact), told in zip(found, felt, strict=True):
        # The model's own error decides of a light touch.
        assert of_contact in (0.0, _core.CONTACT_ERROR)
        assert force == pytest.approx(told.force.tolist(), abs=1e-5 * np.linalg.norm(felt[-1].force))
    last = felt[-1]
    assert found[-1][3] == _core.CONTACT_ERROR
    assert last.grip == "slides"
    assert slid["probe"]["gap"] == pytest.approx(last.gap, abs=1e-9)
    assert close(slid["force"], last.force)
    assert close(slid["field"], last.displacement[touch.surface_nodes])
    assert slid["error_estimate"] == pytest.approx(last.error_estimate, rel=1e-5)
    assert slid["is_trusted"] == last.is_trusted
    # Without friction the contact goes along with the sphere.
    assert np.linalg.norm(np.subtract(slid["point"], pressed["point"])) > 0.1 * touch.radius
    # Kept where it is without the probe: the contact itself is held from now on.
    viewer.page.keyboard.press("f")
    assert viewer.state["probe"] is None
    assert close(viewer.state["force"], touch(slid["point"], slid["displacement"]).force)
    viewer.call("setTool", "push")
    viewer.call("setKeeping", False)


def test_a_probe_stands_where_it_is_held(viewer: Viewer, touch: vs.Touch) -> None:
    shown = """() => {
        const { shaft, head, probe } = viscera.display.arrow;
        const { group, radius } = probe;
        return [shaft.visible, head.visible, group.visible, radius, ...group.position.toArray()];
    }"""
    viewer.call("setKeeping", True)
    x, y = viewer.place(TOP)
    viewer.page.mouse.move(x, y)
    viewer.page.mouse.down()
    viewer.page.mouse.move(x, y + 20, steps=2)
    viewer.page.mouse.up()
    button = viewer.page.locator("button", has_text="Probe")
    assert viewer.page.evaluate(shown)[:3] == [True, True, False]
    viewer.page.keyboard.press("f")
    assert button.get_attribute("aria-pressed") == "true"
    *visible, radius, px, py, pz = viewer.page.evaluate(shown)
    assert visible == [False, False, True]
    assert radius == pytest.approx(touch.radius, rel=1e-5)
    assert (px, py, pz) == pytest.approx(viewer.state["probe"]["center"])
    # Lifted off it is still there, and feels nothing.
    viewer.call("move", [0.0, 0.0, 0.02])
    assert viewer.state["probe"]["grip"] == "free"
    assert np.linalg.norm(viewer.state["force"]) == 0
    assert viewer.page.evaluate(shown)[:3] == [False, False, True]
    viewer.page.keyboard.press("f")
    viewer.call("setKeeping", False)


@pytest.mark.parametrize("push", [(0.0, 0.0, -0.02), (0.004, -0.006, 0.008)])
def test_what_every_order_says(viewer: Viewer, touch: vs.Touch, push: tuple[float, float, float]) -> None:
    viewer.call("touch", TOP, push)
    state = viewer.state
    full = touch.surface_displacement(state["point"], push)
    rest = touch.mesh.points
    surface = touch.mesh.surface
    moved = rest.copy()
    moved[touch.surface_nodes] += full
    gain = volume(moved, surface) / volume(rest, surface) - 1
    assert state["orders"][3]["volume"] == pytest.approx(gain, abs=1e-6)
    assert state["orders"][3]["force"] == pytest.approx(
        float(np.linalg.norm(touch(state["point"], push).force)), rel=1e-5
    )
    # The first order is the slope at rest: linear theory.
    small = 1e-4
    slope = touch.surface_displacement(state["point"], np.multiply(small, push)) / small
    viewer.call("setOrder", 1)
    assert close(viewer.state["field"], slope, 1e-3)
    linear = touch.surface_displacement(state["point"], push, order=1)
    assert close(viewer.state["field"], linear)
    off = np.linalg.norm(slope - full) / np.linalg.norm(full)
    assert state["orders"][0]["off"] == pytest.approx(off, rel=1e-2)


def test_linear_theory_gains_volume_and_the_page_says_so(viewer: Viewer) -> None:
    viewer.call("touch", (0.15, 0.05, 0.1), (0.0, 0.0, -0.025))
    orders = viewer.state["orders"]
    assert orders[0]["volume"] > 5 * abs(orders[3]["volume"])
    row = viewer.page.locator(".orders tbody tr").first.inner_text()
    assert f"+{100 * orders[0]['volume']:.2f}" in row
    viewer.call("setOrder", 1)
    assert "linear theory" in viewer.page.locator(".warning.is-shown").inner_text()


def test_what_is_not_to_be_trusted_is_red(viewer: Viewer, touch: vs.Touch) -> None:
    assert viewer.page.locator(".warning.is-shown").count() == 0
    viewer.call("touch", TOP, (0.0, 0.0, -1.2 * touch.depth))
    assert not viewer.state["is_trusted"]
    assert "made for" in viewer.page.locator(".warning.is-shown").inner_text()
    viewer.shoot("warning")


def test_a_tool_slips_far_beyond_the_depth(viewer: Viewer, touch: vs.Touch) -> None:
    viewer.call("touch", TOP, (0.0, 0.0, -1.0))
    assert np.linalg.norm(viewer.state["displacement"]) == pytest.approx(1.3 * touch.depth)


def test_modes_are_those_of_the_file(viewer: Viewer, touch: vs.Touch) -> None:
    modes = touch._model.array("surface_modes").reshape(len(touch._model.array("mode_scale")), -1)
    shown = viewer.page.evaluate("() => [...window.viscera.evaluator.mode(2)]")
    assert close(shown, modes[2] / np.abs(modes[2]).max())
    starts, regions = touch._model.array("region_start"), touch._model.array("position_region")
    counts = np.diff(starts)
    terms = 34
    position = int(np.flatnonzero(regions == 0)[0])
    offset = int((terms * counts[regions[:position]]).sum())
    coefficient = touch._model.array("position_coefficients")[offset + 5 * int(counts[0]) + 2]
    metres = coefficient * touch._model.array("mode_scale")[2] * np.abs(modes[2]).max() * touch.depth**2
    weights = viewer.page.evaluate("() => [...window.viscera.evaluator.modeAmplitude(2, 5)]")
    assert weights[position] == pytest.approx(metres, rel=1e-4)
    viewer.call("toggleModes")
    assert viewer.page.locator(".modes").is_visible()
    viewer.shoot("modes")
    viewer.page.keyboard.press("Escape")


def test_the_load_path_wanders(viewer: Viewer, touch: vs.Touch) -> None:
    viewer.call("togglePath")
    points = set()
    for _ in range(4):
        viewer.page.evaluate(WALK, 1.0)
        state = viewer.state
        assert state["activity"] == "path"
        points.add(tuple(state["point"]))
        if np.linalg.norm(state["displacement"]) > 1e-3:
            assert close(state["field"], touch.surface_displacement(state["point"], state["displacement"]))
    assert len(points) == 4
    viewer.call("togglePath")


def test_the_load_path_leaves_its_shapes(viewer: Viewer, touch: vs.Touch) -> None:
    viewer.call("togglePath")
    viewer.page.evaluate(WALK, 4.5)
    some = viewer.state["shapes"]
    assert 2 <= some < 7
    viewer.page.evaluate(STROLL, 9.0)  # the page's own frames go on between two calls: the path may begin again
    assert viewer.state["shapes"] == 7
    viewer.shoot("path")
    rest = touch.mesh.points[touch.surface_nodes]
    for shape in (1, 5):
        point, push, drawn = viewer.page.evaluate(
            """(shape) => {
                const { trail } = window.viscera.demonstration.walk;
                const { point, displacement } = trail.station(shape);
                return [point, displacement, [...trail.footprints[shape].geometry.attributes.position.array]];
            }""",
            shape,
        )
        moved = np.reshape(drawn, (-1, 3)) - rest
        full = touch.surface_displacement(point, push)
        assert moved == pytest.approx(full, abs=1e-5 * np.abs(full).max() + 1e-7)  # positions are single precision
    viewer.call("togglePath")
    assert viewer.state["shapes"] == 0


def test_the_keyboard_can_do_it_all(viewer: Viewer) -> None:
    viewer.page.locator("canvas.stage").focus()
    press = viewer.page.keyboard.press
    press("Enter")
    depth = np.linalg.norm(viewer.state["displacement"])
    press("+")
    assert np.linalg.norm(viewer.state["displacement"]) > depth > 0
    press("2")
    assert viewer.state["order"] == 2
    press("c")
    assert viewer.page.locator(".legend:visible").is_visible()
    press("w")
    press("w")
    press("?")
    assert viewer.page.locator(".help").is_visible()
    press("?")
    press("Escape")
    assert viewer.state["activity"] == "rest"


def strain(touch: vs.Touch, displacement: Any) -> Any:
    """Of every triangle the largest change of length in its plane, by singular values of its map; means at nodes (s,).

    displacement: (s, 3) of the surface nodes, from the shape without load.
    """
    rest = touch.rest.points[touch.surface_nodes]
    moved = rest + displacement
    triangles = np.searchsorted(touch.surface_nodes, touch.mesh.surface)
    total, area = np.zeros(len(rest)), np.zeros(len(rest))
    for rows in triangles:
        (a, b), (c, d) = np.diff(rest[rows], axis=0), np.diff(moved[rows], axis=0)
        stretch = np.linalg.svd(np.stack([c, d], 1) @ np.linalg.pinv(np.stack([a, b], 1)), compute_uv=False)[:2]
        weight = np.linalg.norm(np.cross(a, b))
        total[rows] += weight * np.abs(stretch - 1).max()
        area[rows] += weight
    return total / area


def test_strain_is_the_stretch_of_the_surface(viewer: Viewer, touch: vs.Touch) -> None:
    viewer.call("setColouring", "strain")
    viewer.call("touch", TOP, (0.0, 0.003, -0.02))
    shown = np.array(viewer.page.evaluate("() => [...viscera.display.painter.values]"))
    assert shown == pytest.approx(strain(touch, np.reshape(viewer.state["field"], (-1, 3))), abs=1e-5)
    assert "surface strain [%]" in viewer.page.locator(".legend:visible").inner_text()


@pytest.mark.parametrize("colouring", ["displacement", "error"])
def test_colours_have_a_legend(viewer: Viewer, colouring: str) -> None:
    viewer.call("setColouring", colouring)
    viewer.call("touch", TOP, (0.0, 0.003, -0.015))
    assert colouring[:4] in viewer.page.locator(".legend:visible").inner_text()
    viewer.shoot(colouring)


def test_the_error_of_a_probe_has_a_scale_as_wide_as_its_depth(viewer: Viewer, touch: vs.Touch) -> None:
    """Its estimate is never below 25 %: to the scale of a contact most of the organ would have one colour."""
    painted = "() => [viscera.display.legend.ticks.lastChild.textContent, [...viscera.display.painter.values]]"
    viewer.call("setColouring", "error")
    viewer.call("touch", TOP, (0.0, 0.0, -0.02))
    end, values = viewer.page.evaluate(painted)
    assert max(values) < 1e-3 * float(end) == pytest.approx(0.05 * touch.depth, rel=0.3)
    viewer.call("toggleProbe")
    wide, values = viewer.page.evaluate(painted)
    assert 1e-3 * float(end) < np.median(values) < np.quantile(values, 0.9) < 1e-3 * float(wide)
    # The distance of a lower order from the highest is that of the series.
    viewer.call("setOrder", 3)
    assert viewer.page.evaluate(painted)[0] == end
    viewer.call("toggleProbe")


def test_frame_times_are_reported(viewer: Viewer, record_property: Any) -> None:
    viewer.call("togglePath")
    # What is shown follows what is measured by a frame.
    for word in ("frames/s", "answer", "drawing"):
        expect(viewer.page.locator(".clock")).to_contain_text(word)
    frame = viewer.state["frame"]
    assert min(frame["rate"], frame["answer"], frame["drawing"]) > 0
    viewer.call("togglePath")
    for part, value in frame.items():
        record_property(part, value)
    print(frame)
