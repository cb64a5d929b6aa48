"""Statics through the API: supports, loads, and what is refused before any work."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import PathCollection

import viscera as vs

SOFT = vs.NeoHookean(young=1e5, poisson=0.3)
Organ = vs.Organ


@pytest.fixture(scope="module")
def clamped(bar: vs.Mesh) -> Organ:
    return Organ(bar, SOFT, fixed="root")


def test_reactions_balance_the_applied_force(clamped: Organ) -> None:
    state = clamped.solve(force={"tip": (1.0, 2.0, -3.0)})
    assert state.is_converged
    assert state.reaction("root") == pytest.approx([-1.0, -2.0, 3.0], rel=1e-7)


def test_gravity_weighs_volume_times_density(clamped: Organ) -> None:
    state = clamped.solve(gravity=(0, 0, -9.81), density=1060)
    weight = 9.81 * 1060 * clamped.mesh.volume
    assert state.reaction("root") == pytest.approx([0, 0, weight], rel=1e-7, abs=1e-7 * weight)
    per_cell = clamped.solve(gravity=(0, 0, -9.81), density=np.full(len(clamped.mesh.cells), 1060.0))
    assert per_cell.displacement == pytest.approx(state.displacement, abs=1e-12)


def test_free_components_stay_free(clamped: Organ) -> None:
    state = clamped.solve(displacement={"tip": (0.02, None, None)})
    tip = state.displacement[clamped.mesh.nodes("tip")]
    assert tip[:, 0] == pytest.approx(0.02, abs=1e-15)
    assert np.abs(tip[:, 1]).max() > 1e-4, "the tip contracts sideways"
    assert state.reaction("tip")[1:] == pytest.approx(0.0, abs=1e-6)
    assert state.reaction("tip")[0] > 1.0


def test_an_affine_displacement_of_the_surface_is_an_equilibrium(cube: vs.Mesh) -> None:
    gradient = np.array([[0.1, 0.2, 0.0], [0.0, -0.05, 0.1], [0.05, 0.0, 0.1]])
    organ = Organ(cube, SOFT, fixed=np.flatnonzero((cube.points == 0).all(axis=1)))
    boundary = np.setdiff1d(cube.surface_nodes, organ.fixed)
    state = organ.solve(displacement={tuple(boundary.tolist()): cube.points[boundary] @ gradient.T})
    assert state.displacement == pytest.approx(cube.points @ gradient.T, abs=1e-12)


def test_a_traction_is_spread_by_area(cube: vs.Mesh) -> None:
    stretched = Organ(cube, vs.Linear(mu=1e5, lam=0.0), fixed="bottom").solve(force={"top": (0, 0, 1.0)})
    top = stretched.displacement[cube.nodes("top")]
    assert top[:, 2] == pytest.approx(0.1 * 1.0 / 0.01 / 2e5, rel=1e-6), "lam = 0: sigma = 2 mu eps, exactly"


def test_nodal_forces_equal_a_total_over_one_node(clamped: Organ) -> None:
    node = int(clamped.mesh.nodes("tip")[0])
    nodal = np.zeros_like(clamped.mesh.points)
    nodal[node] = (0, 0, 0.1)
    by_array = clamped.solve(force=nodal)
    by_node = clamped.solve(force={(node,): (0, 0, 0.1)})
    assert by_array.displacement == pytest.approx(by_node.displacement, abs=1e-14)


def test_a_patch_mean_is_prescribed_and_its_force_reported(clamped: Organ) -> None:
    patch = clamped.patch((0.4, 0.05, 0.1), radius=0.06)
    state = clamped.solve(displacement={patch: (0, 0, -0.02)})
    assert patch.weights @ state.displacement[patch.nodes] == pytest.approx([0, 0, -0.02], abs=1e-10)
    assert state.reaction(patch) == pytest.approx(-state.reaction("root"), rel=1e-6, abs=1e-8)
    assert state.reaction(patch)[2] < 0
    back = clamped.solve(force={patch: state.reaction(patch)})
    assert back.displacement == pytest.approx(state.displacement, rel=1e-5, abs=1e-8)


def test_solving_on_from_a_state(clamped: Organ) -> None:
    half = clamped.solve(force={"tip": (0, 0, -2.0)})
    on = clamped.solve(force={"tip": (0, 0, -4.0)}, start=half)
    assert on.displacement == pytest.approx(clamped.solve(force={"tip": (0, 0, -4.0)}).displacement, abs=1e-9)


def test_more_steps_reach_the_same_equilibrium(clamped: Organ) -> None:
    seen: list[int] = []
    state = clamped.solve(force={"tip": (0, 0, -4.0)}, steps=4, progress=lambda done, total, stage: seen.append(done))
    assert len(state.residuals) >= 4
    assert seen[-1] == 100
    assert state.displacement == pytest.approx(clamped.solve(force={"tip": (0, 0, -4.0)}).displacement, abs=1e-9)


def test_a_stiff_nodule_stiffens(bar: vs.Mesh) -> None:
    young = np.where(bar.points[bar.cells].mean(axis=1)[:, 0] < 0.1, 1e7, 1e5)
    stiff = Organ(bar, vs.NeoHookean(young=young, poisson=0.3), fixed="root").solve(force={"tip": (0, 0, -1.0)})
    soft = Organ(bar, SOFT, fixed="root").solve(force={"tip": (0, 0, -1.0)})
    assert stiff.max_displacement < 0.9 * soft.max_displacement


def test_failure_is_a_status_and_an_exception_on_request(clamped: Organ) -> None:
    hopeless: dict[str, Any] = {
        "displacement": {"tip": (-0.39, 0, 0)},
        "settings": {"max_iterations": 1, "smallest_step": 0.5},
    }
    state = clamped.solve(**hopeless)
    assert not state.is_converged
    assert state.load < 1.0
    assert state.message
    with pytest.raises(vs.NotConverged) as raised:
        clamped.solve(**hopeless, throw=True)
    assert not raised.value.state.is_converged


def test_a_load_beyond_the_limit_point_says_where_the_tangent_becomes_singular(cube: vs.Mesh) -> None:
    """Uniaxial stress of Saint Venant-Kirchhoff is at most E / (3 sqrt 3) in compression."""
    planes: dict[Any, Any] = {
        lambda x, k=k: x[:, k] == 0: tuple(0.0 if axis == k else None for axis in range(3)) for k in range(3)
    }
    organ = Organ(cube, vs.SaintVenantKirchhoff(young=1e5, poisson=0.3), fixed=[0])
    state = organ.solve(displacement=planes, traction={"top": (0, 0, -0.4e5)})
    assert state.status == "limit point"
    turn = 1 / (3 * np.sqrt(3) * 0.4)
    assert turn - 0.01 < state.load < turn
    assert f"nearly singular at load {turn:.3f}" in state.message
    assert "known flaw of the law" in state.message
    assert "use NeoHookean" in state.message


def test_a_limit_point_under_dead_load_offers_the_arc_length(cube: vs.Mesh) -> None:
    """The load at which the path turns, from two slopes before it, is the largest on the path by arc length."""
    organ = Organ(cube, vs.SaintVenantKirchhoff(young=1e5, poisson=0.3), fixed="bottom")
    force = {"top": (0.0, 0.0, -300.0)}
    state = organ.solve(force=force)
    assert state.status == "limit point"
    assert "Organ.path(parameter='arc length')" in state.message
    load, _ = organ.path(force=force, parameter="arc length", max_expansions=3).curve(50)
    assert load[-1] < load.max(), "the path has passed the limit point"
    said = re.search(r"nearly singular at load ([\d.]+),", state.message)
    assert said is not None
    assert float(said[1]) == pytest.approx(load.max(), abs=1e-4)


def test_what_a_buckling_column_is_advised_leads_to_its_full_load(block: Any) -> None:
    """Above its buckling load it bends aside, which a straight column does not begin by itself."""
    column = vs.mesh(*block((5, 1, 1), (1.0, 0.1, 0.1)))
    organ = Organ(column, vs.NeoHookean(young=1e5, poisson=0.3), fixed="x <= 0%", element="P2")
    euler = np.pi**2 * 1e5 * 0.1**4 / 48
    push, aside = (1.5 * euler * np.array(direction) for direction in ((-1.0, 0.0, 0.0), (-1.0, 0.0, 0.01)))
    straight = organ.solve(force={"x > 99%": push})
    assert not straight.is_converged
    assert "small sideways force" in straight.message
    assert "Poisson" not in straight.message
    bent = organ.solve(force={"x > 99%": push}, start=organ.solve(force={"x > 99%": aside}))
    assert bent.status == "converged"


def test_what_a_progress_callback_raises_stops_the_solve(clamped: Organ) -> None:
    def stop(done: int, total: int, stage: str) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        clamped.solve(force={"tip": (0, 0, -1.0)}, progress=stop)
    assert clamped.solve(force={"tip": (0, 0, -1.0)}).is_converged


def test_every_iteration_can_be_stopped(clamped: Organ) -> None:
    """One step takes several iterations, of which each tells the load that was reached before it."""
    told: list[int] = []
    clamped.solve(force={"tip": (0, 0, -1.0)}, progress=lambda done, total, stage: told.append(done))
    assert told == [0] * (len(told) - 1) + [100]
    assert len(told) > 2


def two_cubes(cube: vs.Mesh) -> vs.Mesh:
    n = len(cube.points)
    return vs.mesh(np.concatenate([cube.points, cube.points + 1.0]), np.concatenate([cube.cells, cube.cells + n]))


@pytest.mark.parametrize(
    ("fixed", "words"),
    [
        (lambda x: x[:, 0] > 9, "fixed: the predicate selects no node"),
        ("botom", "did you mean 'bottom'"),
        (lambda x: x[:, 0] > -9, "every node is fixed"),
    ],
)
def test_supports_that_cannot_be(cube: vs.Mesh, fixed: Any, words: str) -> None:
    with pytest.raises(vs.VisceraError, match=words):
        Organ(cube, SOFT, fixed=fixed)


@pytest.mark.parametrize(
    "ask",
    [
        lambda organ: organ.solve(force={"top": (0, 0, -1.0)}),
        lambda organ: organ.solve(displacement={"top": (0, None, -0.1)}),
        lambda organ: organ.path(force={"top": (0, 0, -1.0)}),
        lambda organ: organ.stepper(),
        lambda organ: organ.reduce("top", order=2),
        lambda organ: organ.pgd("top", load=1.0, order=2),
        lambda organ: organ.unloaded(gravity=(0, 0, -1.0), density=100.0),
        lambda organ: organ.register(points=(organ.mesh.points[:4], 0.0 * organ.mesh.points[:4])),
    ],
)
def test_an_organ_that_nothing_holds_is_refused(cube: vs.Mesh, ask: Any) -> None:
    with pytest.raises(vs.VisceraError, match=r"nothing is fixed|can still move rigidly \(1 of its 6"):
        ask(Organ(cube, SOFT))


def test_displacements_hold_an_organ(cube: vs.Mesh) -> None:
    """In statics and in frames, as fixed nodes do."""
    ends = {"bottom": (0, 0, 0), "top": (0, 0, -0.02)}
    fixed = Organ(cube, SOFT, fixed="bottom").solve(displacement={"top": (0, 0, -0.02)}).displacement
    free = Organ(cube, SOFT)
    assert abs(free.solve(displacement=ends).displacement - fixed).max() < 1e-9
    assert abs(free.stepper(ends, iterations=20, settled=1e-9).frame().displacement - fixed).max() < 1e-9


def test_with_inertia_an_organ_falls_freely(cube: vs.Mesh) -> None:
    """By backward Euler: after n frames of h it has fallen n (n + 1) / 2 g h^2."""
    stepper = Organ(cube, SOFT).stepper(density=1e3, time_step=0.01, dynamics="backward_euler", iterations=5)
    for _ in range(10):
        frame = stepper.frame(gravity=(0, 0, -9.81))
    assert frame.displacement[:, 2] == pytest.approx(-9.81 * 0.01**2 * 55, rel=1e-6)


def test_a_loose_part_is_refused(cube: vs.Mesh) -> None:
    pair = two_cubes(cube)
    with pytest.raises(vs.VisceraError, match="1 of the mesh's 2 disconnected parts have no fixed node"):
        Organ(pair, SOFT, fixed=cube.nodes("bottom")).solve()
    assert Organ(pair, SOFT, fixed=lambda x: x[:, 2] % 1.0 == 0).solve().is_converged


@pytest.mark.parametrize("element", ["P1", "P2"])
def test_parts_on_a_hinge_are_held_each_by_itself_or_named(bar: vs.Mesh, element: str) -> None:
    """A bar and its mirror image about its last point, 80, held on one side only: the other turns about that point."""
    number = np.append(np.arange(81, 161), 80)
    points = np.vstack([bar.points, 2.0 * bar.points[80] - bar.points[:80]])
    both = vs.mesh(points, np.vstack([bar.cells, number[bar.cells]]), {"root": bar.nodes("root")})
    law, load = vs.NeoHookean(young=1e5, poisson=0.3), {(160,): (0.0, 0.0, 0.01)}
    organ = vs.Organ(both, law, fixed="root", element=element)
    words = (
        r"part with node 81 can still move rigidly \(3 of its 6 .*; it shares node 80 with another part, but no face"
    )
    with pytest.raises(vs.VisceraError, match=words):
        organ.solve(force=load)
    one_more = vs.Organ(both, law, fixed=[*bar.nodes("root"), 81], element=element)
    with pytest.raises(vs.VisceraError, match=r"1 of its 6 rigid motions"):  # about the line of the two points
        one_more.solve(force=load)
    assert vs.Organ(both, law, fixed=[*bar.nodes("root"), 81, 83], element=element).solve(force=load).is_converged


def test_a_hinge_is_refused_until_something_holds_it(cube: vs.Mesh) -> None:
    hinge = Organ(cube, SOFT, fixed=lambda x: (x[:, 0] == 0) & (x[:, 2] == 0))
    with pytest.raises(vs.VisceraError, match="can still move rigidly"):
        hinge.solve(gravity=(0, 0, -9.81), density=1000)
    with pytest.raises(vs.VisceraError, match="can still move rigidly"):
        hinge.reduce()
    assert hinge.solve(displacement={"corner": (None, None, 0.0)}, gravity=(0, 0, -9.81), density=100).is_converged
    assert hinge.solve(displacement={hinge.patch((0.1, 0.05, 0.1), 0.03): (0, 0, -0.001)}).is_converged


@pytest.mark.parametrize(
    ("loads", "words"),
    [
        ({"displacement": {"tip": (0, 0, np.nan)}}, "displacement of 'tip' must be three finite numbers"),
        ({"displacement": {"tip": (0, 0)}}, "displacement of 'tip' must be three lengths"),
        ({"displacement": {"tip": (None, None, None)}}, "leaves all components free"),
        ({"displacement": {"tip": np.zeros((2, 3))}}, r"shape \(9, 3\)"),
        ({"displacement": {"tipp": (0, 0, 0)}}, "did you mean 'tip'"),
        ({"displacement": {"root": (0, 0, 0.1)}}, "0 m along z by the fixed set and 0.1 m by 'root'"),
        ({"displacement": {"tip": (0, 0, 0.1), (80,): (0, 0, 0.2)}}, "node 80 .* 0.1 m along z by 'tip' and 0.2 m"),
        ({"force": {"root": (0, 0, 1)}}, "all nodes of 'root' are fixed"),
        ({"force": {"tip": (0, 0)}}, "force on 'tip' must be three finite numbers"),
        ({"force": {"tip": (0, 0, np.inf)}}, "force on 'tip' must be three finite numbers"),
        ({"force": {(): (0, 0, 1)}}, "no nodes"),
        ({"force": {lambda x: x[:, 0] > 9: (0, 0, 1)}}, "selects no node"),
        ({"force": np.zeros((3, 3))}, "nodal forces have shape"),
        ({"gravity": (0, 0, -9.81)}, "gravity needs a density"),
        ({"gravity": (0, 0, -9.81), "density": -1.0}, "density must be a number above 0"),
        ({"gravity": (0, 0, -9.81), "density": np.ones(3)}, "one number or one per cell"),
        ({"steps": 0}, "steps must be a whole number from 1 to 10000, got 0"),
        ({"settings": {"tolerence": 1e-9}}, "tolerence"),
    ],
)
def test_loads_that_are_refused(clamped: Organ, loads: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        clamped.solve(**loads)


def test_the_same_component_prescribed_alike_twice_is_fine(clamped: Organ) -> None:
    state = clamped.solve(displacement={"tip": (0, 0, -0.01), (80,): (None, None, -0.01), "root": (0, 0, 0)})
    assert state.is_converged
    assert state.displacement[80, 2] == pytest.approx(-0.01, abs=1e-15)


def test_a_state_of_another_mesh_is_no_start(clamped: Organ, cube: vs.Mesh) -> None:
    other = Organ(cube, SOFT, fixed="bottom").solve()
    with pytest.raises(vs.VisceraError, match="another mesh"):
        clamped.solve(start=other)


def test_another_shape_has_the_same_cells(clamped: Organ, bar: vs.Mesh, cube: vs.Mesh) -> None:
    counts = (
        f"the mesh has {len(cube.points)} nodes and {len(cube.cells)} cells, and that of the organ "
        f"{len(bar.points)} and {len(bar.cells)}: fixed nodes go by their numbers"
    )
    scene = vs.Scene({"bar": clamped})
    for held in (clamped, scene):
        with pytest.raises(vs.VisceraError, match=counts):
            held.with_mesh(cube)
        with pytest.raises(vs.VisceraError, match=r"the mesh must be a viscera\.Mesh"):
            held.with_mesh("liver")  # type: ignore[arg-type]
    backwards = vs.mesh(bar.points[::-1], len(bar.points) - 1 - bar.cells)
    with pytest.raises(vs.VisceraError, match=r"cell 0 of the mesh joins the nodes \[.*\], and that of the organ \["):
        clamped.with_mesh(backwards)
    mirrored = clamped.with_mesh(vs.mesh(bar.points * [1, -1, 1], bar.cells, bar.sets))
    load = {"tip": (0, 0, -1.0)}
    assert mirrored.solve(force=load).energy == pytest.approx(clamped.solve(force=load).energy, rel=1e-9)


def test_the_law_must_fit_the_mesh(cube: vs.Mesh) -> None:
    with pytest.raises(vs.VisceraError, match="parameters for 2 cells, the mesh has 48"):
        Organ(cube, vs.NeoHookean(young=[1.0, 2.0], poisson=0.3), fixed="bottom")
    with pytest.raises(vs.VisceraError, match="must be one of viscera"):
        Organ(cube, "NeoHookean", fixed="bottom")  # type: ignore[arg-type]


def test_the_touchable_surface_keeps_clear_of_the_fixed_nodes(clamped: Organ) -> None:
    nodes = clamped.touchable(radius=0.1)
    assert set(nodes) <= set(clamped.mesh.surface_nodes)
    assert clamped.mesh.points[nodes, 0].min() > 0.1
    with pytest.raises(vs.VisceraError, match="no surface triangle is farther"):
        clamped.touchable(radius=0.42)
    with pytest.raises(vs.VisceraError, match="no whole free triangle"):
        clamped.touchable("root")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"depth": -0.01}, r"depth must be a number above 0 and at most 1000 \[m\], got -0.01"),
        ({"depth": 1.0}, "depth is 1 m; it may be at most the organ's diagonal, 0.424264 m"),
        ({"depth": 5000.0}, r"depth must be a number above 0 and at most 1000 \[m\], got 5000.0"),
        ({"depth": 0.0}, r"depth must be a number above 0 and at most 1000 \[m\], got 0.0"),
        ({"depth": np.nan}, "depth must be a number"),
        ({"radius": 0.0}, "radius must be a number above 0"),
        ({"order": 0}, "order must be a whole number from 2 to 8, got 0"),
        ({"order": 2.5}, "order must be a whole number"),
        ({"tolerance": 0.0}, "tolerance must be a number above 0 and below 1, got 0.0"),
        ({"touchable": "tipp"}, "did you mean 'tip'"),
        ({"touchable": [80]}, "no whole free triangle"),
    ],
)
def test_reductions_that_are_refused(clamped: Organ, options: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        clamped.reduce(**options)


def test_a_contact_narrower_than_the_mesh_is_taken_with_a_warning(
    clamped: Organ, caplog: pytest.LogCaptureFixture
) -> None:
    """Its edges are 50 mm long, and diagonals of 71 mm."""
    told = "mm, and edges of the surface are 56.9 mm long in the mean: the contact is at single nodes"
    clamped.patch((0.3, 0.05, 0.1), 0.03)
    clamped.reduce("tip", radius=0.03, depth=0.01, order=2)
    assert caplog.text == ""
    clamped.patch((0.3, 0.05, 0.1), 1e-9)
    assert f"the radius of the contact is 1e-06 {told}" in caplog.text
    clamped.patch((0.35, 0.05, 0.1), 1e-9)
    assert len(caplog.records) == 1, "once for a radius"
    clamped.reduce("tip", radius=0.02, depth=0.01, order=2)
    assert f"the radius of the contact is 20 {told}" in caplog.text
    clamped.reduce("tip", depth=0.01, order=2, vary=vs.Vary("radius", 0.01, 0.08, nodes=2))
    assert f"the radius of the contact is 10 {told}" in caplog.text


def test_an_organ_at_rest_is_drawn(bar: vs.Mesh, tmp_path: Path) -> None:
    """Fixed nodes that face the eye as strong dots, the others faint; parts by their names."""
    organ = Organ(bar.with_cell_sets(nodule=lambda x: x[:, 0] > 0.3), SOFT, fixed="root")
    figure = organ.plot(tmp_path / "organ.png", title="a bar")
    assert (tmp_path / "organ.png").read_bytes().startswith(b"\x89PNG")
    (plot,) = figure.axes
    assert plot.get_title(loc="left") == "a bar"
    legend = plot.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["fixed (9 nodes)", "nodule"]
    hidden, seen = (len(np.asarray(c.get_offsets())) for c in plot.collections if isinstance(c, PathCollection))
    assert (hidden, seen) == (4, 5), "the eye is above, in front and to the right: it sees the upper and front edges"


def test_slack_fibres_are_no_ground_for_a_series(cube: vs.Mesh) -> None:
    fibres = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0)]
    slack = vs.HolzapfelGasserOgden(1e4, 1e4, 1.0, fibres=fibres, poisson=0.3)
    with pytest.raises(vs.VisceraError, match="fibres that go slack have no power series about rest"):
        Organ(cube, slack, fixed="bottom").reduce(order=2)
    both = vs.HolzapfelGasserOgden(1e4, 1e4, 1.0, fibres=fibres, poisson=0.3, bear_compression=True)
    touch = Organ(cube, both, fixed="bottom").reduce(radius=0.03, depth=0.005, order=2, tolerance=1e-2)
    law = touch.organ().law
    assert isinstance(law, vs.HolzapfelGasserOgden)
    assert law.bear_compression
    assert law.fibres == pytest.approx(both.fibres)
