"""What a page tells Python of touches, and what it shows: the same, whoever touched."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.web.conftest import settle
from tests.web.notebook import opened

import viscera as vs
from viscera.viewer import Server, page
from viscera.viewer.live import Reply, converse
from viscera.viewer.stepped import PlayedStepper, radius

if TYPE_CHECKING:
    from tests.web.conftest import Viewer

    Look = Callable[..., Viewer]

expect = pytest.importorskip("playwright.sync_api").expect

TOP = (0.3, 0.05, 0.1)
OTHER = (0.15, 0.05, 0.1)
NAMES = ("point", "displacement", "force", "is_trusted")


@pytest.fixture(scope="module")
def organ(bar: vs.Mesh) -> vs.Organ:
    return vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.45), fixed="root")


class Cell:
    """A notebook's cell with the view of a widget; traits go both ways as Jupyter carries them."""

    def __init__(self, tab: Any, widget: Any) -> None:
        self.tab = tab
        self.widget = widget
        self.force = tab.locator(".view .force")

    def touch(self, *touch: Any) -> None:
        """Touch from Python."""
        self.widget.touch(*touch)
        state = {name: getattr(self.widget, name) for name in (*NAMES, "asked")}
        self.tab.evaluate("(state) => window.fromPython(state)", state)

    def hear(self, condition: str) -> dict[str, Any]:
        """Wait until the page has told something, `told`, of which the condition holds, and carry it to Python."""
        self.tab.wait_for_function(f"() => {{ const told = window.saved.at(-1); return told && ({condition}); }}")
        told: dict[str, Any] = self.tab.evaluate("() => window.saved.at(-1)")
        for name in NAMES:
            self.widget.set_trait(name, told[name])
        return told

    def press(self, key: str) -> None:
        self.tab.locator(".view canvas.stage").focus()
        self.tab.keyboard.press(key)

    def expect_agreement(self) -> None:
        """The force that the page shows is the one that the widget holds, and so is its trust."""
        size = np.linalg.norm(self.widget.force)
        expect(self.force).to_have_text(f"{size:.{1 if size > 9.995 else 2}f}")  # as the page writes it
        is_doubtful = self.tab.locator(".view .readings").evaluate("(all) => all.classList.contains('is-doubtful')")
        assert is_doubtful is not self.widget.is_trusted


@contextmanager
def shown(browser: Any, widget: Any) -> Iterator[Cell]:
    """A widget in a page, with the traits that it has by now."""
    traits = {name: getattr(widget, name) for name in (*NAMES, "asked")}
    with opened(browser, widget, traits) as tab:
        yield Cell(tab, widget)


def test_what_the_page_shows_of_a_touch_from_python_is_what_the_widget_holds(
    browser: Any, touch: vs.Touch, server: Server
) -> None:
    pytest.importorskip("anywidget")
    with shown(browser, touch.view("Bar", height=420)) as cell:
        # Beyond the depth a contact slips.
        cell.touch(TOP, (0.0, 0.0, -4 * touch.depth))
        told = cell.hear("told.force")
        assert np.linalg.norm(told["displacement"]) == pytest.approx(1.3 * touch.depth)
        cell.expect_agreement()
        expect(cell.tab.locator(".warning")).to_contain_text("slips before the 100 mm that were asked for")
        # Linear theory was chosen.
        cell.press("1")
        push = (0.0, 0.0, -0.5 * touch.depth)
        cell.touch(TOP, push)
        best = np.linalg.norm(touch(TOP, push).force)
        assert np.linalg.norm(cell.widget.force) == pytest.approx(best)
        told = cell.hear("told.displacement[2] > -0.02")
        assert abs(np.linalg.norm(told["force"]) / best - 1.0) > 1e-3
        cell.expect_agreement()
        # A stiffer organ.
        cell.press("4")
        cell.tab.locator("input[aria-label=stiffness]").evaluate(
            "(slider) => { slider.value = slider.max; slider.dispatchEvent(new Event('input', { bubbles: true })); }"
        )
        cell.touch(TOP, push)
        told = cell.hear(f"Math.hypot(...told.force) > {3 * best}")
        cell.expect_agreement()


def test_a_view_shown_again_shows_the_touch_of_now(browser: Any, touch: vs.Touch, server: Server) -> None:
    pytest.importorskip("anywidget")
    widget = touch.view("Bar", height=420)
    widget.touch(TOP, (0.0, 0.0, -0.01))
    with shown(browser, widget) as cell:
        cell.expect_agreement()
        cell.press("Escape")
        cell.hear("told.force === null")
    assert widget.force is None
    with shown(browser, widget) as cell:
        cell.tab.locator(".view canvas.stage").wait_for()
        expect(cell.force).to_have_text("0.00")
        cell.press("Enter")
        cell.hear("told.force")
    with shown(browser, widget) as cell:
        cell.expect_agreement()
        assert widget.force is not None


def stepped(reply: Reply) -> Server:
    """The page of a stepper, as a scene has it."""

    class Steppable:
        def open(self) -> Reply:
            return reply

    return Server(page.live_files(), live=converse(Steppable()))


def test_while_one_hand_holds_on_it_is_told_of(look_at: Look, organ: vs.Organ, server: Server) -> None:
    stepper = organ.stepper(iterations=10)
    pull = (0.0, 0.0, 0.005)
    with stepped(PlayedStepper(lambda: stepper, "Bar").reply) as running:
        viewer = look_at(running.url)
        viewer.call("touch", TOP, [0.0, 0.0, -0.01], 0)
        viewer.call("touch", OTHER, pull, 1)
        settle(viewer)
        viewer.call("release", 0)
        settle(viewer)
        told = viewer.page.evaluate("() => viscera.told")
        patch = organ.patch(OTHER, radius(organ))
        force = organ.solve(displacement={patch: pull}).reaction(patch)
        assert told["point"] == pytest.approx(OTHER)
        assert told["displacement"] == pytest.approx(pull)
        assert told["force"] == pytest.approx(force.tolist(), abs=1e-3 * np.linalg.norm(force))
        assert told["is_trusted"]
        viewer.call("release", 1)
        assert viewer.page.evaluate("() => viscera.told.force") is None
        assert viewer.complaints == []
        viewer.close()


def test_a_hand_that_cannot_take_hold_anew_lets_go_on_the_page_and_in_the_stepper(
    look_at: Look, organ: vs.Organ, server: Server
) -> None:
    """Whoever presses elsewhere has let go of what he held; the stepper hears of it with the next request."""
    stepper = organ.stepper(iterations=10)
    with stepped(PlayedStepper(lambda: stepper, "Bar").reply) as running:
        viewer = look_at(running.url)
        viewer.call("touch", TOP, [0.0, 0.0, -0.01])
        settle(viewer)
        assert len(stepper._hands) == 1
        viewer.call("touch", (5.0, 5.0, 5.0), [0.0, 0.0, -0.01])
        viewer.page.locator(".warning.is-shown").wait_for()
        settle(viewer)
        assert viewer.page.evaluate("() => viscera.told.force") is None
        assert stepper._hands == []
        assert np.abs(stepper.displacement).max() < 1e-4
        viewer.close()


def test_the_page_goes_on_until_an_organ_with_inertia_is_at_rest(
    look_at: Look, organ: vs.Organ, server: Server
) -> None:
    stepper = organ.stepper(density=1000, time_step=0.1, dynamics="backward_euler", iterations=10)
    push = (0.0, 0.0, -0.01)
    with stepped(PlayedStepper(lambda: stepper, "Bar").reply) as running:
        viewer = look_at(running.url)
        viewer.call("touch", TOP, push)
        viewer.page.wait_for_function(
            """() => {
                const { isWaiting, hasWishes } = viscera.conversation;
                return viscera.told.is_trusted && !isWaiting && !hasWishes;
            }"""
        )
        patch = organ.patch(TOP, radius(organ))
        force = organ.solve(displacement={patch: push}).reaction(patch)
        told = viewer.page.evaluate("() => viscera.told.force")
        # A vibration of a thousandth of the displacement counts as rest.
        assert told == pytest.approx(force.tolist(), abs=5e-3 * np.linalg.norm(force))
        assert viewer.complaints == []
        viewer.close()


def test_tissue_that_relaxes_is_not_coloured_by_stress(look_at: Look, organ: vs.Organ, server: Server) -> None:
    stepper = organ.stepper(time_step=0.01, relaxation=vs.Prony(g=[0.5], tau=[0.1]), iterations=6)
    with stepped(PlayedStepper(lambda: stepper, "Bar").reply) as running:
        viewer = look_at(running.url)
        colours = viewer.page.get_by_role("group", name="colour").get_by_role("button")
        assert colours.all_inner_texts() == ["Tissue", "Displacement"]
        viewer.page.locator("canvas.stage").focus()
        seen = []
        for _ in range(3):
            viewer.page.keyboard.press("c")
            seen.append(viewer.state["colouring"])
        assert seen == ["displacement", "tissue", "displacement"]
        viewer.close()


def test_force_and_displacement_that_are_told_are_of_one_frame(live: Viewer) -> None:
    """A hand that moves is told of where it was in the frame that its force is from."""
    live.call("touch", TOP, [0.0, 0.0, -0.004])
    settle(live)
    before = live.page.evaluate("() => viscera.told")
    told = live.page.evaluate("() => { viscera.move([0, 0, -0.02]); return viscera.told; }")
    assert told == before
    assert told["is_trusted"]
    settle(live)
    after = live.page.evaluate("() => viscera.told")
    assert after["displacement"] == pytest.approx([0, 0, -0.02])
    assert np.linalg.norm(after["force"]) > 3 * np.linalg.norm(before["force"])
    live.call("rest")
    settle(live)


def test_a_force_that_the_page_marks_is_not_told_as_trusted(live: Viewer) -> None:
    live.call("touch", TOP, [0.0, 0.0, -0.004])
    settle(live)
    doubts = """() => ["isUnstable", "cellsAtBound"].map((fact) => {
        const { facts } = viscera.specimens[0];
        facts[fact] = Number(facts[fact]) + 1;
        const { is_trusted } = viscera.told;
        facts[fact] -= 1;
        return is_trusted;
    })"""
    assert live.page.evaluate("() => viscera.told.is_trusted")
    # Standing compares with true and 0, as a frame brings them.
    assert live.page.evaluate(doubts) == [False, False]
    live.call("rest")
    settle(live)
