"""A stepper that a kernel steps: several views of one widget, and a kernel that does not answer."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.web.notebook import answered

import viscera as vs
from viscera.viewer import Server
from viscera.viewer.stepped import radius

expect = pytest.importorskip("playwright.sync_api").expect

TOP = (0.3, 0.05, 0.1)
PUSH = (0.0, 0.0, -0.01)
ELSEWHERE = "The organ is held in another view"
# Five seconds of patience are a moment here.
IMPATIENT = """
const later = window.setTimeout;
window.setTimeout = (work, wait, ...more) => later(work, wait >= 5000 ? 150 : wait, ...more);
"""


@pytest.fixture
def widget(bar: vs.Mesh, server: Server) -> Any:
    pytest.importorskip("anywidget")
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.45), fixed="root")
    return organ.stepper(iterations=10).view("Bar")


def press(tab: Any, view: int, key: str) -> None:
    tab.locator(f"#cell{view} canvas.stage").focus()
    tab.keyboard.press(key)


def shown(tab: Any, view: int) -> Any:
    return tab.locator(f"#cell{view} .force").first


def written(force: Any) -> str:
    """The size of a force [N] as the page writes it."""
    size = np.linalg.norm(force)
    return f"{size:.{1 if size > 9.995 else 2}f}"


def hands(widget: Any) -> list[Any]:
    return [held for held in widget._played._hands if held]


def test_one_view_holds_and_the_other_shows_what_it_does(browser: Any, widget: Any) -> None:
    with answered(browser, widget, views=2) as tab:
        press(tab, 0, "Enter")
        expect(shown(tab, 0)).not_to_have_text("0.00")
        expect(tab.locator("#cell1 .warning.is-shown")).to_contain_text(ELSEWHERE)
        [before] = hands(widget)
        # Who does not hold the organ cannot let it go.
        press(tab, 1, "Escape")
        tab.wait_for_timeout(100)
        assert hands(widget) == [before]
        # Who takes hold, takes it over.
        tab.evaluate("() => (window.saved.length = 0)")
        press(tab, 1, "+")
        expect(tab.locator("#cell0 .warning.is-shown")).to_contain_text(ELSEWHERE)
        expect(tab.locator("#cell1 .warning.is-shown")).to_have_count(0)
        [after] = hands(widget)
        assert after.hand is not before.hand
        tab.wait_for_function("() => window.saved.length > 0 && window.saved.at(-1).is_trusted")
        told = tab.evaluate("() => window.saved.at(-1)")
        assert told["displacement"] == pytest.approx(after.hand.displacement.tolist())
        for view in (0, 1):
            expect(shown(tab, view)).to_have_text(written(told["force"]))
        press(tab, 1, "Escape")
        expect(shown(tab, 0)).to_have_text("0.000")
        expect(tab.locator("#cell0 .warning.is-shown")).to_have_count(0)
        assert hands(widget) == []
        assert tab.evaluate("() => window.saved.at(-1).force") is None
        assert tab.complaints == []


def test_a_touch_from_python_is_seen_in_all_views_and_held_once(browser: Any, widget: Any) -> None:
    with answered(browser, widget, views=2) as tab:
        widget.touch(TOP, PUSH)
        [held] = hands(widget)
        state = {name: getattr(widget, name) for name in ("asked", "force", "displacement")}
        tab.evaluate("(state) => window.fromPython(state)", state)
        for view in (0, 1):
            expect(shown(tab, view)).to_have_text(written(widget.force))
            expect(tab.locator(f"#cell{view} .warning.is-shown")).to_have_count(0)
        assert hands(widget) == [held]
        press(tab, 0, "Escape")
        expect(shown(tab, 1)).to_have_text("0.000")
        assert hands(widget) == []


def test_a_kernel_that_does_not_answer_is_said_and_its_force_is_no_settled_one(browser: Any, widget: Any) -> None:
    with answered(browser, widget, script=IMPATIENT) as tab:
        press(tab, 0, "Enter")
        tab.wait_for_function("() => window.saved.at(-1)?.is_trusted")
        tab.evaluate("() => (window.isDead = true)")
        press(tab, 0, "+")
        warning = tab.locator("#cell0 .warning.is-shown")
        expect(warning).to_contain_text("The kernel does not answer")
        tab.locator("#cell0 .specimen.is-unsettled").wait_for()
        assert not tab.evaluate("() => window.saved.at(-1).is_trusted")
        # Nothing is taken hold of meanwhile.
        press(tab, 0, "Escape")
        press(tab, 0, "Enter")
        tab.evaluate("() => (window.isDead = false)")
        warning.wait_for(state="hidden")
        expect(shown(tab, 0)).to_have_text("0.000")
        assert hands(widget) == []
        press(tab, 0, "Enter")
        tab.wait_for_function("() => window.saved.at(-1)?.is_trusted")


def test_what_the_page_tells_while_a_hand_moves_belongs_together(browser: Any, widget: Any) -> None:
    with answered(browser, widget) as tab:
        press(tab, 0, "Enter")
        for _ in range(8):
            tab.keyboard.press("+")
            tab.wait_for_timeout(30)
        tab.wait_for_function("() => window.saved.at(-1)?.is_trusted")
        told = [saved for saved in tab.evaluate("() => window.saved") if saved["is_trusted"]]
    organ = widget._played._organ
    patch = organ.patch(told[-1]["point"], radius(organ))
    for saved in told:
        force = organ.solve(displacement={patch: saved["displacement"]}).reaction(patch)
        assert saved["force"] == pytest.approx(force.tolist(), abs=2e-2 * np.linalg.norm(force))
