"""Linear solvers by name: what `Organ.solve` and `Organ.stepper` take."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

from viscera import _core, gpu
from viscera.errors import VisceraError, did_you_mean
from viscera.quantity import Choice, Flag, Number, Whole, refused

NEWTON: dict[str, tuple[Number | Whole, str, str]] = {
    "tolerance": (Number(above=0, below=1), "residual, relative to the norm of all nodal forces", "1e-9"),
    "max_iterations": (Whole(1, 10_000), "iterations in one load step before it is halved", "30"),
    "max_backtracks": (Whole(0, 1_000), "halvings of a step in the line search", "12"),
    "smallest_step": (Number(above=0, high=1), "smallest fraction of the load before the solver gives up", "1/1024"),
}
"""Settings of Newton's iteration: what each must be, what it is, and the default (`Newton` in crates/solid)."""

PRECONDITIONERS = ("block_jacobi", "incomplete_cholesky", "lagged_cholesky", "multigrid")


@dataclass(frozen=True)
class ConjugateGradients:
    """Preconditioned conjugate gradients.

    >>> import viscera as vs
    >>> vs.ConjugateGradients(preconditioner="block_jacobi", max_iterations=25).tolerance
    0.001
    """

    preconditioner: str = "lagged_cholesky"
    """"block_jacobi" (paper B), "incomplete_cholesky" without fill, or "lagged_cholesky": the factor of an earlier
    frame in single precision, renewed when iterations grow; or "multigrid": a V-cycle on aggregates of nodes with their
    rigid-body modes, for large bodies."""
    tolerance: float = 1e-3
    """Residual of the linear system to reach, relative to its right-hand side."""
    max_iterations: int = 200
    """Iterations after which to stop with what there is."""
    matrix_free: bool = False
    """Never assemble the tangent: cells multiply it with a vector, evaluated anew each time. Slower, and needs little
    more memory than the mesh; for "block_jacobi" only, since the others are made from the matrix."""
    device: str = "cpu"
    """Where they run: "cpu", or "gpu" with "block_jacobi", in single precision, corrected by Newton's residual in
    double."""

    def __post_init__(self) -> None:
        if self.preconditioner not in PRECONDITIONERS:
            hint = did_you_mean(str(self.preconditioner), PRECONDITIONERS)
            raise VisceraError(f"no preconditioner is called {self.preconditioner!r}; {hint}")
        Number(above=0, below=1)(self.tolerance, "the tolerance of conjugate gradients")
        Whole(1, 1_000_000)(self.max_iterations, "max_iterations of conjugate gradients")
        Flag()(self.matrix_free, "matrix_free")
        Choice(("cpu", "gpu"))(self.device, "the device")
        if self.device == "gpu" and (self.preconditioner != "block_jacobi" or self.matrix_free):
            raise VisceraError('the device "gpu" takes the preconditioner "block_jacobi" and an assembled matrix')
        if self.matrix_free and self.preconditioner != "block_jacobi":
            raise VisceraError(
                f"{self.preconditioner!r} is made from the matrix, and matrix_free=True leaves none; "
                'choose preconditioner="block_jacobi"'
            )


Solver: TypeAlias = str | ConjugateGradients
""""cholesky", "cg" for `ConjugateGradients()`, "multigrid" for that preconditioner with a tolerance of 1e-8, "gpu" for
`GPU`, or settings of its own."""

GPU = ConjugateGradients("block_jacobi", max_iterations=5_000, device="gpu")
"""What `solver="gpu"` stands for."""


def core_solver(solver: Solver) -> _core.Solver:
    """A solver as the core knows it; raises `VisceraError` naming the known ones."""
    if isinstance(solver, ConjugateGradients):
        if solver.device == "gpu":
            gpu.load()
        settings = solver.preconditioner, float(solver.tolerance), int(solver.max_iterations)
        return *settings, bool(solver.matrix_free), solver.device
    if solver == "gpu":
        return core_solver(GPU)
    if solver == "cg":
        return core_solver(ConjugateGradients())
    if solver == "multigrid":
        return core_solver(ConjugateGradients("multigrid", tolerance=1e-8, max_iterations=2000))
    if solver == "cholesky":
        return "cholesky", 0.0, 0, False, "cpu"
    hint = did_you_mean(str(solver), ("cholesky", "cg", "multigrid", "gpu"))
    raise VisceraError(f"no solver is called {solver!r}; {hint}; or give a viscera.ConjugateGradients")


def newton_settings(given: Mapping[str, Any] | None) -> dict[str, float]:
    """Settings of Newton's iteration as the core takes them; raises `VisceraError` naming one that is wrong."""
    if not isinstance(given or {}, Mapping):
        raise refused("settings", "a mapping, such as {'tolerance': 1e-10}", given)
    for name in given or {}:
        if name not in NEWTON:
            raise VisceraError(f"Newton's iteration has no setting {name!r}; {did_you_mean(str(name), NEWTON)}")
    return {name: float(NEWTON[name][0](value, f"{name} in settings")) for name, value in (given or {}).items()}
