"""Thin organs: what faces each other through both bodies is not in contact, however large the reach."""

from __future__ import annotations

import numpy as np
import pytest
from tests.conftest import block

import viscera as vs

LAW = vs.NeoHookean(young=2e4, poisson=0.3)


def sheet(thick: float, low: float = 0.0) -> vs.Mesh:
    """20 cm x 20 cm, from a height on."""
    points, cells = block((4, 4, 1), (0.2, 0.2, thick))
    return vs.mesh(points + np.array([0, 0, low]), cells)


@pytest.mark.parametrize("thick", [0.002, 0.006])
def test_sheets_pressed_on_each_other_push_each_other_away(thick: float) -> None:
    """Both together are thinner than the default reach of 1.4 cm: the outer sides face each other within it."""
    organs = {"lower": vs.Organ(sheet(thick), LAW, fixed="z < 1%"), "upper": vs.Organ(sheet(thick, thick), LAW)}
    told = []
    for reach in (None, 0.3 * thick):
        pair = vs.ContactPair("lower", "upper", reach=reach)
        scene = vs.Scene(organs, contacts=[pair])
        top = scene.place("upper", "z > 99%")
        state = scene.solve(displacement={top: (0, 0, -0.01 * thick)}, throw=True)
        frame = scene.stepper({top: (0, 0, 0)}, iterations=20).frame({top: (0, 0, -0.01 * thick)})
        assert frame.is_settled
        assert frame.force(pair)[2] == pytest.approx(state.contact(pair).force[2], rel=1e-3)
        told.append((*state.contact(pair).force, state.contact(pair).area))
    # Uniaxial strain by half a per cent in both: 0.04 m^2 of the modulus lam + 2 mu.
    assert told[0][2] == pytest.approx(-0.04 * 0.005 * 2e4 * 0.7 / (1.3 * 0.4), rel=0.02)
    assert told[0][3] == pytest.approx(0.04, rel=1e-3)
    assert told[0] == pytest.approx(told[1], rel=1e-6, abs=1e-9)


def test_rods_side_by_side_touch_along_one_side() -> None:
    """5 mm thick, with a reach of 1 cm: all sides of the one face the far ones of the other."""
    points, cells = block((16, 2, 2), (0.2, 0.005, 0.005))
    upper = vs.mesh(points + np.array([0, 0.0012, 0.005]), cells)
    bed = [vs.ElasticSupport("x > -1%", 1e4)]
    organs = {
        "lower": vs.Organ(vs.mesh(points, cells), LAW, fixed="z < 1%"),
        "upper": vs.Organ(upper, LAW, supports=bed),
    }
    told = []
    for reach in (None, "1 mm"):
        pair = vs.ContactPair("lower", "upper", reach=reach)
        state = vs.Scene(organs, contacts=[pair]).solve(force={"upper/z > 99%": (0, 0, -0.05)}, throw=True)
        told.append(state.contact(pair).force)
    np.testing.assert_allclose(told[0], told[1], rtol=2e-3, atol=1e-4)
    assert -0.05 < told[0][2] < -0.03


@pytest.mark.parametrize("sliding", [False, True])
def test_a_bond_joins_the_sides_that_lie_on_each_other(sliding: bool) -> None:
    """Sheets of 1 mm and a reach of 5 mm: the outer sides are 2 mm apart, through both."""
    organs = {"lower": vs.Organ(sheet(0.001), LAW, fixed="z < 1%"), "upper": vs.Organ(sheet(0.001, 0.001), LAW)}
    carried = []
    for lower, upper in (("lower", "upper"), ("lower/z > 99%", "upper/z < 1%")):
        bond = vs.Bond(lower, upper, sliding=sliding, reach="5 mm")
        scene = vs.Scene(organs, bonds=[bond])
        moved = {scene.place("upper", "z > 99%"): (0, 0, 2e-5)}
        carried.append(scene.solve(displacement=moved, throw=True).support_force(bond))
    np.testing.assert_allclose(carried[0], carried[1], rtol=1e-9, atol=1e-9)
    assert carried[0][2] > 1.0
