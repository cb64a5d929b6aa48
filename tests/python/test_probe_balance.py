"""Friction and coupling of a rigid probe at rest: in balance, the same from tick to tick, and told where not."""

from __future__ import annotations

import numpy as np
import pytest

import viscera as vs

TICK = 1e-3


@pytest.fixture(scope="module")
def cantilever() -> vs.Touch:
    """A beam held at one end, whose top may be touched: it resists along itself ten times as much as across."""
    beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    return beam.reduce("x > 30% and z > 99%", depth="8%", order=4)


@pytest.mark.parametrize(("stiffness", "damping"), [(10.0, 0.0), (50.0, 0.5), (500.0, 2.0)])
@pytest.mark.parametrize("friction", [0.0, 0.3, 1.0])
def test_a_probe_whose_device_stands_still_comes_to_rest_in_balance(
    cantilever: vs.Touch, friction: float, stiffness: float, damping: float
) -> None:
    random = np.random.default_rng(7)
    for _ in range(6):
        probe = cantilever.probe(friction=friction, stiffness=stiffness, damping=damping)
        start = np.array([random.uniform(0.4, 1.0), random.uniform(0.05, 0.15), 0.205 + probe.radius])
        device = start + np.append(random.uniform(-0.04, 0.04, 2), -random.uniform(0.01, 0.1))
        for part in np.linspace(0, 1, 200):
            probe.follow(start + part * (device - start), TICK)
        felt = [probe.follow(device, TICK) for _ in range(150)][-30:]
        size = np.linalg.norm(felt[-1].force)
        assert size > 0
        assert max(np.linalg.norm(one.force - felt[-1].force) for one in felt) < 1e-3 * size
        assert np.linalg.norm(felt[-1].force - stiffness * (device - felt[-1].center)) < 2e-3 * size


@pytest.mark.parametrize("entered", [1e-3, 1e-2])
def test_a_probe_with_a_strong_damper_creeps_on_until_spring_and_tissue_agree(
    cantilever: vs.Touch, entered: float
) -> None:
    """Each step is some millionths of the radius long: the rate of the damper is a hundred times the stiffness."""
    stiffness, damping = 500.0, 50.0
    probe = cantilever.probe(friction=0.3, stiffness=stiffness, damping=damping)
    top = np.array([0.8, 0.1, 0.2 + probe.radius])
    probe.follow(top, TICK)
    device = top - (0, 0, entered)
    for _ in range(1500):
        felt = probe.follow(device, TICK)
    # What the creeping still lacks, and what is even: a ten-thousandth.
    size = np.linalg.norm(felt.force)
    assert size > 0
    assert np.linalg.norm(felt.force - stiffness * (device - felt.center)) < 1e-3 * size


def test_what_lacks_to_the_balance_is_part_of_the_estimate(cantilever: vs.Touch) -> None:
    """After a jump of the device, less than the probe may go in a tick."""
    random = np.random.default_rng(3)
    told = 0
    for _ in range(40):
        probe = cantilever.probe(friction=0.6, stiffness=200.0)
        place = np.array([random.uniform(0.5, 0.9), random.uniform(0.05, 0.15), 0.2 + probe.radius])
        probe.follow(place, TICK)
        goal = place + random.uniform(-0.01, 0.01, 3) - (0, 0, 0.012)
        felt = probe.follow(goal, TICK)
        size = np.linalg.norm(felt.force)
        if size > 0:
            lacks = np.linalg.norm(200.0 * (goal - felt.center) - felt.force) / size
            if lacks > 1e-3:
                told += 1
                assert felt.error_estimate >= min(1.0, lacks)
                assert lacks <= 0.1 or not felt.is_trusted
    assert told > 0


def test_a_probe_held_still_feels_the_same_from_tick_to_tick() -> None:
    """Near the side of a layer the response of the surface changes within a slip of the tissue below the sphere."""
    layer = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.45), fixed="z < 1%")
    touch = layer.reduce("x > 10% and z > 99%", depth="8%", order=4)
    random = np.random.default_rng(1)
    places = [(0.5164, 0.1402, 0.0555)]
    places += [(random.uniform(0.3, 0.9), random.uniform(0.02, 0.18), random.uniform(0.01, 0.05)) for _ in range(12)]
    for x, y, entered in places:
        probe = touch.probe()
        top = 0.2 + probe.radius
        for part in np.linspace(0, 1, 60):
            probe.place((x, y, top - part * entered))
        forces = [probe.place((x, y, top - entered)).force for _ in range(8)][4:]
        assert np.ptp(forces, axis=0).max() < 1e-3 * np.abs(forces).max()


@pytest.fixture(scope="module")
def layer() -> vs.Touch:
    """The upper side of a thick layer: a hundred times as stiff as the springs."""
    organ = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="z < 1%")
    return organ.reduce("x > 50% and z > 99%", depth="5%", order=3)


@pytest.mark.parametrize("friction", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("stiffness", [20.0, 500.0, 2e4])
@pytest.mark.parametrize("model", ["layer", "cantilever"])
def test_the_first_step_of_a_probe_in_the_organ_is_in_balance(
    model: str, stiffness: float, friction: float, request: pytest.FixtureRequest
) -> None:
    """New and lifted: the device stands at most half a radius deep, and the spring must not be left out."""
    touch: vs.Touch = request.getfixturevalue(model)
    random = np.random.default_rng(5)
    probe = touch.probe(friction=friction, stiffness=stiffness, damping=1.0)
    for _ in range(30):
        place = random.uniform((0.6, 0.05), (0.9, 0.15))
        device = np.append(place, 0.2 + probe.radius * random.uniform(0.52, 0.99))
        felt = probe.follow(device, TICK)
        size = np.linalg.norm(felt.force)
        assert size > 0
        assert np.linalg.norm(stiffness * (device - felt.center) - felt.force) < 1e-3 * size
        # With friction it sticks to what a tick's iterations have left of the slip, some per cent at most.
        again = probe.follow(device, TICK)
        assert np.linalg.norm(again.force - felt.force) < 0.05 * size
        probe.lift()


def test_a_probe_that_is_lifted_out_of_a_group_comes_back_in_balance(layer: vs.Touch) -> None:
    hands = vs.Probes([layer.probe(friction=0.3, stiffness=500.0, damping=1.0) for _ in range(2)])
    devices = [(x, 0.1, 0.18 + layer.radius) for x in (0.65, 0.9)]
    held = [hands.follow(devices, TICK) for _ in range(50)][-1]
    hands.probes[0].lift()
    back = hands.follow(devices, TICK)
    for one, other in zip(held, back, strict=True):
        assert np.linalg.norm(one.force - other.force) < 0.02 * np.linalg.norm(one.force)
        assert 5.0 < -other.force[2] < 500.0 * 0.02


def test_a_step_of_no_duration_keeps_the_touch(layer: vs.Touch) -> None:
    probe = layer.probe(friction=0.5, stiffness=500.0, damping=1.0)
    start = np.array([0.7, 0.1, 0.19 + layer.radius])
    path = start + np.outer(np.linspace(0.0, 0.01, 100), (1, 0, 0))
    felt = [probe.follow(device, TICK) for device in path][-1]
    assert felt.force[0] > 0.1
    same = probe.follow(path[-1], 0.0)
    assert np.linalg.norm(same.force - felt.force) < 0.01 * np.linalg.norm(felt.force)
