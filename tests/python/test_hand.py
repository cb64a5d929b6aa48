"""Hands that turn and pull: against static solves, the theory of torsion, the balance of moments, and bad input."""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np
import pytest

import viscera as vs
from viscera.errors import VisceraError
from viscera.rotation import mean_rotation, rotation_matrix

Block = Callable[..., tuple[np.ndarray, np.ndarray]]


@pytest.fixture(scope="module")
def organ(bar: vs.Mesh) -> vs.Organ:
    return vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.4), fixed="root")


def settle(stepper: vs.Stepper, frames: int = 12, **loads: object) -> vs.Frame:
    for _ in range(frames):
        frame = stepper.frame(**loads)  # type: ignore[arg-type]
        if frame.is_settled:
            return frame
    raise AssertionError(frame)


def support(organ: vs.Organ, frame: vs.Frame) -> tuple[np.ndarray, np.ndarray]:
    """Force and moment about the origin that the fixed nodes carry."""
    forces = frame._reactions[organ.fixed]
    return forces.sum(axis=0), np.cross(organ.mesh.points[organ.fixed], forces).sum(axis=0)


@pytest.mark.parametrize("place", ["tip", "patch"])
@pytest.mark.parametrize("solver", ["cholesky", "cg", "multigrid"])
def test_force_and_torque_balance_the_support(organ: vs.Organ, place: str, solver: str) -> None:
    stepper = organ.stepper(iterations=20, settled=1e-8, solver=solver)
    where = organ.patch((0.4, 0.05, 0.05), radius=0.09) if place == "patch" else place
    hand = stepper.grasp(where)
    for _ in range(5):
        hand.turn((0.1, 0.03, -0.02))
        hand.move((0.002, 0, -0.004))
        frame = stepper.frame()
    assert frame.is_settled
    force, moment = support(organ, frame)
    size = np.abs(hand.torque).max()
    assert size > 0.1
    assert np.allclose(force, -frame.force(hand), atol=1e-5 * size / 0.4)
    assert np.allclose(moment, -frame.torque(hand) - np.cross(hand.position, frame.force(hand)), atol=1e-5 * size)
    assert (hand.force == frame.force(hand)).all()
    assert (hand.torque == frame.torque(hand)).all()
    assert (frame.reaction(hand) == frame.force(hand)).all()


def test_hands_on_a_place_and_on_a_patch_that_share_nodes_balance_the_support(organ: vs.Organ) -> None:
    """The patch is turned, too: forces that hold its rotation act on the nodes of the place."""
    stepper = organ.stepper(iterations=20, settled=1e-8)
    patch = organ.patch((0.38, 0.05, 0.1), radius=0.06)
    assert np.intersect1d(patch.nodes, organ.mesh.nodes("tip")).size
    place, tool = stepper.grasp("tip"), stepper.grasp(patch)
    place.move((0.001, 0, -0.003))
    tool.move((0, 0, -0.004))
    tool.turn((0.02, 0.05, -0.02))
    frame = settle(stepper)
    force, moment = support(organ, frame)
    size = np.abs(tool.force).max()
    assert size > 1.0
    assert force + place.force + tool.force == pytest.approx(0.0, abs=1e-5 * size)
    assert frame.reaction("tip") == pytest.approx(place.force)
    for hand in (place, tool):
        moment = moment + hand.torque + np.cross(hand.position, hand.force)
    assert moment == pytest.approx(0.0, abs=1e-5 * size * 0.4)


def test_a_turned_tip_is_the_static_solve_with_the_same_motion(organ: vs.Organ) -> None:
    stepper = organ.stepper(iterations=30, settled=1e-9)
    hand = stepper.grasp("tip")
    for _ in range(10):
        hand.turn((0.05, 0, 0))
        hand.move((0, 0, -0.002))
        frame = stepper.frame()
    centre, tip = hand.position, organ.mesh.sets["tip"]
    turned = (organ.mesh.points[tip] - (centre + np.array((0, 0, 0.02)))) @ rotation_matrix((0.5, 0, 0)).T + centre
    exact = organ.solve(displacement={"tip": turned - organ.mesh.points[tip]}, throw=True)
    assert frame.displacement == pytest.approx(exact.displacement, abs=1e-7)
    assert frame.force(hand) == pytest.approx(exact.reaction("tip"), abs=1e-5 * np.abs(exact.reaction("tip")).max())


def rod(block: Block, across: int, along: int, radius: float, length: float) -> vs.Mesh:
    """A round rod along x: each square around the axis of a bar becomes a circle."""
    points, cells = block((along, across, across), (length, 2.0, 2.0))
    square = points[:, 1:] - 1.0
    norm = np.linalg.norm(square, axis=1)
    points[:, 1:] = radius * square * (np.abs(square).max(axis=1) / np.where(norm > 0.0, norm, 1.0))[:, None]
    ends = {"root": np.flatnonzero(points[:, 0] == 0.0), "tip": np.flatnonzero(points[:, 0] == length)}
    return vs.mesh(points, cells, ends)


def test_torsion_of_a_round_rod_is_saint_venants(block: Block) -> None:
    """A rod turned by 3 degrees: T = G J theta / L with J = pi R^4 / 2, within 0.2 per cent, by quadratic elements."""
    radius, length, young, poisson, angle = 0.01, 0.06, 1e5, 0.3, np.radians(3.0)
    mesh = rod(block, 4, 6, radius, length)
    organ = vs.Organ(mesh, vs.NeoHookean(young=young, poisson=poisson), fixed="root", element="P2")
    stepper = organ.stepper(iterations=20, settled=1e-8)
    hand = stepper.grasp("tip")
    hand.turn((angle, 0, 0))
    frame = stepper.frame()
    area = mesh.volume / length  # of the polygon, whose J is that of a disc of this area but for a thousandth
    theory = young / (2.0 * (1.0 + poisson)) * area**2 / (2.0 * np.pi) * angle / length
    assert frame.torque(hand)[0] == pytest.approx(theory, rel=0.002)
    assert np.abs(frame.torque(hand)[1:]).max() < 1e-3 * theory


def test_a_patch_is_held_by_its_mean_rotation(organ: vs.Organ) -> None:
    """Its mean rotation is what was asked; it starts from where the patch is, and the patch bulges as it likes."""
    stepper = organ.stepper(iterations=30, settled=1e-9)
    patch = organ.patch((0.4, 0.05, 0.05), radius=0.09)
    hand = stepper.grasp(patch)
    hand.move((0, 0, -0.05))
    bent = settle(stepper)
    assert (bent.torque(hand) == 0.0).all()
    hand.turn((0, 0, 0))
    assert not np.allclose(hand.rotation, np.eye(3), atol=1e-2)
    held = settle(stepper)
    assert held.displacement == pytest.approx(bent.displacement, abs=1e-7)
    hand.turn((0.3, 0, 0))
    frame = settle(stepper)
    places = frame.positions[patch.nodes]
    found = mean_rotation(
        patch.weights,
        organ.mesh.points[patch.nodes] - patch.weights @ organ.mesh.points[patch.nodes],
        places - patch.weights @ places,
    )
    assert found == pytest.approx(hand.rotation, abs=1e-9)
    assert patch.weights @ places == pytest.approx(hand.position, abs=1e-12)
    rigid = (organ.mesh.points[patch.nodes] - organ.mesh.points[patch.nodes].mean(axis=0)) @ hand.rotation.T
    assert np.abs(places - places.mean(axis=0) - rigid).max() > 1e-4


def test_an_assigned_pose_is_that_of_place(organ: vs.Organ) -> None:
    """On a patch, which holds its rotation from then on; what `place` refuses is refused."""
    torques = []
    for assigns in (False, True):
        stepper = organ.stepper(iterations=20)
        hand = stepper.grasp(organ.patch((0.4, 0.05, 0.05), radius=0.09))
        turn = rotation_matrix((0.1, 0, 0))
        if assigns:
            hand.rotation = turn
            hand.position = np.add(hand.position, (0, 0, -0.002))
            hand.position += (0, 0, -0.002)
        else:
            hand.place(np.add(hand.position, (0, 0, -0.004)), turn)
        torques.append(stepper.frame().torque(hand))
    assert torques[0][0] > 0.1
    assert torques[0] == pytest.approx(torques[1], rel=1e-9)
    with pytest.raises(ValueError, match="read-only"):
        hand.rotation += 0.1
    with pytest.raises(VisceraError, match="the position of a hand must be"):
        hand.position = (0, 0, np.nan)
    hand.pull((0, 0, -1.0))
    for name, value in {"position": hand.position, "rotation": turn}.items():
        with pytest.raises(VisceraError, match="a hand that a force pulls cannot be placed"):
            setattr(hand, name, value)


def test_what_is_turned_and_let_go_comes_back(organ: vs.Organ) -> None:
    stepper = organ.stepper(iterations=20, settled=1e-9)
    hand = stepper.grasp(organ.patch((0.4, 0.05, 0.05), radius=0.09))
    hand.turn((0.4, 0, 0))
    stepper.frame()
    hand.place(rotation=(0, 0, 0))
    frame = settle(stepper)
    assert np.abs(frame.displacement).max() < 1e-8
    assert np.abs(hand.torque).max() < 1e-5
    hand.release()
    assert np.abs(settle(stepper).displacement).max() < 1e-8


@pytest.mark.parametrize("solver", ["cholesky", "cg"])
@pytest.mark.parametrize("on_patch", [False, True])
def test_a_pulled_hand_settles_where_the_static_solve_does(organ: vs.Organ, on_patch: bool, solver: str) -> None:
    where = organ.patch((0.4, 0.05, 0.05), radius=0.09) if on_patch else "tip"
    force = (1.0, 0.5, -2.0)
    exact = organ.solve(force={where: force}, throw=True)
    stepper = organ.stepper(iterations=30, settled=1e-9, solver=solver)
    hand = stepper.grasp(where)
    hand.pull(force)
    frame = settle(stepper)
    assert frame.displacement == pytest.approx(exact.displacement, abs=1e-7)
    assert hand.force.tolist() == list(force)
    assert frame.torque(hand).tolist() == [0.0, 0.0, 0.0]
    nodes = where.nodes if on_patch else organ.mesh.nodes("tip")  # type: ignore[union-attr]
    assert hand.position == pytest.approx(hand._weights @ frame.positions[nodes], abs=1e-15)


@pytest.mark.parametrize("on_patch", [False, True])
def test_a_torque_turns_as_far_as_the_hand_that_needs_it(organ: vs.Organ, on_patch: bool) -> None:
    """Pulled with force and torque, then held: nothing moves, the same force and torque are felt, and they balance the
    support. The forces at its nodes are those of a static solve."""
    stepper = organ.stepper(iterations=60, settled=1e-9)
    hand = stepper.grasp(organ.patch((0.4, 0.05, 0.05), radius=0.09) if on_patch else "tip")
    force, torque = np.array((0.5, 0.0, -1.0)), np.array((1.0, 0.1, -0.2))
    hand.pull(force, torque)
    pulled = settle(stepper)
    assert np.degrees(np.arccos((np.trace(hand.rotation) - 1.0) / 2.0)) > 15.0
    carried, moment = support(organ, pulled)
    assert carried == pytest.approx(-force, abs=1e-6)
    assert moment == pytest.approx(-torque - np.cross(hand.position, force), abs=1e-6)
    arms = pulled.positions[hand._nodes] - hand.position
    inertia = np.einsum("i,ij,ik->jk", hand._weights, arms, arms)
    turning = np.linalg.solve(np.trace(inertia) * np.eye(3) - inertia, torque)
    nodal = np.zeros_like(organ.mesh.points)
    nodal[hand._nodes] = hand._weights[:, None] * (force + np.cross(turning, arms))
    exact = organ.solve(force=nodal, start=pulled.displacement, throw=True)
    assert pulled.displacement == pytest.approx(exact.displacement, abs=1e-6)
    hand.hold()
    held = settle(stepper)
    assert held.displacement == pytest.approx(pulled.displacement, abs=1e-7)
    assert hand.force == pytest.approx(force, abs=1e-5)
    assert hand.torque == pytest.approx(torque, abs=1e-5)


def test_a_hand_that_pulls_beside_loads_and_lets_go(organ: vs.Organ) -> None:
    stepper = organ.stepper(iterations=30, settled=1e-9)
    hand = stepper.grasp("tip")
    hand.pull((0, 0, -1.0))
    frame = settle(stepper, force={"tip": (0, 0, -1.0)}, gravity=(0, 0, -9.81), density=300)
    exact = organ.solve(force={"tip": (0, 0, -2.0)}, gravity=(0, 0, -9.81), density=300)
    assert frame.displacement == pytest.approx(exact.displacement, abs=1e-7)
    hand.release()
    assert np.abs(settle(stepper).displacement).max() < 1e-7


def test_hands_that_share_nodes_balance_the_support_together(organ: vs.Organ) -> None:
    stepper = organ.stepper(iterations=20, settled=1e-9)
    hands = [stepper.grasp("x > 99% and z > 40%"), stepper.grasp("x > 99% and z < 60%")]
    assert set(hands[0]._nodes) & set(hands[1]._nodes)
    for hand in hands:
        hand.move((0, 0, -0.01))
    frame = stepper.frame()
    force, _ = support(organ, frame)
    assert frame.is_settled
    assert hands[0].force + hands[1].force == pytest.approx(-force, abs=1e-6 * abs(force).max())
    hands[1].release()
    assert settle(stepper).force(hands[0])[2] < 0.0


def test_a_density_of_a_frame_is_looked_at_without_gravity(organ: vs.Organ) -> None:
    with pytest.raises(vs.VisceraError, match="density"):
        organ.stepper().frame(density=-1.0)


def released(hand: vs.Hand) -> vs.Hand:
    hand.release()
    return hand


def pulled(hand: vs.Hand) -> vs.Hand:
    hand.pull((0, 0, 1))
    return hand


def turned(hand: vs.Hand, angle: float) -> vs.Hand:
    hand.turn((0, angle, 0))
    return hand


REFUSED: list[tuple[str, Callable[[vs.Organ, vs.Hand], object]]] = [
    ("the turn of a hand must be", lambda organ, hand: hand.turn((0, float("nan"), 0))),
    ("motion of a hand must be", lambda organ, hand: hand.move((0, float("inf"), 0))),
    ("the rotation of a hand must be", lambda organ, hand: hand.place(rotation=np.ones((3, 3)))),
    ("the position of a hand must be", lambda organ, hand: hand.place((0, 0))),
    ("the displacement of a hand must be", lambda organ, hand: setattr(hand, "displacement", np.ones((2, 3)))),
    ("none since it took hold", lambda organ, hand: hand.force),
    ("cannot be turned; take hold again", lambda organ, hand: released(hand).turn((0, 0, 0.1))),
    ("cannot be moved; take hold again", lambda organ, hand: released(hand).move((0, 0, 0.1))),
    ("the force of a hand must be", lambda organ, hand: hand.pull((0, 0))),
    ("the torque of a hand must be", lambda organ, hand: hand.pull((0, 0, 1), (0, float("nan"), 0))),
    ("cannot pull; take hold again", lambda organ, hand: released(hand).pull((0, 0, 0.1))),
    ("pulls cannot be moved; call its hold", lambda organ, hand: pulled(hand).move((0, 0, 0.1))),
    ("held nothing in this frame", lambda organ, hand: organ.stepper().frame().force(hand)),
    ("that count lie on a line", lambda organ, hand: hand._stepper.grasp(organ.mesh.sets["tip"][:1]).turn((0, 0, 1))),
    ("by 120 degrees in one frame", lambda organ, hand: turned(hand, 2.0944)._stepper.frame()),
]


@pytest.mark.parametrize(("message", "act"), REFUSED, ids=[message for message, _ in REFUSED])
def test_what_makes_no_sense_is_said(organ: vs.Organ, message: str, act: Callable[[vs.Organ, vs.Hand], object]) -> None:
    hand = organ.stepper().grasp("tip")
    with pytest.raises(VisceraError, match=message):
        act(organ, hand)


def test_a_turn_beyond_half_a_turn_is_refused_by_its_own_angle(organ: vs.Organ) -> None:
    """It ends where a shorter turn the other way does; so do turns that are asked for one after another."""
    hand = organ.stepper().grasp("tip")
    for degrees in (91, 190, 270, 350, 360):
        with pytest.raises(VisceraError, match=f"to turn by {degrees} degrees in one frame; it can turn by 90 at most"):
            hand.turn((np.radians(degrees), 0, 0))
    hand.turn((np.radians(80), 0, 0))
    for _ in range(4):
        with pytest.raises(VisceraError, match="is to turn by 160 degrees in one frame"):
            hand.turn((np.radians(80), 0, 0))
    assert hand.rotation == pytest.approx(rotation_matrix((np.radians(80), 0, 0)), abs=1e-15)


def test_a_place_is_grasped_once(organ: vs.Organ) -> None:
    stepper = organ.stepper()
    hand = stepper.grasp("x > 99%")
    with pytest.raises(vs.VisceraError, match="'x > 99%' is held already, by the hand at 'x > 99%'; release that hand"):
        stepper.grasp("x > 99%")
    hand.release()
    pulling = stepper.grasp("x > 99%")
    pulling.pull((0, 0, -0.01))
    moving = stepper.grasp("x > 99%")
    assert np.isfinite(stepper.frame().displacement).all()
    pulling.hold()
    with pytest.raises(vs.VisceraError, match="'x > 99%' is held twice; let one hand go"):
        stepper.frame()
    moving.release()


def test_a_patch_made_anew_is_the_same_place(organ: vs.Organ) -> None:
    stepper = organ.stepper()
    patch = functools.partial(organ.patch, (0.4, 0.05, 0.05), radius=0.09)
    hand = stepper.grasp(patch())
    where = r"a contact patch of \d+ nodes around \(0.4, 0.0\d+, 0.0\d+\) m"
    with pytest.raises(vs.VisceraError, match=f"{where} is held already, by the hand at {where}; release that hand"):
        stepper.grasp(patch())
    with pytest.raises(vs.VisceraError, match=f"{where} is held twice; let one hand go"):
        stepper.frame({patch(): (0, 0, 0.001)})
    hand.pull((0, 0, -0.01))
    stepper.grasp(patch())
    assert np.isfinite(stepper.frame({}).displacement).all()
    hand.hold()
    with pytest.raises(vs.VisceraError, match=f"{where} is held twice"):
        stepper.frame()
    stepper.grasp(organ.patch((0.4, 0.05, 0.05), radius=0.1))
