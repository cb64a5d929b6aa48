"""The unloaded shape: found again after loading, refused where it does not exist, and used to predict a posture."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest

import viscera as vs
from viscera import cli

DOWN, ASIDE = (0.0, 0.0, -9.81), (0.0, -9.81, 0.0)
DENSITY = 1060.0
LAWS = [
    vs.Linear(young=2e5, poisson=0.3),
    vs.SaintVenantKirchhoff(young=2e5, poisson=0.4),
    vs.NeoHookean(young=2e5, poisson=0.45),
    vs.MooneyRivlin(25e3, 8e3, kappa=8e5),
]


def loaded(organ: vs.Organ, **loads: Any) -> vs.Organ:
    """The organ as a scanner sees it: its equilibrium under loads, taken as a mesh."""
    state = organ.solve(settings={"tolerance": 1e-12}, throw=True, **loads)
    mesh = vs.mesh(organ.mesh.points + state.displacement, organ.mesh.cells, organ.mesh.sets)
    return vs.Organ(mesh, organ.law, fixed=organ.fixed)


@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
def test_there_and_back(bar: vs.Mesh, law: vs.laws.Law) -> None:
    organ = vs.Organ(bar, law, fixed="root")
    loads: dict[str, Any] = {"gravity": DOWN, "density": DENSITY}
    scan = loaded(organ, **loads)
    sag = np.abs(scan.mesh.points - bar.points).max()
    assert sag > 0.1 * bar.diagonal
    rest = scan.unloaded(**loads)
    assert rest.is_converged, rest.message
    assert rest.error <= 1e-10
    assert np.abs(rest.organ.mesh.points - bar.points).max() < 1e-8 * bar.diagonal


def test_forces_are_taken_off_too(bar: vs.Mesh) -> None:
    """A set's force is spread over its area without load, which the search finds with the shape."""
    organ = vs.Organ(bar, vs.NeoHookean(young=2e5, poisson=0.4), fixed="root")
    loads: dict[str, Any] = {"force": {"tip": (20.0, 10.0, 0.0)}}
    rest = loaded(organ, **loads).unloaded(**loads)
    assert np.abs(rest.organ.mesh.points - bar.points).max() < 1e-8 * bar.diagonal


@pytest.mark.parametrize(
    ("by_condition", "by_nodes"),
    [
        ({"force": {"x > 99%": (0.0, 0.0, -6.0)}}, {"force": {"tip": (0.0, 0.0, -6.0)}}),
        ({"force": [("tip", (0.0, 0.0, -2.0)), ("x > 99%", (0.0, 0.0, -4.0))]}, {"force": {"tip": (0.0, 0.0, -6.0)}}),
        ({"traction": {"z > 99%": (0.0, 0.0, -300.0)}}, {"traction": {"top": (0.0, 0.0, -300.0)}}),
        ({"pressure": {"z > 99%": 300.0}}, {"pressure": {"top": 300.0}}),
    ],
    ids=["force", "pairs", "traction", "pressure"],
)
def test_conditions_of_loads_are_asked_of_the_scan(
    bar: vs.Mesh, by_condition: dict[str, Any], by_nodes: dict[str, Any]
) -> None:
    """Without its loads the bar is bent the other way: a condition holds for other nodes there."""
    mesh = vs.mesh(bar.points, bar.cells, {**bar.sets, "top": bar.nodes("z > 99%")})
    organ = vs.Organ(mesh, vs.NeoHookean(young=2e5, poisson=0.4), fixed="root")
    found, exact = (organ.unloaded(**loads, throw=True).organ.mesh.points for loads in (by_condition, by_nodes))
    assert np.abs(exact - mesh.points).max() > 0.01 * mesh.diagonal
    assert np.abs(found - exact).max() < 1e-8 * mesh.diagonal


def test_places_of_a_density_are_those_of_the_scan(bar: vs.Mesh) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=2e5, poisson=0.4), fixed="root")
    by_place = {"x < 50%": 500.0, "x > 49%": 1500.0}
    by_cell = np.full(len(bar.cells), 500.0)
    by_cell[bar.cells_in("x > 49%")] = 1500.0
    found, exact = (organ.unloaded(gravity=DOWN, density=given, throw=True) for given in (by_place, by_cell))
    assert np.abs(found.organ.mesh.points - exact.organ.mesh.points).max() < 1e-8 * bar.diagonal


def test_an_inner_pressure_is_taken_off() -> None:
    """An artery is imaged under blood pressure, which follows its wall as it deforms."""
    artery = vs.Organ(vs.organs.artery(), vs.NeoHookean(young=1e6, poisson=0.4), fixed=lambda x: x[:, 2] < 1e-4)
    loads: dict[str, Any] = {"pressure": {"lumen": 13e3}}
    scan = loaded(artery, **loads)
    assert np.abs(scan.mesh.points - artery.mesh.points).max() > 1e-4
    rest = scan.unloaded(**loads)
    assert np.abs(rest.organ.mesh.points - artery.mesh.points).max() < 1e-8 * artery.mesh.diagonal


def test_the_liver_there_and_back() -> None:
    liver = vs.Organ(vs.organs.liver(), vs.NeoHookean(young=30e3, poisson=0.45), fixed="hilum")
    loads: dict[str, Any] = {"gravity": ASIDE, "density": DENSITY}
    rest = loaded(liver, **loads).unloaded(**loads)
    assert np.abs(rest.organ.mesh.points - liver.mesh.points).max() < 1e-8 * liver.mesh.diagonal


def test_the_organ_keeps_what_it_is(bar: vs.Mesh) -> None:
    stiffness = np.where(np.arange(len(bar.cells)) % 3 == 0, 3e5, 1e5)
    organ = vs.Organ(bar, vs.NeoHookean(young=stiffness, poisson=0.3), fixed="root")
    rest = organ.unloaded(gravity=DOWN, density=np.full(len(bar.cells), 500.0))
    assert rest.organ.law is organ.law
    assert np.array_equal(rest.organ.fixed, organ.fixed)
    assert rest.organ.mesh.sets.keys() == bar.sets.keys()
    assert np.array_equal(rest.organ.mesh.points[organ.fixed], bar.points[organ.fixed])
    assert rest.state.mesh is rest.organ.mesh


def test_a_posture_is_predicted(bar: vs.Mesh) -> None:
    """Scanned under one gravity, predicted under another: the same as loading the true organ the other way."""
    organ = vs.Organ(bar, vs.NeoHookean(young=2e5, poisson=0.4), fixed="root")
    truth = organ.solve(gravity=ASIDE, density=DENSITY, settings={"tolerance": 1e-12})
    scan = loaded(organ, gravity=DOWN, density=DENSITY)
    rest = scan.unloaded(gravity=DOWN, density=DENSITY)
    turned = rest.organ.solve(gravity=ASIDE, density=DENSITY, start=rest.state, settings={"tolerance": 1e-12})
    seen = rest.from_scan(turned)
    places = seen.mesh.points + seen.displacement
    assert seen.mesh is scan.mesh
    assert np.abs(places - bar.points - truth.displacement).max() < 1e-8 * bar.diagonal
    assert seen.volume_ratio * scan.mesh.volume == pytest.approx(truth.volume_ratio * bar.volume)
    assert seen.reaction("root") == pytest.approx(truth.reaction("root"), rel=1e-6, abs=1e-6)
    assert turned.mesh is rest.organ.mesh, "the state itself is left as it was"


def test_no_unloaded_shape_is_said(bar: vs.Mesh) -> None:
    """A straight bar cannot be what is left of anything under a weight a hundred times its strength."""
    organ = vs.Organ(bar, vs.NeoHookean(young=3e2, poisson=0.3), fixed="root")
    rest = organ.unloaded(gravity=DOWN, density=DENSITY, max_iterations=30)
    assert not rest.is_converged
    assert 0.0 <= rest.load < 1.0
    assert "no unloaded shape found beyond" in rest.message
    with pytest.raises(vs.VisceraError, match="no unloaded shape"):
        organ.unloaded(gravity=DOWN, density=DENSITY, max_iterations=30, throw=True)


def test_a_part_of_the_load_is_consistent_where_all_of_it_fails(bar: vs.Mesh) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=4e4, poisson=0.3), fixed="root")
    rest = organ.unloaded(gravity=DOWN, density=DENSITY, max_iterations=30)
    assert 0.0 < rest.load < 1.0
    assert rest.error <= 1e-10
    again = rest.organ.solve(gravity=rest.load * np.array(DOWN), density=DENSITY, start=rest.state)
    assert np.abs(rest.organ.mesh.points + again.displacement - bar.points).max() < 1e-8 * bar.diagonal


def test_bad_input_is_refused(bar: vs.Mesh) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=2e5, poisson=0.4), fixed="root")
    nothing: list[dict[str, Any]] = [{}, {"force": {}}, {"density": 1000.0}]
    for loads in nothing:
        with pytest.raises(vs.VisceraError, match="no load to remove"):
            organ.unloaded(**loads)
    with pytest.raises(vs.VisceraError, match="density"):
        organ.unloaded(gravity=DOWN)
    with pytest.raises(vs.VisceraError, match="tolerance"):
        organ.unloaded(gravity=DOWN, density=DENSITY, tolerance=0.0)
    with pytest.raises(vs.VisceraError, match="three finite numbers"):
        organ.unloaded(gravity=(0, 0), density=DENSITY)


@pytest.mark.parametrize(
    "loads",
    [
        {"gravity": "down", "density": DENSITY},
        {"gravity": ("0", 0, "-9.81"), "density": DENSITY},
        {"gravity": (None, 0, -1), "density": DENSITY},
        {"force": "x"},
        {"force": True},
        {"force": {"tip": "0 0 1"}},
        {"traction": {"tip": ("10 Pa", 0, 0)}},
        {"traction": np.ones(2)},
        {"pressure": {"tip": "100 Pa"}},
        {"pressure": {"tip": True}},
        {"pressure": np.ones(2)},
    ],
    ids=str,
)
def test_what_solve_refuses_is_no_load_of_a_scan_either(bar: vs.Mesh, loads: dict[str, Any]) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=2e5, poisson=0.4), fixed="root")
    with pytest.raises(vs.VisceraError) as of_solve:
        organ.solve(**loads)
    with pytest.raises(vs.VisceraError) as of_scan:
        organ.unloaded(**loads)
    assert str(of_scan.value) == str(of_solve.value)


CASE = """
mesh = "organ:beam"
fixed = "clamp"
[material]
law = "NeoHookean"
young = 2e6
poisson = 0.3
[scan]
gravity = [0, 0, -9.81]
[loads]
gravity = [0, -9.81, 0]
density = 1000
"""


def test_a_case_with_a_scan(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    case, facts, output = tmp_path / "beam.toml", tmp_path / "facts.json", tmp_path / "turned.vtu"
    case.write_text(CASE, encoding="utf-8")
    assert cli.main(["solve", str(case), "--json", str(facts), "-o", str(output)]) == 0
    assert "displacements count from the scan" in capsys.readouterr().out
    told = json.loads(facts.read_text(encoding="utf-8"))
    assert told["unloading"]["error"] <= 1e-10
    beam = vs.organs.beam()
    rest = vs.Organ(beam, vs.NeoHookean(young=2e6, poisson=0.3), fixed="clamp").unloaded(gravity=DOWN, density=1000.0)
    seen = rest.from_scan(rest.organ.solve(gravity=ASIDE, density=1000.0, start=rest.state))
    assert told["max_displacement"] == pytest.approx(seen.max_displacement)
    written = meshio.read(output)
    assert np.allclose(written.points, beam.points)
    assert np.allclose(written.point_data["displacement"], seen.displacement, atol=1e-9)
    assert seen.displacement[:, 2].max() > 0.01, "it rises from where its weight had drawn it"
    read = vs.case(case)
    assert isinstance(read, vs.Case)
    assert read.predict(read.unloaded(read.organ())).max_displacement == pytest.approx(seen.max_displacement)
    with pytest.raises(vs.VisceraError, match=r"beam.toml: the mesh is loaded, says \[scan\].*case.predict"):
        read.solve(read.organ())


def test_a_scan_that_cannot_be_unloaded_fails(bar: vs.Mesh, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bar.write(tmp_path / "bar.vtu")
    words = CASE.replace("organ:beam", "bar.vtu").replace("clamp", "root").replace("2e6", "3e2")
    case = tmp_path / "bar.toml"
    case.write_text('units = "m"\n' + words, encoding="utf-8")
    assert cli.main(["solve", str(case)]) == 1
    assert "no unloaded shape found" in capsys.readouterr().out


@pytest.mark.parametrize(("verb", "words"), [("compare", "free of load"), ("reduce", "must say what is touched")])
def test_other_verbs_want_an_unloaded_mesh(
    verb: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = tmp_path / "beam.toml"
    case.write_text(CASE, encoding="utf-8")
    assert cli.main([verb, str(case), "-o", str(tmp_path / "out")]) == 2
    assert words in capsys.readouterr().err


def test_an_unknown_word_of_a_scan_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    case = tmp_path / "beam.toml"
    case.write_text(CASE.replace("[loads]", "gravitation = 1\n[loads]"), encoding="utf-8")
    assert cli.main(["solve", str(case)]) == 2
    assert "did you mean 'gravity'" in capsys.readouterr().err


@pytest.mark.parametrize("element", ["P1 mean volume", "P2"])
def test_other_elements_there_and_back(bar: vs.Mesh, element: str) -> None:
    """The scan gives the corners of quadratic cells; their edges are straight without loads."""
    organ = vs.Organ(bar, vs.NeoHookean(young=2e5, poisson=0.47), fixed="root", element=element)
    loads: dict[str, Any] = {"gravity": DOWN, "density": DENSITY}
    state = organ.solve(settings={"tolerance": 1e-12}, throw=True, **loads)
    corners = bar.points + state.displacement[: len(bar.points)]
    scan = vs.Organ(vs.mesh(corners, bar.cells, bar.sets), organ.law, fixed="root", element=element)
    rest = scan.unloaded(**loads)
    assert rest.organ.element == element
    assert rest.error <= 1e-10
    assert np.abs(rest.organ.mesh.points - organ.mesh.points).max() < 1e-8 * bar.diagonal


def test_a_state_of_another_organ_is_not_counted_from_the_scan(bar: vs.Mesh) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=4e5, poisson=0.3), fixed="root")
    rest = organ.unloaded(gravity=DOWN, density=DENSITY)
    with pytest.raises(vs.VisceraError, match="not one of the unloaded organ: its mesh has other points"):
        rest.from_scan(organ.solve(gravity=DOWN, density=DENSITY))
    frame: Any = rest.organ.stepper().frame()
    with pytest.raises(vs.VisceraError, match="the state to count from the scan must be a State"):
        rest.from_scan(frame)


def test_a_state_moves_and_starts_only_the_organ_that_it_belongs_to(bar: vs.Mesh) -> None:
    scan = vs.Organ(bar, vs.NeoHookean(young=4e5, poisson=0.3), fixed="root")
    rest = scan.unloaded(gravity=DOWN, density=DENSITY)
    aside: dict[str, Any] = {"gravity": ASIDE, "density": DENSITY}
    side = rest.organ.solve(**aside, start=rest.state)
    seen = rest.from_scan(side)
    frame = rest.organ.stepper().frame()
    moved = r"the state given to `moved` is not one of this organ: its mesh has other points"
    started = r"the state to start from is not one of this organ: its mesh has other points"
    for given, state in ((scan, seen), (scan, rest.state), (rest.organ, scan.solve()), (scan, frame)):
        with pytest.raises(vs.VisceraError, match=moved):
            given.moved(state)
        for start in (given.solve, given.stepper):
            with pytest.raises(vs.VisceraError, match=started):
                start(start=state)
    with pytest.raises(vs.VisceraError, match="the displacement of `moved` must be a State, a Frame or"):
        scan.moved("side")
    assert np.array_equal(rest.organ.moved(seen).displacement, side.displacement), "from rest, not from the scan"
    assert np.array_equal(rest.organ.moved(seen).stress(), side.stress())
    assert np.array_equal(rest.organ.stepper(start=seen).displacement, side.displacement)
    again = rest.organ.solve(**aside, start=seen)
    assert again.iterations <= 1
    assert again.displacement == pytest.approx(side.displacement, abs=1e-7)


def test_a_state_may_start_an_organ_read_from_its_file(bar: vs.Mesh, tmp_path: Path) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=4e5, poisson=0.3), fixed="root")
    state = organ.solve(gravity=DOWN, density=DENSITY)
    read = organ.to_case(tmp_path / "bar.toml").organ()
    touched = organ.reduce("tip", depth="2%", order=2, start=state).organ()  # its points are sums, rounded
    for again in (read, touched):
        assert np.array_equal(again.moved(state).displacement, state.displacement)


@pytest.mark.parametrize("element", ["P1", "P2"])
def test_the_scanned_posture_is_no_displacement_at_midpoints_either(bar: vs.Mesh, element: str) -> None:
    """They are bent away from the straight edges between the corners that the scan shows."""
    organ = vs.Organ(bar, vs.NeoHookean(young=4e5, poisson=0.3), fixed="root", element=element)
    rest = organ.unloaded(gravity=DOWN, density=DENSITY)
    assert rest.is_converged
    again = rest.organ.solve(gravity=DOWN, density=DENSITY)
    assert rest.from_scan(again).max_displacement < 1e-6 * bar.diagonal
    bent = rest.organ.mesh.points + again.displacement - rest.scan.points  # the scan has straight edges
    largest = float(np.linalg.norm(bent, axis=1).max()) / bar.diagonal
    assert rest.midpoint_error == pytest.approx(largest if element == "P2" else 0.0, rel=1e-5)
    assert (rest.midpoint_error > 1e-4) == (element == "P2")
    assert rest.error < 1e-10
