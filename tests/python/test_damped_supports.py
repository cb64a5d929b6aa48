"""What supports, bonds and springs carry in frames with stiffness damping: with it momentum balances."""

from typing import Any

import numpy as np
import pytest

import viscera as vs
from viscera.boundary.ties import Damping
from viscera.mesh import Floats

LAW = vs.NeoHookean(young=1e4, poisson=0.3)
DENSITY, STEP, ALPHA, BETA = 1000.0, 0.01, 0.7, 0.03
G = np.array([1.0, -2.0, -9.81])
SETTINGS: dict[str, Any] = {"density": DENSITY, "time_step": STEP, "damping": (ALPHA, BETA)}


def velocity_of(stepper: vs.Stepper) -> Floats:
    assert stepper.velocity is not None
    return stepper.velocity


def momentum(mesh: vs.Mesh, velocity: Floats) -> Floats:
    """`rho` times the integral of the velocity (3,) [kg m/s], of lumped and of consistent masses alike."""
    return np.asarray(DENSITY * mesh.facts["cell_volumes"] @ velocity[mesh.cells].mean(axis=1))


def springs(mesh: vs.Mesh) -> list[vs.ElasticSupport | vs.Spring]:
    """A bed under a part of the bar, a stretched and a compressed spring, a slack and a taut cable."""
    tip = mesh.points[mesh.nodes("tip")].mean(axis=0)
    across, along = np.array([0.0, 0.02, 0.09]), np.array([0.08, 0.03, 0.0])
    return [
        vs.ElasticSupport("z < 1%", stiffness=2e5, tangential=5e4),
        vs.Spring("tip", point=tip + across, stiffness=400.0, length=0.07),
        vs.Spring("tip", point=tip + along, stiffness=600.0, length=0.16),
        vs.Spring("tip", point=tip - across, stiffness=500.0, length=0.3, cable=True),
        vs.Spring("tip", point=tip - along, stiffness=500.0, length=0.06, cable=True),
    ]


@pytest.mark.parametrize("mass", ["lumped", "consistent"])
@pytest.mark.parametrize("rule", ["backward_euler", "newmark"])
def test_momentum_balances_in_frames_that_are_not_settled_too(bar: vs.Mesh, rule: str, mass: str) -> None:
    """Whatever a frame leaves out of balance is part of its reactions, so the sum over all nodes is exact."""
    organ = vs.Organ(bar, LAW, fixed="root", supports=springs(bar))
    stepper = organ.stepper(dynamics=rule, mass=mass, iterations=1, **SETTINGS)
    everywhere = np.arange(len(bar.points))
    weight, carried, before = DENSITY * bar.volume * G, [], [np.zeros(3)]
    sums = []
    for _ in range(6):
        frame = stepper.frame(gravity=G)
        carried.append([frame.support_force(each) for each in organ.supports])
        before.append(momentum(bar, velocity_of(stepper)))
        drag = -ALPHA * before[-1]
        sums.append(frame.reaction(everywhere) + np.sum(carried[-1], axis=0) + weight + drag)
    assert not frame.is_settled
    changes = np.diff(before, axis=0) / STEP
    # The trapezoidal rule takes the mean of the forces at both ends.
    forces = np.array(sums) if rule == "backward_euler" else 0.5 * (np.array(sums)[1:] + np.array(sums)[:-1])
    assert abs(forces - changes[-len(forces) :]).max() < 1e-10 * abs(weight).max()
    slack, *others = np.abs(carried).max(axis=(0, 2))[[3, 0, 1, 2, 4]]
    assert slack == 0.0
    assert min(others) > 0.05 * abs(weight).max()


def test_it_balances_where_the_tangent_was_made_convex(bar: vs.Mesh) -> None:
    """A bar that buckles between springs: a compressed one then has a tangent that is not the exact one."""
    organ, push = vs.Organ(bar, LAW, fixed="root", supports=springs(bar)), np.array([-120.0, 0.0, 3.0])
    damping = {**SETTINGS, "time_step": 0.05}
    stepper = organ.stepper(dynamics="backward_euler", iterations=1, **damping)
    before, was_convex = np.zeros(3), []
    for _ in range(4):
        frame = stepper.frame(force={"tip": push})
        after = momentum(bar, velocity_of(stepper))
        held = frame.reaction(np.arange(len(bar.points))) + sum(map(frame.support_force, organ.supports))
        assert frame.taken == 1.0
        assert held + push - ALPHA * after == pytest.approx((after - before) / 0.05, abs=1e-8)
        was_convex.append(frame.is_unstable)
        before = after
    assert any(was_convex)


def test_a_bond_carries_the_damping_between_its_organs(bar: vs.Mesh) -> None:
    beyond = vs.mesh(bar.points + np.array([0.4, 0.0, 0.0]), bar.cells, bar.sets)
    bond = vs.Bond(("near", "tip"), ("far", "root"), stiffness=1e5)
    scene = vs.Scene({"near": vs.Organ(bar, LAW, fixed="root"), "far": vs.Organ(beyond, LAW)}, bonds=[bond])
    stepper = scene.stepper(dynamics="backward_euler", **SETTINGS)
    nodes, before = scene.mesh.nodes("far"), np.zeros(3)
    for _ in range(3):
        frame = stepper.frame(gravity=G)
        after = momentum(beyond, velocity_of(stepper)[nodes])
        unbalanced = frame.reaction(nodes)
        forces = unbalanced + DENSITY * beyond.volume * G - frame.support_force(bond) - ALPHA * after
        assert forces == pytest.approx((after - before) / STEP, abs=1e-9)
        before = after


def test_the_part_of_an_organ_of_a_scene_has_it_and_a_shape_at_rest_has_not(bar: vs.Mesh) -> None:
    bed = vs.ElasticSupport("z < 1%", stiffness=2e5)
    scene = vs.Scene({"bar": vs.Organ(bar, LAW, fixed="root", supports=[bed])})
    stepper = scene.stepper(dynamics="backward_euler", **SETTINGS)
    frame = stepper.frame(gravity=G)
    (ties,) = scene._tied
    at_rest, damped = ties.force(frame.displacement), ties.force(BETA * velocity_of(stepper))
    assert frame["bar"].support_force(bed) == pytest.approx(at_rest + damped, rel=1e-12)
    assert scene.moved(frame).support_force(bed) == pytest.approx(at_rest, rel=1e-12)
    assert np.linalg.norm(damped) > np.linalg.norm(at_rest)


@pytest.mark.parametrize("is_convex", [False, True])
def test_the_damping_of_a_spring_is_that_of_its_tangent(bar: vs.Mesh, is_convex: bool) -> None:
    """Against the difference quotient of its force; a convex tangent lacks what compression adds across the spring."""
    organ = vs.Organ(bar, LAW, fixed="root", supports=springs(bar))
    rng = np.random.default_rng(3)
    displacement, velocity = 2e-3 * rng.standard_normal((2, *bar.points.shape))
    for ties in organ._tied[1:]:
        (link,) = ties.links
        damping = Damping(BETA, velocity, displacement, is_convex)
        ahead, behind = (link.force(displacement + h * velocity) for h in (1e-4, -1e-4))
        tangent = BETA * (ahead - behind) / 2e-4
        if is_convex:
            between = link.rest + link.offset(displacement)
            now = np.linalg.norm(between)
            rate = link.offset(velocity)
            across = rate - between * (between @ rate) / now**2
            is_slack = link.is_cable and now < link.length
            tangent -= 0.0 if is_slack else BETA * link.stiffness * max(link.length / now - 1.0, 0.0) * across
        assert link.damping_force(damping) == pytest.approx(tangent, rel=1e-5, abs=1e-9)
