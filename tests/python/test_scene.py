"""Scenes: bonds and contact through meshes that do not match, parts given back, rigid bodies, and refusals."""

import itertools
import pickle
from typing import Any

import numpy as np
import pytest

import viscera as vs

SIDE = 0.1
SOFT = vs.NeoHookean(young=10e3, poisson=0.3)
STIFF = vs.Yeoh(c10=8e3, poisson=0.3)
ELEMENTS = ("P1", "P1 mean volume", "P2")
SYMMETRY = {"west": (0, None, None), "south": (None, 0, None)}
WRONG: Any = 3


def wrong(value: object) -> Any:
    """For arguments that the types forbid."""
    return value


def block(n: int, height: float = 0.0) -> vs.Mesh:
    """A cube of n^3 cubes, six cells each, on a height."""
    line = np.linspace(0.0, SIDE, n + 1)
    points = np.array([(x, y, z) for z in line for y in line for x in line])
    corner = np.array([i + (n + 1) * (j + (n + 1) * k) for k, j, i in itertools.product(range(n), repeat=3)])
    cells = []
    for order in itertools.permutations((1, n + 1, (n + 1) ** 2)):
        cells.append(np.stack([corner, *(corner + sum(order[: k + 1]) for k in range(3))], axis=1))
    sides = {name: np.flatnonzero(points[:, axis] == 0.0) for axis, name in enumerate(("west", "south", "base"))}
    sets = {**sides, "top": np.flatnonzero(points[:, 2] == SIDE)}
    return vs.mesh(points + np.array([0.0, 0.0, height]), np.vstack(cells), sets)


def tower(element: str = "P1", laws: tuple[vs.laws.Law, ...] = (SOFT, SOFT), **told: bool | float) -> vs.Scene:
    """A block of 2^3 cubes on springs, one of 3^3 bonded on it."""
    bed = vs.ElasticSupport("base", stiffness=1e8, tangential=0.0)
    lower = vs.Organ(block(2), laws[0], supports=[bed], element=element)
    upper = vs.Organ(block(3, SIDE), laws[1], fixed="top", element=element)
    bonds = [vs.Bond(("lower", "top"), ("upper", "base"), **told)]  # type: ignore[arg-type]
    return vs.Scene({"lower": lower, "upper": upper}, bonds=bonds)


def free_top(element: str, laws: tuple[vs.laws.Law, ...], **told: bool | float) -> tuple[vs.Scene, vs.State]:
    """A tower whose sides slide on planes of symmetry and whose top is pressed by 800 Pa."""
    lower = vs.Organ(block(2), laws[0], supports=[vs.ElasticSupport("base", 1e8, 0.0)], element=element)
    upper = vs.Organ(block(3, SIDE), laws[1], supports=[vs.ElasticSupport("west", 1e2, 0.0)], element=element)
    bonds = [vs.Bond(("lower", "top"), ("upper", "base"), **told)]  # type: ignore[arg-type]
    scene = vs.Scene({"lower": lower, "upper": upper}, bonds=bonds)
    held = {f"{name}/{side}": move for name in scene.organs for side, move in SYMMETRY.items()}
    return scene, scene.solve(displacement=held, traction={"upper/top": (0.0, 0.0, -800.0)})


@pytest.mark.parametrize("element", ELEMENTS)
def test_a_uniform_stress_passes_meshes_that_do_not_match(element: str) -> None:
    scene, state = free_top(element, (SOFT, SOFT))
    assert state.is_converged
    for name in scene.organs:
        stress = state[name].stress("pk1", at="points")
        exact = np.zeros((3, 3))
        exact[2, 2] = -800.0
        assert abs(stress - exact).max() < 1e-8 * 800.0, name
    (bond,) = scene.bonds
    assert state.support_force(bond) == pytest.approx([0, 0, -8.0], rel=1e-9, abs=1e-8)
    gap = state["upper"].displacement[scene.organ("upper").mesh.nodes("base"), 2].mean()
    gap -= state["lower"].displacement[scene.organ("lower").mesh.nodes("top"), 2].mean()
    # The layer of the bond is a hundredth of a cell as compliant as the cell.
    assert 0.0 < -gap < 1e-2 * 800.0 / 10e3 * SIDE / 2


@pytest.mark.parametrize("element", ELEMENTS)
def test_a_sliding_bond_carries_pressure_alone(element: str) -> None:
    """Two laws side by side: each is in its own uniaxial stress and widens as it likes."""
    scene, state = free_top(element, (SOFT, STIFF), sliding=True)
    widths = []
    for name in scene.organs:
        stress = state[name].stress("pk1", at="points")
        assert abs(stress[..., 2, 2] + 800.0).max() < 1e-5, name
        assert abs(stress[..., 0, 0]).max() < 1e-5, name
        widths.append(state[name].displacement[:, 0].max())
    assert widths[0] > 2.0 * widths[1]


def test_a_bonded_tower_is_one_block() -> None:
    """Bent sideways, two bonded blocks do as one of the same cells, up to their meshes."""
    whole, tops = block(4), []
    double = vs.mesh(whole.points * [1.0, 1.0, 2.0], whole.cells, whole.sets)
    one = vs.Organ(double, SOFT, fixed="base", element="P2").solve(force={"top": (0.2, 0.0, 0.0)})
    for n in (2, 3):
        lower = vs.Organ(block(n), SOFT, fixed="base", element="P2")
        bond = vs.Bond("lower", "upper")
        upper = vs.Organ(block(5 - n, SIDE), SOFT, supports=[vs.ElasticSupport("top", 1e-3)], element="P2")
        scene = vs.Scene({"lower": lower, "upper": upper}, bonds=[bond])
        state = scene.solve(force={"upper/top": (0.2, 0.0, 0.0)})
        tops.append(state["upper"].at([[SIDE / 2, SIDE / 2, 2 * SIDE]]).displacement[0, 0])
        assert state.support_force(bond) == pytest.approx([0.2, 0.0, 0.0], rel=1e-3, abs=1e-3)
    top = one.at([[SIDE / 2, SIDE / 2, 2 * SIDE]]).displacement[0, 0]
    assert np.array(tops) == pytest.approx(top, rel=0.03)


@pytest.mark.parametrize("solver", ["cg", "multigrid"])
def test_solvers_and_frames_find_the_same(solver: str) -> None:
    scene = tower("P1 mean volume", (SOFT, STIFF))
    loads = {"force": {"lower/west": (1.0, 0.5, 0.0)}}
    direct = scene.solve(**loads)  # type: ignore[arg-type]
    assert direct.is_converged
    size = direct.max_displacement
    assert abs(scene.solve(solver=solver, **loads).displacement - direct.displacement).max() < 1e-6 * size  # type: ignore[arg-type]
    stepper = scene.stepper(iterations=30, settled=1e-7, solver=solver)
    frame = stepper.frame(**loads)  # type: ignore[arg-type]
    assert abs(frame.displacement - direct.displacement).max() < 1e-5 * size
    lower = scene.organ("lower")
    assert frame["lower"].displacement.shape == lower.mesh.points.shape
    path = scene.path(force=loads["force"], order=10)
    assert abs(path.curve(samples=2)[1][-1] - direct.displacement).max() < 1e-5 * size


def test_parts_places_and_copies() -> None:
    scene = tower("P2", (SOFT, STIFF))
    for name, organ in scene.organs.items():
        assert np.array_equal(scene.part(name, scene.mesh.points), organ.mesh.points)
        for place in ("top", "x < 1%"):
            nodes = list(scene.place(name, place))
            assert np.array_equal(scene.mesh.points[nodes], organ.mesh.points[organ.mesh.nodes(place)])
        assert np.array_equal(scene.mesh.nodes(f"{name}/top"), scene.place(name, "top"))
    state = scene.solve(gravity=(0, 0, -9.81), density={"lower": 1000.0, "upper": 2000.0})
    (bed,) = scene.organ("lower").supports
    held = state.support_force(bed)[2] + state.reaction("upper/top")[2]
    assert held == pytest.approx(3000.0 * 9.81 * SIDE**3, rel=1e-6)
    again = pickle.loads(pickle.dumps(scene))
    assert abs(again.solve(gravity=(0, 0, -9.81), density=1000.0).displacement).max() > 0.0
    assert repr(again) == repr(scene)


def test_a_scene_is_reduced_with_its_bonds() -> None:
    scene = tower("P1 mean volume")
    touch = scene.reduce("lower/west", radius=0.03, depth=0.004, order=3)
    assert touch.check(touches=3).verdict == "passed"


def test_organs_lie_on_a_table() -> None:
    """A rigid body of the scene carries what the springs leave, in a solve and in frames."""
    table = vs.Tool(vs.HalfSpace())
    side = vs.ElasticSupport("west", stiffness=1e3)
    scene = vs.Scene({"block": vs.Organ(block(3, 1e-5), SOFT, supports=[side])}, bodies=[table])
    weight = 1000.0 * 9.81 * SIDE**3
    state = scene.solve(gravity=(0, 0, -9.81), density=1000.0)
    assert state.is_converged
    assert state.force(table)[2] + state.support_force(side)[2] == pytest.approx(weight, rel=1e-6)
    assert state.force(table)[2] > 0.9 * weight
    stepper = scene.stepper(start=state, iterations=40, settled=1e-6, density=1000.0)
    for _ in range(3):
        frame = stepper.frame(gravity=(0, 0, -9.81))
    assert frame.is_settled
    assert frame.contact(table).force == pytest.approx(state.force(table), abs=1e-3 * weight)


def test_bodies_stand_still_in_frames_or_are_refused() -> None:
    """A motion would be dropped: `arrived` is the body where a solve has left it."""
    ball = vs.Tool(vs.Sphere(0.03), position=(0.05, 0.05, SIDE + 0.03), displacement=(0, 0, -0.004))
    organs = {"block": vs.Organ(block(3), SOFT, fixed="base")}
    scene = vs.Scene(organs, bodies=[ball])
    state = scene.solve()
    with pytest.raises(vs.VisceraError, match="by which only a solve moves it; in frames the bodies of a scene stand"):
        scene.stepper()
    there = ball.arrived()
    frame = vs.Scene(organs, bodies=[there]).stepper(start=state, iterations=20, settled=1e-6).frame()
    assert frame.is_settled
    assert frame.contact(there).force == pytest.approx(state.force(ball), abs=1e-3 * abs(state.force(ball)[2]))


def test_what_acts_is_named_once() -> None:
    """Twice, it would act twice, and its report tell a half."""
    organs = {"lower": vs.Organ(block(2), SOFT, fixed="base"), "upper": vs.Organ(block(3, SIDE), SOFT, fixed="top")}
    table, bond, pair = vs.Tool(vs.HalfSpace()), vs.Bond("lower", "upper"), vs.ContactPair("lower", "upper")
    spring, plate = vs.Spring("lower/west", "upper/west", stiffness=1.0), vs.HalfSpace()
    twice: dict[str, list[Any]] = {"bodies": [table], "bonds": [bond], "contacts": [pair]}
    for name, (each,) in {**twice, "bonds ": [spring]}.items():
        with pytest.raises(vs.VisceraError, match=rf"the {name.strip()} of a scene: {type(each).__name__}.* twice"):
            vs.Scene(organs, **{name.strip(): [each, each]})
    scene = vs.Scene(organs, bodies=[table, plate])
    for each in (table, plate):
        with pytest.raises(vs.VisceraError, match="is a body of the scene, which acts in every solve; leave it out"):
            scene.solve(contact=[each])
    with pytest.raises(vs.VisceraError, match="a body of a scene must be a Tool or a shape; contact pairs are"):
        vs.Scene(organs, [pair])  # type: ignore[list-item]
    other = vs.Tool(plate, position=(0, 0, -0.5))
    assert scene.solve(contact=[other]).contact(other).touching == 0
    with pytest.raises(vs.VisceraError, match="is in this stepper already"):
        scene.stepper().tool(table)


def test_organs_in_one_place_are_no_contact_pair() -> None:
    """No point of the surface of one is inside the other. The bar that crosses a block has no corner in it, either."""
    lower, crossing = vs.Organ(block(3), SOFT, fixed="base"), block(1)
    bar = vs.mesh((crossing.points - 0.5 * SIDE) * (3.0, 0.2, 0.2) + 0.5 * SIDE, crossing.cells, crossing.sets)
    top = ("lower", "top"), ("upper", "top")
    meshes = {"P1": block(3), "P2": block(3), "moved": block(3, 1e-6), "bar": bar}
    for name, mesh in meshes.items():
        element = "P2" if name == "P2" else "P1"
        organs = {
            "lower": vs.Organ(lower.mesh, SOFT, fixed="base", element=element),
            "upper": vs.Organ(mesh, SOFT, fixed="base", element=element),
        }
        for sides in (("lower", "upper"), top) if name != "bar" else (("lower", "upper"),):
            with pytest.raises(vs.VisceraError, match=r"overlap at rest: the point \(.* m inside '?(lower|upper|the)"):
                vs.Scene(organs, contacts=[vs.ContactPair(*sides)])
        vs.Scene(organs)  # without a pair they may


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (lambda a, b: vs.Scene({}), "the organs of a scene must be a table"),
        (lambda a, b: vs.Scene({"a/b": a}), "must be words without '/'"),
        (lambda a, b: vs.Scene({"a": a.mesh}), "the organ 'a' must be a viscera.Organ"),
        (lambda a, b: vs.Scene({"a": a, "b": vs.Organ(b.mesh, SOFT, fixed="top", element="P2")}), "of one element"),
        (lambda a, b: vs.Scene({"a": a, "b": b}, bonds=[vs.Bond("a", "c")]), "no organ of the scene is called 'c'"),
        (lambda a, b: vs.Scene({"a": a, "b": b}, bonds=[WRONG]), "a bond of a scene must be a Bond"),
        (
            lambda a, b: vs.Scene({"a": a, "b": b}, bonds=[vs.Bond(("a", "base"), "b")]),
            "no triangle of the one surface",
        ),
        (lambda a, b: vs.Scene({"a": a}, contacts=wrong(vs.ContactPair("a"))), r"ContactPair.*, got ContactPair\(a\)"),
        (lambda a, b: vs.Scene({"a": a}, bonds=wrong(vs.Bond("a", "b"))), "the bonds of a scene must be a list"),
        (lambda a, b: vs.Scene({"a": a}, bodies=wrong(None)), "the bodies of a scene must be a list"),
        (lambda a, b: vs.Bond("a", WRONG), "a side of a bond must be the name of an organ"),
        (lambda a, b: vs.Bond("a", "b", stiffness=0), "the stiffness of a bond must be a number above 0"),
        (lambda a, b: vs.Scene({"a": a, "b": b}).solve(density={"a": 1e3}, gravity=(0, 0, -1)), "have no density"),
        (lambda a, b: a.solve()["a"], "this is no scene but one organ"),
    ],
)
def test_what_is_no_scene_is_refused(made: object, said: str) -> None:
    lower = vs.Organ(block(2), SOFT, fixed="base")
    upper = vs.Organ(block(3, SIDE), SOFT, fixed="top")
    with pytest.raises(vs.VisceraError, match=said):
        made(lower, upper)  # type: ignore[operator]


def pile(
    laws: tuple[vs.laws.Law, ...] = (SOFT, SOFT), apart: float = 0.0, element: str = "P1", **told: Any
) -> vs.Scene:
    """A block of 2^3 cubes on springs, one of 3^3 lying on it, held by springs too weak to be felt."""
    bed = vs.ElasticSupport("base", stiffness=1e8, tangential=0.0)
    lower = vs.Organ(block(2), laws[0], supports=[bed], element=element)
    side = vs.ElasticSupport("west", stiffness=1e-2)
    upper = vs.Organ(block(3, SIDE + apart), laws[1], supports=[side], element=element)
    pair = vs.ContactPair(("lower", "top"), "upper", **told)
    return vs.Scene({"lower": lower, "upper": upper}, contacts=[pair])


def held(scene: vs.Scene) -> dict[str, Any]:
    """Planes of symmetry on two sides."""
    return {f"{name}/{side}": move for name in scene.organs for side, move in SYMMETRY.items()}


@pytest.mark.parametrize("element", ELEMENTS)
def test_a_uniform_pressure_passes_a_contact(element: str) -> None:
    """Both blocks widen as they are pressed: the pieces of the interface follow."""
    scene = pile(element=element)
    state = scene.solve(displacement=held(scene), traction={"upper/top": (0.0, 0.0, -800.0)})
    assert state.is_converged
    for name in scene.organs:
        stress = state[name].stress("pk1", at="points")
        exact = np.zeros((3, 3))
        exact[2, 2] = -800.0
        assert abs(stress - exact).max() < 1e-5 * 800.0, name
    (pair,) = scene.contacts
    told = state.contact(pair)
    assert told.force == pytest.approx([0, 0, -8.0], rel=1e-6, abs=1e-6)
    assert told.area == pytest.approx(SIDE**2, rel=1e-6)
    touched = scene.part("upper", told.pressures)[scene.organ("upper").mesh.nodes("base")]
    assert touched == pytest.approx(800.0, rel=1e-5)


def test_surfaces_may_touch_once() -> None:
    pairs = [vs.ContactPair("lower", "upper"), vs.ContactPair("upper", "lower", friction=0.1)]
    scene = pile((SOFT, STIFF))
    with pytest.raises(vs.VisceraError, match="are of the same surfaces and would share the force; name them once"):
        vs.Scene(scene.organs, contacts=pairs)
    vs.Scene(scene.organs, contacts=[pairs[0], vs.ContactPair("upper")])


@pytest.mark.parametrize(("element", "solver"), [("P1", "cholesky"), ("P1", "cg"), ("P2", "cholesky")])
def test_a_block_lies_on_another_in_solves_and_frames(element: str, solver: str) -> None:
    scene = pile((SOFT, STIFF), element=element)
    (pair,) = scene.contacts
    load: dict[str, Any] = {"gravity": (0, 0, -9.81), "density": 1000.0, "displacement": held(scene)}
    state = scene.solve(solver=solver, **load)
    assert state.is_converged
    weight = 9810.0 * SIDE**3
    assert state.force(pair)[2] == pytest.approx(-weight, rel=1e-5)
    (bed,) = scene.organ("lower").supports
    assert state.support_force(bed)[2] == pytest.approx(2.0 * weight, rel=1e-5)
    assert state.support_force(scene.supports[0]).tolist() == state.support_force(bed).tolist()
    assert -1e-3 * SIDE < state.contact(pair).gap < 0.0
    stepper = scene.stepper(held(scene), iterations=40, settled=1e-7, density=1000.0, solver=solver)
    for _ in range(5):
        frame = stepper.frame(gravity=(0, 0, -9.81))
    assert frame.is_settled
    assert frame.force(pair) == pytest.approx(state.force(pair), abs=1e-4 * weight)
    assert abs(frame.displacement - state.displacement).max() < 1e-5 * SIDE


def test_what_is_lifted_lets_go() -> None:
    scene = pile()
    (pair,) = scene.contacts
    stepper = scene.stepper({**held(scene), "upper/top": (None, None, 0.0)}, iterations=40, settled=1e-6)
    forces = []
    for height in (-0.002, -0.004, 0.0, 0.01):
        frame = stepper.frame({**held(scene), "upper/top": (None, None, height)})
        assert frame.is_settled
        forces.append(frame.force(pair)[2])
    assert forces[1] < 1.9 * forces[0] < 0.0
    assert abs(forces[2]) < 1e-2 * abs(forces[0])
    assert forces[3] == 0.0
    assert frame.contact(pair).touching == 0


def test_a_block_sticks_on_another_until_it_slides() -> None:
    """Pressed and dragged in frames: within the cone it is held, at the cone it slides, and the drag is dissipated."""
    scene = pile(friction=0.3)
    (pair,) = scene.contacts
    base = {"lower/base": (0.0, 0.0, 0.0)}
    stepper = scene.stepper({**base, "upper/top": (0.0, 0.0, 0.0)}, iterations=60, settled=1e-6)
    told = []
    for sideways in (0.0, 0.0002, 0.002, 0.004, 0.006, 0.007, 0.008):
        frame = stepper.frame({**base, "upper/top": (sideways, 0.0, -0.004)})
        assert frame.is_settled, sideways
        told.append(frame.contact(pair))
        assert told[-1].dissipation >= 0.0
        assert np.hypot(*told[-1].force[:2]) <= 0.3 * -told[-1].force[2]
    pressed, stuck, last = told[0], told[1], told[-1]
    assert pressed.sliding == stuck.sliding == 0.0 == stuck.dissipation
    assert stuck.force[0] > pressed.force[0] + 0.01
    assert last.sliding == last.touching > 0
    # The upper block tips, so that not all normals and slides are parallel.
    assert 0.85 * 0.3 < last.force[0] / -last.force[2] < 0.3
    # In a steady slide the work of the drag by 1 mm is dissipated, but for the strain that still changes.
    assert last.dissipation == pytest.approx(1e-3 * last.force[0], rel=0.1)


def test_friction_holds_from_load_step_to_load_step() -> None:
    forces = []
    for friction in (0.0, 0.3):
        scene = pile(friction=friction)
        (pair,) = scene.contacts
        move = {"lower/base": (0.0, 0.0, 0.0), "upper/top": (0.0004, 0.0, -0.004)}
        state = scene.solve(displacement=move, steps=4)
        assert state.is_converged
        forces.append(state.force(pair))
    smooth, rough = forces
    assert rough[0] > 10.0 * abs(smooth[0])
    assert np.hypot(*rough[:2]) < 0.3 * -rough[2]


def test_friction_begins_where_surfaces_first_touch() -> None:
    """A block is driven down and aside, from farther away than the reach: where it lands it sticks, in any steps."""
    soft = vs.ElasticSupport("top", stiffness=2e3)
    lower, upper = (vs.Organ(block(2), SOFT, fixed="base"), vs.Organ(block(3, 1.3 * SIDE), SOFT, supports=[soft]))
    pair = vs.ContactPair("lower", "upper", friction=0.5, reach="1 cm")
    scene = vs.Scene({"lower": lower, "upper": upper}, contacts=[pair])
    top = scene.place("upper", "top")
    push = {top: (0.4, 0.0, -1.6)}
    drifts = []
    for steps in (1, 32):
        state = scene.solve(force=push, steps=steps)
        assert state.is_converged
        drifts.append(state.displacement[list(top), 0].mean())
    free = vs.Scene(scene.organs, contacts=[vs.ContactPair("lower", "upper")]).solve(force=push)
    frame = scene.stepper(iterations=40).frame(force=push)
    assert drifts[0] == pytest.approx(drifts[1], rel=0.1)
    assert free.displacement[list(top), 0].mean() > 1.5 * drifts[1]
    assert frame.force(pair)[0] > 0.1 * -frame.force(pair)[2]


def test_short_load_steps_settle_with_friction() -> None:
    """The stretch that a short step leaves of the springs of friction is not lost in the rounding of places."""
    soft = vs.ElasticSupport("top", stiffness=2e3)
    lower, upper = (vs.Organ(block(2), SOFT, fixed="base"), vs.Organ(block(3, 1.05 * SIDE), SOFT, supports=[soft]))
    scene = vs.Scene({"lower": lower, "upper": upper}, contacts=[vs.ContactPair("lower", "upper", friction=0.3)])
    push = {scene.place("upper", "top"): (0.4, 0.0, -1.6)}
    states = [scene.solve(force=push, steps=steps) for steps in (16, 256)]
    assert all(state.is_converged for state in states)
    moved = states[1].max_displacement
    assert abs(states[1].displacement - states[0].displacement).max() < 0.02 * moved


def test_a_pair_is_that_of_its_scene() -> None:
    scene = pile()
    (pair,) = scene.contacts
    state, frame = scene.solve(displacement=held(scene)), scene.stepper(held(scene)).frame(held(scene))
    other = pickle.loads(pickle.dumps(pair))
    for told in (state, frame):
        with pytest.raises(vs.VisceraError, match=r"no contact pair of this (solve|frame); take the one in"):
            told.contact(other)
    copy, again = pickle.loads(pickle.dumps((scene, state)))
    assert again.contact(copy.contacts[0]).gap == state.contact(pair).gap


def test_organs_apart_move_as_if_alone() -> None:
    scene = pile(apart=0.05)
    state = scene.solve(displacement=held(scene), force={"lower/top": (0.0, 0.0, 1.0)})
    alone = vs.Scene(scene.organs).solve(displacement=held(scene), force={"lower/top": (0.0, 0.0, 1.0)})
    assert np.array_equal(state.displacement, alone.displacement)
    assert state.contact(scene.contacts[0]).gap == np.inf


def test_copies_keep_their_contacts() -> None:
    scene = pickle.loads(pickle.dumps(pile()))
    assert repr(scene).endswith("1 contact pairs)")
    state = scene.solve(displacement=held(scene), traction={"upper/top": (0.0, 0.0, -80.0)})
    assert state.force(scene.contacts[0])[2] == pytest.approx(-0.8, rel=1e-5)


def test_contacts_that_cannot_be_are_refused() -> None:
    with pytest.raises(
        vs.VisceraError, match=r"of ContactPair\(lower at 'top', upper\) .*0\.1\d*\) m .* 2\.000e-3 m inside"
    ):
        pile(apart=-2e-3)
    for reach in (0.0, 1e-5):
        with pytest.raises(vs.VisceraError, match=r"reach of ContactPair\(.*\) must be a length of at least 0\.1%"):
            pile(reach=reach)
    with pytest.raises(vs.VisceraError, match="the friction of a contact pair"):
        pile(friction=-0.1)
    with pytest.raises(vs.VisceraError, match="take a Bond"):
        pile(friction="bonded")
    scene = pile()
    with pytest.raises(vs.VisceraError, match="touches itself between two of its places"):
        vs.Scene(scene.organs, contacts=[vs.ContactPair("lower", "lower")])
    with pytest.raises(vs.VisceraError, match="no organ of the scene is called"):
        vs.Scene(scene.organs, contacts=[vs.ContactPair("lower", "uper")])
    with pytest.raises(vs.VisceraError, match="a contact of a scene"):
        vs.Scene(scene.organs, contacts=[WRONG])
    with pytest.raises(vs.VisceraError, match="a side of a contact pair"):
        vs.ContactPair("lower", WRONG)
    for series in (scene.reduce, lambda **_: scene.path(force={"upper/top": (0, 0, -1.0)})):
        with pytest.raises(vs.VisceraError, match="does not know surfaces that touch"):
            series()
    with pytest.raises(vs.VisceraError, match="`contact` gives its force"):
        scene.solve(displacement=held(scene)).support_force(wrong(scene.contacts[0]))
