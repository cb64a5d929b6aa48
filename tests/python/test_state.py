"""What a solve gives back."""

from __future__ import annotations

import base64
import json
import struct
import sys
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

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


def test_a_place_and_a_patch_that_share_nodes_are_told_apart(bar: vs.Mesh) -> None:
    """Each force is the derivative of the energy by what is prescribed there; all of them balance."""
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    patch = organ.patch((0.38, 0.05, 0.1), 0.06)
    assert np.intersect1d(patch.nodes, bar.nodes("tip")).size
    assert np.setdiff1d(patch.nodes, bar.nodes("tip")).size

    def solved(lift: float) -> vs.State:
        prescribed = {"tip": (None, None, lift), patch: (0, 0, -0.006)}
        return organ.solve(displacement=prescribed, settings={"tolerance": 1e-11})

    state, small = solved(-0.004), 1e-5
    tip, pressed = state.reaction("tip"), state.reaction(patch)
    assert np.abs(pressed).max() > 1.0
    assert tip + pressed + state.reaction("root") == pytest.approx(0.0, abs=1e-8 * np.abs(pressed).max())
    assert tip[:2] == pytest.approx(0.0, abs=1e-8 * np.abs(pressed).max()), "nothing holds the tip there"
    work = solved(-0.004 + small).energy - solved(-0.004 - small).energy
    assert tip[2] == pytest.approx(work / (2 * small), rel=1e-5)
    nodal = state._nodal()["reaction"]
    assert nodal.sum(axis=0) == pytest.approx(0.0, abs=1e-8 * np.abs(pressed).max())


def test_reactions_of_a_solve_that_stops_are_those_of_the_load_that_was_reached(bar: vs.Mesh) -> None:
    """The law breaks down under far too large a weight; the base carries a part of it, and free nodes nothing."""
    organ = vs.Organ(bar, vs.SaintVenantKirchhoff(young=1e4, poisson=0.3), fixed="root")
    loads: dict[str, Any] = {"gravity": (-9.81, 0, 0), "density": 1e5, "pressure": {"tip": 3e5}}
    state = organ.solve(**loads)
    assert 0.0 < state.load < 1.0
    weight = 9.81e5 * organ.mesh.facts["volume"]
    assert np.abs(state.reaction("root")).max() < 2.0 * state.load * weight
    free = np.setdiff1d(np.arange(len(bar.points)), organ.fixed)
    left = np.abs(state.internal_force - state.external_force)[free].max()
    assert left < 1e-5 * np.abs(state.internal_force).max()


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


VOLUMES = (".vtu", ".vtk", ".xdmf", ".msh")
SURFACES = (".ply", ".glb", ".gltf", ".obj", ".stl")


@pytest.fixture(scope="module")
def quadratic(bar: vs.Mesh) -> vs.State:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root", element="P2")
    return organ.solve(force={"tip": (5.0, 0.0, -1.0)})


def moved_surface(state: vs.State) -> np.ndarray:
    """Corners (t, 3, 3) of the deformed boundary."""
    return np.asarray((state.mesh.points + state.displacement)[state.mesh.surface])


@pytest.mark.parametrize("ending", VOLUMES)
@pytest.mark.parametrize("element", ["P1", "P2"])
def test_a_volume_holds_every_field(
    state: vs.State,
    quadratic: vs.State,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    element: str,
    ending: str,
) -> None:
    chosen = quadratic if element == "P2" else state
    if (
        ending == ".xdmf" and find_spec("h5py") is None
    ):  # meshio imports it, and for numbers in the file uses nothing of it
        monkeypatch.setitem(sys.modules, "h5py", ModuleType("h5py"))
        monkeypatch.setattr("viscera.output.state.find_spec", lambda name: True)
    chosen.write(tmp_path / f"state{ending}")
    assert [path.name for path in tmp_path.iterdir()] == [f"state{ending}"], "one file, whole"
    grid = meshio.read(tmp_path / f"state{ending}")
    assert len(grid.cells_dict["tetra10" if element == "P2" else "tetra"]) == len(chosen.mesh.cells)
    assert grid.points == pytest.approx(chosen.mesh.points, abs=1e-12)
    assert grid.point_data["displacement"] == pytest.approx(chosen.displacement, rel=1e-6, abs=1e-12)
    assert grid.point_data["reaction"] == pytest.approx(chosen._held, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("ending", [".ply", ".obj", ".stl"])
@pytest.mark.parametrize("element", ["P1", "P2"])
def test_a_surface_file_holds_the_deformed_surface(
    state: vs.State, quadratic: vs.State, tmp_path: Path, element: str, ending: str
) -> None:
    chosen = quadratic if element == "P2" else state
    chosen.write(tmp_path / f"state{ending}")
    found = meshio.read(tmp_path / f"state{ending}")
    corners = found.points[found.cells_dict["triangle"]]
    expected = moved_surface(chosen)
    assert corners.shape == expected.shape
    assert corners == pytest.approx(expected, abs=1e-7), "single precision is all that STL has"
    if ending == ".ply":
        nodes = chosen.mesh.surface_nodes
        fields = {"displacement": chosen.displacement, "reaction": chosen._held}
        for name, field in fields.items():
            held = np.stack([found.point_data[f"{name}_{axis}"] for axis in "xyz"], axis=-1)
            assert held == pytest.approx(field[nodes])


def gltf_arrays(data: bytes) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """The scene of a glTF file and the arrays of its one mesh, read as the specification says."""
    if data[:4] == b"glTF":
        version, size = struct.unpack("<II", data[4:12])
        length, kind = struct.unpack("<I4s", data[12:20])
        scene = json.loads(data[20 : 20 + length])
        held, mark = struct.unpack("<I4s", data[20 + length : 28 + length])
        buffer = data[28 + length :]
        assert (version, size, kind, mark, held) == (2, len(data), b"JSON", b"BIN\0", len(buffer))
        assert length % 4 == held % 4 == 0
    else:
        scene = json.loads(data)
        buffer = base64.b64decode(scene["buffers"][0]["uri"].partition(",")[2])
    assert scene["buffers"][0]["byteLength"] == len(buffer)

    def array(index: int) -> np.ndarray:
        accessor = scene["accessors"][index]
        view = scene["bufferViews"][accessor["bufferView"]]
        part = buffer[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        values = np.frombuffer(part, {5126: "<f4", 5125: "<u4"}[accessor["componentType"]])
        width = {"VEC3": 3, "SCALAR": 1}[accessor["type"]]
        assert len(values) == width * accessor["count"]
        return values.reshape(-1, width)

    primitive = scene["meshes"][0]["primitives"][0]
    names = {**primitive["attributes"], "indices": primitive["indices"]}
    return scene, {name: array(index) for name, index in names.items()}


@pytest.mark.parametrize("ending", [".glb", ".gltf"])
def test_a_gltf_file_holds_the_deformed_surface_and_its_fields(state: vs.State, tmp_path: Path, ending: str) -> None:
    state.write(tmp_path / f"state{ending}")
    scene, arrays = gltf_arrays((tmp_path / f"state{ending}").read_bytes())
    assert scene["asset"]["version"] == "2.0"
    position, nodes = arrays["POSITION"], state.mesh.surface_nodes
    assert position[arrays["indices"].reshape(-1, 3)] == pytest.approx(moved_surface(state), abs=1e-7)
    assert arrays["_DISPLACEMENT"] == pytest.approx(state.displacement[nodes], rel=1e-6, abs=1e-12)
    assert arrays["_REACTION"] == pytest.approx(state._held[nodes], rel=1e-6, abs=1e-9)
    bounds = scene["accessors"][scene["meshes"][0]["primitives"][0]["attributes"]["POSITION"]]
    assert (bounds["min"], bounds["max"]) == (position.min(axis=0).tolist(), position.max(axis=0).tolist())
    x, y, z, w = scene["nodes"][0]["rotation"]
    assert [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)] == pytest.approx([0, 1, 0]), "z is up"


def test_writing_where_nothing_can_be_written(state: vs.State, tmp_path: Path) -> None:
    with pytest.raises(vs.VisceraError, match="does not exist; create it first"):
        state.write(tmp_path / "nowhere" / "state.vtu")
    for name in ("state.nonsense", "state.inp", "state"):
        with pytest.raises(vs.VisceraError, match=r"a solution cannot be written as .*; use \.vtu, \.vtk, .*\.stl"):
            state.write(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_every_deformed_shape_is_written(bar: vs.Mesh, state: vs.State, tmp_path: Path) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    frame = organ.stepper(iterations=10).frame(force={"tip": (5.0, 0.0, 0.0)})
    touch = organ.reduce("z > 99% and x > 70%", order=2)
    shapes: dict[str, Any] = {
        "frame": frame,
        "moved": organ.moved(state),
        "answer": touch((0.38, 0.05, 0.1), (0, 0, -0.001)),
    }
    for name, shape in shapes.items():
        shape.write(tmp_path / f"{name}.vtu")
        grid = meshio.read(tmp_path / f"{name}.vtu")
        assert grid.point_data["displacement"] == pytest.approx(shape.displacement), name
        assert grid.cell_data["von_mises"][0] == pytest.approx(shape.von_mises()), name
        assert ("reaction" in grid.point_data) == (name == "frame")
    reaction = meshio.read(tmp_path / "frame.vtu").point_data["reaction"]
    assert reaction[bar.nodes("root")].sum(axis=0) == pytest.approx(frame.reaction("root"))


@pytest.mark.parametrize("law", [vs.StableNeoHookean(young=1e4, poisson=0.3), vs.Linear(young=1e4, poisson=0.3)])
@pytest.mark.parametrize("element", ["P1", "P2"])
def test_cells_that_are_inside_out_are_counted(cube: vs.Mesh, law: vs.laws.Law, element: str, tmp_path: Path) -> None:
    """These laws allow it: the top is led past the bottom, and with a stress that is no longer defined it is said."""
    organ = vs.Organ(cube, law, fixed="bottom", element=element)
    turned = organ.mesh.points * [0.0, 0.0, -1.5]
    state = organ.solve(displacement={"top": (0, 0, -0.15)}, start=turned)
    assert state.is_converged
    J = np.linalg.det(organ._body.responses(state.displacement)[0])
    count = int((J <= 0.0).any(axis=1).sum())
    assert count > 0
    words = f"{count} of {len(cube.cells)} cells are inside out"
    is_linear = isinstance(law, vs.Linear)
    assert state.message.endswith(words if is_linear else f"; {words}, and files hold no stress")
    state.write(tmp_path / "turned.vtu")
    assert ("cauchy_stress" in meshio.read(tmp_path / "turned.vtu").cell_data) == is_linear
    frame = organ.stepper({"top": (0, 0, -0.15)}, start=state).frame()
    assert words in repr(frame)
    assert "inside out" not in organ.solve(displacement={"top": (0, 0, -0.01)}).message


def test_a_plot_is_a_png(state: vs.State, tmp_path: Path) -> None:
    figure = state.plot(tmp_path / "state.png")
    assert (tmp_path / "state.png").read_bytes().startswith(b"\x89PNG")
    assert "displacement [mm]" in [axes.get_ylabel() for axes in figure.axes]


def test_too_few_iterations_are_told_as_that(bar: vs.Mesh) -> None:
    """Not as rounding, though little is left: two would do."""
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.4), fixed="root")
    loads: dict[str, Any] = {"force": {"tip": (0.0, 0.0, -1e-3)}, "solver": "cg"}
    state = organ.solve(**loads, settings={"max_iterations": 1, "smallest_step": 0.9})
    assert "settings={'max_iterations': 30}" in state.message, state.message
    assert "rounding" not in state.message
    assert organ.solve(**loads, settings={"max_iterations": 2}).is_converged
