"""Stress and strain: the patch test, the law itself, tubes in closed form, pressure of one element by another."""

from __future__ import annotations

import warnings
from pathlib import Path
from types import ModuleType

import meshio
import numpy as np
import pytest
from numpy.typing import NDArray

import viscera as vs
from viscera.stress import corner_values

Floats = NDArray[np.float64]
ELEMENTS = ("P1", "P1 mean volume", "P2")
SHIFT = np.array([0.2, 0.1, -0.15])
F = np.eye(3) + np.outer(SHIFT, [0.0, 0.0, 1.0])
LAWS = (
    vs.NeoHookean(young=1e4, poisson=0.3),
    vs.MooneyRivlin(c1=2e3, c2=1e3, kappa=5e4),
    vs.SaintVenantKirchhoff(young=1e4, poisson=0.3),
    vs.Corotated(young=1e4, poisson=0.3),
    vs.Linear(young=1e4, poisson=0.3),
)


def sheared(cube: vs.Mesh, law: vs.laws.Law, element: str) -> vs.State:
    """The cube clamped at its bottom, its surface moved by u = SHIFT z: F is the same everywhere."""
    organ = vs.Organ(cube, law, fixed="bottom", element=element)
    free = np.setdiff1d(organ.mesh.surface_nodes, organ.fixed)
    moved = np.outer(organ.mesh.points[free, 2], SHIFT)
    return organ.solve(displacement={tuple(free.tolist()): moved}, settings={"tolerance": 1e-12}, throw=True)


@pytest.mark.parametrize("element", ELEMENTS)
@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
def test_the_patch_test_is_exact(cube: vs.Mesh, law: vs.laws.Law, element: str) -> None:
    """Every measure at every place is that of the law at the one deformation gradient."""
    state = sheared(cube, law, element)
    P, J = law.stress(F[None])[0], np.linalg.det(F)
    is_linear = isinstance(law, vs.Linear)
    expected = {"pk1": P, "cauchy": P if is_linear else P @ F.T / J, "pk2": P if is_linear else np.linalg.solve(F, P)}
    size = np.abs(P).max()
    for measure, exact in expected.items():
        for place in ("cells", "nodes", "points"):
            found = state.stress(measure, place)
            assert found == pytest.approx(np.broadcast_to(exact, found.shape), abs=1e-9 * size)
    values, axes = np.linalg.eigh(F @ F.T)
    log = axes @ np.diag(0.5 * np.log(values)) @ axes.T
    for measure, exact in {"green": 0.5 * (F.T @ F - np.eye(3)), "log": log}.items():
        found = state.strain(measure, "nodes")
        assert found == pytest.approx(np.broadcast_to(exact, found.shape), abs=1e-10)
    density = law.energy(F[None])[0]
    assert state.energy_density() == pytest.approx(density, rel=1e-9)
    assert state.energy_density("nodes") == pytest.approx(density, rel=1e-9)
    assert state.energy == pytest.approx(density * cube.volume, rel=1e-9)
    sigma = expected["cauchy"]
    deviator = sigma - np.trace(sigma) / 3 * np.eye(3)
    assert state.pressure("nodes") == pytest.approx(-np.trace(sigma) / 3, abs=1e-9 * size)
    assert state.von_mises() == pytest.approx(np.sqrt(1.5 * (deviator**2).sum()), rel=1e-8)


@pytest.mark.parametrize("element", ELEMENTS)
def test_the_stress_does_the_work_of_the_energy(cube: vs.Mesh, element: str) -> None:
    """int P : dF is the difference of the energies of two states close by, with another stiffness in every cell."""
    rng = np.random.default_rng(3)
    law = vs.NeoHookean(young=1e4 * rng.uniform(0.5, 2.0, len(cube.cells)), poisson=0.47)
    organ = vs.Organ(cube, law, fixed="bottom", element=element)
    u = np.outer(organ.mesh.points[:, 2], SHIFT) + 2e-3 * rng.uniform(-1.0, 1.0, organ.mesh.points.shape)
    v = 1e-6 * rng.uniform(-1.0, 1.0, u.shape)
    before, here, after = (organ.moved(u + t * v) for t in (-1.0, 0.0, 1.0))
    volume = cube.facts["cell_volumes"]
    change = 0.5 * (after._response.gradient - before._response.gradient)
    work = volume @ (here.stress("pk1", "points") * change).sum(axis=(2, 3)).mean(axis=1)
    gained = 0.5 * volume @ (after.energy_density() - before.energy_density())
    assert work == pytest.approx(gained, rel=1e-6)


def test_a_linear_field_comes_through_the_points_of_a_quadratic_cell() -> None:
    corners = np.arange(4.0)[None] ** 2
    near, far = (5 + 3 * 5**0.5) / 20, (5 - 5**0.5) / 20
    weights = np.full((4, 4), far) + (near - far) * np.eye(4)
    assert corner_values(corners @ weights) == pytest.approx(corners, abs=1e-14)


@pytest.mark.parametrize(("element", "poisson", "n"), [("P1", 0.3, 4), ("P1 mean volume", 0.49, 4), ("P2", 0.49, 2)])
def test_a_tube_under_little_pressure_has_the_stress_of_lame(
    stress: ModuleType, element: str, poisson: float, n: int
) -> None:
    """At nodes the error falls at least with the size of the cells."""
    coarse, fine = (np.array(stress.lame(element, poisson, k)) for k in (n, 2 * n))
    assert (fine < 0.12).all()
    assert (fine < 0.65 * coarse).all()


@pytest.mark.parametrize(("element", "n"), [("P1 mean volume", 4), ("P2", 2)])
def test_a_tube_blown_up_by_half_has_its_closed_form(stress: ModuleType, element: str, n: int) -> None:
    """Incompressible neo-Hookean; here nu = 0.4999."""
    coarse, fine = (np.array(stress.blown_up(element, k)) for k in (n, 2 * n))
    assert (fine < 0.12).all()
    assert (fine < 0.65 * coarse).all()


def test_the_pressure_of_shared_volumes_is_that_of_quadratic_cells(stress: ModuleType) -> None:
    """Cook's membrane at nu = 0.4999; that of each linear cell alone is a checkerboard, and no pressure at all."""
    places, exact = stress.membrane_pressure("P2", 8)
    ours, alone = (stress.membrane_pressure(element, 16, places)[1] for element in ("P1 mean volume", "P1"))
    assert stress.off(ours, exact) < 0.1
    assert stress.off(alone, exact) > 0.5


def test_frames_and_reduced_answers_have_the_stress_of_the_whole_organ(bar: vs.Mesh) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    state = organ.solve(force={"tip": (0.0, 0.0, -2.0)}, settings={"tolerance": 1e-12})
    stepper = organ.stepper(iterations=20, settled=1e-12)
    frame = stepper.frame(force={"tip": (0.0, 0.0, -2.0)})
    size = np.abs(state.stress()).max()
    assert frame.stress() == pytest.approx(state.stress(), abs=1e-8 * size)
    touch = organ.reduce(touchable=lambda x: x[:, 2] > 0.099, radius=0.08, depth=0.005, order=4, start=state)
    point, push = np.array([0.3, 0.05, 0.1]) + state.displacement[0], np.array([0.0, 0.0, -0.004])
    point = touch.mesh.points[touch._model.array("positions")[3]]
    answer = touch(point, push)
    full = organ.moved(state.displacement + answer.displacement)
    assert answer.stress() == pytest.approx(full.stress(), abs=1e-9 * size)
    assert np.abs(answer.stress() - state.stress()).max() > 0.01 * size, "the preload alone it is not"
    assert answer.energy_density() == pytest.approx(full.energy_density(), rel=1e-9)


def test_stress_counts_from_the_unloaded_shape_and_not_from_the_scan(bar: vs.Mesh) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    rest = organ.unloaded(gravity=(0, 0, -9.81), density=1000)
    seen = rest.from_scan(rest.state)
    assert np.abs(seen.displacement).max() < 1e-9
    assert seen.stress() == pytest.approx(rest.state.stress())
    assert seen.von_mises().max() > 100.0


def test_principal_values() -> None:
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    tensors = np.stack([turn @ np.diag([-1.0, 5.0, 2.0]) @ turn.T, np.eye(3)])
    assert vs.principal(tensors) == pytest.approx(np.array([[5.0, 2.0, -1.0], [1.0, 1.0, 1.0]]))
    with pytest.raises(vs.VisceraError, match="symmetric"):
        vs.principal(F)
    with pytest.raises(vs.VisceraError, match=r"not of an array \(3,\)"):
        vs.principal(np.zeros(3))


def test_what_is_refused(cube: vs.Mesh) -> None:
    organ = vs.Organ(cube, vs.Corotated(young=1e4, poisson=0.3), fixed="bottom")
    state = organ.moved(np.zeros_like(cube.points))
    with pytest.raises(vs.VisceraError, match="did you mean 'cauchy'"):
        state.stress("cauchi")
    with pytest.raises(vs.VisceraError, match="the strain 'small' is unknown"):
        state.strain("small")
    with pytest.raises(vs.VisceraError, match="the place 'node' is unknown; did you mean 'nodes'"):
        state.stress(at="node")
    u = np.zeros_like(cube.points)
    u[cube.nodes("corner")] = -0.09
    inverted = organ.moved(u)
    with pytest.raises(vs.VisceraError, match=r"cell \d+ is inverted \(J = -"):
        inverted.stress("cauchy")
    assert np.isfinite(inverted.stress("pk1")).all()
    assert "cauchy_stress" not in inverted.fields()[1]
    assert "green_strain" in inverted.fields()[1]
    relaxing = vs.Organ(cube, vs.NeoHookean(young=1e4, poisson=0.3), fixed="bottom")
    frame = relaxing.stepper(relaxation=vs.Prony(g=[0.3], tau=[0.5]), time_step=0.01).frame()
    with pytest.raises(vs.VisceraError, match="depends on its past"):
        frame.von_mises()
    assert frame.strain().shape == (48, 3, 3)


@pytest.mark.parametrize("element", ["P1", "P1 mean volume", "P2"])
@pytest.mark.parametrize("has_value", [False, True])
def test_where_the_law_has_no_stress_none_is_given(
    cube: vs.Mesh, tmp_path: Path, element: str, has_value: bool
) -> None:
    """ln J and powers of J end at an inverted cell; the corotated law has a value there."""
    law = (vs.Corotated if has_value else vs.NeoHookean)(young=1e4, poisson=0.3)
    organ = vs.Organ(cube, law, fixed="bottom", element=element)
    u = np.zeros_like(organ.mesh.points)
    u[organ.mesh.nodes("corner")] = -0.09
    inverted, instead = organ.moved(u), "'pk1'" if has_value else "the strain 'green'"
    with pytest.raises(vs.VisceraError, match=r"cell \d+ is inverted .*; take " + instead):
        inverted.stress("cauchy")
    for at in ("cells", "nodes", "points"):
        if has_value:
            assert np.isfinite(inverted.stress("pk1", at)).all()
            continue
        with pytest.raises(
            vs.VisceraError, match=r"the law has no stress and no energy in cell \d+ \(J = -.*; take the strain 'green'"
        ):
            inverted.stress("pk1", at)
    if has_value:
        assert np.isfinite(inverted.energy_density()).all()
    else:
        with pytest.raises(vs.VisceraError, match="no energy in cell"):
            inverted.energy_density()
    assert ("energy_density" in inverted.fields()[1]) == has_value
    inverted.write(tmp_path / "inverted.vtu")
    written = meshio.read(tmp_path / "inverted.vtu").cell_data
    assert set(written) == ({"green_strain", "energy_density"} if has_value else {"green_strain"})
    assert all(np.isfinite(block).all() for field in written.values() for block in field)


def test_a_stress_without_an_energy_is_none(cube: vs.Mesh, tmp_path: Path) -> None:
    """Of -mu ln J the slope -mu / J has a value at J < 0, where the logarithm has none."""
    law = vs.StrainEnergy("mu/2*(I1 - 3) - mu*log(J) + lam/2*(J - 1)**2", mu=1e3, lam=2e3)
    organ = vs.Organ(cube, law, fixed="bottom", element="P1")
    u = np.zeros_like(organ.mesh.points)
    u[organ.mesh.nodes("corner")] = -0.09
    inverted = organ.moved(u)
    assert np.isfinite(inverted._response.pk1).all()
    words = r"the law has no energy, and so no stress, in cell \d+ \(J = -"
    with pytest.raises(vs.VisceraError, match=words):
        inverted.energy_density()
    with pytest.raises(vs.VisceraError, match=words):
        inverted.stress("pk1")
    with pytest.raises(vs.VisceraError, match=r"cell \d+ is inverted .*; take the strain 'green'"):
        inverted.stress("cauchy")
    inverted.write(tmp_path / "inverted.vtu")
    assert meshio.read(tmp_path / "inverted.vtu").cell_data.keys() == {"green_strain"}


def test_an_upright_cell_whose_energy_no_number_holds_has_no_stress(cube: vs.Mesh, tmp_path: Path) -> None:
    law = vs.Fung(mu=1e3, b=100.0, kappa=1e5)
    organ = vs.Organ(cube, law, fixed="bottom", element="P1")
    torn = organ.moved(organ.mesh.points * [0.0, 0.0, 9.0])
    for measure in ("cauchy", "pk1", "pk2"):
        with pytest.raises(vs.VisceraError, match=r"the law has no stress and no energy in cell 0 \(J = 10\)"):
            torn.stress(measure)
    torn.write(tmp_path / "torn.vtu")
    assert meshio.read(tmp_path / "torn.vtu").cell_data.keys() == {"green_strain"}


@pytest.mark.parametrize("ending", [".vtu", ".vtk", ".msh"])
def test_files_hold_stress_and_strain(cube: vs.Mesh, tmp_path: Path, ending: str) -> None:
    state = sheared(cube, LAWS[0], "P2")
    state.write(tmp_path / f"state{ending}")
    found = meshio.read(tmp_path / f"state{ending}")
    for name, values in {"cauchy_stress": state.stress(), "green_strain": state.strain()}.items():
        assert found.cell_data[name][0].reshape(-1, 3, 3) == pytest.approx(values, rel=1e-6)
    assert np.ravel(found.cell_data["energy_density"][0]) == pytest.approx(state.energy_density(), rel=1e-6)
    assert np.ravel(found.point_data["von_mises"]) == pytest.approx(state.von_mises("nodes"), rel=1e-6)


def test_a_picture_is_coloured_by_stress(cube: vs.Mesh) -> None:
    state = sheared(cube, LAWS[0], "P1")
    labels = [axes.get_ylabel() for axes in state.plot(colour="von_mises").axes]
    assert "von Mises stress [kPa]" in labels
    with pytest.raises(vs.VisceraError, match="did you mean 'von_mises'"):
        state.plot(colour="mises")


@pytest.mark.parametrize("element", ELEMENTS)
def test_probes_within_the_organ(cube: vs.Mesh, element: str) -> None:
    state = sheared(cube, LAWS[0], element)
    places = np.random.default_rng(1).uniform(0.0, 0.1, (50, 3))
    probe = state.at(places)
    assert probe.displacement == pytest.approx(np.outer(places[:, 2], SHIFT), abs=1e-12)
    assert probe.stress() == pytest.approx(np.broadcast_to(state.stress()[0], (50, 3, 3)), rel=1e-7, abs=1e-6)
    assert probe.strain("log").shape == (50, 3, 3)
    nodes = state.at(state.mesh.points)
    assert nodes.displacement == pytest.approx(state.displacement, abs=1e-12)
    assert state.at([0.05, 0.05, 0.05]).displacement == pytest.approx(state.at("(5, 5, 5) cm").displacement)
    with pytest.raises(vs.VisceraError, match=r"place 1 at \[0.05, 0.05, 0.12\] m lies outside the organ, 0.02 m"):
        state.at([[0.05, 0.05, 0.05], [0.05, 0.05, 0.12]])
    with pytest.raises(vs.VisceraError, match="the places must be an array"):
        state.at([0.0, 1.0])


def test_a_quadratic_probe_follows_the_quadratic_shape(cube: vs.Mesh) -> None:
    organ = vs.Organ(cube, LAWS[0], fixed="bottom", element="P2")

    def bent(x: Floats) -> Floats:
        return np.column_stack([x[:, 2] ** 2, x[:, 0] * x[:, 2], 0.5 * x[:, 1] ** 2])

    shape = organ.moved(bent(organ.mesh.points))
    places = np.random.default_rng(2).uniform(0.0, 0.1, (50, 3))
    assert shape.at(places).displacement == pytest.approx(bent(places), abs=1e-15)


@pytest.mark.parametrize(("poisson", "is_right"), [(0.3, True), (0.499, False)])
def test_an_answer_says_what_its_pressure_is_worth(bar: vs.Mesh, poisson: float, is_right: bool) -> None:
    """In nearly incompressible tissue pressure feels errors of the displacement that its von Mises stress does not."""
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=poisson), fixed="root")
    touch = organ.reduce("tip", depth="5%")
    point, push = organ.mesh.points[organ.touchable("tip")[3]], (0.003, 0.004, -0.008)
    answer, full = touch(point, push), organ.solve(displacement={touch.patch(point): push})
    assert answer.is_shape_trusted
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        assert np.linalg.norm(answer.von_mises() - full.von_mises()) < 0.02 * np.linalg.norm(full.von_mises())
        assert not said
        error = np.linalg.norm(answer.pressure() - full.pressure()) / np.linalg.norm(full.pressure())
        answer.at([point]).stress()
        answer.fields()
    assert answer.stress_error_estimate > 0.5 * min(error, 1.0)
    assert (answer.stress_error_estimate < 0.15) == is_right
    assert (error < 0.25) == is_right
    assert all("its pressure is not to be relied on" in str(each.message) for each in said)
    assert bool(said) != is_right


@pytest.mark.parametrize(("poisson", "is_right"), [(0.3, True), (0.499, False)])
def test_answers_of_a_grasp_and_of_a_probe_say_it_too(bar: vs.Mesh, poisson: float, is_right: bool) -> None:
    """Each warning names a program that runs and has the pressure of the same touch."""
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=poisson), fixed="root")
    touch = organ.reduce("z > 99% and x > 40%", depth="5%", order=3)
    grasp, displacements = touch.galerkin().grasp([(0.4, 0.05, 0.1)]), [(0, 0, -0.004)]
    probe = touch.probe()
    probe.place((0.25, 0.05, 0.1 + probe.radius))
    felt = probe.move((0, 0, -0.004))
    for answer in (grasp.solve(displacements), felt):
        assert answer.is_trusted
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            answer.von_mises()
            assert not said
            pressure = answer.pressure()
        full = eval(answer._solved()).pressure()
        error = np.linalg.norm(pressure - full) / np.linalg.norm(full)
        assert answer.stress_error_estimate > 0.5 * min(error, 1.0)
        assert (answer.stress_error_estimate < 0.15) == is_right
        assert all(str(each.message).endswith(answer._solved()) for each in said)
        assert bool(said) != is_right


def test_points_of_a_frame_have_no_stress_where_tissue_relaxes(bar: vs.Mesh) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    frame = organ.stepper(time_step=0.01, relaxation=vs.Prony(g=[0.5], tau=[0.1])).frame({"tip": (None, None, -0.001)})
    for shape in (frame, organ.moved(frame)):
        point = shape.at([(0.3, 0.05, 0.05)])
        for ask in (shape.stress, shape.von_mises, shape.pressure, shape.energy_density, point.stress):
            with pytest.raises(vs.VisceraError, match="depends on its past"):
                ask()
        assert shape.strain().shape == (len(bar.cells), 3, 3)


def test_a_frame_of_tissue_that_relaxes_is_written_without_its_stress(bar: vs.Mesh, tmp_path: Path) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    stepper = organ.stepper(time_step=0.01, relaxation=vs.Prony(g=[0.5], tau=[0.1]), iterations=10)
    frame = stepper.frame({"tip": (None, None, -0.001)})
    assert frame.is_settled
    for ending in ("stl", "obj", "ply", "vtu"):
        frame.write(tmp_path / f"r.{ending}")
    volume = meshio.read(tmp_path / "r.vtu")
    assert volume.point_data.keys() == {"displacement", "reaction", "set:root", "set:tip"}
    assert volume.cell_data.keys() == {"green_strain"}
    vs.write_series(tmp_path / "s.pvd", [(0.0, frame), (1.0, organ.moved(frame))])
    for moment in ("s_0000.vtu", "s_0001.vtu"):
        assert meshio.read(tmp_path / moment).cell_data.keys() == {"green_strain"}
