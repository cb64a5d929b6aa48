"""Who has a keyboard alone sees all sides of the organ; who listens hears what the sliders say."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import pytest
from numpy.typing import NDArray

if TYPE_CHECKING:
    from tests.web.conftest import Viewer

FROM = "() => viscera.stage.camera.position.toArray()"


@pytest.fixture(autouse=True)
def letting_go(viewer: Viewer) -> Iterator[None]:
    """Every test begins with an organ at rest that is seen as at first, and the keys meant for it."""
    viewer.call("reset")
    viewer.page.locator("canvas.stage").focus()
    yield
    assert viewer.complaints == []


def looks(viewer: Viewer, *keys: str) -> NDArray[np.float64]:
    """From where the organ is looked at after these keys [diagonals]."""
    for key in keys:
        viewer.page.keyboard.press(key)
    return np.array(viewer.page.evaluate(FROM))


def test_keys_turn_the_view_to_every_side(viewer: Viewer) -> None:
    """A quarter turn in six presses, and not over the top; the distance stays."""
    first = looks(viewer)
    right = np.cross([0, 0, 1], first)
    assert looks(viewer, *"dddddd") == pytest.approx([*right[:2], first[2]], abs=1e-6)
    assert looks(viewer, *"ssssss") == pytest.approx(first, abs=1e-6)
    assert looks(viewer, "e")[2] > first[2]
    top = looks(viewer, *"eeeeeeeeeeee")
    assert np.hypot(*top[:2]) < 0.1
    bottom = looks(viewer, *"xxxxxxxxxxxxx")
    assert bottom[2] < -0.9 * top[2]
    assert np.linalg.norm(bottom) == pytest.approx(np.linalg.norm(first))


def test_keys_zoom(viewer: Viewer) -> None:
    first = looks(viewer)
    near = looks(viewer, "z")
    assert np.linalg.norm(near) < 0.95 * np.linalg.norm(first)
    assert looks(viewer, "Shift+Z") == pytest.approx(first, abs=1e-6)


def test_the_other_side_is_touched_by_keys_alone(viewer: Viewer) -> None:
    """Half a turn later the middle of the canvas shows another side."""
    looks(viewer, "Enter")
    front = np.array(viewer.state["point"])
    looks(viewer, "Escape", *"dddddddddddd", "Enter")
    back = np.array(viewer.state["point"])
    assert np.linalg.norm(back - front) > 0.04


def test_escape_closes_the_menu_and_keeps_the_touch(viewer: Viewer) -> None:
    viewer.call("touch", (0.3, 0.05, 0.1), (0.0, 0.0, -0.01))
    menu = viewer.page.locator("summary")
    menu.focus()
    viewer.page.keyboard.press("Enter")
    opened = viewer.page.get_by_role("button", name="Picture")
    assert opened.is_visible()
    opened.focus()
    viewer.page.keyboard.press("Escape")
    assert not opened.is_visible()
    assert menu.evaluate("summary => summary.matches(':focus')")
    assert viewer.state["activity"] == "kept"
    viewer.page.keyboard.press("Escape")
    assert viewer.state["activity"] == "rest"


def test_sliders_say_what_they_show(viewer: Viewer) -> None:
    """Not where they stand on their own scales."""

    def said(label: str) -> str | None:
        text: str | None = viewer.page.get_by_label(label, exact=True).get_attribute("aria-valuetext")
        return text

    assert said("stiffness") == "1.0 times"
    viewer.call("setStiffness", 2)
    assert said("stiffness") == "2.0 times"
    viewer.call("setStiffness", 1)
    viewer.page.get_by_role("button", name="Cut").click()
    assert said("depth of the cut") == "through the middle"
    viewer.page.get_by_label("depth of the cut").fill("0.1")
    diagonal = viewer.page.evaluate("() => viscera.stage.diagonal")
    assert said("depth of the cut") == f"{100 * diagonal:.3g} mm behind the middle"
    viewer.page.get_by_role("button", name="Solid").click()
    viewer.call("toggleModes")
    viewer.call("stepMode", 1)
    assert (said("mode") or "").startswith("F2 of ")
