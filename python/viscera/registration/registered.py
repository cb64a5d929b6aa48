"""The result of a registration."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from viscera import _core
from viscera.deformed import Deformed
from viscera.display import Pictured
from viscera.errors import VisceraError
from viscera.mesh import Floats, Mesh
from viscera.output import state as statefile
from viscera.quantity import numbers_of, refused
from viscera.registration.residuals import MISFIT, Left, is_beyond_noise
from viscera.registration.rigid import Rigid, aligned

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from viscera.organ import Organ
    from viscera.state import State

MODEL, SWUNG = 0.2, 0.05
"""Error by law and mesh: standard deviation, as a share of a node's deformation, and of its displacement against the
fixed nodes, which a wrong law turns too far or not far enough."""
NAMED = 3
"""Landmarks and points that a message names; it counts the others."""
LINEARISED = 2.5
"""Standard deviations of places over those of the linearised problem, which knows no other shape that fits as well."""


class Registered(Deformed, Pictured):
    """An organ where it was found: displacement, rigid motion, residuals, uncertainty. Made by `Organ.register`.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> moved = beam.mesh.points[::20] * 0.0 + [0.0, 0.0, 0.1]
    >>> found = beam.register(points=(beam.mesh.points[::20], moved), noise="1 mm")
    >>> found.translation.round(3).tolist(), found.band_at([[0.5, 0.1, 0.1]]).shape
    ([0.0, 0.0, 0.1], (1,))
    """

    def __init__(
        self,
        organ: Organ,
        state: State,
        motion: Rigid,
        *,
        residual: Floats,
        inliers: NDArray[np.bool_],
        pair_residual: dict[str, float],
        pair_noise: Floats,
        covariance: Floats,
        band: Floats,
        observed: NDArray[np.bool_],
        rivals: list[Floats],
        coverage: float,
        left: Left | None,
        nodal_force: Floats,
        iterations: int,
        is_settled: bool,
        message: str,
        seconds: float,
    ) -> None:
        self.organ = organ
        self.state = state
        """The equilibrium before the rigid motion, in the organ's own axes, under `nodal_force`."""
        self.mesh: Mesh = organ.mesh
        self.rotation: Floats = motion.rotation
        """(3, 3): x -> rotation x + translation takes the deformed organ to the measured points."""
        self.translation: Floats = motion.translation
        """(3,) [m]"""
        self.displacement: Floats = motion(self.mesh.points + state.displacement) - self.mesh.points
        """Displacement (n, 3) [m] from the mesh to the present position of the organ, rigid motion included."""
        self.residual = residual
        """Distance (k,) [m] of each surface point from the organ, positive outside."""
        self.is_inlier = inliers
        """(k,) whether a surface point belongs to the organ."""
        self.pair_residual = pair_residual
        """Remaining distance [m] at each landmark, and at each point under the names "point 0", "point 1", ...;
        `message` names those whose noise does not explain theirs (`residuals.is_beyond_noise`)."""
        self.covariance = covariance
        """Covariance (n, 3, 3) [m^2] of the position of each node by noise and unknown forces, linearised."""
        self.rivals: Floats = np.array(rivals, dtype=float).reshape(-1, *self.displacement.shape)
        """Displacements (r, n, 3) [m] of other poses of the organ that fit what was measured as well."""
        gap = np.linalg.norm(self.rivals - self.displacement, axis=2).max(axis=0, initial=0.0)
        self.band: Floats = np.maximum(band, gap)
        """Radius (n,) [m] around each position within which the true one lies with a probability of 95 %."""
        self.is_observed: NDArray[np.bool_] = observed & (gap <= band)
        """(n,) whether the data observe a node: they leave less than a quarter of its variance without data, and no
        other pose that fits as well has it elsewhere."""
        self.coverage = coverage
        """Share of the surface that the measured points lie on."""
        self.misfit: float | None = None if left is None else left.misfit
        """Distance of the inliers from the organ, over what their noise and the error of the model explain; None
        without surface points."""
        self.systematic_residual: float | None = None if left is None else left.systematic
        """What neighbouring inliers have in common of their distances [m] from the organ, as a root mean square: noise
        has nothing. None without surface points."""
        self.is_poor_fit: bool = left is not None and left.is_poor
        """Whether the points lie farther from the organ than noise and model explain, each for itself or whole
        neighbourhoods on one side of it: the band is not to be trusted."""
        self.nodal_force = nodal_force
        """Nodal forces (n, 3) [N] of the fit, in the organ's axes, proportional to the stiffness of the law."""
        self.iterations = iterations
        self.is_converged: bool = is_settled and state.is_converged
        self.seconds = seconds
        """Wall time."""
        fit = (message,) if message else (self._unexplained(), self._ambiguous(), self._unseen())
        self.message = "; ".join(filter(None, (self._doubted(pair_noise), *fit)))
        """What went wrong, what does not fit, or what was not observed; empty if none of these."""
        self._seal()

    @property
    def status(self) -> str:
        """ "converged", "partly observed", "not observed" (no node is), "poor fit" or "not converged"."""
        if not self.is_converged:
            return "not converged"
        if self.is_poor_fit:
            return "poor fit"
        if not self.is_observed.any():
            return "not observed"
        return "converged" if self.is_observed.all() else "partly observed"

    def _unexplained(self) -> str:
        if not self.is_poor_fit or self.misfit is None or self.systematic_residual is None:
            return ""
        if self.misfit > MISFIT:
            how = f"the points of the organ lie {self.misfit:.1f} times as far from it as noise and model explain"
        else:
            how = (
                f"neighbouring points lie {1e3 * self.systematic_residual:.2g} mm beside the organ in common, which "
                "neither noise nor the model's error explains"
            )
        return (
            f"{how}; do not trust the band; are they in another scale, mirrored or noisier than was said, is their "
            "noise the same over whole regions, or is the mesh too coarse?"
        )

    def _doubted(self, noise: Floats) -> str:
        """Landmarks and points that are not where they were measured, the farthest first."""
        gaps = np.array([*self.pair_residual.values()])
        far = np.flatnonzero(is_beyond_noise(gaps, noise, self.mesh.diagonal))
        if not len(far):
            return ""
        names = [*self.pair_residual]
        told = [
            f"{names[k]!r} by {1e3 * gaps[k]:.3g} mm, with a noise of {1e3 * noise[k]:.3g} mm"
            for k in far[np.argsort(-gaps[far])][:NAMED]
        ]
        more = f" and {len(far) - len(told)} others" if len(far) > len(told) else ""
        return (
            f"landmarks and points that do not fit, {len(far)} of {len(gaps)}: {', '.join(told)}{more}; the answer "
            "gives way to them, so check where they were measured, or state a larger noise of them (`landmark_noise`, "
            "--landmark-noise)"
        )

    def _ambiguous(self) -> str:
        if not len(self.rivals):
            return ""
        far = float(np.linalg.norm(self.rivals - self.displacement, axis=2).max())
        return (
            f"{len(self.rivals) + 1} poses fit the data about equally, with nodes up to {1e3 * far:.3g} mm elsewhere; "
            "this is the one that turns the organ least; say by landmarks, `visible` or `start` which is right"
        )

    def _unseen(self) -> str:
        hidden = ~self.is_observed
        if not hidden.any():
            return ""
        sets = [name for name, nodes in self.mesh.sets.items() if hidden[nodes].mean() > 0.5]
        words = f"; not observed for the most part: {', '.join(map(repr, sets))}" if sets else ""
        return (
            f"{100 * self.coverage:.0f} % of the surface was seen; {hidden.sum()} of {len(hidden)} nodes not observed, "
            f"and what is said there comes from the prior{words}"
        )

    def band_at(self, points: ArrayLike) -> Floats:
        """The band (k,) [m] at points (k, 3) [m] of the mesh; infinite at points that are not observed.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> places = beam.mesh.points[::20]
        >>> found = beam.register(points=(places, 0.0 * places + [0.0, 0.0, 0.1]), noise="1 mm")
        >>> bool(found.band_at([[0.5, 0.1, 0.1]])[0] < 5e-3)
        True
        """
        places = numbers_of(points)
        if places is None or places.ndim != 2 or places.shape[1] != 3:
            raise refused("the places", "an array (k, 3) [m]", points)
        mesh = self.mesh.linear()
        cells, weights = _core.Locator(mesh.points, mesh.cells).find(places)
        if (cells < 0).any():
            outside = int(np.argmax(cells < 0))
            raise VisceraError(f"place {outside} at {places[outside].tolist()} m lies outside the organ")
        nodes = mesh.cells[cells]
        is_known = np.einsum("ka,ka->k", weights, self.is_observed[nodes].astype(float)) > 0.5
        return np.where(is_known, np.einsum("ka,ka->k", weights, self.band[nodes]), np.inf)

    def _seen(self) -> tuple[Mesh, Floats]:
        return self.mesh, self.displacement

    def _from_rest(self) -> tuple[Organ, Floats]:
        return self.organ, self.displacement

    def _nodal(self) -> dict[str, Floats]:
        certainty = {statefile.REGISTERED: self.band, "is_observed": self.is_observed.astype(float)}
        return super()._nodal() | certainty

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure:
        """Draw the organ where it was found, coloured by its band. `path`: write a PNG file there.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> places = beam.mesh.points[::20]
        >>> found = beam.register(points=(places, 0.0 * places + [0.0, 0.0, 0.1]), noise="1 mm")
        >>> found.plot("found.png")
        <Figure size 1350x975 with 2 Axes>
        """
        from viscera.output.picture import draw

        return draw(
            self.mesh.points,
            self.mesh.surface,
            self.displacement,
            values=self.band,
            colour="band",
            path=path,
        )

    def __repr__(self) -> str:
        return (
            f"Registered({self.status}, coverage={100 * self.coverage:.0f} %, "
            f"largest band {1e3 * self.band.max():.1f} mm, {self.seconds:.1f} s)"
        )


def wrong_by_model(x: Floats, displacement: Floats) -> Floats:
    """Standard deviation (n,) [m] of what law and mesh get wrong about nodes x (n, 3) and their displacement (n, 3)."""
    moved = x + displacement
    deformation = aligned(moved, x, np.ones(len(x)))(moved) - x
    return np.asarray(
        np.hypot(*(share * np.linalg.norm(by, axis=1) for share, by in ((MODEL, deformation), (SWUNG, displacement))))
    )


def band_of(covariance: Floats, wrong: Floats) -> Floats:
    """Radius (n,) [m] that holds 95 % of a normal distribution, by Satterthwaite's and Wilson and Hilferty's formulas.

    wrong (n,) [m]: standard deviation of further errors in any direction, beside the covariance (n, 3, 3).
    """
    total = covariance + wrong[:, None, None] ** 2 / 3.0 * np.eye(3)
    first, second = np.trace(total, axis1=1, axis2=2), np.einsum("nij,nij->n", total, total)
    degrees = first**2 / second
    part = 2.0 / (9.0 * degrees)
    return np.asarray(np.sqrt(first * (1.0 - part + 1.645 * np.sqrt(part)) ** 3))
