"""What is not what it should be gets a sentence that says so, wherever it enters; places and lengths are words, too."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import viscera as vs
from viscera.quantity import Number, Whole

LAW = vs.NeoHookean(young=1e5, poisson=0.3)


@pytest.fixture(scope="module")
def organ(bar: vs.Mesh) -> vs.Organ:
    return vs.Organ(bar, LAW, fixed="x < 1%")


def test_places_are_words_in_python_too(bar: vs.Mesh, organ: vs.Organ) -> None:
    assert organ.fixed.tolist() == bar.nodes("root").tolist()
    by_words = organ.solve(force={"x > 99%": (0, 0, -1)})
    by_name = organ.solve(force={"tip": (0, 0, -1)})
    by_array = organ.solve(force=[(bar.nodes("tip"), (0, 0, -1))])
    by_list = organ.solve(force=[(bar.nodes("tip").tolist(), (0, 0, -1))])
    for state in (by_words, by_array, by_list):
        assert state.displacement.tolist() == by_name.displacement.tolist()
    assert by_words.reaction("x < 1%") == pytest.approx(by_name.reaction("root"))
    assert bar.cells_in("x > 50%").tolist() == bar.cells_in(lambda x: x[:, 0] > 0.2).tolist()


def test_a_condition_means_the_same_nodes_of_a_quadratic_mesh(bar: vs.Mesh) -> None:
    """Those of the corners that meet it, and the midpoints between them."""
    named = bar.with_sets(end="x > 90%").quadratic()
    assert named.nodes("x > 90%").tolist() == named.nodes("end").tolist()


def test_lengths_are_words_in_python_too(bar: vs.Mesh, organ: vs.Organ) -> None:
    diagonal = bar.diagonal
    assert organ.touchable(radius="20%").tolist() == organ.touchable(radius=0.2 * diagonal).tolist()
    point = bar.points[bar.nodes("tip")[0]]
    assert organ.patch(point, "6 cm").nodes.tolist() == organ.patch(point, 0.06).nodes.tolist()
    assert bar.near(point, "10 cm").tolist() == bar.near(point, 0.1).tolist()
    place = "z > 99% and x > 70%"
    touch = organ.reduce(place, radius="15%", depth="5%", order=2)
    assert touch.radius == pytest.approx(0.15 * diagonal)
    assert touch.depth == pytest.approx(0.05 * diagonal)
    varied = organ.reduce(place, radius="15%", depth="5%", order=2, vary=vs.Vary("radius", "10%", "8 cm", nodes=2))
    assert varied.metadata["parameter"]["range"] == pytest.approx([0.1 * diagonal, 0.08])


def test_what_a_hand_bears_may_be_asked_by_the_hand(organ: vs.Organ) -> None:
    stepper = organ.stepper()
    hand = stepper.grasp("tip")
    hand.move((0, 0, 0.001))
    frame = stepper.frame()
    assert frame.reaction(hand) == pytest.approx(frame.reaction("tip"))
    assert np.abs(frame.reaction(hand)).max() > 0.0


def test_a_start_is_a_state_a_frame_or_an_array(organ: vs.Organ) -> None:
    state = organ.solve(force={"tip": (0, 0, -1)})
    frame = organ.stepper(start=state).frame(force={"tip": (0, 0, -1)})
    for start in (state, frame, state.displacement, state.displacement.tolist()):
        again = organ.solve(force={"tip": (0, 0, -1)}, start=start)
        assert again.iterations <= 1
        stepper = organ.stepper(start=start)
        assert stepper.displacement == pytest.approx(np.asarray(getattr(start, "displacement", start)))


def test_a_mesh_made_of_arrays_is_checked(bar: vs.Mesh) -> None:
    made = vs.Mesh(bar.points.tolist(), bar.cells.astype(np.int64))
    assert made.cells.dtype == np.uint32
    assert vs.Organ(made, LAW, fixed="x < 1%").solve().is_converged
    with pytest.raises(vs.VisceraError, match="names a point that is not one of 81"):
        vs.Mesh(bar.points, bar.cells + 81)


def test_where_nothing_acts_it_is_said(organ: vs.Organ) -> None:
    nothing: list[dict[str, Any]] = [{}, {"force": {"tip": (0, 0, 0)}}, {"displacement": {"tip": (0, 0, None)}}]
    for loads in nothing:
        state = organ.solve(**loads)
        assert state.is_converged
        assert state.message.startswith("nothing acts on the organ")
    assert organ.solve(force={"tip": (0, 0, -1)}).message.startswith("converged in")
    assert organ.solve(gravity=(0, 0, -9.81), density=1000).message.startswith("converged in")


def test_a_density_in_other_units_is_shown(organ: vs.Organ, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, "viscera"):
        organ.solve(gravity=(0, 0, -9.81), density=260)
        assert not caplog.records
        organ.solve(gravity=(0, 0, -9.81), density=1.06)
    assert [record.message for record in caplog.records] == [
        "a density of 1.06 kg/m^3 is 0.00106 g/cm^3, lighter than any tissue; soft tissue has about 1000 kg/m^3"
    ]


class Preset(vs.NeoHookean):
    """A law of ours with parameters of its own is fine."""

    def __init__(self) -> None:
        super().__init__(young=1e5, poisson=0.3)


def test_a_preset_of_a_law_is_a_law(bar: vs.Mesh) -> None:
    assert vs.Organ(bar, Preset(), fixed="root").solve().is_converged


def test_laws_are_not_written_in_python() -> None:
    with pytest.raises(vs.VisceraError, match=r"laws are compiled, .* as CONTRIBUTING"):
        type("Mine", (vs.laws.Law,), {"energy": lambda self, F: 0.0})
    with pytest.raises(vs.VisceraError, match="laws are compiled"):
        type("Mine", (vs.NeoHookean,), {"energy": lambda self, F: 0.0})


Make = Callable[[vs.Organ], Any]


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (
            lambda o: o.solve(displacement=[0, 0, 1]),
            r"displacement must be {where: value}, or pairs .*, got \[0, 0, 1\]",
        ),
        (lambda o: o.solve(displacement={"tip": 0.1}), "displacement of 'tip' must be three lengths"),
        (lambda o: o.solve(force="tip"), "force must be {where: "),
        (lambda o: o.solve(force={"tip": (0, 0, True)}), "force on 'tip' must be three finite numbers"),
        (lambda o: o.solve(force={"tip": (0, 0, "1")}), "force on 'tip' must be three finite numbers"),
        (lambda o: o.solve(force={"tip": (0, 0, 1e100)}), r"none above 1e\+09 in size"),
        (lambda o: o.solve(force=np.full((81, 3), 1e100)), "the force on node 0 must be three finite numbers"),
        (lambda o: o.solve(force=[("tip", (0, 0, 1)), ("tip", (0, 0, 2))]), "force names 'tip' twice"),
        (lambda o: o.solve(force=[({}, (0, 0, 1))]), "a place of force must be a set's name"),
        (lambda o: o.solve(traction=[1]), "traction must be {where: value}"),
        (lambda o: o.solve(pressure=1e3), "pressure must be {where: value}"),
        (lambda o: o.solve(pressure={"tip": True}), "the pressure on 'tip' must be a number"),
        (lambda o: o.solve(gravity=9.81, density=1000), "gravity must be three finite numbers"),
        (lambda o: o.solve(gravity=(0, 0, -9.81), density="water"), "density must be a number above 0 .*, got 'water'"),
        (lambda o: o.solve(gravity=(0, 0, -9.81), density=True), "density must be a number above 0 .*, got True"),
        (lambda o: o.solve(steps=True), "steps must be a whole number from 1 to 10000, got True"),
        (lambda o: o.solve(steps=99999999), "steps must be a whole number from 1 to 10000, got 99999999"),
        (lambda o: o.solve(settings=1), "settings must be a mapping"),
        (lambda o: o.solve(settings={"max_iterations": 1.5}), "max_iterations in settings must be a whole number"),
        (lambda o: o.solve(start="rest"), "start must be a State, a Frame or a finite displacement"),
        (
            lambda o: o.stepper(start=np.full((81, 3), np.nan)),
            "start must be a State, a Frame or a finite displacement",
        ),
        (lambda o: o.stepper(start=np.zeros((3, 3))), "belongs to another mesh"),
        (lambda o: o.stepper(damping=0.1), r"damping must be a pair \(alpha \[1/s\], beta \[s\]\)"),
        (lambda o: o.stepper(relaxation=0.1), "relaxation must be a viscera.Prony"),
        (lambda o: o.stepper(extrapolate="yes"), "extrapolate must be True or False"),
        (lambda o: o.stepper(iterations="1"), "iterations must be a whole number from 1 to 1000, got '1'"),
        (lambda o: o.stepper(budget="soon"), "budget must be a number above 0"),
        (lambda o: o.stepper([0.1]), "grasped must be {where: value}"),
        (lambda o: o.stepper().frame(displacement=[0.1]), "displacement must be {where: value}"),
        (lambda o: o.stepper().frame(pressure=[0.1]), "pressure must be {where: value}"),
        (lambda o: o.reduce("tip", vary=[1e3, 1e5]), "vary must be a viscera.Vary"),
        (lambda o: o.reduce("tip", start=np.zeros((81, 3))), "the state to reduce about must be a State"),
        (lambda o: o.reduce("tip", order=True), "order must be a whole number from 2 to 8, got True"),
        (lambda o: o.reduce("tip", pade="no"), "pade must be true or false, got 'no'"),
        (lambda o: o.reduce("tip", memory=0), r"memory must be a number above 0 and at most 1e\+15 \[bytes\], got 0"),
        (lambda o: o.reduce("tip", memory="2 GB"), r"memory must be a number above 0 .*, got '2 GB'"),
        (lambda o: o.reduce("tip", radius="wide"), "radius 'wide' is not a length"),
        (lambda o: o.reduce("tip", radius=[0.1]), r"radius must be a number .*, got \[0.1\]"),
        (lambda o: o.path(force={"tip": (0, 0, 1)}, order="2"), "order must be a whole number from 2 to 30, got '2'"),
        (lambda o: o.path(force={"tip": (0, 0, 1)}, until=True), "until must be a number"),
        (lambda o: o.pgd("tip", load="1"), "load must be a number"),
        (lambda o: o.unloaded(gravity=(0, 0, -9.81), density=1000, tolerance="1e-9"), "tolerance must be a number"),
        (lambda o: o.unloaded(force=[0, 0, 1]), "nodal forces have shape"),
        (lambda o: o.solve(displacement=np.ones(2)), "displacement must be {where: value}, or pairs"),
        (
            lambda o: o.register(o.mesh.points, progress=3),
            r"progress must be a function of \(done, total, stage\), .* 3",
        ),
        (lambda o: o.register(o.mesh.points, loaded="root"), "^`loaded` holds no whole free triangle"),
        (lambda o: o.reduce("tip", progress="yes"), "progress must be a function"),
        (lambda o: o.patch((0, 0.04, 0.06), 0.3), r"the surface is fixed at the point .*; move the point beside it"),
        (lambda o: o.patch((0, 0.04, 0.9), 0.3), "there is no free surface within 0.3 m of the point"),
        (lambda o: o.path(pressure=np.ones(2)), "pressure must be {where: value}, or pairs"),
        (lambda o: o.stepper().frame(pressure=np.ones(2)), "pressure must be {where: value}, or pairs"),
        (lambda o: vs.Organ("organ.vtu", LAW, fixed="x < 1%"), "the mesh must be a viscera.Mesh"),  # type: ignore[arg-type]
        (lambda o: vs.Organ(o.mesh, LAW, fixed="x < 1%", element=1), "the element 1 is unknown"),  # type: ignore[arg-type]
        (lambda o: vs.NeoHookean(1e3, 0.3), r"NeoHookean takes its parameters by name, .* young= and poisson="),
        (lambda o: vs.NeoHookean(young=True, poisson=0.3), "young must be one number or an array .*, got True"),
        (lambda o: vs.NeoHookean(young="1e5", poisson=0.3), "young must be one number or an array .*, got '1e5'"),
        (lambda o: vs.NeoHookean(young=1e300, poisson=0.3), "young is 1e\\+300; it must not exceed"),
        (lambda o: vs.MooneyRivlin(1, 1, alpha="stiff"), "alpha must be one number or an array"),
        (lambda o: vs.MooneyRivlin(1, 1, kappa=1, volumetric=[]), "volumetric form .* is unknown"),  # type: ignore[arg-type]
        (lambda o: vs.Ogden(mu=None, alpha=[1], poisson=0.3), "mu1 must be one number"),  # type: ignore[arg-type]
        (lambda o: vs.helical_fibres(o.mesh, 30, axis="z"), "the axis of helical fibres must be three finite numbers"),
        (lambda o: vs.Prony(g=[], tau=[]), "relaxation has neither moduli g nor times tau; give one of each at least"),
        (lambda o: vs.Prony(g=0.1, tau=1), "relaxation g must be a list of numbers, got 0.1"),  # type: ignore[arg-type]
        (lambda o: vs.Newmark(beta="a"), "beta of Newmark must be a number"),  # type: ignore[arg-type]
        (lambda o: vs.Vary("young", "low", 2), "the range of young must be a number"),
        (lambda o: vs.Vary(["young"], 1, 2), "the varied parameter .* is unknown"),  # type: ignore[arg-type]
        (lambda o: vs.ConjugateGradients(tolerance=True), "tolerance of conjugate gradients must be a number above 0"),
        (lambda o: vs.ConjugateGradients(max_iterations=1.5), "must be a whole number"),  # type: ignore[arg-type]
        (lambda o: o.mesh.near("tip", 0.1), "centre .tip. is not a point"),
        (lambda o: o.mesh.per_cell(True, {}), "the value per cell must be a number"),
        (lambda o: vs.read("organ.vtu", units=True), "units, .* must be a number above 0"),
    ],
)
def test_wrong_arguments(organ: vs.Organ, make: Make, sentence: str) -> None:
    with pytest.raises(vs.VisceraError, match=sentence):
        make(organ)


CORNER: Any = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
CELL: Any = [[0, 1, 2, 3]]
NUL = "a\0.vtu"


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: vs.mesh([[0, 0], [1]], [[0]]), r"points must be rows of three numbers \(n, 3\), got \[\["),
        (lambda: vs.mesh(CORNER, [[0, 1, 2], [3]]), r"cells must be rows of four node indices \(m, 4\), got"),
        (lambda: vs.mesh(np.array(CORNER) * (1 + 1j), CELL), "points must be real numbers .*, not complex numbers"),
        (lambda: vs.mesh(np.array(CORNER).astype(str), CELL), "points must be real numbers .*, not texts"),
        (lambda: vs.mesh(np.array(CORNER, dtype=bool), CELL), "points must be real numbers .*, not booleans"),
        (lambda: vs.mesh([[False, 0, 0], *CORNER[1:]], CELL), "points must be rows of three numbers .*, got .*False"),
        (lambda: vs.mesh(CORNER, [[0, True, 2, 3]]), "cells must be rows of four node indices .*, got .*True"),
        (lambda: vs.mesh(CORNER, CELL, sets=[0, 1]), r"sets must be a mapping from the name .*, got \[0, 1\]"),  # type: ignore[arg-type]
        (lambda: vs.mesh(CORNER, CELL, cell_sets=[0]), r"cell sets must be a mapping from the name .*, got \[0\]"),  # type: ignore[arg-type]
        (lambda: vs.mesh(CORNER, CELL, sets={3: [0, 1]}), "the name of a set must be a text .*, got 3"),  # type: ignore[dict-item]
        (lambda: vs.mesh(CORNER, CELL, cell_sets={3: [0]}), "the name of a cell set must be a text .*, got 3"),  # type: ignore[dict-item]
        (lambda: vs.mesh(CORNER, CELL, sets={"a": [[0], [1, 2]]}), "set 'a' must be a list of indices, or a mask, got"),
        (lambda: vs.load(3), "the model file must be named by a text or a path, got 3"),  # type: ignore[arg-type]
        (lambda: vs.load(NUL), "the model file must be named by a text or a path, got"),
        (lambda: vs.case(None), "the case file must be named by a text or a path, got None"),  # type: ignore[arg-type]
        (lambda: vs.read(3), "the mesh file must be named by a text or a path, got 3"),  # type: ignore[arg-type]
        (lambda: vs.scan(3), "the image must be named by a text or a path, got 3"),  # type: ignore[arg-type]
        (lambda: vs.StrainEnergy("fibres*(I1bar - 3) + 1e4*(J - 1)**2"), "'fibres' names the directions of fibres"),
        (lambda: vs.StrainEnergy(3, mu=1e3), "the energy must be a formula, .*, got 3"),  # type: ignore[arg-type]
    ],
)  # fmt: skip
def test_wrong_meshes_and_files(make: Callable[[], object], sentence: str) -> None:
    with pytest.raises(vs.VisceraError, match=sentence):
        make()


@pytest.fixture(scope="module")
def touch(organ: vs.Organ) -> vs.Touch:
    return organ.reduce("z > 99% and x > 70%", depth="5%", order=2)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda t: t.check("3"), "touches must be a whole number from 1 to 1000000, got '3'"),
        (lambda t: t.check(True), "touches must be a whole number from 1 to 1000000, got True"),
        (lambda t: t.check(2.5), "touches must be a whole number from 1 to 1000000, got 2.5"),
        (lambda t: t.check(2, seed="a"), "seed must be a whole number from 0 to 4294967295, got 'a'"),
        (lambda t: t.check(2, seed=-1), "seed must be a whole number from 0 to 4294967295, got -1"),
        (lambda t: t.check(2, depths=3), "depths must be a list of lengths, such as .*, got 3"),
        (lambda t: t.check(2, depths="5%"), "depths must be a list of lengths, such as .*, got '5%'"),
        (lambda t: t.compressed("a"), "tolerance must be a number above 0 and below 1, got 'a'"),
        (lambda t: t.compressed(True), "tolerance must be a number above 0 and below 1, got True"),
        (lambda t: t.compressed(1), "tolerance must be a number above 0 and below 1, got 1"),
        (lambda t: t.save(5), "the file to write must be named by a text or a path, got 5"),
    ],
)
def test_wrong_questions_to_a_model(touch: vs.Touch, make: Callable[[vs.Touch], object], sentence: str) -> None:
    with pytest.raises(vs.VisceraError, match=sentence):
        make(touch)


@pytest.mark.parametrize("name", [5, None, b"a.vtu", "", NUL])
def test_what_names_no_file_is_refused(organ: vs.Organ, name: Any) -> None:
    state = organ.solve(force={"tip": (0, 0, -1)})
    for write in (state.write, organ.mesh.write, organ.to_case):
        with pytest.raises(vs.VisceraError, match="must be named by a text or a path, got"):
            write(name)


@pytest.mark.parametrize(
    ("read", "ending"),
    [
        (vs.case, ".toml"),
        (vs.load, ".viscera"),
        (vs.read, ".vtu"),
        (vs.scan, ".nii"),
        (vs.organs.beam().write, ".vtu"),
    ],
)
def test_a_name_that_no_file_can_have_is_refused(read: Callable[[str], Any], ending: str) -> None:
    with pytest.raises(vs.VisceraError, match=r"'x+\.\.\. is too long for the name of a file; give a shorter one"):
        read("x" * 300 + ending)


@pytest.mark.parametrize("start", [5, (0, 0), [1.0, 2.0], "tip", np.zeros(3)])
def test_a_start_that_is_no_displacement_is_called_so(organ: vs.Organ, start: Any) -> None:
    with pytest.raises(vs.VisceraError, match="start must be a State, a Frame or a finite displacement"):
        organ.solve(force={"tip": (0, 0, -1)}, start=start)
    with pytest.raises(vs.VisceraError, match="the state to reduce about must be a State"):
        organ.reduce("tip", start=start)
    with pytest.raises(vs.VisceraError, match="belongs to another mesh"):
        organ.solve(force={"tip": (0, 0, -1)}, start=np.zeros((2, 3)))


def test_a_formula_may_name_its_parameters_as_it_likes() -> None:
    """They were taken for arguments of Python."""
    usual = vs.StrainEnergy("mu/2*(I1bar - 3) + 1e4*(J - 1)**2", mu=1e3)
    by_name = vs.StrainEnergy(energy="mu/2*(I1bar - 3) + 1e4*(J - 1)**2", mu=1e3)
    assert repr(by_name) == repr(usual)
    F = np.diag([1.1, 0.9, 1.0])[None]
    for name in ("energy", "self", "law"):
        law = vs.StrainEnergy(f"{name}/2*(I1bar - 3) + 1e4*(J - 1)**2", **{name: 1e3})
        assert law.energy(F) == pytest.approx(usual.energy(F), rel=1e-14)


@pytest.mark.parametrize("name", ["energy", "law"])
def test_a_parameter_that_is_a_key_of_cases_is_not_written_over_it(bar: vs.Mesh, name: str) -> None:
    law = vs.StrainEnergy(f"{name}/2*(I1bar - 3) + 1e4*(J - 1)**2", **{name: 1e3})
    with pytest.raises(vs.VisceraError, match=f"{name!r} is a key of every case file"):
        vs.Organ(bar, law, fixed="root").to_case("never.toml")


def test_a_push_that_is_no_size_of_an_organ_is_refused(organ: vs.Organ) -> None:
    """It gave a force that was no number."""
    touch = organ.reduce("z > 99% and x > 70%", depth="5%", order=2)
    point = organ.mesh.points[touch.mesh.nodes("z > 99% and x > 90%")[0]]
    with pytest.raises(vs.VisceraError, match=r"contact displacement must be three finite numbers .* 1000 in size"):
        touch(point, (0, 0, -1e100))
    assert np.isfinite(touch(point, (0, 0, -1e3)).force).all()


def test_what_numpy_calls_a_number_is_one() -> None:
    assert Number()(np.float32(0.5), "x") == 0.5
    assert Whole(1, 3)(np.int16(2), "n") == 2
    assert Whole(1, 3)(np.array(2), "n") == 2
    for wrong in (np.True_, np.array([1]), 1 + 0j, None, 2.0, "2"):
        with pytest.raises(vs.VisceraError, match="n must be a whole number from 1 to 3"):
            Whole(1, 3)(wrong, "n")
