"""Nodal pressures and contact areas of tools, against the force and against Hertz."""

import numpy as np
import pytest
from tests.conftest import block

import viscera as vs
from viscera.mesh import Floats

YOUNG, POISSON, RADIUS, DEPTH, SIDE = 1e4, 0.3, 0.05, 1.5e-3, 0.1
CONTACT = np.sqrt(RADIUS * DEPTH)
"""Hertz's contact radius [m]."""


def organ(element: str, n: int, down: int = 8) -> vs.Organ:
    """A block under linear elasticity, its cells small around the middle of its top."""
    points, cells = block((n, n, down), (2.0, 2.0, 1.0))
    along, below = points[:, :2] - 1.0, 1.0 - points[:, 2:]
    points = np.hstack([0.5 * SIDE * np.sign(along) * np.abs(along) ** 1.6, SIDE * (1.0 - below**1.8)])
    mesh = vs.mesh(points, cells)
    return vs.Organ(mesh, vs.Linear(young=YOUNG, poisson=POISSON), fixed="z < 1%", element=element)


def pressed(body: vs.Organ, stiffness: float) -> vs.Tool:
    place = (0.0021, 0.0013, SIDE + RADIUS)  # between the nodes
    return vs.Tool(vs.Sphere(RADIUS), place, displacement=(0, 0, -DEPTH), stiffness=stiffness)


def carried(body: vs.Organ, pressures: Floats) -> float:
    """The integral of linear pressures over the surface [N]."""
    points, faces = body.mesh.points, body.mesh.surface
    arms = points[faces[:, 1:]] - points[faces[:, :1]]
    areas = 0.5 * np.linalg.norm(np.cross(arms[:, 0], arms[:, 1]), axis=1)
    return float(areas @ pressures[faces].mean(axis=1))


def test_pressures_carry_the_force_and_the_area_is_that_of_hertz_whatever_the_layer() -> None:
    """On three cells to a contact radius, whose force is 14 % above Hertz's: the area of the mesh is too large, too."""
    body = organ("P1", 20)
    areas, largest = [], []
    for stiffness in (30.0, 300.0):
        tool = pressed(body, stiffness)
        contact = body.solve(contact=[tool], throw=True).contact(tool)
        # The sphere presses almost straight down: the sizes of normal forces add up to a little more.
        assert carried(body, contact.pressures) == pytest.approx(-contact.force[2], rel=0.02)
        areas.append(contact.area / (np.pi * CONTACT**2))
        largest.append(contact.pressures.max() / (2 * YOUNG / (1 - POISSON**2) * CONTACT / (np.pi * RADIUS)))
    assert areas == pytest.approx([1.1, 1.1], abs=0.1)
    assert areas[0] == pytest.approx(areas[1], rel=0.1)
    assert max(largest) < 1.3


def test_quadratic_elements_have_an_area_that_does_not_depend_on_the_layer() -> None:
    """On few cells to a contact radius, so that it is larger than Hertz's."""
    body = organ("P2", 8, 5)
    areas = []
    for stiffness in (30.0, 120.0):
        tool = pressed(body, stiffness)
        contact = body.solve(contact=[tool], throw=True).contact(tool)
        areas.append(contact.area / (np.pi * CONTACT**2))
    assert areas[0] == pytest.approx(areas[1], rel=0.03)
    assert areas == pytest.approx([1.3, 1.3], abs=0.1)


@pytest.mark.parametrize("stiffness", [30.0, 300.0])
def test_a_plate_over_the_whole_top_has_its_area_and_an_even_pressure(stiffness: float) -> None:
    """Also at the edges, where nodes belong to faces that the plate does not press."""
    body = organ("P1", 6)
    plate = vs.Tool(vs.HalfSpace(), (0, 0, SIDE), (np.pi, 0, 0), displacement=(0, 0, -1e-3), stiffness=stiffness)
    # Without lateral contraction the block is in uniaxial compression.
    body = vs.Organ(body.mesh, vs.Linear(young=YOUNG, poisson=0.0), fixed="z < 1%")
    contact = body.solve(contact=[plate], throw=True).contact(plate)
    top = body.mesh.points[:, 2] > 0.999 * SIDE
    assert contact.area == pytest.approx(SIDE**2, rel=1e-6)
    assert contact.pressures[top] == pytest.approx(-contact.force[2] / SIDE**2, rel=1e-4)  # as far as it is solved
    assert not contact.pressures[~top].any()
