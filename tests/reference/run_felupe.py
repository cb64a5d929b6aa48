"""Solves the problems with FElupe and writes data/felupe.npz: displacements (n, 3) [m] and reactions (3,) [N].

Quadrature, materials, stresses, tangents and assembly are FElupe's; Newton's iteration and the multipliers that hold a
mean displacement are here, in SciPy, so that the residual is driven to round-off.
"""

from __future__ import annotations

import platform
from importlib.metadata import version
from pathlib import Path
from typing import Any

import felupe as fem
import numpy as np
import tensortrax.math as tm
from problems import (
    FIBRES,
    HOLZAPFEL_GASSER_OGDEN,
    OGDEN,
    PROBLEMS,
    STUDY,
    STUDY_LAWS,
    YEOH,
    Problem,
    area_shares,
    nodal_forces,
    prescribed,
    study_data,
)
from scipy.sparse import block_array, csr_array
from scipy.sparse.linalg import splu

DATA = Path(__file__).parent / "data" / "felupe.npz"
TOLERANCE = 1e-12


def holzapfel_gasser_ogden(C: Any, c: float, k1: float, k2: float, dispersion: float) -> Any:
    """The isochoric energy as printed, differentiated by tensortrax; fibres bear no compression."""
    isochoric = tm.linalg.det(C) ** (-1 / 3) * C
    shear = tm.trace(isochoric) - 3
    energy = c / 2 * shear
    for a in FIBRES:
        along = sum(a[i] * a[j] * isochoric[i, j] for i in range(3) for j in range(3))
        E = tm.maximum(dispersion * shear + (1 - 3 * dispersion) * (along - 1), 0.0 * shear)
        energy = energy + k1 / (2 * k2) * (tm.exp(k2 * E**2) - 1)
    return energy


def corotated(C: Any, mu: float, lam: float) -> Any:
    """The corotated energy in the principal stretches."""
    stretches = tm.sqrt(tm.linalg.eigvalsh(C))
    return mu * tm.sum((stretches - 1) ** 2, axis=0) + lam / 2 * (tm.sum(stretches, axis=0) - 3) ** 2


def squared(C: Any, kappa: float) -> Any:
    """The volumetric energy kappa/8 (J^2 - 1)^2."""
    return kappa / 8 * (tm.linalg.det(C) - 1) ** 2


def material(problem: Problem, law: str) -> fem.ConstitutiveMaterial:
    c1, c2, kappa = problem.mooney_rivlin
    mu, volume = problem.mu, fem.Volumetric(bulk=problem.kappa)
    c, k1, k2, dispersion = HOLZAPFEL_GASSER_OGDEN
    fibres = {"c": c * mu, "k1": k1 * mu, "k2": k2, "dispersion": dispersion}
    shares, exponents = zip(*OGDEN, strict=True)
    yeoh = dict(zip(("C10", "C20", "C30"), mu * np.array(YEOH), strict=True))
    return {
        "linear": lambda: fem.LinearElastic(E=problem.young, nu=problem.poisson),
        "svk": lambda: fem.Hyperelastic(fem.saint_venant_kirchhoff, mu=problem.mu, lmbda=problem.lam),
        "nh": lambda: fem.NeoHookeCompressible(mu=problem.mu, lmbda=problem.lam),
        "yeoh": lambda: fem.Hyperelastic(fem.yeoh, **yeoh) & volume,
        "ogden": lambda: fem.Hyperelastic(fem.ogden, mu=[mu * s for s in shares], alpha=list(exponents)) & volume,
        "hgo": lambda: fem.Hyperelastic(holzapfel_gasser_ogden, **fibres) & volume,
        "corotated": lambda: fem.Hyperelastic(corotated, mu=problem.mu, lam=problem.lam),
        "mr2": lambda: fem.Hyperelastic(fem.mooney_rivlin, C10=c1, C01=c2) & fem.Hyperelastic(squared, kappa=kappa),
        "mr": lambda: fem.Hyperelastic(fem.mooney_rivlin, C10=c1, C01=c2) & fem.Volumetric(bulk=kappa),
    }[law]()


def means(problem: Problem) -> tuple[csr_array, np.ndarray]:
    """Rows of B and values c of the constraints B u = c on mean displacements."""
    rows, values = [], []
    for name, target in problem.mean.items():
        for axis in range(3):
            row = np.zeros_like(problem.mesh.points)
            row[problem.mesh.nodes(name), axis] = area_shares(problem.mesh, name)
            rows.append(row.ravel())
            values.append(target[axis])
    size = problem.mesh.points.size
    return csr_array(np.array(rows).reshape(len(rows), size)), np.array(values)


def solve(problem: Problem, law: str) -> tuple[np.ndarray, np.ndarray]:
    """Displacement (n, 3) and the reaction (3,) of the fixed set."""
    mesh = fem.Mesh(problem.mesh.points, problem.mesh.cells.astype(int), "tetra")
    field = fem.FieldContainer([fem.Field(fem.RegionTetra(mesh), dim=3)])
    body = fem.SolidBody(material(problem, law), field)
    weight = (
        fem.SolidBodyForce(field, values=problem.density * np.array(problem.gravity))
        .assemble.vector()
        .toarray()
        .ravel()
    )
    dead, target = nodal_forces(problem).ravel(), prescribed(problem).ravel()
    is_free = np.isnan(target)
    B, c = means(problem)
    u, multipliers = field[0].values, np.zeros(len(c))
    for load in np.linspace(0, 1, problem.steps + 1)[1:]:
        for iteration in range(30):
            internal = body.assemble.vector(field).toarray().ravel()
            residual = load * (dead + weight) - internal - B.T @ multipliers
            move = np.where(is_free, 0.0, load * target - u.ravel())
            gap = load * c - B @ u.ravel()
            if iteration > 0 and np.linalg.norm(residual[is_free]) <= TOLERANCE * np.linalg.norm(internal):
                break
            K = csr_array(body.assemble.matrix(field))
            right = (residual - K @ move)[is_free]
            if len(c):
                left = block_array([[K[is_free][:, is_free], B[:, is_free].T], [B[:, is_free], None]])
                right = np.concatenate([right, gap - B @ move])
            else:
                left = K[is_free][:, is_free]
            solution = splu(left.tocsc()).solve(right)
            n = int(is_free.sum())
            move[is_free] = solution[:n]
            multipliers += solution[n:]
            u += move.reshape(u.shape)
        else:
            raise RuntimeError(f"{problem.organ}, {law}: no equilibrium at load {load}")
    held = (internal - weight - dead).reshape(u.shape)
    return u.copy(), held[problem.mesh.nodes(problem.fixed)].sum(axis=0)


def main() -> None:
    versions = [f"{package} {version(package)}" for package in ("felupe", "tensortrax", "numpy", "scipy")]
    stamp = {"versions": np.array([*versions, f"Python {platform.python_version()}"])}
    data: dict[str, Any] = dict(stamp)
    for name, problem in PROBLEMS.items():
        if problem.pressure:  # FElupe has no boundary of tetrahedra to press on
            continue
        for law in problem.laws:
            data[f"{name}/{law}/u"], data[f"{name}/{law}/reaction"] = solve(problem, law)
            report(name, law, data[f"{name}/{law}/u"])
    DATA.parent.mkdir(exist_ok=True)
    np.savez_compressed(DATA, **data)
    study: dict[str, Any] = dict(stamp)
    for label, problem in STUDY.items():
        for law, name in STUDY_LAWS.items():
            study[f"{label}/{name}"], _ = solve(problem, law)
            report(label, law, study[f"{label}/{name}"])
    np.savez_compressed(study_data("felupe"), **study)


def report(name: str, law: str, u: np.ndarray) -> None:
    print(f"{name:16} {law:9} largest displacement {np.linalg.norm(u, axis=1).max():.9g} m", flush=True)


if __name__ == "__main__":
    main()
