"""Laws whose energy ends at a finite stretch: frames and solutions stay where there is one, and come back."""

from __future__ import annotations

import numpy as np
import pytest

import viscera as vs

JM = 0.5
"""I1bar - 3 at which the energies end."""
REST = "kappa/2*log(J)**2"
ENERGIES = {
    "log": f"-mu*Jm/2*log(1 - (I1bar - 3)/Jm) + {REST}",
    "root": f"mu*Jm*(1 - sqrt(1 - (I1bar - 3)/Jm)) + {REST}",
    "pole": f"mu/2*(I1bar - 3)/(1 - (I1bar - 3)/Jm) + {REST}",
}


def law(energy: str) -> vs.StrainEnergy:
    return vs.StrainEnergy(ENERGIES[energy], mu=1e4, Jm=JM, kappa=9e4)


def beam(energy: str, element: str = "P1") -> vs.Organ:
    return vs.Organ(vs.organs.beam(), law(energy), fixed="clamp", element=element)


def largest(organ: vs.Organ, displacement: np.ndarray) -> float:
    """The largest I1bar - 3 of a cell of corners, over that at which the energy ends."""
    corners = organ.mesh.points[organ.mesh.cells]
    moved = corners + displacement[organ.mesh.cells]
    edges, now = ((x[:, 1:] - x[:, :1]).swapaxes(1, 2) for x in (corners, moved))
    gradient = now @ np.linalg.inv(edges)
    i1 = (gradient**2).sum((1, 2))
    return float((i1 * np.linalg.det(gradient) ** (-2 / 3) - 3).max() / JM)


@pytest.mark.parametrize(
    ("energy", "element"),
    [*((energy, "P1") for energy in ENERGIES), ("log", "P1 mean volume"), ("pole", "P1 mean volume")],
)
def test_a_hand_that_strides_out_is_followed_and_back(energy: str, element: str) -> None:
    organ = beam(energy, element)
    stepper = organ.stepper(iterations=10)
    for z in (0.2, 0.4, 0.6, 0.8, 1.0):
        frame = stepper.frame({"tip": (0, 0, z)})
        assert np.isfinite([frame.energy, frame.residual]).all()
        assert frame.energy > 0
        if element == "P1":
            assert largest(organ, frame.displacement) < 1
    for _ in range(4):
        frame = stepper.frame({"tip": (0, 0, 0)})
    for _ in range(5):
        frame = stepper.frame({})
    assert frame.is_settled
    assert np.abs(frame.displacement).max() < 1e-6  # of a beam of 1.5 m
    assert abs(frame.energy) < 1e-6  # [J], of hundreds


def test_frames_go_as_far_as_solutions() -> None:
    """One metre in five strides, each as long as the last: the extrapolation of the fourth leads across the pole."""
    organ = beam("pole")
    stepper = organ.stepper(iterations=20)
    for z in (0.2, 0.4, 0.6, 0.8, 1.0, 1.0):
        frame = stepper.frame({"tip": (0, 0, z)})
    state = organ.solve(displacement={"tip": (0, 0, 1.0)})
    assert frame.is_settled
    assert state.is_converged
    assert frame.energy == pytest.approx(state.energy, rel=1e-6)


def test_a_start_without_energy_is_refused_by_its_cell() -> None:
    organ = beam("pole")
    start = organ.mesh.points * (1.0, 0, 0)  # twice as long
    for use in (lambda: organ.solve(start=start), lambda: organ.stepper(start=start)):
        with pytest.raises(
            vs.VisceraError, match=r"strains cell 0 to where its law has no energy \(J = 2.000\); start from"
        ):
            use()
