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
