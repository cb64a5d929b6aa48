"""Linear solvers by name: what `Organ.solve` and `Organ.stepper` take."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from viscera import _core
from viscera.errors import VisceraError, did_you_mean

PRECONDITIONERS = ("block_jacobi", "incomplete_cholesky", "lagged_cholesky")


@dataclass(frozen=True)
class ConjugateGradients:
    """Preconditioned conjugate gradients.

    >>> import viscera as vs
    >>> vs.ConjugateGradients(preconditioner="block_jacobi", max_iterations=25).tolerance
    0.001
    """

    preconditioner: str = "lagged_cholesky"
    """"block_jacobi" (paper B), "incomplete_cholesky" without fill, or "lagged_cholesky": the factor of an earlier
    frame in single precision, renewed when iterations grow."""
    tolerance: float = 1e-3
    """Residual of the linear system to reach, relative to its right-hand side."""
    max_iterations: int = 200
    """Iterations after which to stop with what there is."""
    matrix_free: bool = False
    """Never assemble the tangent: cells multiply it with a vector, evaluated anew each time. Slower, and needs little
    more memory than the mesh; for "block_jacobi" only, since the others are made from the matrix."""

    def __post_init__(self) -> None:
        if self.preconditioner not in PRECONDITIONERS:
            hint = did_you_mean(str(self.preconditioner), PRECONDITIONERS)
            raise VisceraError(f"no preconditioner is called {self.preconditioner!r}; {hint}")
        if not 0.0 < self.tolerance < 1.0:
            raise VisceraError(f"the tolerance of conjugate gradients lies between 0 and 1, got {self.tolerance}")
        if self.max_iterations < 1:
            raise VisceraError(f"conjugate gradients need at least one iteration, got {self.max_iterations}")
        if self.matrix_free and self.preconditioner != "block_jacobi":
            raise VisceraError(
                f"{self.preconditioner!r} is made from the matrix, and matrix_free=True leaves none; "
                'choose preconditioner="block_jacobi"'
            )


Solver: TypeAlias = str | ConjugateGradients
""""cholesky", "cg" for `ConjugateGradients()`, or settings of its own."""


def core_solver(solver: Solver) -> _core.Solver:
    """A solver as the core knows it; raises `VisceraError` naming the known ones."""
    if isinstance(solver, ConjugateGradients):
        settings = solver.preconditioner, float(solver.tolerance), int(solver.max_iterations)
        return *settings, bool(solver.matrix_free)
    if solver == "cg":
        return core_solver(ConjugateGradients())
    if solver == "cholesky":
        return "cholesky", 0.0, 0, False
    hint = did_you_mean(str(solver), ("cholesky", "cg"))
    raise VisceraError(f"no solver is called {solver!r}; {hint}; or give a viscera.ConjugateGradients")
