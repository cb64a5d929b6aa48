"""A case in the browser: the page drives the stepper of this machine."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
import pytest

import viscera as vs
from viscera.case import read_case
from viscera.viewer import Server, serve_live

if TYPE_CHECKING:
    from tests.web.conftest import Viewer

CASE = """
mesh = "bar.vtu"
units = "m"
fixed = "root"
material = {law = "NeoHookean", young = 1e5, poisson = 0.45}
"""
TIP = (0.35, 0.05, 0.1)


@pytest.fixture(scope="module")
def live(
    look_at: Callable[..., Viewer], server: Server, bar: vs.Mesh, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Viewer]:
    folder = tmp_path_factory.mktemp("case")
    bar.write(folder / "bar.vtu")
    (folder / "bar.toml").write_text(CASE)
    with serve_live(read_case(folder / "bar.toml"), "Bar") as running:
        viewer = look_at(running.url)
        yield viewer
        assert viewer.complaints == []
        viewer.close()


def settle(live: Viewer) -> None:
    """Wait until the organ stands still."""
    for _ in range(100):
        live.page.wait_for_timeout(100)
        if all(specimen["residual"] < 1e-5 for specimen in live.state["specimens"]):
            return
    pytest.fail(f"the organ does not settle: {[s['residual'] for s in live.state['specimens']]}")


def test_a_drag_steps_the_organ(live: Viewer, bar: vs.Mesh) -> None:
    x, y = live.place(TIP)
    live.page.mouse.move(x, y)
    live.page.mouse.down()
    live.page.mouse.move(x + 10, y + 30, steps=4)
    settle(live)
    state = live.state
    live.shoot("case")
    live.page.mouse.up()
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.45), fixed="root")
    patch = organ.patch(state["held"]["point"], 0.1 * bar.diagonal)
    exact = organ.solve(displacement={patch: state["held"]["displacement"]})
    [specimen] = state["specimens"]
    shown = np.reshape(specimen["field"], (-1, 3))
    size = np.abs(exact.displacement).max()
    assert shown == pytest.approx(exact.displacement[bar.surface_nodes], abs=1e-3 * size)
    assert specimen["force"] == pytest.approx(exact.reaction(patch), rel=1e-2)


def test_two_laws_side_by_side(live: Viewer) -> None:
    live.page.get_by_role("button", name="one organ, or two laws in the same hand").click()
    live.call("setGravity", [0, 0, -9.81])
    settle(live)
    live.shoot("laws")
    assert live.state["laws"] == ["NeoHookean", "Linear"]
    neo, linear = (np.reshape(specimen["field"], (-1, 3)) for specimen in live.state["specimens"])
    assert np.abs(neo - linear).max() > 0.01 * np.abs(neo).max()
    live.page.get_by_label("law").first.select_option("Corotated")
    settle(live)
    assert live.state["laws"] == ["Corotated", "Linear"]
