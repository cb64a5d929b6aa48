"""Forms that docstrings show are forms that type hints accept: mypy reads this program in `make lint`."""

from __future__ import annotations

import numpy as np
import pytest

import viscera as vs


def test_lengths_in_words_stand_beside_numbers(bar: vs.Mesh) -> None:
    organ = vs.Organ(bar.with_sets(tip="x > 99%"), vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    expected = organ.solve(displacement={"tip": (None, None, -0.001)}).displacement
    for state in (
        organ.solve(displacement={"tip": (None, None, "-1 mm")}),
        organ.solve(displacement={"tip": ("free", "free", "-1 mm")}),
        organ.solve(displacement={"tip": ["free", None, -0.001]}),
    ):
        assert np.array_equal(state.displacement, expected)
    touch = organ.reduce("tip", depth="2%", order=2)
    point = touch.mesh.points[organ.touchable("tip")[0]]
    words = "({:g}, {:g}, {:g}) mm".format(*1e3 * point)
    answer = touch(point, [0.0, 0.0, -0.001])
    for other in (touch(words, [0, 0, "-1 mm"]), touch(words, (0, 0, "-1 mm")), touch(list(point), (0, 0, -1e-3))):
        assert other.force == pytest.approx(answer.force, rel=1e-9)
    assert organ.law.young.min() == pytest.approx(1e5)
