"""Copies and pickles: organs, models and states travel to other processes, and are the same there."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

import viscera as vs
from viscera.contact.shapes import AnyShape


def pickled(thing: Any) -> Any:
    return pickle.loads(pickle.dumps(thing))


COPIES: list[Callable[[Any], Any]] = [copy.copy, copy.deepcopy, pickled]
copies = pytest.mark.parametrize("again", COPIES)


@pytest.fixture(scope="module")
def organ(bar: vs.Mesh) -> vs.Organ:
    young = bar.per_cell(1e5, {"x > 50%": 3e5})
    return vs.Organ(bar.with_cell_sets(stiff="x > 50%"), vs.NeoHookean(young=young, poisson=0.3), "root", element="P2")


@copies
def test_a_mesh_keeps_all_that_it_tells(bar: vs.Mesh, again: Callable[[Any], Any]) -> None:
    mesh = replace(bar.with_cell_sets(stiff="x > 50%").quadratic(), axes="LPS", messages=("doubtful",))
    other: vs.Mesh = again(mesh)
    for each in fields(vs.Mesh):
        assert repr(getattr(other, each.name)) == repr(getattr(mesh, each.name)), each.name
    assert np.array_equal(other.points, mesh.points)
    assert other.axes == again(vs.Organ(mesh, vs.Linear(young=1e5, poisson=0.3), "root")).mesh.axes == "LPS"


@copies
def test_a_scene_with_bodies_of_every_shape(bar: vs.Mesh, again: Callable[[Any], Any]) -> None:
    shapes: list[AnyShape] = [
        vs.Sphere(0.03),
        vs.Capsule(0.02, 0.05),
        vs.Box((0.1, 0.2, 0.3), rounding=0.01),
        vs.HalfSpace(),
        vs.Shape(bar),
    ]
    at = (1.0, 0.05, -1.0)
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), "root")
    pusher = vs.Tool(shapes[0], position=(0.35, 0.05, 0.14), displacement=(0, 0, -0.02), friction=0.3)
    scene = vs.Scene({"bar": organ}, bodies=[pusher, *(vs.Tool(shape, position=at) for shape in shapes[1:])])
    other: vs.Scene = again(scene)
    points = np.random.default_rng(0).uniform(-0.2, 0.4, (50, 3))
    for tool, copied in zip(scene.bodies, other.bodies, strict=True):
        assert repr(copied) == repr(tool)
        assert np.array_equal(copied.shape._core.distance(points), tool.shape._core.distance(points))
    state = scene.solve()
    felt, pushed = again((state, pusher))
    assert felt.force(pushed).tolist() == state.force(pusher).tolist()
    assert state.force(pusher)[2] < -0.1


@copies
def test_an_organ(organ: vs.Organ, again: Callable[[Any], Any]) -> None:
    other: vs.Organ = again(organ)
    assert other is not organ
    assert other.element == "P2"
    assert other.mesh.cell_sets["stiff"].tolist() == organ.mesh.cell_sets["stiff"].tolist()
    assert not other.mesh.points.flags.writeable
    loads: dict[str, Any] = {"force": {"tip": (0, 0, -1)}}
    assert np.array_equal(other.solve(**loads).displacement, organ.solve(**loads).displacement)


@copies
def test_a_model(bar: vs.Mesh, again: Callable[[Any], Any]) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), "root")
    varied = organ.reduce("z > 99% and x > 70%", order=2, vary=vs.Vary("young", 5e4, 2e5, nodes=2))
    touch = varied.at(7e4)
    other: vs.Touch = again(touch)
    at, push = touch.locate((0.4, 0.05, 0.1)), (0, 0, -0.002)
    assert other.value == touch.value == 7e4
    assert np.array_equal(other(at, push).force, touch(at, push).force)
    assert np.array_equal(other(at, push).displacement, touch(at, push).displacement)


@copies
def test_a_separated_series_that_has_been_asked(organ: vs.Organ, again: Callable[[Any], Any]) -> None:
    model = organ.pgd("z > 99% and x > 70%", load=1.0, order=2)
    at = (0.37, 0.04, 0.1)
    asked = model.displacement(at)
    other = again(model)
    assert other.displacement(at).tolist() == asked.tolist()
    assert repr(other) == repr(model)


@copies
def test_a_contact_patch(organ: vs.Organ, again: Callable[[Any], Any]) -> None:
    patch = organ.patch((0.4, 0.05, 0.1), "4 cm")
    other = again(patch)
    state = organ.solve(displacement={patch: (0, 0, "-1 mm")})
    assert state.reaction(other).tolist() == state.reaction(patch).tolist()
    assert organ.solve(displacement={other: (0, 0, "-1 mm")}).energy == state.energy


@copies
def test_a_state_with_the_patch_that_it_moved(organ: vs.Organ, again: Callable[[Any], Any]) -> None:
    patch = organ.patch((0.4, 0.05, 0.1), "4 cm")
    state = organ.solve(displacement={patch: (0, 0, "-1 mm")})
    other: vs.State = again(state)
    assert other.is_converged
    assert np.array_equal(other.displacement, state.displacement)
    assert other.reaction(patch).tolist() == state.reaction(patch).tolist()
    assert other.reaction("root").tolist() == state.reaction("root").tolist()
    with pytest.raises(vs.VisceraError, match="was not prescribed"):
        other.reaction(organ.patch((0.4, 0.05, 0.1), "5 cm"))


@pytest.mark.parametrize("again", COPIES[1:])
@pytest.mark.parametrize("of", ["stepper", "tool", "hand", "forceps", "frame"])
def test_a_stepper_says_what_to_keep_instead(bar: vs.Mesh, of: str, again: Callable[[Any], Any]) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), "root")
    stepper = organ.stepper(iterations=10)
    made: dict[str, Any] = {
        "stepper": stepper,
        "tool": stepper.tool(vs.Sphere(0.03), position=(0.35, 0.05, 0.14)),
        "hand": stepper.grasp("tip"),
        "forceps": stepper.forceps(vs.Sphere(0.02), (0.2, 0.05, 0.05), (0, 0, np.pi / 2), opening=0.12),
    }
    made["hand"].move((0, 0, -0.002))
    frame = made["frame"] = stepper.frame()
    with pytest.raises(vs.VisceraError, match=r"neither copied nor pickled.* keep the organ .*stepper\(start=...\)"):
        again(made[of])
    other, displacement = again((organ, frame.displacement))
    assert np.array_equal(other.stepper(start=displacement).displacement, frame.displacement)


def test_a_tool_pickled_with_its_state_tells_its_force(bar: vs.Mesh) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=10e3, poisson=0.3), fixed="root")
    table = vs.Tool(vs.HalfSpace(), position=(0, 0, 1e-4))
    state = organ.solve(contact=[table], throw=True)
    again, tool = pickle.loads(pickle.dumps((state, table)))
    assert np.array_equal(again.force(tool), state.force(table))
    with pytest.raises(vs.VisceraError, match=r"take the tool pickled with it, as in \(state, tool\)"):
        again.force(table)


@copies
def test_a_failed_solve_travels_with_its_state(bar: vs.Mesh, again: Callable[[Any], Any]) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), "root")
    with pytest.raises(vs.NotConverged) as failed:
        organ.solve(force={"tip": (0, 0, -10.0)}, settings={"max_iterations": 1, "smallest_step": 1.0}, throw=True)
    other: vs.NotConverged = again(failed.value)
    assert type(other) is vs.NotConverged
    assert str(other) == str(failed.value)
    assert other.state.load == failed.value.state.load < 1.0
    assert np.array_equal(other.state.displacement, failed.value.state.displacement)


def _kinds(of: type[Exception]) -> list[type[Exception]]:
    return [of, *(each for kind in of.__subclasses__() for each in _kinds(kind))]


@copies
def test_every_error_of_bad_input_travels(again: Callable[[Any], Any]) -> None:
    kinds = [kind for kind in _kinds(vs.VisceraError) if kind is not vs.NotConverged]
    assert {kind.__name__ for kind in kinds} >= {"VisceraError", "NotWritten", "Undetermined"}
    for kind in kinds:
        other = again(kind("young is -1"))
        assert (type(other), str(other)) == (kind, "young is -1")
