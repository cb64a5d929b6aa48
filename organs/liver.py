"""The liver: an implicit surface of our own making, after the textbook anatomy and nobody's data set.

Axes: x to the patient's left, y to the back, z to the head; metres. Two blobs (right and left lobe) under one dome
make the diaphragmatic face; a slanted concave cut makes the visceral face and, where it meets the dome, the sharp
inferior margin. Grooves add the gallbladder fossa, the fissure of the round ligament with its notch in the margin,
the porta hepatis, the bed of the vena cava and the shallow impression of the heart.
"""

import numpy as np
from numpy.typing import NDArray
from stuffing import boundary, fill

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Triple = tuple[float, float, float]

SPACING = 0.0118  # of the lattice that the cells come from, about their edge length [m]
BOX = np.array([-0.14, -0.10, -0.14]), np.array([0.15, 0.11, 0.11])  # holds the liver [m]
PORTA = np.array([0.000, 0.022, 0.012])  # where the vessels enter
VOLUME = 1.5e-3  # of an adult liver [m^3]
RIM = 0.008  # what of the face counts as the margin [m]
CLEARANCE = 0.018  # between what is touched and what is held [m]


def smooth_min(a: Array, b: Array, width: float) -> Array:
    """Minimum rounded over a band of the given width (polynomial, twice differentiable)."""
    h = np.clip(width - np.abs(a - b), 0.0, None) / width
    return np.minimum(a, b) - h**3 * width / 6.0


def smooth_max(a: Array, b: Array, width: float) -> Array:
    return -smooth_min(-a, -b, width)


def superellipsoid(p: Array, center: Triple, radii: Triple, power: float) -> Array:
    """Signed distance to `sum |q_k / r_k|^power = 1`, to first order; power 2 is an ellipsoid, more is boxier."""
    q = (p - np.array(center)) / np.array(radii)
    size = np.maximum((np.abs(q) ** power).sum(axis=-1), 1e-12) ** (1.0 / power)
    slope = np.linalg.norm((np.abs(q) / size[..., None]) ** (power - 1.0) / np.array(radii), axis=-1)
    return (size - 1.0) / slope


def bump(distance: Array, width: float) -> Array:
    """A smooth bump of height 1 where `distance` is zero."""
    return np.exp(-((distance / width) ** 2))


def before(a: Array, limit: float, width: float = 0.010) -> Array:
    """1 where a < limit, 0 beyond, with a smooth step of the given width."""
    return 0.5 - 0.5 * np.tanh((a - limit) / width)


def dome(p: Array) -> Array:
    """The convex body under the diaphragm: a bulky right lobe and a flat left one."""
    x, y, z = np.moveaxis(p, -1, 0)
    right = superellipsoid(p, (-0.030, 0.006, -0.020), (0.080, 0.073, 0.097), 2.3)
    tilted = p + np.stack([0.0 * x, 0.0 * x, 0.10 * x], axis=-1)
    left = superellipsoid(tilted, (0.036, -0.012, 0.022), (0.085, 0.055, 0.042), 2.0)
    body = smooth_min(right, left, 0.055)
    heart = 0.006 * bump(np.hypot(x - 0.040, y + 0.010), 0.035) * before(-z, -0.02)
    falciform = 0.0025 * bump(x - 0.020, 0.007) * before(y, 0.0)
    cava = 0.022 * bump(np.hypot(x - 0.006, y - 0.076), 0.017)
    return body + heart + falciform + cava


def visceral(p: Array) -> Array:
    """Positive below the visceral face, which looks down, back and to the left."""
    x, y, z = np.moveaxis(p, -1, 0)
    face = -0.022 + 0.42 * (x + 0.02) + 0.55 * y
    concavity = 0.020 * bump(np.hypot((x + 0.015) / 0.065, (y - 0.015) / 0.060), 1.0)
    caudate = -0.010 * bump(np.hypot((x - 0.006) / 0.016, (y - 0.048) / 0.020), 1.0)
    gallbladder = 0.016 * bump(x + 0.026 - 0.25 * (y + 0.04), 0.012) * before(y, 0.0)
    round_ligament = 0.018 * bump(x - 0.020, 0.008) * before(y, 0.012)
    porta = 0.010 * bump(np.hypot((x - PORTA[0]) / 1.8, y - PORTA[1]), 0.012)
    slope = np.sqrt(1.0 + 0.42**2 + 0.55**2)
    return (face + concavity + caudate + gallbladder + round_ligament + porta - z) / slope


def implicit(p: Array) -> Array:
    """Negative inside the liver, roughly the distance to its surface [m]."""
    return smooth_max(dome(p), visceral(p), 0.012)


def vertex_normals(points: Array, triangles: Indices) -> Array:
    x = points[triangles]
    normals = np.zeros_like(points)
    face = np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0])
    for i in range(3):
        np.add.at(normals, triangles[:, i], face)
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)


def liver() -> tuple[Array, Indices, dict[str, Indices]]:
    """Points [m], cells and node sets.

    `hilum`: where the organ is held. The porta hepatis on the visceral face, and the bare area at the back, which
    ligaments and the vena cava bind to the diaphragm. `anterior`: what a surgeon touches, the diaphragmatic face
    seen from the front and above, clear of the hilum and of the sharp margin. `tip`: the end of the left lobe.
    """
    points, cells = fill(implicit, *BOX, SPACING)
    volume = np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]]).sum() / 6.0
    points = points * np.cbrt(VOLUME / volume)

    triangles = boundary(cells)
    nodes = np.unique(triangles)
    x, normals = points[nodes], vertex_normals(points, triangles)[nodes]
    is_porta = (np.linalg.norm(x - PORTA, axis=1) < 0.026) & (normals[:, 2] < 0.0)
    is_bare = (np.hypot(x[:, 0] + 0.012, 1.5 * (x[:, 2] - 0.038)) < 0.043) & (normals[:, 1] > 0.35) & (x[:, 1] > 0.03)
    hilum = nodes[is_porta | is_bare]
    to_hilum = np.linalg.norm(x[:, None] - points[hilum], axis=2).min(axis=1)
    looks_at_us = normals @ np.array([0.0, -0.75, 0.66]) > 0.35
    is_diaphragmatic = dome(x) > visceral(x) + RIM
    sets = {
        "anterior": nodes[looks_at_us & is_diaphragmatic & (to_hilum > CLEARANCE)],
        "hilum": hilum,
        "tip": nodes[x[:, 0] > points[:, 0].max() - 0.015],
    }
    return points, cells, sets
