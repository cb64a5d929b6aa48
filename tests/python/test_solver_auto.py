"""The solver that is chosen automatically: what it chooses, that it says so, and that nothing else changes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import viscera as vs
from viscera.cli import main

Block = Callable[[tuple[int, int, int], tuple[float, float, float]], tuple[NDArray[np.float64], NDArray[np.uint32]]]


def organ(block: Block, counts: tuple[int, int, int], size: tuple[float, float, float], poisson: float) -> vs.Organ:
    points, cells = block(counts, size)
    ends = {"foot": np.flatnonzero(points[:, 0] == 0.0), "end": np.flatnonzero(np.isclose(points[:, 0], size[0]))}
    mesh = vs.mesh(points, cells, ends)
    return vs.Organ(mesh, vs.NeoHookean(young=1e4, poisson=poisson), fixed="foot", element="P1")


@pytest.mark.parametrize(
    ("counts", "size", "chosen"),
    [((14, 14, 14), (0.1, 0.1, 0.1), "incomplete_cholesky"), ((40, 2, 2), (0.1, 0.005, 0.005), "cholesky")],
)
def test_a_cube_is_solved_by_conjugate_gradients_and_a_bar_by_a_factor(
    block: Block, counts: tuple[int, int, int], size: tuple[float, float, float], chosen: str
) -> None:
    body = organ(block, counts, size, 0.45)
    found, exact = (body.solve(displacement={"end": (0.01, 0, 0)}, solver=name) for name in ("auto", "cholesky"))
    assert found.solver == chosen
    assert (found.linear_iterations > 0) == (chosen != "cholesky")
    assert (found.status, exact.status, exact.solver) == ("converged", "converged", "cholesky")
    assert abs(found.displacement - exact.displacement).max() < 1e-9


def test_frames_ask_for_a_solver(block: Block) -> None:
    body = organ(block, (2, 2, 2), (0.1, 0.1, 0.1), 0.45)
    with pytest.raises(vs.VisceraError, match='"auto" chooses a solver for a whole solution; frames take "cholesky"'):
        body.stepper(solver="auto")


def test_a_case_says_which_solver_it_was(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    liver = vs.Organ(vs.organs.liver(), vs.NeoHookean(young=1e4, poisson=0.4), fixed="hilum")
    load = {"tip": (0, 0, -0.02)}
    chosen = liver.solve(force=load).solver
    assert chosen != "cholesky"
    liver.to_case(tmp_path / "liver.toml", loads={"force": load})
    assert main(["solve", str(tmp_path / "liver.toml")]) == 0
    assert f"linear solver         {chosen}" in capsys.readouterr().out
    liver.to_case(tmp_path / "liver.toml", loads={"force": load}, settings={"solver": "cholesky"})
    assert main(["solve", str(tmp_path / "liver.toml")]) == 0
    assert "linear solver         cholesky" in capsys.readouterr().out


def test_a_lagged_factor_shifts_tangents_that_are_not_positive_definite(block: Block) -> None:
    """As are the first ones of a nearly incompressible cube of quadratic cells that is stretched by a quarter."""
    points, cells = block((7, 7, 7), (0.1, 0.1, 0.1))
    ends = {"foot": np.flatnonzero(points[:, 0] == 0.0), "end": np.flatnonzero(np.isclose(points[:, 0], 0.1))}
    law = vs.NeoHookean(young=1e4, poisson=0.49)
    cube = vs.Organ(vs.mesh(points, cells, ends), law, fixed="foot", element="P2")
    found, exact = (cube.solve(displacement={"end": (0.025, 0, 0)}, solver=name) for name in ("auto", "cholesky"))
    assert (found.status, found.solver) == ("converged", "lagged_cholesky")
    assert abs(found.displacement - exact.displacement).max() < 1e-8


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_what_touches_is_solved_by_conjugate_gradients_to_the_end(friction: float) -> None:
    """Its tangents are not always positive definite, and its load steps are shortened: with every solver."""
    liver = vs.Organ(vs.organs.liver(), vs.NeoHookean(young=5e3, poisson=0.45), fixed="hilum")
    top = liver.mesh.points[liver.mesh.points[:, 2].argmax()]
    tool = vs.Tool(vs.Sphere(0.015), top + np.array((0, 0, 0.015)), friction=friction, displacement=(0, 0, -0.01))
    found, exact = (liver.solve(contact=[tool], solver=name) for name in ("auto", "cholesky"))
    assert (found.status, found.solver) == ("converged", "lagged_cholesky")
    assert abs(found.displacement - exact.displacement).max() < 1e-8
    assert found.iterations <= exact.iterations + 5
