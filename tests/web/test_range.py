"""A model for a range of a parameter: the page answers for one value, and says for which."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pytest

import viscera as vs
from viscera.viewer import Server, serve

if TYPE_CHECKING:
    from tests.web.conftest import Viewer

TOP, PUSH = (0.3, 0.05, 0.1), (0.0, 0.0, -0.01)


@pytest.mark.parametrize(
    ("vary", "value", "said"),
    [
        (vs.Vary("young", 5e4, 5e5, nodes=2), 2e5, "young 200 of 50 to 500 kPa"),
        (vs.Vary("poisson", 0.3, 0.45, nodes=2), 0.4, "poisson 0.4 of 0.3 to 0.45"),
        (vs.Vary("radius", 0.06, 0.08, nodes=2), 0.065, "radius 65 of 60 to 80 mm"),
    ],
    ids=["young", "poisson", "radius"],
)
def test_the_value_and_its_range_are_named(
    look_at: Callable[..., Viewer], server: Server, bar: vs.Mesh, vary: vs.Vary, value: float, said: str
) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.45), fixed="root")
    top = lambda x: (x[:, 2] == 0.1) & (x[:, 0] > 0.15)  # noqa: E731
    touch = organ.reduce(top, radius=0.07, depth=0.02, order=2, vary=vary).at(value)
    with serve(touch, "Bar") as running:
        viewer = look_at(running.url)
        assert f" · {said} · " in viewer.page.locator("header p").inner_text()
        viewer.call("touch", TOP, PUSH)
        force = touch(viewer.state["point"], PUSH).force
        assert viewer.state["force"] == pytest.approx(force.tolist(), abs=1e-5 * np.linalg.norm(force))
        assert viewer.complaints == []
        viewer.close()


def test_a_range_that_is_too_coarse_is_the_reason_of_its_doubt(
    look_at: Callable[..., Viewer], server: Server, bar: vs.Mesh
) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.45), fixed="root")
    vary = vs.Vary("radius", 0.06, 0.08, nodes=2)
    touch = organ.reduce("x > 15% and z > 99%", radius=0.07, depth=0.01, order=2, vary=vary).at(0.065)
    assert touch.metadata["errors"]["parameter"] > 0.01, "more than is allowed at a small depth"
    with serve(touch, "Bar") as running:
        viewer = look_at(running.url)
        viewer.call("touch", TOP, (0.0, 0.0, -0.002))
        warning = viewer.page.locator(".warning.is-shown")
        warning.wait_for()
        said = warning.inner_text()
        off = r"between the values of radius that were solved, answers are up to [\d.]+ % off"
        above = r"above the 1(\.0)? % that is allowed here; give Vary more nodes\."
        assert re.fullmatch(f"Not trusted: {off}, {above}", said), said
        viewer.close()
