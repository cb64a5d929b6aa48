"""Several rigid probes on one reduced model: against the full organ, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

import viscera as vs
from viscera.errors import VisceraError

PLACES = (0.6, 0.95)
"""Of two probes along the beam [m]."""


@pytest.fixture(scope="module")
def layer() -> vs.Touch:
    """The upper side of the beam's free half, all of its lower side fixed: a thick layer."""
    organ = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="z < 1%")
    return organ.reduce("x > 50% and z > 99%", depth="5%", order=3)


@pytest.fixture(scope="module")
def beam() -> vs.Touch:
    """The upper side of the beam's free half."""
    organ = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    return organ.reduce("x > 50% and z > 99%", depth="5%", order=3)


@pytest.fixture(scope="module")
def whole() -> vs.Touch:
    """All of the beam but what its clamp takes."""
    organ = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    return organ.reduce(depth="5%", order=2, radius="8 cm")


def above(touch: vs.Touch, entered: tuple[float, float]) -> list[tuple[float, float, float]]:
    return [(x, 0.1, 0.2 + touch.radius - depth) for x, depth in zip(PLACES, entered, strict=True)]


def pressed(touch: vs.Touch, entered: tuple[float, float], friction: float = 0.0) -> vs.Probes:
    """Probes that have gone down in a few ticks."""
    hands = vs.Probes([touch.probe(friction=friction), touch.probe(friction=friction)])
    for part in (0.0, 0.25, 0.5, 0.75, 1.0):
        hands.place(above(touch, (part * entered[0], part * entered[1])))
    return hands


def test_small_touches_are_those_of_the_full_organ_under_both(layer: vs.Touch) -> None:
    felt = (hands := pressed(layer, (4e-4, 3e-4))).place(above(layer, (4e-4, 3e-4)))
    patches = [layer.patch(one.contact_point) for one in felt]
    means = [patch.weights @ hands.displacement[patch.nodes] for patch in patches]
    full = layer.organ().solve(displacement=dict(zip(patches, means, strict=True)))
    for one, patch in zip(felt, patches, strict=True):
        force = full.reaction(patch)
        assert np.linalg.norm(one.force - force) < 0.02 * np.linalg.norm(force)


def test_the_tip_that_one_presses_down_leaves_the_other(beam: vs.Touch) -> None:
    hands = pressed(beam, (0.0, 0.005))
    assert all(felt.is_touching == bool(k) for k, felt in enumerate(hands.place(above(beam, (0.0, 0.005)))))
    # Between the clamp and the first, the beam sinks: the second must follow to touch it.
    left, right = hands.place(above(beam, (0.03, 0.005)))
    assert left.is_touching
    assert not right.is_touching
    assert right.gap > 0.0


def test_probes_far_from_the_organ_are_free_and_one_alone_is_a_probe(beam: vs.Touch) -> None:
    hands = vs.Probes([beam.probe(), beam.probe()])
    assert [felt.grip for felt in hands.place([(0.6, 0.1, 1.0), (0.9, 0.1, 1.0)])] == ["free", "free"]
    assert not hands.displacement.any()
    alone, single = beam.probe(friction=0.3), vs.Probes([beam.probe(friction=0.3)])
    for depth in (0.0, 0.005, 0.01):
        at = above(beam, (depth, 0.0))[0]
        np.testing.assert_array_equal(single.place([at])[0].force, alone.place(at).force)


def test_the_field_is_that_of_the_probes_as_they_are_now(beam: vs.Touch) -> None:
    """Also where one was lifted or moved by itself."""
    hands = pressed(beam, (0.01, 0.02))
    one, other = hands.place(above(beam, (0.015, 0.02)))
    np.testing.assert_array_equal(hands.displacement, one.displacement + other.displacement)
    left, right = hands.probes
    moved = left.place(above(beam, (0.01, 0.0))[0])
    assert np.abs(moved.displacement - one.displacement).max() > 1e-3
    np.testing.assert_array_equal(hands.displacement, moved.displacement + other.displacement)
    right.lift()
    np.testing.assert_array_equal(hands.displacement, moved.displacement)
    left.lift()
    assert not hands.displacement.any()


def test_two_probes_cost_trust(beam: vs.Touch) -> None:
    alone = pressed(beam, (0.01, -0.1)).place(above(beam, (0.01, -0.1)))[0]
    both = pressed(beam, (0.01, 0.02)).place(above(beam, (0.01, 0.02)))[0]
    assert both.error_estimate > alone.error_estimate


def test_two_rigid_spheres_in_one_place_are_not_trusted(layer: vs.Touch) -> None:
    """One of them may seem free, though both are as deep."""
    hands = vs.Probes([layer.probe(), layer.probe()])
    for apart, is_trusted in ((2.2, True), (0.9, False), (0.1, False)):
        places = [(0.75 + side * apart * layer.radius, 0.1, 0.2 + layer.radius) for side in (-0.5, 0.5)]
        hands.place(places)
        felt = hands.move([(0, 0, -4e-4)] * 2)
        felt = hands.move([(0, 0, 0)] * 2)
        assert [one.is_trusted for one in felt] == [is_trusted] * 2, (apart, felt)
        for probe in hands.probes:
            probe.lift()


def test_what_is_no_group_of_probes_is_refused(beam: vs.Touch) -> None:
    probe = beam.probe()
    other = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp").reduce(
        "tip", depth="2%", order=2
    )
    for probes, words in (
        ([], "there are no probes"),
        ([probe, probe], "probe 1 is the same"),
        ([probe, other.probe()], "probe 1 is on another model"),
        ([probe, (0, 0, 0)], "probe 1 is .*; make it by touch.probe"),
    ):
        with pytest.raises(VisceraError, match=words):
            vs.Probes(probes)  # type: ignore[arg-type]


def test_poses_are_refused_before_they_reach_the_probes(beam: vs.Touch) -> None:
    hands = vs.Probes([beam.probe(stiffness=100.0), beam.probe(stiffness=100.0)])
    with pytest.raises(VisceraError, match="probe 0 must be placed before it is moved"):
        hands.move([(0, 0, 1), (0, 0, 1)])
    with pytest.raises(VisceraError, match=r"have the shape \(3,\); give 2 vectors"):
        hands.place((0, 0, 1))
    with pytest.raises(VisceraError, match="the positions of the probes are 'above'; give 2 vectors"):
        hands.place("above")
    with pytest.raises(VisceraError, match=r"the positions of the probes are array.*; give 2 vectors"):
        hands.place(np.full((2, 3), 1j))
    with pytest.raises(VisceraError, match="the positions of the probes, number 1"):
        hands.place([(0, 0, 1), (0, 0, float("nan"))])
    with pytest.raises(VisceraError, match="the time step"):
        hands.follow([(0, 0, 1), (0, 0, 1)], -1e-3)


def pinching(touch: vs.Touch, upper: float, lower: float) -> vs.Probes:
    """A millimetre above and below the beam, at these places along it [m]."""
    hands = vs.Probes([touch.probe(), touch.probe()])
    hands.place([(upper, 0.1, 0.201 + touch.radius), (lower, 0.1, -0.001 - touch.radius)])
    return hands


def test_what_a_tick_leaves_open_is_not_trusted(whole: vs.Touch) -> None:
    """Pressed from both sides of a beam that gives way: a tick finds a small part of the forces of true contact."""
    hands = pinching(whole, 0.8, 0.8)
    for _ in range(2):
        upper, lower = hands.move([(0, 0, -0.002), (0, 0, 0.002)])
        # Two tools of a stepper feel 6.1 N, then 16.6 N.
        assert abs(upper.force[2]) < 3.0
        assert not upper.is_trusted
        assert not lower.is_trusted


def test_beside_a_probe_that_is_too_deep_none_is_trusted(whole: vs.Touch) -> None:
    hands = pinching(whole, 0.5, 0.9)
    felt = [hands.move([(0, 0, -0.002), (0, 0, 0.002)]) for _ in range(13)][-1]
    assert "deeper than the model serves" in felt[1].reason
    assert felt[0].is_touching
    assert not felt[0].is_trusted


@pytest.mark.parametrize("given", [None, 3, "probe"])
def test_what_is_no_list_of_probes_is_refused(given: object) -> None:
    with pytest.raises(VisceraError, match=r"probes must be a list of probes|probe 0 is"):
        vs.Probes(given)  # type: ignore[arg-type]
