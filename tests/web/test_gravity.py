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


# Whether all points of the organ [m] are in the part of the page that no panel takes.
IS_SEEN = """() => {
    const { stage, row } = viscera;
    const { offsetLeft: left, offsetTop: top, clientWidth: width, clientHeight: height } = stage.clearing;
    const [{ moved }] = row.specimens;
    const place = stage.camera.position.clone();
    return Array.from({ length: moved.length / 3 }, (_, n) => {
        const { x, y } = stage.project(place.fromArray(moved, 3 * n));
        return left < x && x < left + width && top < y && y < top + height;
    }).every(Boolean);
}"""
HANGS = "() => viscera.row.specimens[0].hasSettled && Math.min(...viscera.row.specimens[0].field) < -0.1"


def test_the_first_view_is_of_the_organ_as_it_hangs(
    look_at: Look, server: Server, bar: vs.Mesh, tmp_path: Path
) -> None:
    bar.write(tmp_path / "bar.vtu")
    (tmp_path / "bar.toml").write_text(f"{CASE}[loads]\ngravity = [0, 0, -9.81]\ndensity = 1000\n")
    with serve_live(read_case(tmp_path / "bar.toml"), "Bar") as running:
        viewer = look_at(running.url)
        viewer.page.wait_for_function(HANGS)
        viewer.page.wait_for_function(IS_SEEN)
        # Where it is said to press, there it is.
        viewer.page.wait_for_function("() => viscera.hint.spot !== null")
        spot = "viscera.stage.project(viscera.hint.spot)"
        assert viewer.page.evaluate(f"() => viscera.pointer.under({spot}.x, {spot}.y) !== null")
        viewer.page.evaluate("() => { viscera.stage.turn(0.5, 0); viscera.stage.zoom(4); }")
        assert not viewer.page.evaluate(IS_SEEN)
        viewer.call("reset")
        viewer.page.wait_for_function(HANGS)
        viewer.page.wait_for_function(IS_SEEN)
        # Who has turned the view before the organ hangs keeps it.
        camera = "viscera.stage.camera.position.toArray()"
        turned = viewer.page.evaluate(f"() => {{ viscera.reset(); viscera.stage.turn(0.5, 0); return {camera}; }}")
        viewer.page.wait_for_function(HANGS)
        settle(viewer)
        viewer.page.wait_for_function("() => !viscera.isFresh")
        assert viewer.page.evaluate(f"() => {camera}") == pytest.approx(turned)
        assert viewer.complaints == []
        viewer.close()
