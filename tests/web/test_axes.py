"""A page that steps the organ of a scan has the axes of the patient, as that of a model has."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import viscera as vs
from viscera.viewer import Server, serve_live

if TYPE_CHECKING:
    from tests.web.conftest import Viewer


@pytest.mark.parametrize("in_page", [True, False])
def test_a_stepped_organ_has_the_axes_of_its_scan(
    look_at: Callable[..., Viewer], server: Server, bar: vs.Mesh, tmp_path: Path, in_page: bool
) -> None:
    organ = vs.Organ(dataclasses.replace(bar, axes="LPS"), vs.NeoHookean(young=1e5, poisson=0.45), fixed="root")
    with serve_live(organ.to_case(tmp_path / "bar.toml"), "Bar", in_page=in_page) as running:
        viewer = look_at(running.url)
        assert set(viewer.page.evaluate("() => Object.keys(viscera.gauge.letters)")) == set("RLAPSI")
        towards = viewer.page.locator("select[aria-label=gravity] option").all_inner_texts()
        assert towards[1:3] == ["gravity to I, inferior", "gravity to S, superior"]
        assert towards[-1] == "gravity to L, left"
        assert "density 1000 kg/m³, as the case names none" in viewer.page.locator("header p").inner_text()
        assert viewer.complaints == []
        viewer.close()
