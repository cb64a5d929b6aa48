"""What rounding allows depends on the stresses of a law, not on its other parameters."""

from __future__ import annotations

import pytest

import viscera as vs

PUSH = {"tip": (None, None, -0.1)}


def held(bar: vs.Mesh, lock: float) -> vs.Organ:
    """Of chains that lock at this stretch."""
    return vs.Organ(bar, vs.ArrudaBoyce(mu=1e3, lambda_m=lock, poisson=0.3), fixed="root")


def test_chains_that_never_lock_are_settled_and_converged_where_they_are_in_balance(bar: vs.Mesh) -> None:
    near, far = held(bar, 1e3), held(bar, 1e12)
    frames = [organ.stepper().frame(PUSH) for organ in (near, far)]
    assert frames[1].residual == pytest.approx(frames[0].residual, rel=1e-3)
    assert [frame.is_settled for frame in frames] == [False, False]
    states = [organ.solve(displacement=PUSH) for organ in (near, far)]
    assert states[1].residuals[-1] == pytest.approx(states[0].residuals[-1], rel=1e-3, abs=1e-12)
    assert states[1].reaction("tip") == pytest.approx(states[0].reaction("tip"), rel=1e-6, abs=1e-9)
    assert states[1].reaction("root") == pytest.approx(-states[1].reaction("tip"), abs=1e-9)
