"""What a solve gives back."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest

import viscera as vs
from viscera import _core


@pytest.fixture(scope="module")
def state(bar: vs.Mesh) -> vs.State:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    return organ.solve(force={"tip": (5.0, 0.0, 0.0)})


def test_the_work_of_a_small_force_is_twice_the_energy(bar: vs.Mesh) -> None:
    organ = vs.Organ(bar, vs.Linear(young=1e5, poisson=0.3), fixed="root")
    node = int(bar.nodes("tip")[0])
    state = organ.solve(force={(node,): (0.0, 0.0, 0.01)})
    assert 0.01 * state.displacement[node, 2] == pytest.approx(2 * state.energy, rel=1e-7)


def test_the_numbers_belong_together(state: vs.State) -> None:
    assert state.status == "converged"
    assert state.load == 1.0
    assert state.max_displacement == np.linalg.norm(state.displacement, axis=1).max()
    assert state.volume_ratio > 1.0, "pulling at nu < 0.5 gains volume"
    assert state.iterations == sum(len(step) for step in state.residuals)
    assert state.residuals[-1][-1] < 1e-8
    assert 0.0 < state.timings["total"] <= state.seconds


def test_the_volume_ratio_is_that_of_the_moved_mesh(state: vs.State) -> None:
    moved = vs.mesh(state.mesh.points + state.displacement, state.mesh.cells)
    assert state.volume_ratio == pytest.approx(moved.volume / state.mesh.volume, rel=1e-12)


def test_a_patch_that_was_not_prescribed_has_no_reaction(state: vs.State) -> None:
    stranger = _core.Patch(np.array([80], dtype=np.uint32), np.array([1.0]))
    with pytest.raises(vs.VisceraError, match="was not prescribed"):
        state.reaction(stranger)


def test_the_vtu_file_holds_the_solution(state: vs.State, tmp_path: Path) -> None:
    state.write(tmp_path / "state.vtu")
    grid = meshio.read(tmp_path / "state.vtu")
    assert grid.points == pytest.approx(state.mesh.points)
    assert grid.point_data["displacement"] == pytest.approx(state.displacement)
    assert grid.point_data["reaction"][state.mesh.nodes("root")].sum(axis=0) == pytest.approx(state.reaction("root"))
    assert [path.name for path in tmp_path.iterdir()] == ["state.vtu"]


def test_writing_where_nothing_can_be_written(state: vs.State, tmp_path: Path) -> None:
    with pytest.raises(vs.VisceraError, match="does not exist; create it first"):
        state.write(tmp_path / "nowhere" / "state.vtu")
    with pytest.raises(vs.VisceraError, match=r"use \.vtu"):
        state.write(tmp_path / "state.nonsense")
    assert list(tmp_path.iterdir()) == []


def test_a_plot_is_a_png(state: vs.State, tmp_path: Path) -> None:
    figure = state.plot(tmp_path / "state.png")
    assert (tmp_path / "state.png").read_bytes().startswith(b"\x89PNG")
    assert "displacement [mm]" in [axes.get_ylabel() for axes in figure.axes]
