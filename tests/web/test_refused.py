"""Hands that cannot take hold, and loads that are not applied: the page says so, and goes on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.web.conftest import settle

from viscera.cases.case import Case
from viscera.viewer import Server, serve_live

if TYPE_CHECKING:
    from tests.web.conftest import Viewer

    Look = Callable[..., Viewer]

TIP = (0.35, 0.05, 0.1)


def test_what_cannot_be_held_is_let_go_and_the_page_goes_on_saying_so(live: Viewer) -> None:
    """The clamped end, by a mouse that goes on moving: no force, and no hand."""
    live.page.evaluate("() => viscera.stage.lookFrom([-1.5, -0.5, 0.5])")
    live.page.wait_for_timeout(100)
    x, y = live.place((0.0, 0.05, 0.05))
    live.page.mouse.move(x, y)
    live.page.mouse.down()
    warning = live.page.locator(".warning.is-shown")
    warning.wait_for()
    for k in range(1, 5):
        live.page.mouse.move(x + 10 * k, y - 10 * k)
        live.call("setGravity", [0, 0, -0.1 * k])  # frames go on
        settle(live)
    said = warning.inner_text()
    assert said.startswith("the surface is fixed at the point (0, ")
    assert said.endswith(") mm; take hold beside it")
    assert live.state["held"] is None
    assert live.call("caption") == ""
    assert live.page.evaluate("() => viscera.told.force") is None
    assert live.page.locator(".force-label:visible").count() == 0
    live.page.mouse.up()
    assert warning.inner_text() == said
    live.call("setGravity", [0, 0, 0])
    live.page.evaluate("() => viscera.stage.goHome()")
    live.call("touch", TIP, [0.0, 0.0, -0.01])
    settle(live)
    assert warning.count() == 0
    assert np.linalg.norm(live.state["specimens"][0]["force"]) > 0
    live.call("rest")
    settle(live)


@pytest.mark.parametrize("place", [TIP, (0.345, 0.05, 0.1)], ids=["same", "almost"])
def test_two_hands_at_one_place_are_a_sentence_and_the_first_holds_on(
    live: Viewer, place: tuple[float, float, float]
) -> None:
    push = [0.0, 0.0, -0.02]
    live.call("touch", TIP, push)
    settle(live)
    force = live.state["specimens"][0]["force"]
    live.call("touch", place, [0.0, 0.0, 0.01], 1)
    warning = live.page.locator(".warning.is-shown")
    warning.wait_for()
    live.call("move", [0.0, 0.0, 0.03], 1)
    settle(live)
    assert warning.inner_text() == "both hands hold the same place; take hold elsewhere"
    state = live.state
    assert [hand and hand["displacement"] for hand in state["hands"]] == [push, None]
    assert state["specimens"][0]["force"] == pytest.approx(force, rel=1e-4, abs=1e-6)
    # The other one may take hold elsewhere.
    live.call("touch", (0.2, 0.05, 0.1), [0.0, 0.0, 0.005], 1)
    settle(live)
    assert warning.count() == 0
    assert np.linalg.norm(live.state["specimens"][0]["second"]) > 0
    live.call("rest")
    settle(live)


def test_what_is_asked_for_beside_a_refused_grasp_is_done(live: Viewer) -> None:
    """At once, before any of it has been asked for: a hand lets go, another law, and a grasp of what is clamped."""
    live.call("touch", TIP, [0.0, 0.0, -0.02])
    settle(live)
    live.page.evaluate(
        """() => {
            viscera.release();
            viscera.setLaws(["Linear"]);
            viscera.touch([0, 0.05, 0.05], [0, 0, 0], 1);
        }"""
    )
    live.page.locator(".warning.is-shown").wait_for()
    settle(live)
    state = live.state
    assert (state["laws"], state["hands"]) == (["Linear"], [None, None])
    assert np.abs(state["specimens"][0]["field"]).max() < 1e-6
    live.call("setLaws", ["NeoHookean"])
    live.call("rest")
    settle(live)


@pytest.mark.parametrize("in_page", [True, False], ids=["in this page", "on this machine"])
def test_loads_that_are_not_applied_are_named(look_at: Look, server: Server, case: Case, in_page: bool) -> None:
    loads = {
        "gravity": [0, 0, -1],
        "density": 1000,
        "displacement": {"tip": [0, 0, -0.01]},
        "force": {"x > 90%": [0, 0, -1]},
    }
    with serve_live(replace(case, loads=loads), "Bar", in_page=in_page) as running:
        viewer = look_at(running.url)
        said = viewer.page.locator("header p").inner_text()
        assert said.endswith("loads of the case are not applied: displacement, force")
        assert viewer.complaints == []
        viewer.close()
