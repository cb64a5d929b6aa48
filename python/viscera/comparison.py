"""The models of surgical simulation on one case: the effects of linearisation, corotation and the choice of an energy.

All models have the same moduli at small strain. They differ in their treatment of geometry and in their energy.
Paper B, *Implementation and Evaluation of Hyperelastic Model for Surgical Simulator and Navigation*:
linear, corotated, geometrically nonlinear (Saint Venant-Kirchhoff) and Mooney-Rivlin on an artery.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from viscera.boundary.loads import prescribed
from viscera.display import Pictured, Tabled
from viscera.errors import VisceraError
from viscera.files.atomic import replacing
from viscera.law import Corotated, Law, Linear, MooneyRivlin, NeoHookean, SaintVenantKirchhoff
from viscera.mesh import Floats, Mesh
from viscera.organ import Organ
from viscera.progress import Progress, shown
from viscera.quantity import Choice, brief, refused
from viscera.sealed import Sealed
from viscera.select import AXES
from viscera.state import State

if TYPE_CHECKING:
    from matplotlib.figure import Figure

REFERENCE = "SaintVenantKirchhoff"
"""Paper B compares with its geometrically nonlinear model."""

CLEAR = 0.05
"""A component counts in a relative difference if it is at least this part of the largest displacement, as the smallest
that paper B tabulates."""

STAGES = ("factorization", "solve")

REPEATS = 40
"""Newton iterations timed for each model; the quickest counts."""


@dataclass(frozen=True)
class Times:
    """Wall time [s] of the parts of one Newton iteration: the quickest of several at rest."""

    generation: float
    """Internal force and assembled tangent."""
    factorization: float
    """Sparse Cholesky factorisation, without the analysis of the pattern."""
    substitution: float
    """Solution with the factor."""


@dataclass(frozen=True)
class Difference:
    """How far a displacement field is from that of the reference. All numbers are relative: 0.01 is one per cent."""

    field: float
    """|u - u_ref| / |u_ref| over all nodes."""
    node_mean: float
    """Distance of a node from its place in the reference over the largest displacement there: mean of moving nodes."""
    node_max: float
    component_mean: float
    """|u_i - u_i,ref| / |u_i,ref| of single components that are free and clearly different from zero: mean."""
    component_max: float
    axis_mean: tuple[float, float, float]
    """The same for x, y and z; NaN for an axis without such a component."""
    axis_max: tuple[float, float, float]


@dataclass(frozen=True)
class Run:
    """One model: its law, its equilibrium, its times, and its difference from the reference if both converged."""

    law: Law
    state: State
    times: Times
    difference: Difference | None


@dataclass(frozen=True, eq=False)
class Comparison(Pictured, Tabled, Sealed):
    """The models on one case, in the order of `models`."""

    mesh: Mesh
    element: str
    reference: str
    runs: Mapping[str, Run]
    free: NDArray[np.bool_]
    """(n, 3), true where a displacement component is neither fixed nor prescribed."""

    @property
    def is_converged(self) -> bool:
        """Whether every model reached the full load."""
        return all(run.state.is_converged for run in self.runs.values())

    def ratios(self, name: str) -> Times:
        """The times of a model in units of the corotated model's generation, as paper B's Table V gives them.

        If the corotated model was left out, they are in units of the reference's generation.
        """
        unit = self.runs["Corotated" if "Corotated" in self.runs else self.reference].times.generation
        times = self.runs[name].times
        return Times(times.generation / unit, times.factorization / unit, times.substitution / unit)

    def table(self) -> str:
        """Differences and volume, then times, one model a line."""
        width = max(map(len, self.runs))
        lines = [
            f"difference from {self.reference} in per cent, element {self.element}",
            f"{'':{width}s}   whole      node            component         volume",
            f"{'model':{width}s}   field      mean     max    mean     max      ratio",
        ]
        for name, run in self.runs.items():
            lines.append(f"{name:{width}s} {_percentages(run)}  {run.state.volume_ratio:9.4f}")
        lines += [
            "time in units of one corotated generation (assembly of the tangent)",
            f"{'model':{width}s}  generation  factorisation  substitution  iterations  load steps",
        ]
        for name, run in self.runs.items():
            t = self.ratios(name)
            lines.append(
                f"{name:{width}s}{t.generation:12.2f}{t.factorization:15.2f}{t.substitution:14.2f}"
                f"{run.state.iterations:12d}{len(run.state.residuals):12d}"
            )
        return "\n".join(lines)

    def to_json(self) -> dict[str, Any]:
        """All data of the table and more, for machines; a number that does not exist is None."""
        return {
            "reference": self.reference,
            "element": self.element,
            "models": [self._facts(name) for name in self.runs],
        }

    def _facts(self, name: str) -> dict[str, Any]:
        run = self.runs[name]
        return {
            "name": name,
            "law": repr(run.law),
            "status": run.state.status,
            "message": run.state.message,
            "load": run.state.load,
            "iterations": run.state.iterations,
            "solve_seconds": run.state.seconds,
            "max_displacement": run.state.max_displacement,
            "volume_ratio": run.state.volume_ratio,
            "energy": run.state.energy,
            "difference": None if run.difference is None else vars(run.difference),
            "times": vars(run.times),
            "ratios": vars(self.ratios(name)),
        }

    def write(self, path: str | os.PathLike[str]) -> None:
        """Every node and component as CSV: the reference's displacement [m] and each model's difference from it [m]."""
        others = [name for name in self.runs if name != self.reference]
        header = ["node", "axis", "is_free", f"{self.reference} [m]", *(f"{name} - reference [m]" for name in others)]
        base = self.runs[self.reference].state.displacement
        with replacing(path) as scratch, scratch.open("w", newline="", encoding="utf-8") as file:
            rows = csv.writer(file)
            rows.writerow(header)
            for node in range(len(self.mesh.points)):
                for axis, word in enumerate(AXES):
                    gaps = [self.runs[name].state.displacement[node, axis] - base[node, axis] for name in others]
                    rows.writerow([node, word, int(self.free[node, axis]), base[node, axis], *gaps])

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure:
        """Draw the deformed organ of every model over the wireframe at rest. `path`: write a PNG file there."""
        from viscera.output.picture import draw_side_by_side

        fields = {name: run.state.displacement for name, run in self.runs.items()}
        return draw_side_by_side(self.mesh.points, self.mesh.surface, fields, path=path)


def models(law: Law) -> dict[str, Law]:
    """The models of paper B with the moduli of a law at small strain, and the law itself under its own name.

    Mooney-Rivlin takes c1 : c2 = 4 : 1 as in paper B, with 2 (c1 + c2) = mu, kappa = lam + 2 mu / 3, unless the law is
    Mooney-Rivlin; then its own c1 and c2.

    >>> list(models(NeoHookean(young=1e6, poisson=0.49)))
    ['Linear', 'Corotated', 'SaintVenantKirchhoff', 'NeoHookean', 'MooneyRivlin J^2-1', 'MooneyRivlin J-1']
    """
    mu, lam = moduli(law)
    c1, c2 = law.parameters.T[:2] if isinstance(law, MooneyRivlin) else (0.4 * mu, 0.1 * mu)
    kappa = lam + 2.0 / 3.0 * mu
    known: dict[str, Law] = {
        kind.__name__: kind(mu=mu, lam=lam) for kind in (Linear, Corotated, SaintVenantKirchhoff, NeoHookean)
    }
    for form in ("J^2-1", "J-1"):
        known[f"MooneyRivlin {form}"] = MooneyRivlin(c1, c2, kappa, volumetric=form)
    own = f"MooneyRivlin {law.volumetric}" if isinstance(law, MooneyRivlin) else type(law).__name__
    return known | {own: law}


def moduli(law: Law) -> tuple[Floats, Floats]:
    """Lamé constants mu and lam (rows,) [Pa] of a law at small strain, read from its tangent at rest.

    Raises `VisceraError` if that tangent is not isotropic.
    """
    rest = np.eye(3)[None]
    tangents = np.array([law.tangent(rest, cell)[0] for cell in range(len(law.parameters))])
    lam, mu = tangents[:, 0, 0, 1, 1], tangents[:, 0, 1, 0, 1]
    i = np.eye(3)
    hooke = lam[:, None, None, None, None] * np.einsum("ij,kl->ijkl", i, i) + mu[:, None, None, None, None] * (
        np.einsum("ik,jl->ijkl", i, i) + np.einsum("il,jk->ijkl", i, i)
    )
    if np.abs(tangents - hooke).max() > 1e-9 * np.abs(hooke).max():
        raise VisceraError(
            f"{type(law).__name__} is not isotropic at small strain: the models have no such counterpart"
        )
    return mu, lam


def _checked(laws: Mapping[str, Law]) -> Mapping[str, Law]:
    """The laws of a comparison; raises `VisceraError` if they are no laws by name."""
    if not isinstance(laws, Mapping) or not all(isinstance(name, str) for name in laws):
        raise refused(
            "laws", "a mapping from names to laws, such as {'soft': NeoHookean(young=1e3, poisson=0.4)}", laws
        )
    for name, law in laws.items():
        if not isinstance(law, Law):
            raise refused(f"the law {brief(name)}", "a law, such as NeoHookean(young=1e3, poisson=0.4)", law)
    return laws


@shown
def compare(
    organ: Organ,
    *,
    laws: Mapping[str, Law] | None = None,
    reference: str = REFERENCE,
    progress: Progress | None = None,
    **loads: Any,
) -> Comparison:
    """Solve one case with every model and measure each against the reference.

    loads: as `Organ.solve` takes them. laws: by name; by default `models(organ.law)`, which all have the moduli of the
    organ's law at small strain. A model that fails keeps its last equilibrium and is not compared.

    >>> import viscera as vs
    >>> corners, floor = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [0, 1, 2]
    >>> mesh = vs.mesh(corners, [[0, 1, 2, 3]], sets={"floor": floor, "top": [3]})
    >>> organ = vs.Organ(mesh, vs.NeoHookean(young=1e5, poisson=0.3), fixed="floor")
    >>> table = vs.compare(organ, force={"top": (0, 0, -10.0)})
    >>> table.is_converged, list(table.runs)[:2]
    (True, ['Linear', 'Corotated'])
    """
    laws = models(organ.law) if laws is None else _checked(laws)
    Choice(laws)(reference, "the reference")
    states: dict[str, State] = {}
    for step, (name, law) in enumerate(laws.items()):
        # One solver for all, as for their times.
        states[name] = organ.with_law(law).solve(**{"solver": "cholesky", **loads})
        if progress:
            progress(step + 1, len(laws), "models")
    times = _times({name: organ.with_law(law) for name, law in laws.items()}, loads.get("displacement") or {})
    moved = prescribed(organ.mesh, organ.fixed, loads.get("displacement") or {})
    free = np.ones(organ.mesh.points.shape, dtype=bool)
    free.ravel()[moved.dofs] = False
    free[organ.fixed] = False
    truth = states[reference]
    runs = {}
    for name, state in states.items():
        is_comparable = state.is_converged and truth.is_converged
        gap = difference(state.displacement, truth.displacement, free) if is_comparable else None
        runs[name] = Run(laws[name], state, times[name], gap)
    return Comparison(organ.mesh, organ.element, reference, runs, free)


def difference(u: Floats, reference: Floats, free: NDArray[np.bool_]) -> Difference:
    """Relative differences of a displacement u (n, 3) from a reference; free (n, 3): the components that count."""
    gap, largest = np.abs(u - reference), float(np.linalg.norm(reference, axis=1).max())
    if largest == 0.0:
        raise VisceraError("the reference does not move: there is nothing to compare; give the case a load")
    moving = free.any(axis=1)
    distance = np.linalg.norm(u - reference, axis=1)[moving] / largest
    clear = free & (np.abs(reference) >= CLEAR * largest)
    relative = np.where(clear, gap / np.where(clear, np.abs(reference), 1.0), np.nan)
    axes = [relative[clear[:, axis], axis] for axis in range(3)]
    every = relative[clear]
    return Difference(
        field=float(np.linalg.norm(u - reference) / np.linalg.norm(reference)),
        node_mean=float(distance.mean()),
        node_max=float(distance.max()),
        component_mean=_mean(every),
        component_max=_max(every),
        axis_mean=(_mean(axes[0]), _mean(axes[1]), _mean(axes[2])),
        axis_max=(_max(axes[0]), _max(axes[1]), _max(axes[2])),
    )


def _percentages(run: Run) -> str:
    d = run.difference
    if d is None:
        return f"{'did not converge' if not run.state.is_converged else 'nothing to compare with':42s}"
    parts = (d.field, d.node_mean, d.node_max, d.component_mean, d.component_max)
    return "{:7.2f} {:9.2f} {:7.2f} {:7.2f} {:7.2f}".format(*(100.0 * part for part in parts))


def _mean(values: Floats) -> float:
    return float(values.mean()) if values.size else float("nan")


def _max(values: Floats) -> float:
    return float(values.max()) if values.size else float("nan")


def _times(organs: Mapping[str, Organ], displacement: Mapping[Any, Any]) -> dict[str, Times]:
    """Times of one Newton iteration at rest with the case's supports: as much work as any other, and it never fails.

    The models take turns, so that other work of the machine affects all of them alike.
    """
    held = {where: _unmoved(target) for where, target in displacement.items()}
    quickest = {name: np.full(3, np.inf) for name in organs}
    for _ in range(REPEATS):
        for name, organ in organs.items():
            state = organ.solve(displacement=held)
            tangents = state.iterations + len(state.residuals)
            t = state.timings
            parts = np.array([t["assembly"] / tangents, *(t[stage] / state.iterations for stage in STAGES)])
            quickest[name] = np.minimum(quickest[name], parts)
    return {name: Times(*parts.tolist()) for name, parts in quickest.items()}


def _unmoved(target: Any) -> Any:
    """The same components, prescribed to stay at rest."""
    if isinstance(target, np.ndarray) and target.ndim == 2:
        return np.zeros_like(target)
    return [None if component is None else 0.0 for component in target]
