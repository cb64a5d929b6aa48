"""How bonds are asked for: their reach, and what is bonded once."""

from __future__ import annotations

from typing import Any

import pytest

import viscera as vs

TISSUE = vs.NeoHookean(young=10e3, poisson=0.3)


@pytest.mark.parametrize("reach", [0, -0.01, "-1 mm", "0%", float("nan"), True])
def test_the_reach_of_a_bond_is_a_length_above_0(reach: Any) -> None:
    with pytest.raises(vs.VisceraError, match=r"^the reach of a bond must be a number above 0 and at most 1000 \[m\]"):
        vs.Bond("lower", "upper", reach=reach)
    with pytest.raises(vs.VisceraError, match="the reach of a bond 'far' is not a length"):
        vs.Bond("lower", "upper", reach="far")
