"""The problems that other codes solve on our organs: supports, loads and laws as plain data.

One statement serves the scripts that run the other codes and the test that compares: who changes it runs them again.
Moduli are given once for an organ; each law takes its parameters from them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import viscera as vs
from viscera.law import Law
from viscera.study import artery

Floats = NDArray[np.float64]
Vector = tuple[float | None, float | None, float | None]

GRAVITY = (0.0, -9.81, 0.0)
FORMS = {"mr": "J-1", "mr2": "J^2-1"}


@dataclass(frozen=True)
class Problem:
    """An organ, what holds it and what loads it; SI units."""

    organ: str
    young: float
    poisson: float
    fixed: str
    displacement: Mapping[str, Vector] = field(default_factory=dict)
    """Prescribed components of node sets [m]; None leaves one free."""
    force: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    """Dead loads [N], a uniform traction over the set's surface triangles."""
    mean: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    """Prescribed mean displacement of node sets [m], each node weighted by its share of the set's area."""
    density: float = 0.0
    pressure: Mapping[str, float] = field(default_factory=dict)
    """Follower pressure on the surface triangles of node sets [Pa]."""
    gravity: tuple[float, float, float] = GRAVITY
    steps: int = 10
    laws: tuple[str, ...] = ("linear", "svk", "nh", "mr")
    c1_c2_kappa: tuple[float, float, float] | None = None
    """Of Mooney-Rivlin; by default those of the same moduli at small strain."""

    @property
    def mesh(self) -> vs.Mesh:
        mesh: vs.Mesh = getattr(vs.organs, self.organ)()
        return mesh

    @property
    def mu(self) -> float:
        return self.young / (2 * (1 + self.poisson))

    @property
    def lam(self) -> float:
        return self.young * self.poisson / ((1 + self.poisson) * (1 - 2 * self.poisson))

    @property
    def mooney_rivlin(self) -> tuple[float, float, float]:
        """c1, c2 and kappa."""
        return self.c1_c2_kappa or (0.4 * self.mu, 0.1 * self.mu, self.lam + 2 / 3 * self.mu)

    @property
    def kappa(self) -> float:
        """Bulk modulus."""
        return self.lam + 2 / 3 * self.mu

    def law(self, name: str) -> Law:
        """Our law by the name the data files use."""
        if name in FORMS:
            return vs.MooneyRivlin(*self.mooney_rivlin, volumetric=FORMS[name])
        if name == "yeoh":
            return vs.Yeoh(*(c * self.mu for c in YEOH), kappa=self.kappa)
        if name == "ogden":
            mu = [2 * share * self.mu / exponent for share, exponent in OGDEN]
            return vs.Ogden(mu, [exponent for _, exponent in OGDEN], kappa=self.kappa)
        if name == "hgo":
            c, k1, k2, dispersion = HOLZAPFEL_GASSER_OGDEN
            return vs.HolzapfelGasserOgden(
                c * self.mu, k1 * self.mu, k2, dispersion=dispersion, fibres=FIBRES, kappa=self.kappa
            )
        laws = {
            "linear": vs.Linear,
            "corotated": vs.Corotated,
            "svk": vs.SaintVenantKirchhoff,
            "nh": vs.NeoHookean,
        }
        return laws[name](mu=self.mu, lam=self.lam)


# In units of the shear modulus: c10, c20, c30; shares of the modulus and exponents; c, k1, then k2 and dispersion.
YEOH = (0.5, 0.3, 0.2)
OGDEN = ((0.7, 2.3), (0.1, 9.0), (0.2, -3.4))
HOLZAPFEL_GASSER_OGDEN = (1.0, 0.8, 1.1, 0.1)
FIBRES = np.array([[0.8, 0.6, 0.0], [0.8, 0.0, -0.6]])

# The artery's protocol is that of Niroomandi et al., IJNME 96 (2013) 129: the top ring fixed, the middle one driven
# by half the outer diameter across, the bottom one by 30 % of the height along the vessel.
PROBLEMS = {
    "beam": Problem("beam", 1e5, 0.45, "clamp", force={"tip": (0.0, -6.0, -8.0)}),
    "artery_stretch": Problem(
        "artery", 5e5, 0.45, "top", {"middle": (0.0035, None, None), "bottom": (None, None, -0.012)}, density=510.0
    ),
    "artery_compress": Problem(  # a tenth of the way: the vessel has not buckled
        "artery", 5e5, 0.45, "top", {"middle": (0.00035, None, None), "bottom": (None, None, 0.0012)}, density=510.0
    ),
    "beam_rubber": Problem("beam", 1e5, 0.45, "clamp", force={"tip": (9.0, -6.0, -8.0)}, laws=("yeoh", "ogden", "hgo")),
    "artery_inflated": Problem(  # the rim of the branch is free; CalculiX errs with the square of its increments here
        "artery", 5e5, 0.45, "top", {"bottom": (0.0, 0.0, 0.0)}, pressure={"lumen": 13e3}, steps=160, laws=("svk", "mr")
    ),
    "liver": Problem("liver", 1e4, 0.45, "hilum", force={"tip": (0.1, 0.0, 0.4)}),
    "liver_driven": Problem("liver", 1e4, 0.45, "hilum", mean={"tip": (0.0, 0.01, 0.02)}),
}

# The study of paper B, as the package states it; what the peers find for it goes where `viscera study artery` reads.
STUDY = {
    label: Problem(
        "artery",
        artery.YOUNG,
        artery.POISSON,
        "top",
        artery.loads(density)["displacement"],
        density=density,
        gravity=artery.GRAVITY,
        steps=artery.STEPS,
        c1_c2_kappa=(artery.C1, artery.C2, 4 * artery.ALPHA),
    )
    for label, density in artery.DENSITIES.items()
}
STUDY_LAWS = {
    "linear": "Linear",
    "corotated": "Corotated",
    "svk": "SaintVenantKirchhoff",
    "nh": "NeoHookean",
    "mr2": "MooneyRivlin J^2-1",
    "mr": "MooneyRivlin J-1",
}


def study_data(peer: str) -> Path:
    """The file in the package that holds what a peer found for the study."""
    return Path(artery.__file__).with_name(f"artery_{peer}.npz")


def area_shares(mesh: vs.Mesh, name: str) -> Floats:
    """Share (k,) of each node of a set in the area of the surface triangles that lie in the set."""
    nodes = mesh.nodes(name)
    areas = np.zeros(len(mesh.points))
    for triangle in mesh.surface:
        if np.isin(triangle, nodes).all():
            a, b, c = mesh.points[triangle]
            areas[triangle] += np.linalg.norm(np.cross(b - a, c - a)) / 6
    shares: Floats = areas[nodes] / areas[nodes].sum()
    return shares


def nodal_forces(problem: Problem) -> Floats:
    """Dead loads (n, 3) [N]: each triangle gives a third of its share to each corner."""
    forces = np.zeros_like(problem.mesh.points)
    for name, total in problem.force.items():
        forces[problem.mesh.nodes(name)] += area_shares(problem.mesh, name)[:, None] * total
    return forces


def pressed(problem: Problem) -> Iterator[tuple[NDArray[np.uint32], float]]:
    """Surface triangles, outward, and the pressure on each."""
    for name, value in problem.pressure.items():
        inside = np.isin(problem.mesh.surface, problem.mesh.nodes(name)).all(axis=1)
        yield from ((triangle, value) for triangle in problem.mesh.surface[inside])


def prescribed(problem: Problem) -> Floats:
    """Prescribed displacement (n, 3) [m], NaN where a component is free."""
    values = np.full_like(problem.mesh.points, np.nan)
    for name, target in problem.displacement.items():
        for axis, value in enumerate(target):
            if value is not None:
                values[problem.mesh.nodes(name), axis] = value
    values[problem.mesh.nodes(problem.fixed)] = 0.0
    return values
