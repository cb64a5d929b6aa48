"""What is left between points and organ: the scatter of each, and what neighbours have in common."""

import numpy as np
import pytest

from viscera.mesh import Floats
from viscera.registration.residuals import UNLIKELY, is_beyond_noise, left

SIZE, NOISE = 0.3, 2e-3


def plate(count: int, seed: int = 0) -> tuple[Floats, Floats]:
    """Feet (k, 3) on a plate as large as the organ, and noise (k,) [m]."""
    rng = np.random.default_rng(seed)
    feet = np.column_stack([rng.uniform(0.0, SIZE / np.sqrt(2.0), size=(count, 2)), np.zeros(count)])
    return feet, rng.normal(scale=NOISE, size=count)


@pytest.mark.parametrize("count", [5000, 500, 100])
def test_noise_has_nothing_in_common(count: int) -> None:
    found = [left(noise, feet, np.ones(count), NOISE, SIZE) for feet, noise in (plate(count, k) for k in range(40))]
    assert not any(rest.is_poor for rest in found)
    assert np.median([rest.systematic for rest in found]) < 0.3 * NOISE
    assert np.mean([rest.misfit for rest in found]) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("count", [5000, 500])
def test_a_smooth_misfit_is_found_below_the_noise(count: int) -> None:
    """It is smaller than the noise, so that the spread of all residuals hardly shows it. In wide cubes some cancels."""
    found = []
    for seed in range(20):
        feet, noise = plate(count, seed)
        smooth = 1.2e-3 * np.sqrt(2.0) * np.sin(2.0 * np.pi * np.sqrt(2.0) * feet[:, 0] / SIZE)
        found.append(left(noise + smooth, feet, np.ones(count), NOISE, SIZE))
    assert np.median([rest.misfit for rest in found]) < 1.25
    assert np.median([rest.systematic for rest in found]) == pytest.approx(1.2e-3, rel=0.12)
    assert np.mean([rest.is_poor for rest in found]) >= 0.9


def test_what_noise_was_told_does_not_matter_to_it() -> None:
    feet, noise = plate(3000)
    quiet, right = (left(noise + 1e-3, feet, np.ones(len(feet)), told, SIZE) for told in (0.2 * NOISE, NOISE))
    assert quiet.systematic == right.systematic == pytest.approx(1e-3, rel=0.1)
    assert quiet.misfit > 3.0 * right.misfit


def test_points_with_little_weight_count_little() -> None:
    feet, noise = plate(4000)
    weights = np.where(np.arange(len(feet)) % 2, 1.0, 1e-2)
    residual = noise / np.sqrt(weights) + np.where(weights < 1.0, 8e-3, 0.0)
    assert not left(residual, feet, weights, NOISE, SIZE).is_poor
    assert left(residual, feet, np.ones(len(feet)), NOISE, SIZE).is_poor


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_points_say_nothing_in_common(count: int) -> None:
    feet, noise = plate(count)
    rest = left(noise, feet, np.ones(count), NOISE, SIZE)
    assert np.isfinite([rest.misfit, rest.systematic]).all()


@pytest.mark.parametrize("count", [1, 5, 100])
def test_noise_puts_a_landmark_beyond_it_as_often_as_is_said(count: int) -> None:
    """In one of a hundred registrations, however many landmarks each has."""
    told = 4000
    noise = np.full(count, NOISE)
    gaps = np.linalg.norm(np.random.default_rng(count).normal(scale=NOISE, size=(told, count, 3)), axis=2)
    share = np.mean([is_beyond_noise(each, noise, 0.0).any() for each in gaps])
    # Three standard deviations of a share of 1 % in so many trials.
    assert share == pytest.approx(UNLIKELY, abs=3.0 * np.sqrt(UNLIKELY / told))
    assert not is_beyond_noise(gaps[0], noise, 1e3 * SIZE).any(), "the model's error explains them"


def test_the_noise_of_each_landmark_is_its_own() -> None:
    gaps, noise = np.full(3, 4e-3), np.array([1e-3, 2e-3, 0.5e-3])
    assert is_beyond_noise(gaps, noise, SIZE).tolist() == [True, False, True]
    assert is_beyond_noise(np.empty(0), np.empty(0), SIZE).tolist() == []
