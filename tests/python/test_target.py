"""Parts within an organ: kept in the model file, and how far a touch moves them, with a band that holds the truth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.conftest import program

import viscera as vs
from viscera.reduced.parts import Target, boundary, centroid_weights, inner_parts
from viscera.reduced.touch import load_bytes
from viscera.viewer.surface import surface_model

TUMOUR = "within 24 mm of (32.5, 7.5, 7.5) cm"
POINT, PUSH = (0.3, 0.05, 0.1), (0.0, 0.002, -0.01)


@pytest.fixture(scope="module")
def touch(bar: vs.Mesh) -> vs.Touch:
    mesh = replace(bar.with_cell_sets(tumour=TUMOUR, tissue="x > 10%"), axes="LPS")
    organ = vs.Organ(mesh, vs.NeoHookean(young=1e5, poisson=0.45), fixed="root")
    return organ.reduce(lambda x: x[:, 0] > 0.1, radius=0.07, depth=0.02, order=3)


def test_a_file_keeps_cell_sets_and_axes(touch: vs.Touch, bar: vs.Mesh, tmp_path: Path) -> None:
    touch.save(tmp_path / "bar.viscera")
    again = vs.load(tmp_path / "bar.viscera")
    assert again.mesh.axes == "LPS"
    assert set(again.mesh.cell_sets) == {"tumour", "tissue"}
    assert np.array_equal(again.mesh.cells_in("tumour"), bar.cells_in(TUMOUR))


def test_what_is_within_is_less_than_half(touch: vs.Touch) -> None:
    assert list(inner_parts(touch.mesh)) == ["tumour"]


def test_a_target_is_the_centroid_of_its_surface(touch: vs.Touch) -> None:
    mesh = touch.mesh
    triangles = boundary(mesh, mesh.cells_in("tumour"))
    nodes, weights = centroid_weights(mesh.points, triangles)
    corners = mesh.points[triangles]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert np.allclose(weights @ mesh.points[nodes], areas @ corners.mean(axis=1) / areas.sum())
    answer = touch(POINT, PUSH)
    target = answer.target("tumour")
    assert np.allclose(target.displacement, weights @ answer.displacement[nodes])
    assert str(target).endswith(" mm")
    deep = touch(POINT, (0.0, 0.0, -0.03)).target("tumour")
    assert not deep.is_trusted
    assert str(deep).endswith("not trusted")


@pytest.mark.parametrize(
    ("distance", "band", "words"),
    [
        (9.97258, 0.00626, "9.973 ± 0.007"),
        (6.2149, 0.2871, "6.21 ± 0.30"),
        (6.21, 0.3, "6.21 ± 0.30"),
        (0.0413, 0.00031, "0.04130 ± 0.00031"),
        (0.02, 12.4, "0 ± 13"),
        (45.3, 123.0, "45 ± 124"),
        (10.0, 0.0, "10.00 ± 0.00"),
        (0.0, 0.0, "0.0 ± 0.0"),
        (10.0, np.inf, "10.00 ± inf"),
    ],
)
def test_a_band_in_words_holds_what_the_band_holds(distance: float, band: float, words: str) -> None:
    assert str(Target(np.array([0.0, 0.0, 1e-3 * distance]), 1e-3 * band, is_trusted=True)) == f"{words} mm"
    shown, wide = map(float, words.split(" ± "))
    assert shown - wide <= distance - band + 1e-12
    assert distance + band <= shown + wide + 1e-12


def test_the_page_has_the_nodes_within(touch: vs.Touch) -> None:
    page = load_bytes(surface_model(touch, "Bar"))
    rows = np.unique(page.metadata["user"]["inside"][0]["triangles"])
    nodes = np.unique(boundary(touch.mesh, touch.mesh.cells_in("tumour")))
    assert not np.isin(nodes, touch.surface_nodes).all()
    assert np.array_equal(page._model.array("points")[rows], touch.mesh.points[nodes])
    moved = page.surface_displacement(POINT, PUSH)[rows]
    assert np.allclose(moved, touch(POINT, PUSH).displacement[nodes], rtol=0, atol=1e-9)


def test_bands_hold_the_full_solution(touch: vs.Touch) -> None:
    """In small what benchmarks/targets.py does: 20 contacts, five targets."""
    for name in ("machine", "trust"):
        program(name)
    targets = program("targets")
    rows = targets.ask(touch, contacts=20, seed=1)
    trusted = [row for row in rows if row.is_trusted]
    assert len(trusted) >= 50
    assert targets.share(trusted) >= 0.95
    assert np.median([row.error for row in trusted]) > 0.0
