"""Series of shapes: for ParaView with every field, for glTF as an animation."""

from __future__ import annotations

import base64
import json
import os
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest
from numpy.typing import NDArray

import viscera as vs


@pytest.fixture(scope="module")
def organ(bar: vs.Mesh) -> vs.Organ:
    return vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")


def listed(path: Path) -> list[tuple[float, Path]]:
    """Times and files of a .pvd."""
    sets = ElementTree.parse(path).getroot().iter("DataSet")
    return [(float(entry.attrib["timestep"]), path.parent / entry.attrib["file"]) for entry in sets]


def test_frames_become_a_time_series_with_their_stress(organ: vs.Organ, tmp_path: Path) -> None:
    stepper = organ.stepper(density=1000.0, time_step=0.01, dynamics="newmark")
    frames = [(0.01 * k, stepper.frame(gravity=(0, 0, -9.81))) for k in range(1, 4)]
    written = vs.write_series(tmp_path / "swing.pvd", frames)
    assert [path.name for path in written] == ["swing.pvd", *(f"swing_{k:04d}.vtu" for k in range(3))]
    for (time, path), (expected, frame) in zip(listed(tmp_path / "swing.pvd"), frames, strict=True):
        found = meshio.read(path)
        assert time == expected
        assert found.point_data["displacement"] == pytest.approx(frame.displacement)
        assert found.cell_data["cauchy_stress"][0].reshape(-1, 3, 3) == pytest.approx(frame.stress(), abs=1e-6)


def test_quadratic_states_and_recorded_touches_too(bar: vs.Mesh, organ: vs.Organ, tmp_path: Path) -> None:
    quadratic = vs.Organ(bar, organ.law, fixed="root", element="P2")
    loads = [(f, quadratic.solve(force={"tip": (0.0, 0.0, -f)})) for f in (1.0, 2.0)]
    vs.write_series(tmp_path / "load.pvd", loads)
    assert len(meshio.read(tmp_path / "load_0001.vtu").cells_dict["tetra10"]) == len(bar.cells)
    touch = organ.reduce(touchable=lambda x: x[:, 2] > 0.099, radius=0.08, depth=0.005, order=3)
    point = touch.mesh.points[touch._model.array("positions")[3]]
    record = [(1e-3 * k, touch(point, (0.0, 0.0, -1e-3 * k))) for k in range(3)]
    vs.write_series(tmp_path / "touch.pvd", record)
    last = meshio.read(tmp_path / "touch_0002.vtu").point_data["displacement"]
    assert last == pytest.approx(record[-1][1].displacement)


def test_through_a_link_the_moments_lie_beside_the_file_that_lists_them(organ: vs.Organ, tmp_path: Path) -> None:
    shared, mine = tmp_path / "shared", tmp_path / "mine"
    for folder in (shared, mine):
        folder.mkdir()
    first, second = (organ.moved(np.full_like(organ.mesh.points, size)) for size in (1e-3, 2e-3))
    vs.write_series(shared / "s.pvd", [(0.0, first)])
    (mine / "link.pvd").symlink_to(Path("..", "shared", "s.pvd"))
    written = vs.write_series(mine / "link.pvd", [(0.0, second)])
    ((_, path),) = listed(shared / "s.pvd")
    assert meshio.read(path).point_data["displacement"] == pytest.approx(second.displacement)
    assert [os.path.samefile(*pair) for pair in zip(written, [shared / "s.pvd", path], strict=True)] == [True, True]
    assert [each.name for each in mine.iterdir()] == ["link.pvd"]


def test_a_path_is_a_series_over_the_load(organ: vs.Organ, tmp_path: Path) -> None:
    path = organ.path(force={"tip": (0.0, 0.0, -20.0)}, until=1.0)
    path.write(tmp_path / "path.pvd", samples=4)
    times = [time for time, _ in listed(tmp_path / "path.pvd")]
    assert len(times) == 1 + 3 * len(path.expansions)
    assert times[0] == 0.0
    assert times[-1] == pytest.approx(1.0)
    assert (np.diff(times) > 0).all()
    end = meshio.read(listed(tmp_path / "path.pvd")[-1][1]).point_data["displacement"]
    assert end == pytest.approx(path.curve(4)[1][-1])


def same(first: Path, second: Path) -> None:
    """Two `.vtu` files hold the same axes, sets and fields."""
    assert vs.read(first).axes == vs.read(second).axes
    a, b = meshio.read(first), meshio.read(second)
    assert a.point_data.keys() == b.point_data.keys()
    assert a.cell_data.keys() == b.cell_data.keys()
    for name, values in b.point_data.items():
        assert (a.point_data[name] == values).all(), name
    for name, (values,) in b.cell_data.items():
        assert (a.cell_data[name][0] == values).all(), name


def test_a_moment_is_the_file_that_it_writes_by_itself(organ: vs.Organ, tmp_path: Path) -> None:
    """With its axes, the sets of its mesh, and the fields that it has, which differ between the moments."""
    stated = replace(organ.mesh, axes="LPS", cell_sets={"first half": np.arange(96, dtype=np.uint32)})
    organ = vs.Organ(stated, organ.law, fixed="root")
    state = organ.solve(force={"tip": (0.0, 0.0, -1.0)})
    seen = stated.surface_nodes
    found = organ.register(points=(stated.points[seen], (stated.points + state.displacement)[seen]), noise="1 mm")
    frame = organ.stepper().frame(force={"tip": (0.0, 0.0, -1.0)})
    moments = [organ.moved(0.5 * state.displacement), state, frame, found]
    vs.write_series(tmp_path / "mixed.pvd", list(enumerate(moments)))
    for number, moment in enumerate(moments):
        moment.write(tmp_path / "alone.vtu")
        same(tmp_path / f"mixed_{number:04d}.vtu", tmp_path / "alone.vtu")
    own = [meshio.read(tmp_path / f"mixed_{number:04d}.vtu").point_data for number in range(4)]
    assert ["reaction" in fields for fields in own] == [False, True, True, False]
    mesh = vs.read(tmp_path / "mixed_0001.vtu")
    assert mesh.axes == "LPS"
    assert {*mesh.sets, *mesh.cell_sets} == {"root", "tip", "first half"}
    assert "band" in own[3]


def test_a_moment_of_a_path_deforms_the_image_of_its_own_axes(organ: vs.Organ, tmp_path: Path) -> None:
    """The field of a moment in LPS axes is that of the organ, also where the image is in RAS axes."""
    pytest.importorskip("SimpleITK")
    mesh = replace(organ.mesh, points=organ.mesh.points - [0.2, 0.05, 0.05], axes="LPS")
    lps = vs.Organ(mesh, organ.law, fixed="root")
    path = lps.path(force={"tip": (0.0, 0.5, -1.0)})
    vs.Scan.of(mesh, voxel=0.02).write(tmp_path / "scan.nii.gz")
    last = path.write(tmp_path / "path.pvd", samples=3)[-1]
    shape, displacement, _ = vs.output.state.read(last, in_scan=True)
    read = vs.Organ(shape, organ.law, fixed=organ.fixed).moved(displacement).on_grid(tmp_path / "scan.nii.gz")
    expected = lps.moved(path.curve(3)[1][-1]).on_grid(tmp_path / "scan.nii.gz")
    assert expected.inside.sum() > 100
    assert (read.inside == expected.inside).all()
    assert read.displacement == pytest.approx(expected.displacement, abs=1e-12)


def scene_of(data: bytes) -> tuple[dict[str, Any], bytes]:
    """The scene of a glTF file and its buffer."""
    if data[:4] != b"glTF":
        scene = json.loads(data)
        return scene, base64.b64decode(scene["buffers"][0]["uri"].partition(",")[2])
    (length,) = struct.unpack("<I", data[12:16])
    return json.loads(data[20 : 20 + length]), data[28 + length :]


@pytest.mark.parametrize("ending", [".glb", ".gltf"])
def test_gltf_blends_from_shape_to_shape(organ: vs.Organ, tmp_path: Path, ending: str) -> None:
    states = [(t, organ.solve(force={"tip": (0.0, 0.0, -f)})) for t, f in ((1.0, 0.0), (1.5, 1.0), (3.0, 2.0))]
    vs.write_series(tmp_path / f"bend{ending}", states)
    scene, buffer = scene_of((tmp_path / f"bend{ending}").read_bytes())

    def array(index: int) -> NDArray[np.float32]:
        start = scene["bufferViews"][scene["accessors"][index]["bufferView"]]["byteOffset"]
        accessor = scene["accessors"][index]
        width = {"VEC3": 3, "SCALAR": 1}[accessor["type"]]
        return np.frombuffer(buffer, "<f4", width * accessor["count"], start).reshape(-1, width)

    nodes = organ.mesh.surface_nodes
    primitive = scene["meshes"][0]["primitives"][0]
    assert array(primitive["attributes"]["POSITION"]) == pytest.approx(organ.mesh.points[nodes], abs=1e-7)
    targets = primitive["targets"]
    (animation,) = scene["animations"]
    (sampler,) = animation["samplers"]
    assert animation["channels"] == [{"sampler": 0, "target": {"node": 0, "path": "weights"}}]
    assert array(sampler["input"]).ravel().tolist() == [0.0, 0.5, 2.0]
    assert (array(sampler["output"]).reshape(3, 3) == np.eye(3)).all()
    for (_, state), target in zip(states, targets, strict=True):
        assert array(target["POSITION"]) == pytest.approx(state.displacement[nodes], abs=1e-7)


def test_what_is_no_series_is_refused(organ: vs.Organ, cube: vs.Mesh, tmp_path: Path) -> None:
    state = organ.solve(force={"tip": (0.0, 0.0, -1.0)})
    other = vs.Organ(cube, organ.law, fixed="bottom").moved(np.zeros_like(cube.points))
    with pytest.raises(vs.VisceraError, match="there is no moment to write"):
        vs.write_series(tmp_path / "none.pvd", [])
    with pytest.raises(vs.VisceraError, match=r"the folder '.*nodir' does not exist; create it first"):
        vs.write_series(tmp_path / "nodir" / "none.pvd", [(1.0, state)])
    with pytest.raises(vs.VisceraError, match="times must rise: moment 1 is at 1, the one before it at 1"):
        vs.write_series(tmp_path / "twice.pvd", [(1.0, state), (1.0, state)])
    with pytest.raises(vs.VisceraError, match="moment 1 is one of another mesh"):
        vs.write_series(tmp_path / "mixed.pvd", [(0.0, state), (1.0, other)])
    with pytest.raises(vs.VisceraError, match=r"a series is written as \.pvd"):
        vs.write_series(tmp_path / "series.vtu", [(0.0, state)])
    with pytest.raises(vs.VisceraError, match="257 moments; glTF viewers take at most 256"):
        vs.write_series(tmp_path / "long.glb", [(float(k), state) for k in range(257)])
    wrong: Any
    for wrong in ({0: state}, "ab", iter([(0.0, state)])):
        with pytest.raises(vs.VisceraError, match="the moments of a series must be a list of pairs"):
            vs.write_series(tmp_path / "wrong.pvd", wrong)
    for wrong in (state, (0.0, state.displacement), (0.0,), (0.0, state, state)):
        with pytest.raises(vs.VisceraError, match="moment 1 of a series must be a pair of a time and a state"):
            vs.write_series(tmp_path / "wrong.pvd", [(0.0, state), wrong])
    assert not list(tmp_path.iterdir())
