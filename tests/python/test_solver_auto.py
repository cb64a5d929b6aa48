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
    beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    beam.to_case(tmp_path / "beam.toml", loads={"force": {"tip": (0, 0, -10.0)}}, settings={"solver": "auto"})
    assert main(["solve", str(tmp_path / "beam.toml")]) == 0
    assert "linear solver         incomplete_cholesky" in capsys.readouterr().out
