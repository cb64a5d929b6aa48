"""What lies within an organ: it is seen, moves with the touch, and says how far it moved by the numbers of Python."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import viscera as vs
from viscera.viewer import Server, serve

if TYPE_CHECKING:
    from tests.web.conftest import Viewer

TOP = (0.3, 0.05, 0.1)
PUSH = (0.0, 0.002, -0.015)
TUMOUR = "within 24 mm of (32.5, 7.5, 7.5) cm"


@pytest.fixture(scope="module")
def ill(bar: vs.Mesh) -> vs.Touch:
    """The bar with a hard tumour, and a set that is most of it and therefore no part within."""
    mesh = replace(bar.with_cell_sets(tumour=TUMOUR, tissue="x > 10%"), axes="LPS")
    law = vs.NeoHookean(young=mesh.per_cell(1e5, {"tumour": 1e6}), poisson=0.45)
    return vs.Organ(mesh, law, fixed="root").reduce(lambda x: x[:, 0] > 0.1, radius=0.07, depth=0.025, order=3)


@pytest.fixture(scope="module")
def viewer(ill: vs.Touch, server: Server, look_at: Callable[..., Viewer]) -> Iterator[Viewer]:
    with serve(ill, "Bar") as running:
        opened = look_at(running.url)
        yield opened
        opened.close()


@pytest.fixture(autouse=True)
def letting_go(viewer: Viewer) -> Iterator[None]:
    viewer.call("rest")
    yield
    assert viewer.complaints == []


def test_a_part_within_moves_by_the_numbers_of_python(viewer: Viewer, ill: vs.Touch) -> None:
    assert viewer.state["looking"] == "translucent"
    assert viewer.state["inside"] is None
    viewer.call("touch", TOP, PUSH)
    state = viewer.state
    (shift,) = state["inside"]
    assert shift["name"] == "tumour"
    target = ill(state["point"], PUSH).target("tumour")
    assert shift["distance"] == pytest.approx(target.distance, rel=1e-4)
    assert shift["band"] == pytest.approx(target.band, rel=1e-4)
    viewer.page.wait_for_function(f"() => viscera.display.inside.root.innerText.includes('{target!s}')")
    viewer.shoot("inside")


def test_what_is_drawn_within_is_where_python_has_it(viewer: Viewer, ill: vs.Touch) -> None:
    viewer.call("touch", TOP, PUSH)
    drawn = viewer.page.evaluate(
        "() => [...viscera.display.inside.group.children[0].geometry.attributes.position.array]",
    )
    mesh = ill.mesh
    nodes = np.unique(mesh.cells[mesh.cells_in("tumour")])
    moved = (mesh.points + ill(viewer.state["point"], PUSH).displacement)[nodes]
    corners = np.reshape(drawn, (-1, 3))
    gaps = np.linalg.norm(corners[:, None] - moved, axis=2).min(axis=0)
    surface = np.isin(nodes, vs.reduced.parts.boundary(mesh, mesh.cells_in("tumour")))
    assert gaps[surface].max() < 1e-5


def test_a_lower_order_widens_the_band(viewer: Viewer) -> None:
    viewer.call("touch", TOP, PUSH)
    best = viewer.state["inside"][0]["band"]
    viewer.call("setOrder", 1)
    assert viewer.state["inside"][0]["band"] > best
    viewer.call("setOrder", 3)


def test_a_cut_opens_the_organ_and_a_hand_reaches_through_it(viewer: Viewer) -> None:
    x, y = viewer.place(TOP)
    pressed: Any = "([x, y]) => viscera.pointer.under(x, y)?.rest ?? null"
    assert viewer.page.evaluate(pressed, [x, y]) is not None
    viewer.page.keyboard.press("i")
    assert viewer.state["looking"] == "cut"
    slider = viewer.page.get_by_label("depth of the cut")
    assert slider.is_visible()
    viewer.page.evaluate("() => viscera.sight.cutAt(0.2)")
    viewer.shoot("cut")
    viewer.page.evaluate("() => viscera.sight.cutAt(0.5)")  # beyond the organ: nothing is left to be pressed
    assert viewer.page.evaluate(pressed, [x, y]) is None
    viewer.page.keyboard.press("i")
    assert viewer.state["looking"] == "solid"
    assert not slider.is_visible()
    assert viewer.page.evaluate(pressed, [x, y]) is not None


def test_all_stiffnesses_times_a_factor(viewer: Viewer, ill: vs.Touch, bar: vs.Mesh) -> None:
    """Exact about a rest that is free of stress: the same as the model of the organ that is made of other stuff."""
    viewer.call("touch", TOP, PUSH)
    soft = viewer.state
    viewer.page.get_by_label("stiffness").fill("1.5")
    hard = viewer.state
    factor = 2**1.5
    assert hard["stiffness_factor"] == pytest.approx(factor)
    assert hard["field"] == soft["field"]
    assert hard["error_estimate"] == soft["error_estimate"]
    law = vs.NeoHookean(young=bar.per_cell(factor * 1e5, {TUMOUR: factor * 1e6}), poisson=0.45)
    other = vs.Organ(bar, law, fixed="root").reduce(lambda x: x[:, 0] > 0.1, radius=0.07, depth=0.025, order=3)
    answer = other(hard["point"], PUSH)
    assert np.allclose(hard["force"], answer.force, rtol=1e-6)
    assert np.allclose(np.reshape(hard["stiffness"], (3, 3)), answer.stiffness, rtol=1e-5, atol=1e-3)
    viewer.call("setStiffness", 1)


def test_letters_stand_where_the_patient_has_them(viewer: Viewer) -> None:
    """LPS: x to the left of the patient, y to the back, z to the head."""
    letters = viewer.page.evaluate("() => { viscera.display.gauge.follow(); return viscera.display.gauge.letters }")
    assert set(letters) == set("RLAPSI")
    middle = np.array([0.2, 0.05, 0.05])
    x, y = viewer.place(middle)
    for letter, opposite, axis in zip("LPS", "RAI", np.eye(3), strict=True):
        to_x, to_y = viewer.place(middle + 1e-3 * axis)
        seen = np.array([to_x - x, y - to_y])
        assert letters[letter] @ seen > 0.98 * np.linalg.norm(letters[letter]) * np.linalg.norm(seen)
        assert np.allclose(letters[opposite], np.negative(letters[letter]))
