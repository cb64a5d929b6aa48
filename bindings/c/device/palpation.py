"""Writes palpation.csv: a synthetic recording of a palpating hand, as `bindings/c/device/hand.c` plays it.

Presses and strokes follow the minimum jerk law (Flash and Hogan, J. Neuroscience 5, 1985), between the landmarks of a
short examination, with physiological tremor between 8 and 12 Hz on top. No person was recorded.
"""

from pathlib import Path

import numpy as np

FRAMES_PER_SECOND = 100
# Seconds to get there, across the surface in radii of the contact patch, pressed in parts of the model's depth.
LANDMARKS = [
    *[(0.6, 0.0, 0.0, 0.02), (0.4, 0.0, 0.0, 0.45), (0.5, 0.0, 0.0, 0.40), (0.3, 0.0, 0.0, 0.03)],  # a press
    *[(0.5, 0.9, 0.3, -0.2), (0.3, 0.9, 0.3, 0.3), (0.9, -1.1, 0.5, 0.35), (0.3, -1.1, 0.5, -0.1)],  # a stroke
    *[(0.4, -0.6, -0.8, 0.05), (0.2, -0.6, -0.8, 0.8), (0.2, -0.6, -0.8, 0.15), (0.2, -0.6, -0.8, 0.85)],  # probing
    *[(0.3, -0.6, -0.8, 0.1), (0.7, 0.4, -1.0, 0.5), (0.7, 1.0, 0.2, 0.5), (0.7, 0.2, 0.9, 0.45)],  # a circle
    *[(0.4, 0.2, 0.9, -0.25), (0.15, 0.2, 0.9, 0.6), (0.15, 0.2, 0.9, -0.15), (0.15, 0.0, 0.5, 0.6)],  # taps
    *[(0.15, 0.0, 0.5, -0.15), (0.6, 0.0, 0.0, -0.3), (0.5, 0.0, 0.0, -0.3)],
]


def palpation() -> np.ndarray:
    """Poses (frames, 3), ending where they begin."""
    poses = []
    last = np.array(LANDMARKS[-1][1:])
    for seconds, *place in LANDMARKS:
        t = np.arange(round(seconds * FRAMES_PER_SECOND))[:, None] / round(seconds * FRAMES_PER_SECOND)
        poses.append(last + (np.array(place) - last) * t**3 * (10 - 15 * t + 6 * t**2))
        last = np.array(place)
    motion = np.concatenate(poses)
    random = np.random.default_rng(1)
    seconds = len(motion) / FRAMES_PER_SECOND
    cycles = np.arange(np.ceil(8 * seconds), np.floor(12 * seconds) + 1)  # whole ones: the end meets the beginning
    phase = random.uniform(0, 2 * np.pi, (len(cycles), 3))
    turns = 2 * np.pi * cycles * np.arange(len(motion))[:, None] / len(motion)
    tremor = np.cos(turns[:, :, None] + phase).sum(axis=1) / np.sqrt(len(cycles))
    return np.asarray(motion + tremor * [0.004, 0.004, 0.006])


if __name__ == "__main__":
    path = Path(__file__).with_suffix(".csv")
    np.savetxt(
        path,
        palpation(),
        fmt="%.4f",
        delimiter=",",
        header=f"frames_per_second,{FRAMES_PER_SECOND}\nacross,across,press",
        comments="",
    )
