"""Contact of an organ with itself, at two of its places or all over: jaws that meet, in solves, frames and case files,
and refusals."""

import itertools
import pickle
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import viscera as vs
from viscera.cases.scene_case import SceneCase
from viscera.cli import main

SIDE, BASE, JAW = 0.1, 0.02, 0.04
SOFT = vs.NeoHookean(young=10e3, poisson=0.3)
WALLS = (("jaws", "left"), ("jaws", "right"))
CLOSING = (0.3, 0.6, 0.75, 0.8, 0.85, 0.9, 0.95, 1.0)
"""Frame by frame, the way of the jaws: by small steps where they meet."""


def jaws() -> vs.Mesh:
    """A U, 2 cm between its jaws: a block of 5^3 cubes, six cells each, without the middle of its upper part. The
    heights of the nodes of the right jaw are not those of the left one."""
    n = 5
    line = np.linspace(0.0, SIDE, n + 1)
    points = np.array([(x, y, z) for z in line for y in line for x in line])
    corner = np.array([i + (n + 1) * (j + (n + 1) * k) for k, j, i in itertools.product(range(n), repeat=3)])
    cells = np.vstack(
        [
            np.stack([corner, *(corner + sum(order[: k + 1]) for k in range(3))], axis=1)
            for order in itertools.permutations((1, n + 1, (n + 1) ** 2))
        ]
    )
    middle = points[cells].mean(axis=1)
    used, cells = np.unique(cells[(abs(middle[:, 0] - SIDE / 2) > 0.01) | (middle[:, 2] < BASE)], return_inverse=True)
    points = points[used]
    x, _, z = points.T
    right = x > SIDE - JAW - 1e-9
    points[right, 2] += 0.004 * np.sin(np.pi * np.maximum(z[right] - BASE, 0.0) / (SIDE - BASE))
    walls = {"left": abs(x - JAW) < 1e-9, "right": abs(x - (SIDE - JAW)) < 1e-9}
    sets = {name: wall & (z > BASE - 1e-9) for name, wall in walls.items()}
    upper = z > 0.6 * SIDE
    sets |= {"west": (x == 0.0) & upper, "east": (x > 0.999 * SIDE) & upper, "base": z == 0.0}
    return vs.mesh(points, cells.reshape(-1, 4), {name: np.flatnonzero(chosen) for name, chosen in sets.items()})


def scene(*pairs: vs.ContactPair, element: str = "P1") -> vs.Scene:
    return vs.Scene({"jaws": vs.Organ(jaws(), SOFT, fixed="base", element=element)}, contacts=pairs)


def closing(by: float = 0.012, slide: float | None = None) -> dict[str, Any]:
    """The backs of the jaws moved towards each other, each by this much, and the right one along the other."""
    return {"jaws/west": (by, None, None), "jaws/east": (-by, slide, None)}


def closed(pair: vs.ContactPair) -> vs.Stepper:
    """In frames, the jaws pressed on each other."""
    stepper = scene(pair).stepper(closing(0.0, slide=0.0), iterations=60, settled=1e-6)
    for part in CLOSING:
        stepper.frame(closing(0.012 * part, slide=0.0))
    return stepper


@pytest.mark.parametrize("element", ["P1", "P1 mean volume", "P2"])
def test_jaws_that_meet_press_on_each_other(element: str) -> None:
    """Farther apart at rest than the reach: with every solver and in frames they bear the same."""
    pair, reverse = vs.ContactPair(*WALLS, reach="1 cm"), vs.ContactPair(*WALLS[::-1], reach="1 cm")
    one = scene(pair, element=element)
    state = one.solve(displacement=closing())
    assert state.is_converged
    told = state.contact(pair)
    assert told.force[0] < -0.5
    assert told.area > 0.1 * SIDE**2
    assert -1e-3 * SIDE < told.gap < 0.0
    # The left jaw is in balance: what its back and the base give it, the right one takes.
    held = sum(state.reaction(place) for place in ("jaws/west", "jaws/east", "jaws/base"))
    assert held == pytest.approx(np.zeros(3), abs=1e-6 * -told.force[0])
    without = scene(element=element).solve(displacement=closing())
    assert state.reaction("jaws/west")[0] > without.reaction("jaws/west")[0] + 0.5 * -told.force[0]

    other = scene(reverse, element=element).solve(displacement=closing())
    assert other.force(reverse) == pytest.approx(-told.force, abs=1e-6 * -told.force[0])
    # However it comes there, it samples the pieces that the surfaces share in the end.
    for way in ({"solver": "cg"}, {"steps": 4}):
        again = one.solve(displacement=closing(), **way)
        assert abs(again.displacement - state.displacement).max() < 1e-7 * SIDE, way
    for solver in ("cholesky", "cg"):
        stepper = one.stepper(closing(0.0), iterations=40, settled=1e-7, solver=solver)
        for part in CLOSING:
            frame = stepper.frame(closing(0.012 * part))
        assert frame.is_settled
        assert abs(frame.displacement - state.displacement).max() < 1e-5 * SIDE
        assert frame.force(pair) == pytest.approx(told.force, abs=1e-4 * -told.force[0])


def test_jaws_slide_along_each_other_with_friction() -> None:
    """One is dragged along the other: at the cone it slides, and the drag is dissipated."""
    pair = vs.ContactPair(*WALLS, friction=0.3)
    stepper = closed(pair)
    for slide in np.linspace(0.0, 0.006, 7):
        frame = stepper.frame(closing(slide=slide))
        assert frame.is_settled, slide
        told = frame.contact(pair)
        assert told.dissipation >= 0.0
        assert np.hypot(*told.force[1:]) <= 0.301 * -told.force[0]
    # They twist, so that the slides are not parallel, and some samples still stick.
    assert told.sliding > 0.5 * told.touching > 0
    assert told.dissipation > 0.0
    assert told.force[1] > 0.2 * -told.force[0]  # dragged towards positive y


def test_lobes_folded_onto_each_other_settle_in_balance() -> None:
    """Forces on the backs push the jaws together, more in every frame: their work is the strain's and the contact's."""
    pair = vs.ContactPair(*WALLS)
    one = scene(pair)
    stepper = one.stepper(iterations=60, settled=1e-7)
    push, frames = 1.5, 30
    force = np.zeros_like(one.mesh.points)
    for back, sign in (("jaws/west", 1.0), ("jaws/east", -1.0)):
        nodes = one.mesh.nodes(back)
        force[nodes, 0] = sign * push / len(nodes)
    work, moved = 0.0, np.zeros_like(force)
    for number in range(1, frames + 1):
        frame = stepper.frame(force=number / frames * force)
        assert frame.is_settled, number
        work += (number - 0.5) / frames * np.vdot(force, frame.displacement - moved)
        moved = frame.displacement
    told = frame.contact(pair)
    assert told.force[0] < -0.5 * push
    assert -1e-3 * SIDE < told.gap < 0.0
    assert frame.energy + told.energy == pytest.approx(work, rel=5e-3)
    frame = stepper.frame()
    assert frame.is_settled
    assert abs(frame.displacement).max() < 1e-6 * SIDE
    assert frame.contact(pair).touching == 0


def test_jaws_apart_move_as_if_there_was_no_pair() -> None:
    pair = vs.ContactPair(*WALLS, reach="1 cm")
    one, alone = scene(pair), scene()
    load: dict[str, Any] = {"displacement": closing(0.004), "force": {"jaws/left": (0.0, 0.0, 0.1)}}
    state = one.solve(**load)
    assert np.array_equal(state.displacement, alone.solve(**load).displacement)
    assert state.contact(pair).gap == np.inf
    steppers = [each.stepper(closing(0.0), iterations=5) for each in (one, alone)]
    for by in (0.002, 0.004):
        frames = [stepper.frame(closing(by)) for stepper in steppers]
        assert np.array_equal(frames[0].displacement, frames[1].displacement)


def test_a_case_file_keeps_the_pair(tmp_path: Path) -> None:
    pair = vs.ContactPair(("jaws", "left"), ("jaws", "x > 59% and 1.9 cm < z"), friction=0.2, reach="8 mm")
    one = scene(pair)
    written = one.to_case(tmp_path / "jaws.toml", loads={"displacement": closing()}, settings={"steps": 2})
    assert isinstance(written, SceneCase)
    assert written.contacts[0]["first"] == "jaws/left"
    again = written.organ()
    state, other = one.solve(displacement=closing(), steps=2), written.solve(again)
    assert state.is_converged
    assert abs(state.displacement - other.displacement).max() < 1e-9
    (told,) = written.facts(again, other)["contacts"]
    assert told["force"] == pytest.approx(state.force(pair), rel=1e-6, abs=1e-8)
    copy = pickle.loads(pickle.dumps(one))
    assert np.array_equal(copy.solve(displacement=closing(), steps=2).displacement, state.displacement)


@pytest.mark.parametrize("element", ["P1", "P2"])
def test_a_surface_touches_itself_as_its_places_touch_each_other(element: str) -> None:
    """Without names the jaws bear what they bear between their walls: by both solvers and in frames."""
    walls, own = vs.ContactPair(*WALLS), vs.ContactPair("jaws")
    between = scene(walls, element=element).solve(displacement=closing())
    one = scene(own, element=element)
    state = one.solve(displacement=closing())
    assert state.is_converged
    press = between.reaction("jaws/west")[0]
    assert state.reaction("jaws/west")[0] == pytest.approx(press, rel=0.01)
    told, named = state.contact(own), between.contact(walls)
    assert told.area == pytest.approx(named.area, rel=0.05)
    assert -1e-3 * SIDE < told.gap < 0.0
    assert not np.any(told.force)
    touched = told.pressures > 0.0
    assert set(np.flatnonzero(touched)) <= set(one.mesh.nodes("jaws/left")) | set(one.mesh.nodes("jaws/right"))
    # However it comes there, it samples the pieces that the surfaces share in the end.
    for way in ({"solver": "cg"}, {"steps": 4}):
        again = one.solve(displacement=closing(), **way)
        assert abs(again.displacement - state.displacement).max() < 1e-7 * SIDE, way
    stepper = one.stepper(closing(0.0), iterations=40, settled=1e-7)
    for part in CLOSING:
        frame = stepper.frame(closing(0.012 * part))
    assert frame.is_settled
    assert abs(frame.displacement - state.displacement).max() < 1e-5 * SIDE


def test_a_surface_that_only_bends_does_not_touch_itself() -> None:
    """A thin plate rolled half up: front, back and neighbours are near each other, and none of them touches."""
    points = np.array([(x, y, z) for z in (0.0, 0.002) for y in (0.0, 0.01, 0.02) for x in np.linspace(0, 0.1, 31)])
    corner = np.array([i + 31 * (j + 3 * 0) for j in range(2) for i in range(30)])
    cells = np.vstack(
        [
            np.stack([corner, *(corner + sum(order[: k + 1]) for k in range(3))], axis=1)
            for order in itertools.permutations((1, 31, 93))
        ]
    )
    organ = vs.Organ(vs.mesh(points, cells, {"end": points[:, 0] > 0.0999}), SOFT, fixed="x < 1%")
    pair = vs.ContactPair("plate", reach="4 mm")
    one = vs.Scene({"plate": organ}, contacts=[pair])
    bend = {"plate/end": (-0.03, None, 0.05)}
    state, free = one.solve(displacement=bend, steps=8), vs.Scene({"plate": organ}).solve(displacement=bend, steps=8)
    assert state.is_converged
    assert state.contact(pair).touching == 0
    assert abs(state.displacement - free.displacement).max() < 1e-8


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_a_solve_that_stops_tells_the_contact_of_its_state(block: Any, friction: float) -> None:
    """A hook bent until it snaps: at the free nodes the forces balance, those of contact among them. The load step that
    failed led far away, and what it met there had forces of 200 N."""
    points, cells = block((6, 2, 4), (0.6, 0.2, 0.2))
    x, _, z = points[cells].mean(axis=1).T
    used, cells = np.unique(cells[(x < 0.1) | (abs(z - 0.1) > 0.05)], return_inverse=True)
    mesh = vs.mesh(points[used], cells.reshape(-1, 4), {"root": points[used][:, 0] == 0.0})
    pair = vs.ContactPair("hook", friction=friction)
    organ = vs.Organ(mesh, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root", element="P1")
    force = 20.0
    state = vs.Scene({"hook": organ}, contacts=[pair]).solve(
        force={"hook/x > 99% and z > 99%": (0, 0, -force)}, settings={"max_iterations": 25, "smallest_step": 0.002}
    )
    assert not state.is_converged
    assert 0.0 < state.load < 1.0
    assert state.contact(pair).touching > 0
    free = mesh.points[:, 0] > 0.0
    # The solve's own tolerance is 1e-8 of all nodal forces, which are some times the load.
    assert abs(state._nodal()["reaction"][free]).max() < 1e-7 * force


def test_a_lobe_that_slides_on_the_other_dissipates_without_names() -> None:
    pair = vs.ContactPair("jaws", friction=0.3)
    stepper = closed(pair)
    for slide in np.linspace(0.0, 0.006, 7):
        frame = stepper.frame(closing(slide=slide))
        assert frame.is_settled, slide
    told = frame.contact(pair)
    assert told.sliding > 0.5 * told.touching > 0
    assert told.dissipation > 0.0


def test_a_case_file_keeps_a_surface_that_touches_itself(tmp_path: Path) -> None:
    pair = vs.ContactPair("jaws", reach="3 mm")
    one = scene(pair)
    written = one.to_case(tmp_path / "jaws.toml", loads={"displacement": closing()})
    assert isinstance(written, SceneCase)
    assert "second" not in written.contacts[0]
    again = written.organ()
    assert again.contacts[0].second is None
    state, other = one.solve(displacement=closing()), written.solve(again)
    assert abs(state.displacement - other.displacement).max() < 1e-9
    (told,) = written.facts(again, other)["contacts"]
    assert told["first"] == "jaws"
    assert told["area"] == pytest.approx(state.contact(pair).area, rel=1e-6)
    copy = pickle.loads(pickle.dumps(one))
    assert repr(copy.contacts[0]) == "ContactPair(jaws)"


def test_a_mesh_that_crosses_itself_is_refused() -> None:
    one = jaws()
    moved = one.points * [1.0, 0.9, 1.0] + [0.05, 0.0, 0.013]
    mesh = vs.mesh(np.vstack([one.points, moved]), np.vstack([one.cells, one.cells + len(one.points)]))
    with pytest.raises(
        vs.VisceraError, match=r"the surface of ContactPair\(jaws\) crosses itself at rest at the point"
    ):
        vs.Scene({"jaws": vs.Organ(mesh, SOFT, fixed="z < 20%")}, contacts=[vs.ContactPair("jaws")])


@pytest.mark.parametrize(
    ("first", "second", "words"),
    [
        ("jaws", "jaws", r"ContactPair\(jaws, jaws\): an organ touches itself between two of its places, such as"),
        ("jaws", WALLS[1], r"or all over, as ContactPair\('jaws'\)"),
        (("jaws", "x < 70%"), ("jaws", "x > 50%"), r"faces at node 3, 9, 15, 21, 27 and 31 more of 'jaws'; .* without"),
        (("jaws", "west"), WALLS[0], r"overlap at rest: the point \(0.0.* inside the other.* faces each other from"),
        (("jaws", "0, 1"), WALLS[0], "the place of 'jaws' holds no triangle of its surface"),
    ],
)
def test_places_that_are_no_pair_are_refused(first: Any, second: Any, words: str) -> None:
    with pytest.raises(vs.VisceraError, match=words):
        scene(vs.ContactPair(first, second))


def test_the_command_tells_what_touches_itself(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene(vs.ContactPair("jaws")).to_case(tmp_path / "jaws.toml", loads={"displacement": closing()})
    assert main(["solve", str(tmp_path / "jaws.toml"), "-o", str(tmp_path / "jaws.vtu")]) == 0
    assert re.search(r"'jaws' and itself: 0, 0, 0 N over \d.* cm2, smallest gap -0.0\d+ mm", capsys.readouterr().out)
    assert (tmp_path / "jaws.vtu").exists()


def test_the_sides_of_a_cut_bear_each_other() -> None:
    """Two blocks of one mesh that lie on each other at rest, node on node: as between two places."""
    points = np.array([(x, y, z) for z in (0.0, 0.05, 0.1) for y in (0.0, 0.1) for x in (0.0, 0.1)])
    corner = np.array([0, 4])
    cells = np.vstack(
        [
            np.stack([corner, *(corner + sum(order[: k + 1]) for k in range(3))], axis=1)
            for order in itertools.permutations((1, 2, 4))
        ]
    )
    n = len(points)
    sets = {"below": np.arange(n), "above": n + np.arange(n), "top": n + np.flatnonzero(points[:, 2] > 0.09)}
    mesh = vs.mesh(np.vstack([points, points + np.array((0.0, 0.0, 0.1))]), np.vstack([cells, cells + n]), sets)
    organ = vs.Organ(mesh, SOFT, fixed="z < 1%", supports=[vs.ElasticSupport("top", 1.0)])
    held = []
    for pair in (vs.ContactPair("o"), vs.ContactPair(("o", "below"), ("o", "above"))):
        state = vs.Scene({"o": organ}, contacts=[pair]).solve(displacement={"o/top": (0, 0, -0.02)})
        assert state.is_converged
        assert state.contact(pair).gap < 0.0
        held.append(state.reaction("o/top")[2])
    assert held[0] < -5.0
    assert held[0] == pytest.approx(held[1], rel=1e-3)
