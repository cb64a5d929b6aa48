"""One Newton iteration a frame."""

from __future__ import annotations

import numpy as np
import pytest

import viscera as vs
from viscera.errors import VisceraError


@pytest.fixture(scope="module")
def organ(bar: vs.Mesh) -> vs.Organ:
    return vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.4), fixed="root")


def test_a_waiting_hand_finds_the_full_solution(organ: vs.Organ) -> None:
    target = {"tip": (None, None, -0.05)}
    exact = organ.solve(displacement=target, gravity=(0, 0, -9.81), density=1000)
    stepper = organ.stepper({"tip": (None, None, 0)})
    for share in np.minimum(np.arange(1, 16) / 8, 1):
        frame = stepper.frame({"tip": (None, None, -0.05 * share)}, gravity=(0, 0, -9.81), density=1000)
    assert frame.residual < 1e-9
    assert frame.taken == 1.0
    assert not frame.is_unstable
    assert frame.displacement == pytest.approx(exact.displacement, abs=1e-10)
    assert frame.reaction("root") == pytest.approx(exact.reaction("root"), abs=1e-6)


def test_a_grasped_patch_tells_its_force(organ: vs.Organ) -> None:
    patch = organ.patch((0.4, 0.05, 0.1), radius=0.06)
    exact = organ.solve(displacement={patch: (0, 0, -0.02)})
    stepper = organ.stepper({patch: (0, 0, 0)})
    for _ in range(8):
        frame = stepper.frame({patch: (0, 0, -0.02)})
    assert frame.reaction(patch) == pytest.approx(exact.reaction(patch), rel=1e-6)


def test_turning_gravity_turns_the_organ(organ: vs.Organ) -> None:
    """The patient turns: from lying to the side, the organ settles where a full solution from rest ends."""
    stepper = organ.stepper({})
    for _ in range(8):
        stepper.frame({}, gravity=(0, 0, -9.81), density=300)
    for _ in range(12):
        frame = stepper.frame({}, gravity=(0, -9.81, 0), density=300)
    exact = organ.solve(gravity=(0, -9.81, 0), density=300)
    assert frame.displacement == pytest.approx(exact.displacement, abs=1e-9)


def test_a_frame_moves_what_is_grasped(organ: vs.Organ) -> None:
    stepper = organ.stepper({"tip": (None, None, 0)})
    with pytest.raises(VisceraError, match="exactly the places"):
        stepper.frame({"tip": (0, None, 0)})
    with pytest.raises(VisceraError, match="finite"):
        stepper.frame({"tip": (None, None, np.nan)})
    with pytest.raises(VisceraError, match="density"):
        stepper.frame({"tip": (None, None, 0)}, gravity=(0, 0, -9.81))
