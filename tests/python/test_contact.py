"""Rigid tools: what they press against, what they feel, and every way they can be refused."""

import importlib
import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import viscera as vs
from viscera.rotation import rotation_matrix

SIDE = 0.1
SOFT = vs.NeoHookean(young=10e3, poisson=0.3)


def wrong(value: object) -> Any:
    """For arguments that the types forbid."""
    return value


def block(n: int = 4, side: float = SIDE) -> vs.Mesh:
    """A cube of n^3 cubes, six cells each."""
    line = np.linspace(0.0, side, n + 1)
    points = np.array([(x, y, z) for z in line for y in line for x in line])
    corner = np.array([i + (n + 1) * (j + (n + 1) * k) for k, j, i in itertools.product(range(n), repeat=3)])
    steps = (1, n + 1, (n + 1) ** 2)
    cells = []
    for order in itertools.permutations(steps):
        cells.append(np.stack([corner, *(corner + sum(order[: k + 1]) for k in range(3))], axis=1))
    return vs.mesh(points, np.vstack(cells), {"base": np.flatnonzero(points[:, 2] == 0.0)})


@pytest.fixture(scope="module")
def organ() -> vs.Organ:
    return vs.Organ(block(), SOFT, fixed="base")


def above(shape: vs.Sphere, height: float, **told: object) -> vs.Tool:
    return vs.Tool(shape, position=(0.05, 0.05, SIDE + height), **told)  # type: ignore[arg-type]


@pytest.mark.parametrize("solver", ["cholesky", "cg"])
@pytest.mark.parametrize("element", ["P1", "P2"])
def test_a_pressed_sphere_is_carried_by_the_base(solver: str, element: str) -> None:
    organ = vs.Organ(block(3), SOFT, fixed="base", element=element)
    tool = above(vs.Sphere("30 mm"), 0.03, displacement=(0, 0, -0.008))
    state = organ.solve(contact=[tool], solver=solver, throw=True)
    contact = state.contact(tool)
    assert np.allclose(state.force(tool), -state.reaction("base"), atol=1e-6 * abs(contact.force[2]))
    assert contact.force[2] < 0.0
    assert contact.pressures.min() >= 0.0
    assert -1e-3 * organ.mesh.diagonal < contact.gap < 0.0


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_frames_of_a_sphere_pressed_into_the_liver_settle(friction: float) -> None:
    """In 20 frames of at most 8 iterations, 10 mm deep: no step leaves the tool for good, or the tool the layer."""
    liver = vs.Organ(vs.organs.liver(), vs.NeoHookean(young=5e3, poisson=0.45), fixed="hilum")
    top, radius = liver.mesh.points[liver.mesh.points[:, 2].argmax()], 0.015
    stepper = liver.stepper(solver="cg", iterations=8)
    tool = stepper.tool(vs.Sphere(radius), position=(*top[:2], top[2] + radius), friction=friction)
    gaps = []
    for _ in range(20):
        tool.move((0, 0, -0.0005))
        frame = stepper.frame()
        assert frame.is_settled
        gaps.append(frame.contact(tool).gap)
    assert min(gaps) > -1e-3 * liver.mesh.diagonal


def test_a_needle_that_goes_in_is_noticed() -> None:
    """Coarse surfaces have no sample near it: without a look into the cells it would be far away and at rest."""
    organ = vs.Organ(block(2), SOFT, fixed="base")
    needle, place = vs.Capsule("1 mm", "80 mm"), np.array((0.043, 0.051, SIDE + 0.0415))
    stepper = organ.stepper(iterations=5)
    tool = stepper.tool(needle, position=place)
    assert not stepper.frame().contact(tool).is_inside
    tool.move((0, 0, -0.01))
    frame = stepper.frame()
    assert frame.contact(tool).is_inside
    assert not frame.is_settled
    assert "not settled, the Instrument(Capsule(radius=0.001, length=0.08), position=" in repr(frame)
    assert "is inside the organ" in repr(frame)
    with pytest.raises(vs.VisceraError, match="starts inside the organ; start it outside"):
        stepper.tool(vs.Sphere("5 mm"), position=(0.04, 0.05, 0.06))
    state = organ.solve(contact=[vs.Tool(needle, position=place, displacement=(0, 0, -0.01))])
    assert not state.is_converged
    assert "goes into the organ between the samples of its surface" in state.message


def test_unloading_is_loading_backwards(organ: vs.Organ) -> None:
    """Without friction contact has a potential: the force depends on where the sphere is, not on how it came there."""
    shape = vs.Sphere(0.03)
    once = above(shape, 0.03, displacement=(0, 0, -0.006))
    deep = above(shape, 0.03, displacement=(0, 0, -0.012))
    state = organ.solve(contact=[deep], throw=True)
    back = vs.Tool(shape, deep.arrived().position, displacement=(0, 0, 0.006))
    returned = organ.solve(contact=[back], start=state, throw=True)
    loaded = organ.solve(contact=[once], throw=True)
    assert np.allclose(returned.force(back), loaded.force(once), atol=1e-6 * abs(loaded.force(once)[2]))


def test_a_capsule_presses_as_far_as_it_reaches(organ: vs.Organ) -> None:
    lying = vs.Tool(
        vs.Capsule("10 mm", "40 mm"), (0.05, 0.05, SIDE + 0.01), (0, np.pi / 2, 0), displacement=(0, 0, -0.005)
    )
    state = organ.solve(contact=[lying], throw=True)
    touched = organ.mesh.points[state.contact(lying).pressures > 0.0]
    assert np.ptp(touched[:, 0]) > np.ptp(touched[:, 1])
    assert abs(state.torque(lying)[0]) < 1e-9  # nothing rubs, so nothing turns it about its own axis


def test_a_box_and_the_closed_surface_of_it_are_the_same_tool(organ: vs.Organ) -> None:
    box = block(1, 0.04)
    corner = vs.Tool(vs.Shape(box), (0.03, 0.03, SIDE), displacement=(0, 0, -0.004))
    centred = vs.Tool(vs.Box(0.04), (0.05, 0.05, SIDE + 0.02), displacement=(0, 0, -0.004))
    one, other = (organ.solve(contact=[tool], throw=True).force(tool) for tool in (corner, centred))
    assert np.allclose(one, other, atol=1e-5 * abs(one[2]))


def test_friction_drags_and_is_bounded(organ: vs.Organ) -> None:
    drags = {}
    for friction in (0.0, 0.3, "bonded"):
        tool = above(vs.Sphere(0.03), 0.03, friction=friction, displacement=(0, 0, -0.008))
        state = organ.solve(contact=[tool], throw=True)
        dragged = tool.arrived()
        dragged.displacement = np.array((0.02, 0.0, 0.0))
        drawn = organ.solve(contact=[dragged], start=state, steps=4, throw=True)
        drags[friction] = drawn.force(dragged)
    assert drags[0.3][0] > drags[0.0][0]
    assert drags["bonded"][0] > drags[0.3][0]


@pytest.mark.parametrize("friction", [0.3, "bonded"])
def test_a_solve_goes_on_with_what_stuck_to_the_tool(organ: vs.Organ, friction: float | str) -> None:
    """A tool that is pulled aside and then stands still keeps its force; drawn back, it does as in frames."""
    down, aside, back = np.array([(0.0, 0.0, -0.008), (0.01, 0.0, 0.0), (-0.002, 0.0, 0.0)])
    tool, state = above(vs.Sphere(0.03), 0.03, friction=friction), None
    forces = []
    for motion in (down, aside, np.zeros(3), back):
        tool = tool.arrived()
        tool.displacement = motion
        state = organ.solve(contact=[tool], start=state, steps=4, throw=True)
        forces.append(state.force(tool))
    drawn, still, returned = forces[1:]
    assert np.allclose(still, drawn, rtol=1e-6)
    stepper = organ.stepper(iterations=40, settled=1e-8)
    moved = stepper.tool(tool.shape, position=(0.05, 0.05, SIDE + 0.03), friction=friction)
    for motion in (down, aside, back):
        for _ in range(4):
            moved.move(motion / 4)
            frame = stepper.frame()
    assert np.allclose(returned, frame.force(moved), rtol=0.01, atol=0.01 * np.linalg.norm(drawn))
    anew = vs.Tool(vs.Sphere(0.03), tool.arrived().position, friction=friction)
    assert not np.allclose(organ.solve(contact=[anew], start=state).force(anew), returned, rtol=0.01)


def test_a_tool_moves_with_frames_and_lets_go(organ: vs.Organ) -> None:
    stepper = organ.stepper(iterations=10, settled=1e-6)
    tool = stepper.tool(vs.Sphere(0.03), position=(0.05, 0.05, SIDE + 0.03))
    for _ in range(8):
        tool.move((0, 0, -0.001))
        frame = stepper.frame()
    assert frame.is_settled
    still = above(vs.Sphere(0.03), 0.03, displacement=(0, 0, -0.008))
    exact = organ.solve(contact=[still], throw=True)
    assert np.allclose(frame.force(tool), exact.force(still), rtol=1e-4, atol=1e-6)
    assert np.allclose(frame.displacement, exact.displacement, atol=1e-7)
    tool.remove()
    assert np.abs([stepper.frame() for _ in range(3)][-1].displacement).max() < 1e-8
    with pytest.raises(vs.VisceraError, match="no tool of this frame"):
        stepper.frame().force(tool)


@pytest.mark.parametrize("solver", ["cholesky", "cg"])
def test_a_hand_on_a_patch_does_not_disturb_a_tool(organ: vs.Organ, solver: str) -> None:
    """The mean of a patch that stands still is rounded; frames settle as those with a hand on nodes do."""
    hold = organ.patch((0.02, 0.0, 0.08), 0.03)
    stepper = organ.stepper(iterations=10, solver=solver)
    tool = stepper.tool(vs.Sphere("30 mm"), position=(0.05, 0.05, SIDE + 0.0301))
    hand = stepper.grasp(hold)
    for _ in range(6):
        tool.move((0, 0, -0.001))
        frame = stepper.frame()
        assert frame.is_settled, frame
    pressed = above(vs.Sphere("30 mm"), 0.0301, displacement=(0, 0, -0.006))
    state = organ.solve(displacement={hold: (0, 0, 0)}, contact=[pressed], throw=True)
    assert frame.force(tool) == pytest.approx(state.force(pressed), rel=2e-3, abs=1e-4)
    assert hand.force == pytest.approx(state.reaction(hold), rel=1e-2, abs=1e-3)


def test_two_tools_each_feel_their_own(organ: vs.Organ) -> None:
    stepper = organ.stepper(iterations=10, settled=1e-6)
    left = stepper.tool(vs.Sphere(0.02), position=(0.02, 0.05, SIDE + 0.02))
    right = stepper.tool(vs.Sphere(0.02), position=(0.08, 0.05, SIDE + 0.02))
    for _ in range(4):
        left.move((0, 0, -0.001))
        frame = stepper.frame()
    assert frame.force(left)[2] < 0.0
    assert frame.contact(right).touching == 0
    assert frame.contact(right).gap > 0.0


def test_an_assigned_pose_is_that_of_the_next_frame(organ: vs.Organ) -> None:
    """As by `move` and `turn`, to the last bit."""
    forces = []
    for assigns in (False, True):
        stepper = organ.stepper(iterations=10)
        tool = stepper.tool(vs.Capsule(0.02, 0.03), position=(0.05, 0.05, SIDE + 0.02), rotation=(0, np.pi / 2, 0))
        first = stepper.frame().force(tool)
        if assigns:
            tool.position = np.add(tool.position, (0, 0, -0.004))
            tool.rotation = rotation_matrix((0, 0.1, 0)) @ tool.rotation
        else:
            tool.move((0, 0, -0.004))
            tool.turn((0, 0.1, 0))
        forces.append(stepper.frame().force(tool))
        assert forces[-1][2] < first[2] - 0.1
    assert forces[0].tolist() == forces[1].tolist()


def test_a_pose_is_not_changed_in_place(organ: vs.Organ) -> None:
    template = vs.Tool(vs.Sphere(0.02), position=(0.05, 0.05, SIDE + 0.02))
    tool = organ.stepper().tool(template)
    for pose in (tool.position, tool.rotation):
        with pytest.raises(ValueError, match="read-only"):
            pose += 0.001
    tool.position = (0.05, 0.05, SIDE + 0.03)
    assert template.position.tolist() == [0.05, 0.05, SIDE + 0.02]
    for name, value in (("position", (0, 0, np.nan)), ("position", None), ("rotation", 2 * np.eye(3))):
        with pytest.raises(vs.VisceraError, match=f"the {name} of a tool must be"):
            setattr(tool, name, value)
    assert tool.position.tolist() == [0.05, 0.05, SIDE + 0.03]


def test_a_tool_that_was_removed_says_so(organ: vs.Organ) -> None:
    stepper = organ.stepper()
    tool = stepper.tool(vs.Sphere(0.02), (0.05, 0.05, SIDE + 0.02))
    there = stepper.frame()
    assert repr(tool) == "Instrument(Sphere(radius=0.02), position=(0.05, 0.05, 0.12))"
    with pytest.raises(
        vs.VisceraError, match=r"^Instrument\(Sphere.*\)\) was no tool of this frame; make it by Stepper"
    ):
        organ.stepper().frame().force(tool)
    for _ in range(2):
        tool.remove()
    acts: list[Callable[[], object]] = [
        lambda: tool.move((0, 0, 0.001)),
        lambda: tool.turn((0, 0, 0.1)),
        lambda: setattr(tool, "position", (0.05, 0.05, SIDE + 0.04)),
    ]
    for act in acts:
        with pytest.raises(vs.VisceraError, match=r"^this tool was removed; make a new one by Stepper\.tool$"):
            act()
    with pytest.raises(vs.VisceraError, match=r"^Instrument.*, removed\) was no tool .* from before it was removed"):
        stepper.frame().force(tool)
    assert there.force(tool).shape == (3,)


def test_what_is_assigned_to_a_tool_is_checked(organ: vs.Organ) -> None:
    """Tuples become arrays as in the constructor, and what it refuses is refused in the same words."""
    tool = above(vs.Sphere(0.03), 0.03)
    tool.displacement = wrong((0, 0, -0.008))
    tool.rotation = wrong((0, 0, 1.0))
    assert tool.rotation[0, 0] == pytest.approx(np.cos(1.0))
    other = above(vs.Sphere(0.03), 0.03, displacement=(0, 0, -0.008))
    forces = [organ.solve(contact=[each]).force(each) for each in (tool, other)]
    assert forces[0] == pytest.approx(forces[1], rel=1e-6, abs=1e-9)
    for name, value in {
        "shape": 3,
        "position": (0, 0),
        "rotation": 2 * np.eye(3),
        "friction": "sticky",
        "displacement": (0, 0, np.nan),
        "turn": "half",
        "stiffness": 0.0,
    }.items():
        told = {"shape": vs.Sphere(0.03), name: value}
        with pytest.raises(vs.VisceraError, match=f"the {name} of a tool must be") as made:
            vs.Tool(**told)  # type: ignore[arg-type]
        with pytest.raises(vs.VisceraError) as assigned:
            setattr(tool, name, value)
        assert str(assigned.value) == str(made.value)


def test_a_tool_is_named_once(organ: vs.Organ) -> None:
    shape = vs.Sphere(0.02)
    left, right = (vs.Tool(shape, position=(x, 0.05, SIDE + 0.02), displacement=(0, 0, -0.004)) for x in (0.02, 0.08))
    for twice in ([left, right, left], [shape, shape]):
        with pytest.raises(vs.VisceraError, match=r"contact: .*Sphere.* is named twice and would act twice"):
            organ.solve(contact=twice)
    state = organ.solve(contact=[left, right])
    assert state.force(left)[2] < -0.1
    with pytest.raises(vs.VisceraError, match=r"2 tools of this solve have the shape Sphere\(radius=0.02\); ask by"):
        state.force(shape)
    assert organ.solve(contact=[left]).force(shape)[2] < -0.1


def test_a_stepper_takes_a_tool_as_it_is_and_once(organ: vs.Organ) -> None:
    stepper = organ.stepper()
    tool = vs.Tool(vs.Sphere(0.02), position=(0.05, 0.05, SIDE + 0.02), friction=0.2)
    for name, value in {"position": (0, 0, 1), "rotation": np.eye(3), "friction": 0.5}.items():
        with pytest.raises(vs.VisceraError, match=f"has its own {name}; leave it out"):
            stepper.tool(tool, **wrong({name: value}))
    stepper.tool(tool)
    with pytest.raises(vs.VisceraError, match="is in this stepper already and would act twice"):
        stepper.tool(tool)
    for motion in ({"displacement": (0, 0, -0.001)}, {"turn": (0, 0, 0.1)}):
        with pytest.raises(vs.VisceraError, match="by which only a solve moves it; in frames the bodies"):
            stepper.tool(vs.Tool(vs.Sphere(0.02), position=(0.02, 0.05, SIDE + 0.02), **wrong(motion)))
    assert len(stepper._tools) == 1


def doubled(side: int) -> vs.Shape:
    """A box with another wall within it, which faces outwards or, with -1, bounds a cavity."""
    outer = block(1)
    inner = 0.05 + 0.9 * (outer.points - 0.05)
    triangles = np.vstack([outer.surface, len(inner) + outer.surface[:, ::side]])
    return vs.Shape((np.vstack([outer.points, inner]), triangles))


def test_a_shape_may_have_a_cavity_and_parts_beside_each_other() -> None:
    cavity = doubled(-1)._core.distance(np.array([[0.05, 0.05, 0.05], [0.0025, 0.05, 0.05]]))
    assert cavity == pytest.approx([0.045, -0.0025])
    one = block(1)
    triangles = np.vstack([one.surface, len(one.points) + one.surface])
    both = vs.Shape((np.vstack([one.points, one.points + np.array([0.2, 0, 0])]), triangles))
    assert both._core.distance(np.array([[0.25, 0.05, 0.05]])) == pytest.approx([-0.05])


def test_what_cannot_be_is_refused(organ: vs.Organ) -> None:
    sphere = vs.Sphere(0.02)
    closed = block(1)
    refusals: dict[str, Callable[[], object]] = {
        "a length above 0": lambda: vs.Sphere(-0.01),
        "radius of a sphere: a percentage of what": lambda: vs.Sphere("10%"),
        "rounding of a box: a percentage of what": lambda: vs.Box((0.1, 0.1, 0.1), rounding="10%"),
        "rounding of a box is 0.1": lambda: vs.Box((0.1, 0.1, 0.1), rounding=0.1),
        r"not closed: edge \[\d+, \d+\], from \(.*\) to \(.*\) m, has one triangle": lambda: vs.Shape(
            (closed.points, closed.surface[1:])
        ),
        "inside out": lambda: vs.Shape((closed.points, closed.surface[:, ::-1])),
        r"a wall of 12 triangles within another one, at \(.*\) m, and both face outwards": lambda: doubled(1),
        "this one has no triangles": lambda: vs.Shape((closed.points, np.zeros((0, 3)))),
        r"uses point 7e\+20; it has 8 points": lambda: vs.Shape((closed.points, closed.surface * 1e20)),
        "must be indices": lambda: vs.Shape((closed.points, closed.surface - 1.5)),
        "position of a tool must be three finite": lambda: vs.Tool(sphere, position=(0, 0, np.nan)),
        "orthogonal matrix": lambda: vs.Tool(sphere, rotation=2 * np.eye(3)),
        "friction of a tool must be a number from 0": lambda: vs.Tool(sphere, friction=-0.1),
        r'friction of a tool must be .* or "bonded", got \'stick\'': lambda: vs.Tool(sphere, friction="stick"),
        "shape of a tool must be": lambda: vs.Tool(0.01),  # type: ignore[arg-type]
        "contact must be a list of tools": lambda: organ.solve(contact=vs.Tool(sphere)),  # type: ignore[arg-type]
        "a tool of contact must be": lambda: organ.solve(contact=["sphere"]),  # type: ignore[list-item]
        "inside the organ": lambda: organ.solve(contact=[above(sphere, 0.015)]),
        "start it outside": lambda: organ.stepper().tool(sphere, position=(0.05, 0.05, SIDE)),
        "no tool of this solve": lambda: organ.solve().force(sphere),
    }
    for sentence, ask in refusals.items():
        with pytest.raises(vs.VisceraError, match=sentence):
            ask()


@pytest.mark.parametrize("shape", ["sphere", "capsule", "box"])
def test_a_random_tool_keeps_out_and_the_energy_balance_holds(shape: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The beginning of `benchmarks/contact_soak.py`."""
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "benchmarks")
    soak = importlib.import_module("contact_soak").Soak(shape, seed=0)
    for _ in range(150):
        soak.frame()
    assert soak.tally.touched > 20
    assert soak.tally.wrong() == []


@pytest.mark.parametrize("friction", [0.0, 0.5, "bonded"])
def test_the_gap_is_that_of_the_surface_however_the_tool_rubs(bar: vs.Mesh, friction: Any) -> None:
    """Of the nodes, where a plate presses a bar on its whole top."""
    high, turned = bar.points[:, 2].max(), (np.pi, 0, 0)
    organ = vs.Organ(bar, vs.NeoHookean(young=2e4, poisson=0.3), fixed="z < 1%")
    at = (0, 0, high + 1e-4)
    tool = vs.Tool(vs.HalfSpace(), position=at, rotation=turned, displacement=(0, 0, -0.005), friction=friction)
    state = organ.solve(contact=[tool], throw=True)
    top = bar.nodes("z > 99%")
    gaps = at[2] - 0.005 - (bar.points + state.displacement)[top, 2]
    assert state.contact(tool).force[2] < 0.0
    assert state.contact(tool).gap == pytest.approx(gaps.min(), rel=0.3)
