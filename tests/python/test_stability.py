"""What is called stable: the organ under what holds it, tools included; and what Newton's method spends on the way."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import viscera as vs
from viscera.solver import Solver

Block = Callable[[tuple[int, int, int], tuple[float, float, float]], tuple[NDArray[np.float64], NDArray[np.uint32]]]

YOUNG, THICK, LONG = 1e6, 0.01, 0.2  # of the column [Pa, m, m]
CRITICAL = 20.19 * YOUNG * THICK**4 / 12 / LONG**2
"""Euler's load of a column that is clamped at one end and pinned at the other [N]."""


@pytest.fixture(scope="module")
def column(block: Block) -> vs.Organ:
    """A slender column, clamped at its foot and bowed by a thousandth of its thickness."""
    points, cells = block((2, 2, 24), (THICK, THICK, LONG))
    points[:, 0] += 1e-3 * THICK * np.sin(np.pi * points[:, 2] / LONG)
    mesh = vs.mesh(points, cells, {"foot": np.flatnonzero(points[:, 2] == 0.0)})
    return vs.Organ(mesh, vs.NeoHookean(young=YOUNG, poisson=0.3), fixed="foot", element="P2")


@pytest.mark.parametrize("solver", ["auto", "cholesky", "cg", "multigrid"])
def test_a_column_pushed_by_a_tool_buckles_where_euler_says(column: vs.Organ, solver: Solver) -> None:
    # The tool holds the means of the three displacements of the head, which can still turn. Without the tool the column
    # would buckle at an eighth of the load.
    head = column.patch((THICK / 2, THICK / 2, LONG), 0.8 * THICK)
    little = column.solve(displacement={head: (0, 0, -1e-6)}).reaction(head)[2]
    critical = CRITICAL / abs(little) * 1e-6
    pushed = {part: column.solve(displacement={head: (0, 0, -part * critical)}, solver=solver) for part in (0.9, 1.1)}
    assert pushed[0.9].status == "converged", pushed[0.9].message
    assert pushed[0.9].reaction(head)[2] == pytest.approx(0.9 * -CRITICAL, rel=0.01)
    assert pushed[0.9].iterations <= 10
    assert pushed[1.1].status == "converged past an instability", pushed[1.1].message


@pytest.mark.parametrize("solver", ["auto", "cholesky", "cg", "multigrid"])
def test_a_cube_that_next_to_nothing_holds_is_stable_in_pressure_and_on_a_table(block: Block, solver: Solver) -> None:
    # Uniform pressure turns with the body, so what little holds it decides; a residual of a thousandth outweighs that.
    points, cells = block((2, 2, 2), (0.1, 0.1, 0.1))
    mesh, little = vs.mesh(points, cells), vs.ElasticSupport("x > -1%", stiffness=0.1)
    cube = vs.Organ(mesh, vs.NeoHookean(young=1e4, poisson=0.3), supports=[little])
    pressed = cube.solve(pressure={"x > -1%": 1e3}, solver=solver)
    assert pressed.status == "converged", pressed.message
    table = vs.Tool(vs.HalfSpace(), position=(0, 0, -1e-3))
    lying = cube.solve(gravity=(0, 0, -9.81), density=1000, contact=[table], solver=solver)
    assert lying.status == "converged", lying.message


@pytest.mark.parametrize("solver", ["cholesky", "cg", "multigrid"])
def test_frames_with_a_tool_are_stable_as_long_as_the_column_is(column: vs.Organ, solver: Solver) -> None:
    head = column.patch((THICK / 2, THICK / 2, LONG), 0.8 * THICK)
    critical = CRITICAL / abs(column.solve(displacement={head: (0, 0, -1e-6)}).reaction(head)[2]) * 1e-6
    stepper = column.stepper(solver=solver)
    tool = stepper.grasp(head)
    for _ in range(9):
        tool.move((0, 0, -0.1 * critical))
        assert not stepper.frame().is_unstable
    # Pushed too fast to bend on the way, it stands straight beyond Euler's load for a frame.
    tool.move((0, 0, -0.6 * critical))
    assert any(stepper.frame().is_unstable for _ in range(4))


TOUCHES = [
    ([-0.0672, -0.0616, -0.0335], [-0.199, 0.967, 0.158]),
    ([-0.0294, -0.0689, 0.0018], [-0.264, 0.897, 0.356]),
    ([-0.1096, 0.0019, -0.0422], [0.604, -0.509, 0.613]),
]
"""Points and directions of touches at whose end the tangent is indefinite without what the tool holds."""


@pytest.mark.parametrize(("point", "direction"), TOUCHES)
def test_a_touch_of_the_liver_that_its_tool_holds_is_stable(point: list[float], direction: list[float]) -> None:
    liver = vs.Organ(vs.organs.liver(), vs.NeoHookean(young=0.17e6, poisson=0.48), fixed="hilum", element="P1")
    patch = liver.patch(point, 0.06 * liver.mesh.diagonal)
    state = liver.solve(
        displacement={patch: 0.1 * liver.mesh.diagonal * np.array(direction)}, settings={"tolerance": 1e-6}
    )
    assert state.status == "converged", state.message
    assert state.iterations <= 12


@pytest.mark.parametrize("element", ["P1", "P1 mean volume"])
def test_the_silicone_cylinder_hangs_as_in_sofa_within_twenty_factors(shared: Path, element: str) -> None:
    # SOFA's regression test of hyperelasticity: node 2677 at rest after 180 frames, with linear cells.
    mesh = vs.read(shared / "meshes" / "pdms_cylinder.vtk", units="m")
    foot = np.flatnonzero((mesh.points[:, 2] >= -0.002) & (mesh.points[:, 2] <= 1e-9))
    law = vs.MooneyRivlin(c1=151065.460, c2=101709.668, kappa=1e7, volumetric="ln J")
    state = vs.Organ(mesh, law, fixed=foot, element=element).solve(gravity=(0.0, -9.81, 0.0), density=965.0)
    assert state.status == "converged", state.message
    assert state.factorizations <= 20, state.factorizations
    if element == "P1":
        place = mesh.points[2677] + state.displacement[2677]
        assert place == pytest.approx([-0.000373234, -0.106832, 0.141393], abs=1e-5)
