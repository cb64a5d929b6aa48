"""Tensors of a deformed organ: stress and strain at quadrature points, in cells, at nodes; their invariants.

With P = d psi / dF of the element (docs/elements.md) and J = det F:
    Cauchy sigma = P F^T / J,    S = F^-1 P,    E = (F^T F - I) / 2,    ln V = ln(F F^T) / 2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from viscera import _core
from viscera.errors import VisceraError
from viscera.files.mesh import EDGES
from viscera.mesh import Floats, Mesh
from viscera.quantity import Choice, numbers_of, refused
from viscera.sealed import Sealed

STRESSES = ("cauchy", "pk1", "pk2")
STRAINS = ("green", "log")
PLACES = ("cells", "nodes", "points")
SYMMETRIC = 1e-9
"""Part of a tensor's largest entry by which it may differ from its transpose."""

NEAR, FAR = (5.0 + 3.0 * 5.0**0.5) / 20.0, (5.0 - 5.0**0.5) / 20.0
"""Barycentric coordinates of the four quadrature points of a quadratic cell."""


@dataclass(frozen=True, eq=False)
class Response(Sealed):
    """What the law answers at q quadrature points, of equal weight, in each of m cells."""

    mesh: Mesh
    gradient: Floats
    """Deformation gradient F (m, q, 3, 3)."""
    pk1: Floats
    """First Piola-Kirchhoff stress P (m, q, 3, 3) [Pa] of the element."""
    energy: Floats
    """Strain energy density (m, q) [J/m^3] of the rest volume."""
    is_linear: bool
    """Whether the law is linear, so that its stress is the same in the shape at rest and in the deformed shape."""

    def stress(self, measure: str) -> Floats:
        """Stress (m, q, 3, 3) [Pa]."""
        Choice(STRESSES)(measure, "the stress")
        if measure == "pk1" or self.is_linear:
            return self.require_values()
        if measure == "pk2":
            self._require_upright()
            return np.asarray(np.linalg.solve(self.gradient, self.require_values()))
        J = self._require_upright()[..., None, None]
        return np.asarray(self.require_values() @ self.gradient.swapaxes(-1, -2) / J)

    def even(self) -> Response:
        """The same with one pressure in each cell, the mean over its points.

        Near incompressibility the pressures of the four points of a quadratic cell are far apart, and only their mean
        is that of the tissue: a straight line through them would be further off than any of them (docs/output.md).
        """
        if self.pk1.shape[1] == 1 or (self.inverted.any() and not self.is_linear):
            return self
        sigma = self.stress("cauchy")
        apart = pressure(sigma) - pressure(sigma).mean(axis=1, keepdims=True)
        sigma = sigma + apart[..., None, None] * np.eye(3)
        if self.is_linear:
            return replace(self, pk1=sigma)
        turned = np.linalg.solve(self.gradient, sigma.swapaxes(-1, -2)).swapaxes(-1, -2)  # sigma F^-T
        return replace(self, pk1=np.asarray(self.volume_ratio[..., None, None] * turned))

    def corner_forces(self) -> Floats:
        """Forces f_a = V P grad N_a (m, 4, 3) [N] of the mean stress of each cell on its corners, alone."""
        corners = self.mesh.points[self.mesh.cells[:, :4]]
        edges = corners[:, 1:] - corners[:, :1]
        slopes = np.linalg.inv(edges).swapaxes(1, 2)
        slopes = np.concatenate([-slopes.sum(axis=1, keepdims=True), slopes], axis=1)
        volumes = np.linalg.det(edges) / 6.0
        return np.asarray(np.einsum("m,mij,maj->mai", volumes, self.pk1.mean(axis=1), slopes))

    def strain(self, measure: str) -> Floats:
        """Strain (m, q, 3, 3)."""
        Choice(STRAINS)(measure, "the strain")
        F = self.gradient
        if measure == "green":
            return np.asarray(0.5 * (F.swapaxes(-1, -2) @ F - np.eye(3)))
        self._require_upright()
        squares, axes = np.linalg.eigh(F @ F.swapaxes(-1, -2))
        return np.asarray((axes * 0.5 * np.log(squares)[..., None, :]) @ axes.swapaxes(-1, -2))

    def at(self, values: Floats, place: str) -> Floats:
        """Values (m, q, ...) of quadrature points there, as means in cells (m, ...), or at nodes (n, ...)."""
        Choice(PLACES)(place, "the place")
        if place == "points":
            return values
        return values.mean(axis=1) if place == "cells" else at_nodes(self.mesh, values)

    @cached_property
    def volume_ratio(self) -> Floats:
        """J (m, q)."""
        return np.asarray(np.linalg.det(self.gradient))

    @cached_property
    def inverted(self) -> NDArray[np.bool_]:
        """Cells (m,) of which a point has no positive volume ratio."""
        return np.asarray(~(self.volume_ratio > 0.0).all(axis=1))

    @cached_property
    def without_value(self) -> NDArray[np.bool_]:
        """Cells (m,) of which a point has no stress or no energy.

        One may have a value where the other has none: below J = 0 the logarithm has none, its slope 1 / J has.
        """
        return np.asarray(~(np.isfinite(self.pk1).all(axis=(1, 2, 3)) & np.isfinite(self.energy).all(axis=1)))

    def _require_upright(self) -> Floats:
        J = self.volume_ratio
        if not (J > 0.0).all():
            cell, point = np.unravel_index(int(np.argmin(J)), J.shape)
            instead = "the strain 'green'" if self.without_value.any() else "'pk1' or 'green'"
            raise VisceraError(
                f"cell {cell} is inverted (J = {J[cell, point]:.3g}), so this measure is not defined; "
                f"take {instead}, or load the organ less"
            )
        return J

    def require_values(self) -> Floats:
        """The stress P. Raises `VisceraError` where stress or energy has no value, as with most laws in an inverted
        cell: ln J and powers of J end there."""
        if self.without_value.any():
            cell = int(np.argmax(self.without_value))
            what = "no energy, and so no stress," if np.isfinite(self.pk1[cell]).all() else "no stress and no energy"
            raise VisceraError(
                f"the law has {what} in cell {cell} (J = {self.volume_ratio[cell].min():.3g}); "
                "take the strain 'green', or load the organ less"
            )
        return self.pk1


def principal(tensor: ArrayLike) -> Floats:
    """Principal values (..., 3) of symmetric tensors (..., 3, 3), largest first.

    >>> principal(np.diag([1.0, 3.0, 2.0])).tolist()
    [3.0, 2.0, 1.0]
    """
    numbers = numbers_of(tensor)
    if numbers is None or not np.isfinite(numbers).all():
        raise refused("the tensor", "an array (..., 3, 3) of finite numbers", tensor)
    if numbers.shape[-2:] != (3, 3):
        raise VisceraError(f"principal values are those of tensors (..., 3, 3), not of an array {numbers.shape}")
    if np.abs(numbers - numbers.swapaxes(-1, -2)).max(initial=0.0) > SYMMETRIC * np.abs(numbers).max(initial=0.0):
        raise VisceraError("principal values are those of symmetric tensors; of stresses take 'cauchy' or 'pk2'")
    return np.asarray(np.linalg.eigvalsh(numbers)[..., ::-1])


def pressure(stress: Floats) -> Floats:
    """-tr(sigma) / 3 (...) of stresses (..., 3, 3)."""
    return np.asarray(-np.trace(stress, axis1=-2, axis2=-1) / 3.0)


def von_mises(stress: Floats) -> Floats:
    """sqrt(3/2 s : s) (...) with s = sigma - tr(sigma) / 3 I, of stresses (..., 3, 3)."""
    deviator = stress + pressure(stress)[..., None, None] * np.eye(3)
    return np.asarray(np.sqrt(1.5 * (deviator**2).sum(axis=(-2, -1))))


def at_nodes(mesh: Mesh, values: Floats) -> Floats:
    """Means (n, ...) over the cells around each node, weighted by volume, of values (m, q, ...) at points of cells."""
    nodes, corners = mesh.cells, corner_values(values)
    if len(mesh.edges):
        nodes = _core.quadratic(mesh.n_corners, mesh.cells)[1]
        middles = [0.5 * (corners[:, a] + corners[:, b])[:, None] for a, b in EDGES]
        corners = np.concatenate([corners, *middles], axis=1)
    volumes = np.asarray(mesh.facts["cell_volumes"])
    n, flat = len(mesh.points), corners.reshape(*nodes.shape, -1)
    weights = np.broadcast_to(volumes[:, None], nodes.shape).ravel()
    sums = [np.bincount(nodes.ravel(), weights * flat[..., k].ravel(), n) for k in range(flat.shape[-1])]
    means = np.stack(sums, axis=-1) / np.bincount(nodes.ravel(), weights, n)[:, None]
    return means.reshape(n, *values.shape[2:])


def corner_values(values: Floats) -> Floats:
    """At the corners (m, 4, ...) of cells: what one point has, or the linear function through four."""
    if values.shape[1] == 1:
        return np.repeat(values, 4, axis=1)
    return np.asarray((values - FAR * values.sum(axis=1, keepdims=True)) / (NEAR - FAR))
