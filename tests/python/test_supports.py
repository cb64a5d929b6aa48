"""Elastic supports: closed forms, every analysis that meets them, files that keep them, and refusals."""

import itertools
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import viscera as vs
from viscera.reduced.touch import load_bytes
from viscera.viewer.surface import surface_model

SIDE = 0.1
SPRING = 4e5
TISSUE = vs.NeoHookean(young=10e3, poisson=0.3)
ELEMENTS = ("P1", "P1 mean volume", "P2")


def block(n: int = 3) -> vs.Mesh:
    """A cube of n^3 cubes, six cells each."""
    line = np.linspace(0.0, SIDE, n + 1)
    points = np.array([(x, y, z) for z in line for y in line for x in line])
    corner = np.array([i + (n + 1) * (j + (n + 1) * k) for k, j, i in itertools.product(range(n), repeat=3)])
    cells = []
    for order in itertools.permutations((1, n + 1, (n + 1) ** 2)):
        cells.append(np.stack([corner, *(corner + sum(order[: k + 1]) for k in range(3))], axis=1))
    sides = {name: np.flatnonzero(points[:, axis] == 0.0) for axis, name in enumerate(("west", "south", "base"))}
    return vs.mesh(points, np.vstack(cells), {**sides, "top": np.flatnonzero(points[:, 2] == SIDE)})


def bed(stiffness: float = SPRING, tangential: float | None = None) -> vs.ElasticSupport:
    return vs.ElasticSupport("base", stiffness, tangential)


def lying(element: str = "P1", tangential: float | None = None) -> vs.Organ:
    return vs.Organ(block(), TISSUE, supports=[bed(tangential=tangential)], element=element)


@pytest.mark.parametrize("element", ELEMENTS)
def test_a_uniform_pressure_passes_through_springs(element: str) -> None:
    """Patch test: with springs along the normal alone, the stress is uniform and the base sinks by p / k everywhere."""
    organ, p = lying(element, tangential=0.0), 500.0
    symmetry = {"west": (0, None, None), "south": (None, 0, None)}
    state = organ.solve(traction={"top": (0, 0, -p)}, displacement=symmetry)
    base = state.displacement[organ.mesh.nodes("base"), 2]
    assert state.is_converged
    assert base == pytest.approx(-p / SPRING, rel=1e-9)
    (support,) = organ.supports
    assert state.support_force(support) == pytest.approx([0, 0, p * SIDE**2], rel=1e-9, abs=1e-9)
    stress = state.stress("pk1")[:, 2, 2]
    assert stress == pytest.approx(-p, rel=1e-8)


@pytest.mark.parametrize("element", ELEMENTS)
def test_a_stiff_block_on_springs_sinks_slides_and_tilts(element: str) -> None:
    """The closed form of a rigid block: F / (k A), F / (k_t A), and M / (k I) about the middle of its base."""
    organ = vs.Organ(block(2), vs.Linear(young=1e12, poisson=0.3), supports=[bed(tangential=1e5)], element=element)
    area, inertia, arm = SIDE**2, SIDE**4 / 12, SIDE
    state = organ.solve(force={"top": (0.3, 0.0, -2.0)})
    base = organ.mesh.nodes("base")
    x, u = organ.mesh.points[base], state.displacement[base]
    sunk, tilt = -2.0 / (SPRING * area), 0.3 * arm / (SPRING * inertia)
    assert u[:, 2] == pytest.approx(sunk - tilt * (x[:, 0] - SIDE / 2), rel=1e-4)
    assert u[:, 0] == pytest.approx(0.3 / (1e5 * area), rel=1e-4)
    # Springs hold half the product of force and displacement.
    top = state.displacement[organ.mesh.nodes("top")].mean(axis=0)
    assert state.energy == pytest.approx(0.5 * (0.3 * top[0] - 2.0 * top[2]), rel=1e-3)


@pytest.mark.parametrize("solver", ["cg", "multigrid", vs.ConjugateGradients("block_jacobi", matrix_free=True)])
def test_every_solver_frames_and_series_find_the_same(solver: vs.ConjugateGradients | str) -> None:
    organ, load = lying("P1 mean volume"), {"top": (0.1, 0.0, -1.0)}
    direct = organ.solve(force=load)
    size = direct.max_displacement
    other = organ.solve(force=load, solver=solver)
    assert abs(other.displacement - direct.displacement).max() < 1e-6 * size
    stepper = organ.stepper(iterations=30, settled=1e-7, solver=solver)
    frame = stepper.frame(force=load)
    assert frame.is_settled
    assert abs(frame.displacement - direct.displacement).max() < 1e-5 * size
    (support,) = organ.supports
    assert frame.support_force(support) == pytest.approx([-0.1, 0.0, 1.0], abs=1e-5)
    path = organ.path(force=load, order=10).curve(samples=2)[1][-1]
    assert abs(path - direct.displacement).max() < 1e-5 * size


def test_inertia_swings_on_the_springs() -> None:
    """A stiff block on springs oscillates with sqrt(k A / m); Newmark's rule keeps its energy."""
    mass, step = 1000.0 * SIDE**3, 1e-3
    organ = vs.Organ(block(1), vs.Linear(young=1e9, poisson=0.0), supports=[bed()])
    stepper = organ.stepper(iterations=5, settled=1e-9, dynamics="newmark", time_step=step, density=1000.0)
    weight = -mass * 9.81
    heights = [stepper.frame(gravity=(0, 0, -9.81)).displacement[:, 2].mean() for _ in range(400)]
    rate = np.sqrt(SPRING * SIDE**2 / mass)
    exact = weight / (SPRING * SIDE**2) * (1.0 - np.cos(rate * step * np.arange(1, 401)))
    assert np.abs(heights - exact).max() < 0.02 * np.abs(exact).max()


def test_a_support_that_organs_share_tells_the_force_on_all_of_them() -> None:
    """Two blocks of different weight on one bed."""
    bed = vs.ElasticSupport("base", 1e6)
    mesh = block(2)
    beside = vs.mesh(mesh.points + np.array([2.0 * SIDE, 0.0, 0.0]), mesh.cells, mesh.sets)
    scene = vs.Scene({name: vs.Organ(at, TISSUE, supports=[bed]) for name, at in (("a", mesh), ("b", beside))})
    density = {"a": 1000.0, "b": 100.0}
    state = scene.solve(gravity=(0, 0, -9.81), density=density, throw=True)
    frame = scene.stepper(iterations=20, density=density).frame(gravity=(0, 0, -9.81))
    for result in (state, frame):
        assert result.support_force(bed)[2] == pytest.approx(1100.0 * 9.81 * SIDE**3, rel=1e-6)
        assert result["b"].support_force(bed)[2] == pytest.approx(100.0 * 9.81 * SIDE**3, rel=1e-6)


def test_a_model_keeps_its_supports(tmp_path: Path) -> None:
    organ = lying("P1 mean volume")
    touch = organ.reduce("top", radius=0.03, depth=0.004, order=3)
    assert touch.check(touches=4).verdict == "passed"
    touch.save(tmp_path / "lying.viscera")
    again = vs.load(tmp_path / "lying.viscera")
    full = again.organ()
    (kept,) = full.supports
    answer = again((0.05, 0.05, SIDE), (0, 0, -0.002))
    # The support feels the field, which is compressed to a per cent; the force is not.
    assert answer.support_force(kept) == pytest.approx(-answer.force, abs=0.01 * abs(answer.force[2]))
    patch = again.patch((0.05, 0.05, SIDE))
    state = full.solve(displacement={patch: (0, 0, -0.002)})
    assert state.reaction(patch) == pytest.approx(answer.force, rel=5e-3, abs=1e-4)
    with pytest.raises(vs.VisceraError, match="several touches at once do not know elastic supports"):
        again.galerkin(order=2)
    with pytest.raises(vs.VisceraError, match="cannot be registered yet"):
        organ.register(landmarks={"top": (0.05, 0.05, SIDE)})


def test_an_answer_tells_the_force_of_each_support(tmp_path: Path) -> None:
    """A model keeps the samples of all together, and finds those of one among them; a place may be a set."""
    below, side = bed(tangential=0.3 * SPRING), vs.ElasticSupport("x < 1%", 0.2 * SPRING)
    organ = vs.Organ(block(), TISSUE, supports=[below, side])
    touch = organ.reduce("top", depth="4%", order=2)
    touch.save(tmp_path / "block.viscera")
    for model in (touch, vs.load(tmp_path / "block.viscera")):
        answer = model((0.05, 0.05, SIDE), (0.001, 0.0, -0.002))
        moved = organ.moved(answer.displacement)
        for one in (below, side):
            (samples,) = answer._its_ties(one)
            assert samples.force(answer.displacement) == pytest.approx(moved.support_force(one), rel=1e-9)
            assert answer.support_force(one) == pytest.approx(moved.support_force(one), rel=0.02, abs=2e-3)
        assert answer.support_force(model.organ().supports[0]) == pytest.approx(-answer.force, rel=1e-9)
        with pytest.raises(vs.VisceraError, match="not found among the supports of this model"):
            answer.support_force(bed(2.0 * SPRING))


def test_the_model_of_a_bonded_scene_is_not_told_to_merge_its_organs(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """And it knows the places of its organs by name."""
    lower = block()
    upper = vs.mesh(lower.points + np.array([0.0, 0.0, SIDE]), lower.cells, lower.sets)
    organs = {
        "lower": vs.Organ(lower, TISSUE, fixed="base"),
        "upper": vs.Organ(upper, TISSUE, supports=[vs.ElasticSupport("west", 1e-3 * SPRING)]),
    }
    scene = vs.Scene(organs, bonds=[vs.Bond(("lower", "top"), ("upper", "base"))])
    scene.reduce("upper/top", depth="4%", order=2).save(tmp_path / "two.viscera")
    caplog.clear()
    model = vs.load(tmp_path / "two.viscera")
    state = model.organ().solve(force={"upper/top": (0, 0, -1.0)})
    assert state.reaction("lower/base") == pytest.approx([0.0, 0.0, 1.0], abs=0.01)
    assert "merge" not in caplog.text


def test_the_page_of_a_supported_organ_answers_alike() -> None:
    """Its nodes are those of the surface, whatever the order of all nodes; it may not be made stiffer as a whole."""
    mesh = block()
    order = np.random.default_rng(0).permutation(len(mesh.points))
    at = np.argsort(order)
    shuffled = vs.mesh(mesh.points[order], at[mesh.cells], {name: at[nodes] for name, nodes in mesh.sets.items()})
    touch = vs.Organ(shuffled, TISSUE, supports=[bed()]).reduce("top", radius=0.03, depth=0.004, order=3)
    alone = load_bytes(surface_model(touch, "Block"))
    point, push = (0.05, 0.05, SIDE), (0, 0, -0.002)
    assert np.array_equal(alone(point, push).force, touch(point, push).force)
    assert np.array_equal(alone.surface_displacement(point, push), touch.surface_displacement(point, push))
    assert alone.metadata["user"]["is_stress_free"] is False


def test_a_model_about_a_posture_of_a_supported_organ() -> None:
    organ = lying()
    posture = organ.solve(gravity=(0, 0, -9.81), density=1000)
    touch = organ.reduce("top", radius=0.03, depth=0.004, order=3, start=posture)
    assert touch.check(touches=3).verdict == "passed"


def test_the_scan_of_a_supported_organ_is_unloaded() -> None:
    rest = lying().unloaded(gravity=(0, 0, -9.81), density=1000.0)
    assert rest.is_converged
    (support,) = rest.organ.supports
    weight = 9.81 * 1000 * SIDE**3
    assert rest.state.support_force(support)[2] == pytest.approx(weight * rest.organ.mesh.volume / SIDE**3, rel=1e-6)


def test_copies_keep_supports_and_know_them() -> None:
    organ, load = lying(), {"top": (0.0, 0.0, -1.0)}
    (support,) = organ.supports
    state = organ.solve(force=load)
    for other in (pickle.loads(pickle.dumps(organ)), organ.with_law(TISSUE), organ.with_mesh(organ.mesh)):
        assert abs(other.solve(force=load).displacement - state.displacement).max() < 1e-12
    assert organ.with_mesh(organ.mesh).solve(force=load).support_force(support)[2] == pytest.approx(1.0)
    with pytest.raises(vs.VisceraError, match="is no elastic support of this organ"):
        state.support_force(bed())


def test_a_case_file_keeps_supports(tmp_path: Path) -> None:
    organ, load = lying(tangential=1e5), {"top": (0.1, 0.0, -1.0)}
    case = organ.to_case(tmp_path / "lying.toml", loads={"force": load})
    assert case.supports == {"base": {"stiffness": SPRING, "tangential": 1e5}}
    again = case.organ()
    state = case.solve(again)
    assert abs(state.displacement - organ.solve(force=load).displacement).max() < 1e-9
    assert case.reactions(again, state)["base"] == pytest.approx([-0.1, 0.0, 1.0], abs=1e-9)
    with pytest.raises(vs.VisceraError, match="must be a number from 0"):
        vs.Case(mesh="organ:beam", material=case.material, supports={"base": {"stiffness": 1e6, "tangential": -1}})


BED = bed()


@pytest.mark.parametrize(
    ("held", "said"),
    [
        ({}, "nothing is fixed: the organ would float away"),
        ({"supports": bed()}, "supports must be a list"),
        ({"supports": ["base"]}, "a support of an organ must be an ElasticSupport"),
        ({"supports": [BED, BED]}, "supports: .* is named twice and would act twice; name it once"),
        ({"supports": [vs.ElasticSupport([0], 1e6)]}, "holds no whole triangle of the surface"),
        ({"supports": [vs.ElasticSupport("bottom", 1e6)]}, "the elastic support of 'bottom'"),
        ({"supports": [bed(tangential=0.0)]}, "3 of its 6 rigid motions are free"),
    ],
)
def test_what_does_not_hold_is_refused(held: dict[str, object], said: str) -> None:
    with pytest.raises(vs.VisceraError, match=said):
        vs.Organ(block(), TISSUE, **held).solve(force={"top": (0, 0, -1.0)})  # type: ignore[arg-type]


REFUSED = [(0.0, None), (-1.0, None), (np.nan, None), (1e6, -1.0), ("1", 0)]


@pytest.mark.parametrize(("stiffness", "tangential"), REFUSED)
def test_stiffnesses_out_of_range_are_refused(stiffness: float, tangential: float) -> None:
    with pytest.raises(vs.VisceraError, match="stiffness of an elastic support must be a number"):
        vs.ElasticSupport("base", stiffness, tangential)


def bonded_blocks(lower_supports: list[Any], upper_supports: list[Any], element: str) -> vs.Scene:
    lower = block(2)
    upper = vs.mesh(lower.points + np.array([0.0, 0.0, SIDE]), lower.cells, lower.sets)
    organs = {
        "lower": vs.Organ(lower, TISSUE, supports=lower_supports, element=element),
        "upper": vs.Organ(upper, TISSUE, fixed="top", supports=upper_supports, element=element),
    }
    return vs.Scene(organs, bonds=[vs.Bond(("lower", "top"), ("upper", "base"))])


@pytest.mark.parametrize("element", ["P1", "P2"])
def test_an_answer_of_a_scene_tells_the_force_of_the_support_of_an_organ(tmp_path: Path, element: str) -> None:
    """The place of a support is one of its organ, not of the whole scene; of two supports alike none is guessed."""
    high, west, alike = (vs.ElasticSupport(where, SPRING) for where in ("z > 49%", "west", "west"))
    push: Any = ((SIDE, 0.05, 0.05), (-0.001, 0.0, 0.0))
    scene = bonded_blocks([high, west], [], element)
    reduced: dict[str, Any] = {"radius": 0.04, "depth": 0.002, "order": 2}
    touch = scene.reduce(scene.place("lower", "x > 99%"), **reduced)
    touch.save(tmp_path / "scene.viscera")
    for model in (touch, vs.load(tmp_path / "scene.viscera")):
        answer = model(*push)
        moved = scene.moved(answer.displacement)
        for one in (high, west):
            (samples,) = answer._its_ties(one)
            assert samples.force(answer.displacement) == pytest.approx(moved.support_force(one), rel=1e-9)
            assert answer.support_force(one) == pytest.approx(moved.support_force(one), rel=0.02, abs=2e-3)
    twice = bonded_blocks([west], [alike], element)
    answer = twice.reduce(twice.place("lower", "x > 99%"), **reduced)(*push)
    with pytest.raises(vs.VisceraError, match="2 organs of this model of a scene have a support as"):
        answer.support_force(west)


def test_the_supports_of_a_bonded_scene_carry_what_fixed_nodes_and_touch_leave() -> None:
    """A bond pulls on both of its organs: it adds nothing to the force of all supports, in any analysis."""
    west = vs.ElasticSupport("west", SPRING)
    scene = bonded_blocks([west], [], "P1")
    touch = scene.reduce(scene.place("lower", "x > 99%"), radius=0.04, depth=0.002, order=2)
    patch, push = touch.patch((SIDE, 0.05, 0.05)), (-0.001, 0.0, 0.0005)
    full = scene.solve(displacement={patch: push}, throw=True)
    carried = -(full.reaction(patch) + full.reaction("upper/top"))
    assert np.abs(full.support_force(scene.bonds[0])).max() > 0.1 * np.abs(carried).max()
    model = touch.organ()
    (kept,) = model.supports
    again = model.solve(displacement={patch: push}, throw=True)
    beside = vs.Scene({"all": model}).solve(displacement={patch: push}, throw=True)
    # Newton's method leaves 1e-9 of the load; the field of the answer is compressed to a per cent.
    for told, off in ((again, 1e-6), (beside, 1e-6), (touch((SIDE, 0.05, 0.05), push), 0.02)):
        assert np.abs(told.support_force(kept) - carried).max() < off * np.abs(carried).max()


def test_a_support_is_found_among_those_of_a_model_within_rounding() -> None:
    """The rest shape of a preloaded model is computed back from the loaded one."""
    mesh, support = block(), bed()
    back = vs.mesh((mesh.points + 1.0123) - 1.0123, mesh.cells, mesh.sets)
    assert not np.array_equal(back.points, mesh.points)
    assert support.ties(mesh).holds(support.ties(back))
    assert not support.ties(mesh).holds(bed(1.001 * SPRING).ties(back))


def test_the_error_of_an_organ_that_nothing_holds_names_what_lets_a_table_hold_it(cube: vs.Mesh) -> None:
    """A support that carries next to nothing: the table does."""
    law, load = vs.NeoHookean(young=1e5, poisson=0.3), (0.0, 0.0, -5.0)
    table = vs.Tool(vs.HalfSpace(), friction="bonded")
    with pytest.raises(vs.VisceraError, match=r"ElasticSupport\('x > -1%', 1e-3\)"):
        vs.Organ(cube, law).solve(force={"top": load}, contact=[table])
    weak = vs.ElasticSupport("x > -1%", 1e-3)
    state = vs.Organ(cube, law, supports=[weak]).solve(force={"top": load}, contact=[table])
    assert state.is_converged
    assert np.abs(state.support_force(weak)).max() < 1e-6
    assert state.contact(table).force[2] == pytest.approx(5.0, abs=1e-5)


@pytest.mark.parametrize("gap", [1e-5, 5e-4, 5e-3])
def test_an_organ_comes_down_on_a_table(cube: vs.Mesh, gap: float) -> None:
    """Held by next to nothing above it, and by the table then, as if it had begun there."""
    law, weak = vs.NeoHookean(young=1e5, poisson=0.3), vs.ElasticSupport("x > -1%", 1e-3)

    def rests(above: float) -> vs.State:
        mesh = vs.mesh(cube.points + np.array([0.0, 0.0, above]), cube.cells, cube.sets)
        table = vs.Tool(vs.HalfSpace(), friction=0.5)
        organ = vs.Organ(mesh, law, supports=[weak])
        state = organ.solve(gravity=(0, 0, -9.81), density=1000.0, contact=[table])
        assert state.is_converged, state.message
        return state

    moved = rests(gap).displacement + np.array([0.0, 0.0, gap])
    assert abs(moved - rests(0.0).displacement).max() < 1e-6


@pytest.mark.parametrize("element", ["P1", "P2"])
def test_the_residual_of_what_supports_and_springs_alone_load_is_relative_to_their_forces(element: str) -> None:
    """A tightened spring between two blocks on supports: their forces are in balance with those of the tissue."""
    mesh = block(2)
    law = vs.NeoHookean(young=1e6, poisson=0.3)
    low = vs.Organ(mesh, law, supports=[vs.ElasticSupport("z < 1%", 1e5)], element=element)
    bed = vs.ElasticSupport("z > 99%", 2e5, tangential=1e4)
    high = vs.Organ(vs.mesh(mesh.points + np.array([0.05, 0.2, 0.3]), mesh.cells), law, supports=[bed], element=element)
    spring = vs.Spring("low/z > 99%", "high/z < 1%", stiffness=300, length=0.05)
    scene = vs.Scene({"low": low, "high": high}, bonds=[spring])
    state = scene.solve(throw=True)
    assert state.residuals[-1][-1] < 1e-8
    assert "rounding" not in state.message
    frame = scene.stepper(iterations=30, settled=1e-9).frame()
    assert abs(frame.displacement - state.displacement).max() < 1e-6 * abs(state.displacement).max()
