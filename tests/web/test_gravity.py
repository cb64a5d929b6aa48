"""The gravity of a case that is stepped: shown, removed, chosen."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from tests.web.conftest import CASE, settle

import viscera as vs
from viscera.cases.case import read_case
from viscera.viewer import Server, serve_live

if TYPE_CHECKING:
    from tests.web.conftest import Viewer

    Look = Callable[..., Viewer]


@pytest.mark.parametrize(("gravity", "shown"), [("[0, 0, -5]", "gravity of the case"), ("[0, 0, -9.81]", "gravity −z")])
def test_the_gravity_of_a_case_is_shown_and_can_be_removed(
    look_at: Look, server: Server, bar: vs.Mesh, tmp_path: Path, gravity: str, shown: str
) -> None:
    bar.write(tmp_path / "bar.vtu")
    loads = f"[loads]\ngravity = {gravity}\ndensity = 1000\n"
    (tmp_path / "bar.toml").write_text(CASE + loads)
    with serve_live(read_case(tmp_path / "bar.toml"), "Bar") as running:
        viewer = look_at(running.url)
        chosen = "(list) => list.selectedOptions[0].textContent"
        pull = viewer.page.get_by_label("gravity")
        assert pull.evaluate(chosen) == shown
        settle(viewer)
        assert largest(viewer) > 1e-3
        pull.select_option(label="no gravity")
        viewer.page.wait_for_function("() => Math.max(...viscera.state().specimens[0].field.map(Math.abs)) < 1e-6")
        # Chosen anew just before a reset, it is not forgotten.
        viewer.page.evaluate("() => { viscera.setGravity([0, 0, -9.81]); viscera.reset(); }")
        viewer.page.wait_for_function("() => Math.max(...viscera.state().specimens[0].field.map(Math.abs)) > 1e-3")
        assert viewer.complaints == []
        viewer.close()


def largest(viewer: Viewer) -> float:
    """Largest component of a displacement [m]."""
    return max(abs(float(x)) for x in viewer.state["specimens"][0]["field"])
