"""Sets of nodes in words."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import viscera as vs
from viscera.select import length


@pytest.mark.parametrize(
    ("words", "holds"),
    [
        ("x < 10%", lambda x: x[:, 0] < 0.04),
        ("x <= 0%", lambda x: x[:, 0] <= 0),
        ("z > 3 cm", lambda x: x[:, 2] > 0.03),
        ("z>=50mm", lambda x: x[:, 2] >= 0.05),
        ("20% < x < 300 mm", lambda x: (x[:, 0] > 0.08) & (x[:, 0] < 0.3)),
        ("0.09 m <= y", lambda x: x[:, 1] >= 0.09),
        ("x < 50% and z > 1e-2 m and y < 9e4um", lambda x: (x[:, 0] < 0.2) & (x[:, 2] > 0.01) & (x[:, 1] < 0.09)),
        ("300 mm > x > 20%", lambda x: (x[:, 0] > 0.08) & (x[:, 0] < 0.3)),
        ("x > -5%", lambda x: x[:, 0] > -1),
    ],
)
def test_conditions(bar: vs.Mesh, words: str, holds: Any) -> None:
    expected: NDArray[np.bool_] = holds(bar.points)
    assert bar.nodes(words).tolist() == np.flatnonzero(expected).tolist()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("x < 10", "10 has no unit; use %, m, cm, mm"),
        ("x < 10 ft", "unit 'ft' is unknown"),
        ("w < 10%", "cannot read 'w < 10%'"),
        ("x < 10% or z > 3 cm", "cannot read"),
        ("x << 10%", "cannot read"),
        ("x > 2 m", "selects no node; the mesh spans x 0..400 mm, y 0..100 mm"),
        ("rot", "did you mean 'root'"),
        ("x", "no node set 'x'"),
    ],
)
def test_words_that_mean_nothing(bar: vs.Mesh, words: str, message: str) -> None:
    with pytest.raises(vs.VisceraError, match=message):
        bar.nodes(words)


def test_a_set_with_a_strange_name_is_still_a_set(bar: vs.Mesh) -> None:
    named = bar.with_sets(**{"x < 10": [1, 2]})
    assert named.nodes("x < 10").tolist() == [1, 2]
    assert bar.nodes([3, 1]).tolist() == [1, 3]


def test_lengths() -> None:
    assert length("12 mm", 1.0, "radius") == pytest.approx(0.012)
    assert length("10%", 0.3, "radius") == pytest.approx(0.03)
    assert length(0.02, 1.0, "radius") == 0.02
    wrong: Any
    for wrong in ("12", "wide", "12 parsec", True, [1]):
        with pytest.raises(vs.VisceraError, match="radius"):
            length(wrong, 1.0, "radius")
