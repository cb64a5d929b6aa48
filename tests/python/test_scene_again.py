"""Scenes with another law or in another shape, and what their rigid bodies do in every analysis."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import viscera as vs

TISSUE = vs.NeoHookean(young=10e3, poisson=0.3)
WEIGHT: dict[str, Any] = {"gravity": (0, 0, -9.81), "density": 300.0}


def stacked(cube: vs.Mesh, law: vs.laws.Law, element: str = "P1") -> vs.Scene:
    """A cube bonded on another, with a spring from its top to the wall."""
    above = vs.mesh(cube.points + np.array([0.0, 0.0, 0.1]), cube.cells, cube.sets)
    spring = vs.Spring("top", point=(0.3, 0.05, 0.2), stiffness=10.0)
    lower = vs.Organ(cube, law, fixed="bottom", element=element)
    upper = vs.Organ(above, law, supports=[spring], element=element)
    return vs.Scene({"lower": lower, "upper": upper}, bonds=[vs.Bond(("lower", "top"), ("upper", "bottom"))])


def on_a_table(bar: vs.Mesh) -> vs.Scene:
    """A bar one millimetre above a table."""
    table = vs.Tool(vs.HalfSpace(), position=(0, 0, -1e-3))
    return vs.Scene({"bar": vs.Organ(bar, TISSUE, fixed="root")}, bodies=[table])


@pytest.mark.parametrize("law", [vs.NeoHookean(young=40e3, poisson=0.3), vs.Yeoh(c10=8e3, poisson=0.3)])
def test_bonds_are_as_stiff_as_another_law_asks_for(cube: vs.Mesh, law: vs.laws.Law) -> None:
    again, made = stacked(cube, TISSUE).with_law(law), stacked(cube, law)
    assert isinstance(again, vs.Scene)
    found, expected = (scene.solve(**WEIGHT, throw=True).displacement for scene in (again, made))
    assert np.abs(found - expected).max() < 1e-12
    parts = stacked(cube, TISSUE).with_law({"lower": law, "upper": TISSUE})
    assert repr(parts.organ("lower").law) == repr(law)
    assert parts.organ("upper").law.young == pytest.approx(10e3)


@pytest.mark.parametrize("element", ["P1", "P2"])
def test_a_scene_there_and_back(cube: vs.Mesh, element: str) -> None:
    """The shape without the weight, loaded again, is the scan; bonds are without stress there."""
    scan = stacked(cube, TISSUE, element)
    rest = scan.unloaded(**WEIGHT)
    assert rest.is_converged
    assert isinstance(rest.organ, vs.Scene)
    assert rest.organ.bonds == scan.bonds
    assert np.abs(rest.organ.mesh.points - scan.mesh.points).max() > 2e-3
    again = rest.organ.solve(**WEIGHT, throw=True)
    corners = slice(scan.mesh.n_corners)
    assert np.abs((rest.organ.mesh.points + again.displacement - scan.mesh.points)[corners]).max() < 1e-7
    assert rest.organ.solve().max_displacement < 1e-9


@pytest.mark.parametrize(
    "held",
    [
        {"fixed": "root", "supports": [vs.Spring("tip", "root", stiffness=100.0, length=0.35)]},
        {"fixed": "root", "supports": [vs.Spring("tip", point=(0.4, 0.0, 0.3), stiffness=20.0)]},
        {"supports": [vs.ElasticSupport("root", 3e5, 1e5)]},
    ],
)
def test_what_holds_an_organ_holds_it_in_a_scene_too(bar: vs.Mesh, held: dict[str, Any]) -> None:
    organ = vs.Organ(bar, TISSUE, **held)
    alone, joined = (each.unloaded(gravity=(0, 0, -1.0), density=300.0) for each in (organ, vs.Scene({"bar": organ})))
    assert alone.is_converged
    assert joined.is_converged
    assert np.abs(alone.organ.mesh.points - bar.points).max() > 1e-3
    assert np.abs(alone.organ.mesh.points - joined.organ.mesh.points).max() < 1e-7


def test_bodies_act_on_the_scene_made_again(bar: vs.Mesh) -> None:
    scene = on_a_table(bar)
    expected = scene.solve(**WEIGHT, throw=True).displacement
    free = scene.organ("bar").solve(**WEIGHT, throw=True).displacement
    assert free[:, 2].min() < 5 * expected[:, 2].min()
    for again in (scene.with_law(TISSUE), scene.with_mesh(scene.mesh)):
        assert np.abs(again.solve(**WEIGHT, throw=True).displacement - expected).max() < 1e-12
    runs = vs.compare(scene, laws={"own": TISSUE}, reference="own", **WEIGHT).runs
    assert np.abs(runs["own"].state.displacement - expected).max() < 1e-6


@pytest.mark.parametrize(
    "series",
    [
        lambda scene: scene.path(force={"bar/tip": (0, 0, -1.0)}),
        lambda scene: scene.reduce("bar/tip", order=2),
        lambda scene: scene.pgd("bar/tip", load=1.0),
    ],
)
def test_series_refuse_bodies(bar: vs.Mesh, series: Callable[[vs.Scene], object]) -> None:
    with pytest.raises(vs.VisceraError, match="a series does not know the rigid bodies"):
        series(on_a_table(bar))


def test_no_model_begins_at_what_a_tool_presses(bar: vs.Mesh) -> None:
    organ = vs.Organ(bar, TISSUE, fixed="root")
    table, far = (vs.Tool(vs.HalfSpace(), position=(0, 0, z)) for z in (-1e-3, -1.0))
    pressed = organ.solve(contact=[table], **WEIGHT, throw=True)
    with pytest.raises(vs.VisceraError, match="is pressed by a tool"):
        organ.reduce("tip", order=2, start=pressed)
    hanging = organ.solve(contact=[far], gravity=(0, 0, -0.5), density=300.0, throw=True)
    assert organ.reduce("tip", order=2, start=hanging).preload is not None


def test_one_model_keeps_one_stiffness_of_bonds(cube: vs.Mesh) -> None:
    organs = stacked(cube, TISSUE).organs
    lower = vs.Organ(cube, TISSUE, fixed="bottom", element="P1")
    scene = vs.Scene({**organs, "lower": lower}, bonds=[vs.Bond(("lower", "top"), ("upper", "bottom"))])
    with pytest.raises(vs.VisceraError, match="bonds are as stiff as the law"):
        vs.Vary("young", 5e3, 2e4).family(scene, 0.05)
    apart = vs.Scene({"lower": lower})
    assert isinstance(vs.Vary("young", 5e3, 2e4).family(apart, 0.05)[0], vs.Scene)


def test_organs_that_would_lie_in_each_other_have_no_unloaded_shape(cube: vs.Mesh) -> None:
    """A soft cube under a stiff one that hangs: without its weight it is higher, where the other one is."""
    above = vs.mesh(cube.points + np.array([0.0, 0.0, 0.10005]), cube.cells, cube.sets)
    stiff = vs.NeoHookean(young=1e6, poisson=0.3)
    organs = {"lower": vs.Organ(cube, TISSUE, fixed="bottom"), "upper": vs.Organ(above, stiff, fixed="top")}
    rest = vs.Scene(organs, contacts=[vs.ContactPair("lower", "upper")]).unloaded(**WEIGHT)
    assert not rest.is_converged
    assert rest.load < 0.5
    assert "without the loads, the surfaces of ContactPair(lower, upper) overlap" in rest.message


@pytest.mark.parametrize("sliding", [False, True])
def test_a_bond_of_another_shape_has_its_normals_areas_and_stiffness(cube: vs.Mesh, sliding: bool) -> None:
    """A scene turned and halved is solved as the one made there, under loads turned with it."""
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])

    def bonded(mesh: Callable[[Any], vs.Mesh]) -> vs.Scene:
        lower = vs.Organ(mesh(cube.points), TISSUE, fixed="bottom")
        upper = vs.Organ(mesh(cube.points + np.array([0.0, 0.0, 0.1])), TISSUE, fixed="top")
        bond = vs.Bond(("lower", "top"), ("upper", "bottom"), sliding=sliding)
        return vs.Scene({"lower": lower, "upper": upper}, bonds=[bond])

    def turned(points: Any) -> vs.Mesh:
        return vs.mesh(0.5 * points @ turn.T, cube.cells, cube.sets)

    first = bonded(lambda points: vs.mesh(points, cube.cells, cube.sets))
    made = bonded(turned)
    again = first.with_mesh(vs.mesh(0.5 * first.mesh.points @ turn.T, first.mesh.cells, first.mesh.sets))
    force = {"lower/top": turn @ np.array([0.02, 0.01, -0.03])}
    found, expected = (scene.solve(force=force, throw=True) for scene in (again, made))
    assert np.abs(found.displacement - expected.displacement).max() < 1e-6 * expected.max_displacement
    pull, right = (state.support_force(scene.bonds[0]) for state, scene in ((found, again), (expected, made)))
    assert np.abs(pull - right).max() < 1e-6 * np.abs(right).max()


def test_what_is_joined_stays_joined_with_another_law_in_another_shape(cube: vs.Mesh) -> None:
    """The surfaces are three millimetres apart there, farther than the bond reaches."""
    scene = stacked(cube, TISSUE)
    points = scene.mesh.points + np.array([0.0, 0.0, 3e-3]) * (scene.of_node == 1)[:, None]
    apart = scene.with_mesh(vs.mesh(points, scene.mesh.cells, scene.mesh.sets))
    again = apart.with_law(TISSUE)
    found, expected = (each.solve(**WEIGHT, throw=True).displacement for each in (again, apart))
    assert np.abs(found - expected).max() < 1e-9


def test_the_reach_of_a_contact_pair_is_that_of_the_shape(cube: vs.Mesh) -> None:
    """In per cent it grows with the organs; in metres it stays."""
    above = vs.mesh(cube.points + np.array([0.0, 0.0, 0.101]), cube.cells, cube.sets)
    organs = {"lower": vs.Organ(cube, TISSUE, fixed="bottom"), "upper": vs.Organ(above, TISSUE, fixed="top")}
    for reach, factor in (("5%", 0.01), (4e-3, 1.0)):
        scene = vs.Scene(organs, contacts=[vs.ContactPair("lower", "upper", reach=reach)])
        small = scene.with_mesh(vs.mesh(0.01 * scene.mesh.points, scene.mesh.cells, scene.mesh.sets))
        before, now = (each._ties.surfaces[0].reach for each in (scene, small))
        assert now == pytest.approx(factor * before, rel=1e-9)
