"""Meshes from arrays and what is refused, and the sets of nodes and cells."""

from __future__ import annotations

import logging

import numpy as np
import pytest

import viscera as vs
from viscera.errors import VisceraError

TET = np.array([[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]])


def test_facts_of_a_cube(cube: vs.Mesh) -> None:
    assert (cube.points.shape, cube.cells.shape, cube.surface.shape) == ((27, 3), (48, 4), (48, 3))
    assert cube.volume == pytest.approx(1e-3, rel=1e-13)
    assert cube.diagonal == pytest.approx(0.1 * np.sqrt(3))
    assert cube.bounding_box.tolist() == [[0, 0, 0], [0.1, 0.1, 0.1]]
    assert len(cube.surface_nodes) == 26
    assert "27 points" in repr(cube)
    assert "bottom (9)" in repr(cube)


def test_the_surface_looks_outward(cube: vs.Mesh) -> None:
    a, b, c = np.moveaxis(cube.points[cube.surface], 1, 0)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 == pytest.approx(cube.volume, rel=1e-13)


def test_a_mesh_cannot_be_changed(cube: vs.Mesh) -> None:
    for array in (cube.points, cube.cells, cube.surface, cube.sets["top"]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_arrays_given_are_copied() -> None:
    points = TET.copy()
    made = vs.mesh(points, [[0, 1, 2, 3]])
    points[0] = 7
    assert made.points[0].tolist() == [0, 0, 0]


def test_inverted_cells_are_turned_round_with_a_message(cube: vs.Mesh, caplog: pytest.LogCaptureFixture) -> None:
    cells = cube.cells.copy()
    cells[[3, 8]] = cells[[3, 8]][:, [1, 0, 2, 3]]
    with caplog.at_level(logging.INFO, logger="viscera"):
        repaired = vs.mesh(cube.points, cells)
    assert repaired.messages == ("turned round 2 of 48 cells that were inverted",)
    assert repaired.messages[0] in caplog.text
    assert repaired.volume == pytest.approx(cube.volume, rel=1e-13)


def bad_arrays() -> dict[str, tuple[object, object, str]]:
    nan, two = TET.copy(), np.array([[0, 1, 2, 3], [1, 0, 3, 2]])
    nan[2, 1] = np.nan
    flat = np.vstack([TET, [[0.1, 0.1, 0]]])
    return {
        "nan": (nan, [[0, 1, 2, 3]], r"point 2 has a coordinate that is not finite: \[0.0, nan, 0.0\]"),
        "duplicate": (TET, two, "cell 1 is on the same four points as an earlier cell"),
        "zero volume": (flat, [[0, 1, 2, 3], [0, 1, 2, 4]], "cell 1 is of zero volume"),
        "out of range": (TET, [[0, 1, 2, 4]], r"cell 0 \[0, 1, 2, 4\] names a point that is not one of 4"),
        "negative": (TET, [[0, 1, 2, -1]], "cell 0 .* names a point"),
        "loose": (np.vstack([TET, TET + 1]), [[0, 1, 2, 3]], r"4 points \(first: 4, 5, 6, 7\) are in no cell"),
        "flat points": (TET[:, :2], [[0, 1, 2, 3]], r"points must have the shape \(n, 3\)"),
        "triangles": (TET, [[0, 1, 2]], r"cells must have the shape \(m, 4\)"),
        "no cells": (TET, np.zeros((0, 4), int), r"with m > 0, not \(0, 4\)"),
        "real cells": (TET, [[0.0, 1, 2, 3]], "cells must hold integers, not float64"),
        "words": ([["a", "b", "c"]] * 4, [[0, 1, 2, 3]], r"points must be real numbers \(n, 3\), not texts"),
    }


@pytest.mark.parametrize("case", bad_arrays())
def test_bad_arrays_are_refused(case: str) -> None:
    points, cells, sentence = bad_arrays()[case]
    with pytest.raises(VisceraError, match=sentence):
        vs.mesh(points, cells)  # type: ignore[arg-type]


def test_a_bad_set_is_refused() -> None:
    with pytest.raises(VisceraError, match="set 'tip' names node 4, but the mesh has 4 nodes"):
        vs.mesh(TET, [[0, 1, 2, 3]], {"tip": [1, 4]})


# Node sets


def test_nodes_by_name_indices_mask_and_predicate(cube: vs.Mesh) -> None:
    top = np.flatnonzero(cube.points[:, 2] == 0.1)
    for where in ("top", top, top[::-1].tolist(), cube.points[:, 2] == 0.1, lambda x: x[:, 2] > 0.09):
        found = cube.nodes(where)
        assert found.dtype == np.uint32
        assert np.array_equal(found, top)
    assert cube.nodes(5).tolist() == [5]


@pytest.mark.parametrize(
    ("where", "sentence"),
    [
        ("botom", r"no node set 'botom'; did you mean 'bottom'\?"),
        ([0, 27], "names node 27, but the mesh has 27 nodes"),
        ([-1], "names node -1"),
        ([], "has no nodes"),
        ([0.5], "must be integers"),
        (lambda x: x[:, 2] > 7, "selects no node; the points lie between"),
        (lambda x: x, r"returned float64 \(27, 3\)"),
    ],
)
def test_bad_sets_are_refused(cube: vs.Mesh, where: object, sentence: str) -> None:
    with pytest.raises(VisceraError, match=sentence):
        cube.nodes(where)  # type: ignore[arg-type]


def test_sets_can_be_added(cube: vs.Mesh) -> None:
    more = cube.with_sets(side=lambda x: x[:, 0] == 0, lid="top")
    assert len(more.nodes("side")) == 9
    assert np.array_equal(more.nodes("lid"), cube.nodes("top"))
    assert "side" not in cube.sets


def test_nodes_near_a_place(cube: vs.Mesh) -> None:
    assert cube.points[cube.near([0.05, 0.05, 0.1], 0.051)].tolist() == [
        [0, 0.05, 0.1],
        [0.05, 0, 0.1],
        [0.05, 0.05, 0.1],
        [0.05, 0.1, 0.1],
        [0.1, 0.05, 0.1],
    ]
    with pytest.raises(VisceraError, match=r"the nearest is 0.9 m away"):
        cube.near([0.05, 0.05, 1], 0.1)


# Files
