"""The web version of a model: the surface alone, with fewer modes, below a size; and what that costs, measured.

Region by region the stored fields are expanded in their principal directions, weighted as off-line (each order by the
depth to its degree), and the fewest are kept that leave less than a tolerance at the worst position. Forces, stiffness
and their error estimates come from coefficients that are kept as they are.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import prod, sqrt
from typing import Any

import numpy as np

from viscera.check import surface_points
from viscera.errors import VisceraError
from viscera.mesh import Floats
from viscera.touch import Touch, load_bytes
from viscera.viewer.surface import Arrays, named, pack, surface_arrays

LIMIT = 25_000_000
"""Largest web version [bytes]."""
TOLERANCES = (0.002, 0.003, 0.005, 0.007, 0.01, 0.015, 0.02, 0.03, 0.05)
"""Tried in this order: errors of the field at full depth, relative to it, root mean square over directions."""
TOUCHES = 200


@dataclass(frozen=True)
class WebModel:
    """The bytes of the web version and its distance from the full model."""

    data: bytes
    modes: int
    worst_error: float
    """|u - u_full| / |u_full| over the surface nodes: the worst of random touches at full depth."""
    touches: int


def web_model(touch: Touch, name: str, limit: int = LIMIT) -> WebModel:
    """The most accurate web version below `limit` bytes; raises `VisceraError` where even the coarsest is larger."""
    arrays = surface_arrays(touch)
    regions = [_Region(touch, arrays, index) for index in range(len(arrays["region_start"]) - 1)]
    for tolerance in TOLERANCES:
        kept = [region.modes_needed(tolerance) for region in regions]
        if _size(arrays, regions, kept) < 0.98 * limit:
            return _measured(touch, name, _recompressed(arrays, regions, kept))
    raise VisceraError(f"no web version of this model is below {limit / 1e6:.0f} MB; reduce it with fewer positions")


class _Region:
    """A region's modes in orthonormal form: principal directions of its weighted fields, the strongest first."""

    def __init__(self, touch: Touch, arrays: Arrays, index: int) -> None:
        exponents = _exponents(touch.order)
        weight = _weights(exponents, touch.depth)
        self.terms = len(exponents)
        self.edge_terms = len(arrays["edge_force"]) // max(len(arrays["edges"]), 1)
        start, end = arrays["region_start"][index : index + 2]
        modes = arrays["surface_modes"].reshape(len(arrays["mode_scale"]), -1)[start:end].astype(float)
        modes *= arrays["mode_scale"][start:end, None]
        self.positions = np.flatnonzero(arrays["position_region"] == index)
        self.edges = np.flatnonzero(arrays["edge_region"] == index)
        own = _rows(arrays, "position", self.terms, index).reshape(len(self.positions), self.terms, -1)
        between = _rows(arrays, "edge", self.edge_terms, index).reshape(len(self.edges), self.edge_terms, -1)
        # An orthonormal basis over the surface, in which the stored modes have the coordinates `directions * lengths`.
        squares, directions = np.linalg.eigh(modes @ modes.T)
        lengths = np.sqrt(np.maximum(squares, 1e-14 * squares[-1]))
        orthonormal = (directions / lengths).T @ modes
        own, between = own @ (directions * lengths), between @ (directions * lengths)
        weighted = own * weight[:, None]
        weighted_between = between * weight[3 : 3 + self.edge_terms, None]
        fields = np.concatenate([weighted.reshape(-1, len(modes)), weighted_between.reshape(-1, len(modes))])
        _, principal = np.linalg.eigh(fields.T @ fields)
        principal = principal[:, ::-1]
        self.modes = principal.T @ orthonormal
        self.own, self.between = own @ principal, between @ principal
        first = ((weighted[:, :3] @ principal) ** 2).sum(axis=(1, 2))
        # Square of what a position or an edge loses when only the first k modes are kept, relative to its field.
        self._losses = np.concatenate(
            [
                _tails(weighted @ principal) / first[:, None],
                _tails(weighted_between @ principal) / first.mean(),
            ]
        ).max(axis=0)
        pushes = _directions() * touch.depth
        self._monomials = np.array([[prod(d**e) for e in exponents] for d in pushes])

    def modes_needed(self, tolerance: float) -> int:
        """The fewest modes that lose less than the tolerance at every position and edge."""
        return int(np.argmax(self._losses <= tolerance**2))

    def errors(self, kept: int) -> Floats:
        """Loss of each position at full depth in the worst direction, relative to its field."""
        fields = np.einsum("dt,ptm->pdm", self._monomials, self.own)
        lost = np.linalg.norm(fields[:, :, kept:], axis=2) / np.linalg.norm(fields, axis=2)
        return np.asarray(lost.max(axis=1))


def _recompressed(arrays: Arrays, regions: list[_Region], kept: list[int]) -> Arrays:
    modes = np.concatenate([region.modes[:k] for region, k in zip(regions, kept, strict=True)])
    scale = (np.abs(modes).max(axis=1) / np.iinfo(np.int16).max).astype(np.float32)
    out = {
        **arrays,
        "region_start": np.concatenate([[0], np.cumsum(kept)]).astype(np.uint32),
        "mode_scale": scale,
        "surface_modes": np.round(modes / scale[:, None]).astype(np.int16).reshape(-1, 3),
        "position_coefficients": _gathered(
            [(r.positions, r.own[:, :, :k]) for r, k in zip(regions, kept, strict=True)]
        ),
        "edge_coefficients": _gathered([(r.edges, r.between[:, :, :k]) for r, k in zip(regions, kept, strict=True)]),
        "compression": arrays["compression"].copy(),
    }
    for region, k in zip(regions, kept, strict=True):
        out["compression"][region.positions] += region.errors(k).astype(np.float32)
    return out


def _gathered(parts: list[tuple[Any, Floats]]) -> Floats:
    """Coefficients of all regions as one run, in the order of positions or edges."""
    runs = {int(owner): rows for owners, block in parts for owner, rows in zip(owners, block, strict=True)}
    return np.concatenate([runs[owner].ravel() for owner in sorted(runs)]).astype(np.float32)


def _measured(touch: Touch, name: str, arrays: Arrays) -> WebModel:
    errors = {**touch.metadata["errors"], "compression": float(arrays["compression"].max())}
    metadata = {**touch.metadata, "errors": errors}
    small = load_bytes(pack(named(metadata, name), arrays))
    rng = np.random.default_rng(0)
    worst = 0.0
    for point in surface_points(touch, TOUCHES, rng):
        direction = rng.normal(size=3)
        push = touch.depth * direction / np.linalg.norm(direction)
        full = touch.surface_displacement(point, push)
        difference = np.linalg.norm(small.surface_displacement(point, push) - full)
        worst = max(worst, float(difference / np.linalg.norm(full)))
    notes = named(metadata, name, web={"worst_error": worst, "touches": TOUCHES})
    return WebModel(pack(notes, arrays), len(arrays["mode_scale"]), worst, TOUCHES)


def _size(arrays: Arrays, regions: list[_Region], kept: list[int]) -> int:
    """Bytes of the file, but for its header."""
    changed = ("surface_modes", "position_coefficients", "edge_coefficients", "mode_scale")
    rest = sum(array.nbytes for name, array in arrays.items() if name not in changed)
    nodes = len(arrays["surface_nodes"])
    each = [2 * 3 * nodes + 4 + 4 * (r.terms * len(r.positions) + r.edge_terms * len(r.edges)) for r in regions]
    return rest + sum(k * size for k, size in zip(kept, each, strict=True))


def _rows(arrays: Arrays, kind: str, terms: int, region: int) -> Floats:
    """The coefficients of a region's positions or edges, as one run."""
    owners = arrays[f"{kind}_region"]
    lengths = terms * np.diff(arrays["region_start"].astype(int))[owners]
    mine = np.repeat(owners == region, lengths)
    return np.asarray(arrays[f"{kind}_coefficients"][mine], float)


def _tails(rows: Floats) -> Floats:
    """For each owner (p, terms, modes) the squares beyond the first 0, 1, ..., modes: (p, modes + 1)."""
    squares = (rows**2).sum(axis=1)
    beyond = np.cumsum(squares[:, ::-1], axis=1)[:, ::-1]
    return np.concatenate([beyond, np.zeros((len(rows), 1))], axis=1)


def _exponents(order: int) -> list[tuple[int, int, int]]:
    """Of the series' monomials in the order of the model file."""
    return [
        (i, j, degree - i - j)
        for degree in range(1, order + 1)
        for i in range(degree, -1, -1)
        for j in range(degree - i, -1, -1)
    ]


def _weights(exponents: list[tuple[int, int, int]], depth: float) -> Floats:
    """Root mean square of each monomial over the sphere of full depth."""

    def odd(k: int) -> int:
        return prod(range(1, 2 * k, 2))

    return np.array([depth ** sum(e) * sqrt(prod(map(odd, e)) / odd(sum(e) + 1)) for e in exponents])


def _directions() -> Floats:
    """Unit vectors to the faces, edges and corners of a cube."""
    grid = np.stack(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 3), axis=-1).reshape(-1, 3)
    grid = grid[np.abs(grid).sum(axis=1) > 0]
    return np.asarray(grid / np.linalg.norm(grid, axis=1, keepdims=True))
