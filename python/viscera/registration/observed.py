"""What was measured during the intervention, checked before anything is computed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from viscera import _core
from viscera.errors import VisceraError, did_you_mean
from viscera.mesh import Floats, Mesh
from viscera.quantity import brief, numbers_of, refused
from viscera.select import place as place_of

LARGEST_CLOUD = 4.0
"""Diagonals of the organ; a cloud wider than that is of something else, or in another unit."""
SMALLEST_CLOUD = 0.02
LONGEST, SHORTEST = 4.0, 0.02
"""Distances of landmarks and points from their middle over those at rest; beyond these they are in another unit."""
CLOSE = 0.1
"""Diagonals within which noise may move landmarks apart so many times as far."""
BESIDE_CLOUD = 2.0
"""Diagonals between a landmark and the cloud."""
BESIDE_LINE = 0.01
"""Diagonals by which landmarks and points extend beside the line through most of them, to fix a rigid motion."""
LARGEST_NOISE = 0.25
"""Diagonals of the organ; what is as uncertain as that says nothing of it, and is in another unit."""
FEWEST = 20
"""Surface points by which an organ is looked for without landmarks."""
LINE = 1e-3
"""Width over length up to which what was measured lies on a line."""


@dataclass(frozen=True, eq=False)
class Observed:
    """Places in space [m], in the axes of the intervention."""

    surface: Floats
    """Points (k, 3) on the organ's surface, nobody knows where on it."""
    weights: Floats
    """(k,), 1 by default; a point of weight 0 does not count. Of equal points one has the largest of their weights, and
    the others 0: two measurements of a place differ by their errors, so equal points are copies of one measurement."""
    places: Floats
    """Places (l, 3) of the organ at rest that were found again: landmarks first, then points."""
    members: tuple[tuple[NDArray[np.int64], Floats], ...]
    """Nodes and their weights, whose mean each of these places is."""
    measured: Floats
    """Where they were found (l, 3)."""
    names: tuple[str, ...]
    """Of the landmarks."""
    noise: float
    """Standard deviation of the surface points [m] along each axis."""
    pair_noise: Floats
    """The same of landmarks and points (l,)."""
    size: float
    """Diagonal of the organ at rest [m]."""

    @property
    def labels(self) -> tuple[str, ...]:
        """What landmarks and points (l,) are called in results and messages."""
        return (*self.names, *(f"point {k}" for k in range(len(self.places) - len(self.names))))

    def counted(self) -> Observed:
        """The same without surface points of weight 0, of which a fit is to know nothing."""
        counts = self.weights > 0.0
        return replace(self, surface=self.surface[counts], weights=self.weights[counts])

    @property
    def fixes_motion(self) -> bool:
        """Whether landmarks and points alone fix a rigid motion: three that are not on a line, for the organ's size."""
        if len(self.places) < 3:
            return False
        return bool(
            np.linalg.svd(self.places - self.places.mean(axis=0), compute_uv=False)[1] > BESIDE_LINE * self.size
        )


def observed(
    mesh: Mesh,
    surface: ArrayLike | None,
    weights: ArrayLike | None,
    landmarks: Mapping[str, ArrayLike] | None,
    points: tuple[ArrayLike, ArrayLike] | None,
    noise: float,
    landmark_noise: float,
) -> Observed:
    """Check what was measured; raises `VisceraError` with the place, the value and what to do."""
    cloud = np.empty((0, 3)) if surface is None else _places(surface, "surface")
    share = _once(cloud, np.ones(len(cloud)) if weights is None else _weights(weights, len(cloud)))
    names, members, measured = _landmarks(mesh, landmarks or {})
    if points is not None:
        if not isinstance(points, tuple | list) or len(points) != 2:
            raise refused(
                "points", "a pair of arrays (l, 3): places of the organ [m] and their displacements [m]", points
            )
        at, moved = _places(points[0], "the places of points"), _places(points[1], "the displacements of points")
        if at.shape != moved.shape:
            raise VisceraError(f"points has {len(at)} places but {len(moved)} displacements")
        low, high = mesh.bounding_box
        away = np.linalg.norm(np.clip(at, low, high) - at, axis=1)
        if (away > 0.1 * mesh.diagonal).any():
            first = int(np.argmax(away > 0.1 * mesh.diagonal))
            raise VisceraError(
                f"place {first} of points, {at[first].tolist()} m, is {away[first]:.3g} m outside the organ's box; "
                "give places of the organ at rest, in metres"
            )
        members, measured = [*members, *_within(mesh, at)], np.concatenate([measured, at + moved])
    places = np.array([weights @ mesh.points[nodes] for nodes, weights in members]).reshape(-1, 3)
    if not len(cloud) and not len(places):
        raise VisceraError("nothing was measured: give surface points, landmarks or points with displacements")
    pair_noise = np.full(len(places), landmark_noise)
    seen = Observed(cloud, share, places, tuple(members), measured, names, noise, pair_noise, mesh.diagonal)
    if not len(cloud) and not seen.fixes_motion:
        raise VisceraError(
            f"{len(places)} landmarks and points do not fix a rigid motion; give three that are not on a line, or "
            "surface points"
        )
    counted = seen.counted()
    if 0 < len(counted.surface) < FEWEST and not seen.fixes_motion:
        without = len(cloud) - len(counted.surface)
        repeated = " or repeated" if len(np.unique(cloud, axis=0)) < len(cloud) else ""
        beside = f", beside {without} of weight 0{repeated}," if without else ""
        raise VisceraError(
            f"{len(counted.surface)} surface points{beside} are too few to find the organ by; give {FEWEST}, or three "
            "landmarks"
        )
    _check_noise(seen, landmark_noise)
    _check_extent(counted)
    return seen


def _places(values: ArrayLike, what: str) -> Floats:
    given = numbers_of(values)
    if given is None or given.ndim != 2 or given.shape[1] != 3:
        raise refused(what, "an array (k, 3) [m]", values)
    if not len(given):
        raise VisceraError(f"{what} has no points")
    wrong = np.flatnonzero(~np.isfinite(given).all(axis=1))
    if len(wrong):
        raise VisceraError(
            f"point {wrong[0]} of {what} is not finite: {given[wrong[0]].tolist()} ({len(wrong)} of {len(given)} are "
            "not); leave it out"
        )
    return given


def _weights(values: ArrayLike, count: int) -> Floats:
    given = numbers_of(values)
    if given is None or given.shape != (count,) or not (np.isfinite(given) & (given >= 0.0)).all() or not given.any():
        raise refused("weights", f"{count} finite numbers from 0 on, one for each surface point, not all 0", values)
    return given


def _once(cloud: Floats, weights: Floats) -> Floats:
    """Weights (k,) of points (k, 3) with which equal points count once."""
    heaviest = np.argsort(-weights, kind="stable")
    first = heaviest[np.unique(cloud[heaviest], axis=0, return_index=True)[1]]
    once = np.zeros(len(weights))
    once[first] = weights[first]
    return once


def _landmarks(
    mesh: Mesh, landmarks: Mapping[str, ArrayLike]
) -> tuple[tuple[str, ...], list[tuple[NDArray[np.int64], Floats]], Floats]:
    """Names, their node sets, and where the means of these were found."""
    if not isinstance(landmarks, Mapping):
        raise refused("landmarks", "{name of a node set: (x, y, z)} [m]", landmarks)
    unknown = [name for name in landmarks if name not in mesh.sets]
    if unknown:
        raise VisceraError(f"no node set is called {brief(unknown[0])}; {did_you_mean(str(unknown[0]), mesh.sets)}")
    sets = [mesh.nodes(name).astype(np.int64) for name in landmarks]
    members = [(nodes, np.full(len(nodes), 1.0 / len(nodes))) for nodes in sets]
    measured = [place_of(place, f"landmark {name!r}") for name, place in landmarks.items()]
    return tuple(landmarks), members, np.array(measured).reshape(-1, 3)


def _within(mesh: Mesh, places: Floats) -> list[tuple[NDArray[np.int64], Floats]]:
    """Nodes and weights of places, those outside of all cells being moved onto the surface."""
    linear = mesh.linear()
    cells, weights = _core.Locator(linear.points, linear.cells).find(places)
    surface = _core.Surface(linear.points, linear.surface)
    found = []
    for place, cell, share in zip(places, cells, weights, strict=True):
        if cell < 0:
            triangle, corners, _ = surface.closest(place)
            found.append((linear.surface[triangle].astype(np.int64), np.array(corners)))
        else:
            found.append((linear.cells[cell].astype(np.int64), share))
    return found


def _check_noise(seen: Observed, landmark_noise: float) -> None:
    """Raise `VisceraError` if the noise of what was measured is as large as the organ."""
    for what, noise, count in (
        ("the surface points", seen.noise, len(seen.surface)),
        ("landmarks and points", landmark_noise, len(seen.places)),
    ):
        if count and noise > LARGEST_NOISE * seen.size:
            raise VisceraError(
                f"the noise of {what} is {noise:.3g} m and the organ extends over {seen.size:.3g} m, so they would say "
                "nothing of it; was it meant in metres? Give it with its unit, such as '2 mm'"
            )


def _check_extent(seen: Observed) -> None:
    """Raise `VisceraError` if what was measured fixes no turn, or cannot be this organ in metres."""
    if len(seen.places):
        _check_pairs(seen)
    everything: Any = np.concatenate([seen.surface, seen.measured])
    arms = everything - everything.mean(axis=0)
    _, width, length = np.linalg.eigvalsh(arms.T @ arms)
    if not width > LINE**2 * length:
        raise VisceraError(
            f"what was measured, {len(everything)} points, lies on one line or in one place, about which the organ may "
            "be turned in any way; add points beside it"
        )
    # Fewer points, beside landmarks that fix the motion, may lie close together.
    if len(seen.surface) < FEWEST:
        return
    size = float(np.linalg.norm(np.subtract(*_box(seen.surface))))
    if not SMALLEST_CLOUD * seen.size < size < LARGEST_CLOUD * seen.size:
        raise VisceraError(
            f"what was measured extends over {size:.3g} m and the organ over {seen.size:.3g} m; are both in metres?"
        )


def _check_pairs(seen: Observed) -> None:
    """Raise `VisceraError` if landmarks and points are as far from each other, or from the cloud, as no organ is.

    Beside a cloud their unit is a matter of its own: thousands of points hide that a few are in another one.
    """
    now, rest = (np.linalg.norm(x - x.mean(axis=0), axis=1) for x in (seen.measured, seen.places))
    far, most = int(now.argmax()), float(rest.max())
    if not SHORTEST * most <= now[far] <= LONGEST * max(most, CLOSE * seen.size):
        raise VisceraError(
            f"{seen.labels[far]!r} was measured {now[far]:.3g} m from the middle of landmarks and points, which lie up "
            f"to {most:.3g} m from it at rest; are both in metres?"
        )
    if not len(seen.surface):
        return
    high, low = _box(seen.surface)
    away = np.linalg.norm(np.clip(seen.measured, low, high) - seen.measured, axis=1)
    far = int(away.argmax())
    if away[far] > BESIDE_CLOUD * seen.size:
        raise VisceraError(
            f"{seen.labels[far]!r} was measured {away[far]:.3g} m from the surface points, and the organ extends over "
            f"{seen.size:.3g} m; are both in metres?"
        )


def _box(points: Floats) -> Any:
    """The upper and the lower corner of a box around points (k, 3), without the outermost twentieth on each side."""
    return np.percentile(points, [95, 5], axis=0)
