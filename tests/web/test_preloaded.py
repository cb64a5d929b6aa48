"""A model about a preload on the page: its strain is that of the tissue, with the load."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.web.test_viewer import strain

import viscera as vs
from viscera.reduced.touch import load_bytes
from viscera.viewer import Server, export, page, serve

if TYPE_CHECKING:
    from tests.web.conftest import Viewer

    Look = Callable[..., Viewer]


@pytest.fixture(scope="module")
def hanging(bar: vs.Mesh) -> vs.Touch:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.45), fixed="root")
    state = organ.solve(gravity=(0, 0, -9.81), density=1000)
    return organ.reduce(lambda x: x[:, 0] > 0.1, radius=0.07, depth=0.025, order=3, start=state)


def test_strain_counts_from_rest(look_at: Look, server: Server, hanging: vs.Touch) -> None:
    nodes = hanging.surface_nodes
    assert hanging.preload is not None
    load = hanging.preload[nodes]
    values = "() => [...viscera.display.painter.values]"
    with serve(hanging, "Hanging") as running:
        viewer = look_at(running.url)
        viewer.call("setColouring", "strain")
        expected = strain(hanging, load)
        assert expected.max() > 0.05
        # Positions are in single precision.
        assert viewer.page.evaluate(values) == pytest.approx(expected, abs=1e-5)
        point = hanging.locate(hanging.points[hanging.points[:, 0].argmax()])
        viewer.call("touch", point.tolist(), [0.0, 0.003, -0.01])
        field = np.reshape(viewer.state["field"], (-1, 3))
        assert np.abs(field).max() > 5e-3
        assert viewer.page.evaluate(values) == pytest.approx(strain(hanging, load + field), abs=1e-5)
        assert viewer.complaints == []
        viewer.close()


def test_the_scale_of_strains_leaves_room_above_those_of_the_preload(
    look_at: Look, server: Server, hanging: vs.Touch
) -> None:
    assert hanging.preload is not None
    largest = 100 * strain(hanging, hanging.preload[hanging.surface_nodes]).max()
    with serve(hanging, "Hanging") as running:
        viewer = look_at(running.url)
        viewer.call("setColouring", "strain")
        legend = viewer.page.locator(".legend:visible")
        ends = legend.locator(".legend-ticks span").all_inner_texts()
        # A tenth, and at most a step of the scale more.
        step = float(ends[1]) - float(ends[0])
        assert largest + 10 <= float(ends[-1]) <= largest + 10 + step
        assert legend.locator(".legend-beyond").inner_text() == ""
        # It stays while one touches.
        point = hanging.locate(hanging.points[hanging.points[:, 0].argmax()])
        viewer.call("touch", point.tolist(), [0.0, 0.003, -0.01])
        assert legend.locator(".legend-ticks span").all_inner_texts() == ends
        assert viewer.complaints == []
        viewer.close()


def test_an_exported_page_has_the_shape_without_the_load(hanging: vs.Touch, server: Server, tmp_path: Path) -> None:
    export(hanging, tmp_path / "site")
    alone = load_bytes((tmp_path / "site" / page.MODEL).read_bytes())
    unloaded = np.reshape(alone.metadata["user"]["unloaded"], (-1, 3))
    assert unloaded == pytest.approx(hanging.rest.points[hanging.surface_nodes], abs=1e-7)


def test_a_model_about_rest_carries_its_shape_once(touch: vs.Touch, server: Server, tmp_path: Path) -> None:
    export(touch, tmp_path / "site")
    alone = load_bytes((tmp_path / "site" / page.MODEL).read_bytes())
    assert "unloaded" not in alone.metadata["user"]
