"""The measured silicone beam: the facts kept are those of the recordings, and what is told of them stays as good."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest

import viscera as vs
from viscera.study import measured_beam as beam

ROOT = Path(__file__).resolve().parents[2]


def test_the_facts_are_those_of_the_recordings(shared: Path) -> None:
    folder = shared / "measured" / "silicone_beam"
    if not folder.is_dir():
        pytest.skip(f"no recordings of the beam in {folder}")
    spec = importlib.util.spec_from_file_location("measured_beam", ROOT / "scripts" / "measured_beam.py")
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    assert script.runs(folder) == json.loads(script.TARGET.read_text(encoding="utf-8"))["runs"]


def test_a_swing_has_the_frequency_and_the_decay_it_was_made_of() -> None:
    """With creep below it, and sampled as coarsely as the recordings."""
    time = np.arange(0.0, 1.0, 0.02)
    height = 6.0 * np.exp(-2.7 * time) * np.cos(2 * np.pi * 7.7 * time) + 0.4 * np.exp(-time / 0.6)
    found = beam.swing(time, height)
    assert found.frequency == pytest.approx(7.7, rel=5e-3)
    assert found.decay == pytest.approx(2.7, rel=0.05)
    with pytest.raises(vs.VisceraError, match="the swing has 2 extremes, fewer than the 9 asked for"):
        beam.swing(time[:14], height[:14])


def test_markers_ride_on_a_rigid_motion() -> None:
    organ = beam.organ_of(2e5, "P1", 3)
    angle = 0.4
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    moved = beam.markers(organ, organ.mesh.points @ (turn - np.eye(3)).T + [0.01, 0.0, 0.02])
    for found, (seat, normal) in zip(moved, beam.MARKERS.values(), strict=True):
        centre = np.array(seat) + beam.ARM * np.array(normal)
        assert 1e-3 * found == pytest.approx((turn - np.eye(3)) @ centre + [0.01, 0.0, 0.02], abs=1e-12)


@pytest.mark.parametrize(("element", "across"), [("P2", 2), ("P1 mean volume", 5)])
def test_the_hanging_load_is_told_to_a_millimetre(element: str, across: int) -> None:
    """E from the weight alone; upwards, of 17 mm. Along the beam the held shapes of the two series differ by 2 mm."""
    runs = beam.measured()
    young = beam.fitted_modulus([runs["gravity a"], runs["gravity b"]], element, across)
    assert 2.3e5 < young < 2.8e5, "the authors' own fit is 263.8 kPa"
    organ = beam.organ_of(young, element, across)
    told = beam.markers(organ, beam.hanging(organ, beam.LOAD))
    for run in ("load a", "load b"):
        assert np.abs(told - runs[run].displacement)[:, 2].max() < 1.1


def test_the_free_swing_is_told_within_a_twentieth() -> None:
    """The frequency is not fitted; nearly undamped, since damping hardly changes it."""
    organ = beam.organ_of(250e3, "P2", 2)
    found = beam.swing(*beam.let_go(organ, 4e-3, 0.75, (0.0, 2e-3)))
    runs = beam.measured()
    measured = [beam.swing(runs[name].time, runs[name].height).frequency for name in ("gravity a", "gravity b")]
    assert measured[0] == pytest.approx(measured[1], rel=0.01)
    assert found.frequency == pytest.approx(np.mean(measured), rel=0.05)
