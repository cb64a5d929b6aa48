"""Linear solvers by name: what `Organ.solve` and `Organ.stepper` take."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

from viscera import _core, gpu
from viscera.errors import VisceraError, did_you_mean
from viscera.quantity import Choice, Flag, Number, Whole, brief, refused

Rule: TypeAlias = Number | Whole | Flag


def _rule(row: _core.Setting) -> Rule:
    """What a setting must be, by its row in the core."""
    low, high = row["low"], row["high"]
    match row["kind"]:
        case "fraction":
            return Number(above=low, below=high)
        case "part":
            return Number(above=low, high=high)
        case "whole":
            return Whole(int(low), int(high))
        case _:
            return Flag()


def _text(value: float) -> str:
    """A default as documentation says it: 30, 1e-9, 1/1024.

    >>> _text(30.0), _text(1e-9), _text(1 / 1024)
    ('30', '1e-9', '1/1024')
    """
    text = f"{value:g}".replace("e-0", "e-")
    return text if float(text) == value else f"1/{1 / value:g}"


_SETTINGS = _core.solver_settings()

NEWTON: dict[str, tuple[Rule, str, str]] = {
    row["name"]: (_rule(row), row["means"], _text(row["default"])) for row in _SETTINGS["newton"]
}
"""Settings of Newton's method: allowed values, meaning and default of each."""

PRECONDITIONERS = tuple(_core.preconditioners())
LAGGED = "lagged_cholesky"
_CG = {row["name"]: row for row in _SETTINGS["conjugate_gradients"]}


@dataclass(frozen=True)
class ConjugateGradients:
    """Preconditioned conjugate gradients.

    >>> import viscera as vs
    >>> vs.ConjugateGradients(preconditioner="block_jacobi", max_iterations=25).tolerance
    0.001
    """

    preconditioner: str = LAGGED
    """"block_jacobi" (paper B), "incomplete_cholesky" without fill, or "lagged_cholesky": the factor of an earlier
    frame in single precision, renewed when iterations grow; or "multigrid": a V-cycle on aggregates of nodes with their
    rigid-body modes, for large bodies."""
    tolerance: float = _CG["tolerance"]["default"]
    """Residual of the linear system to reach, relative to its right-hand side; in frames up to 30 times as much where
    Newton's method gains nothing from less."""
    max_iterations: int = int(_CG["max_iterations"]["default"])
    """Iterations after which conjugate gradients stop and return the last iterate."""
    matrix_free: bool = bool(_CG["matrix_free"]["default"])
    """Never assemble the tangent: every product evaluates the tangents of all cells again. This is slower, and needs
    little more memory than the mesh. For "block_jacobi" only, since the others are made from the matrix."""
    device: str = "cpu"
    """Where they run: "cpu", or "gpu" with "block_jacobi", in single precision, corrected by residuals in double
    precision."""

    def __post_init__(self) -> None:
        if self.preconditioner not in PRECONDITIONERS:
            hint = did_you_mean(str(self.preconditioner), PRECONDITIONERS)
            raise VisceraError(f"no preconditioner is called {brief(self.preconditioner)}; {hint}")
        for name, row in _CG.items():
            _rule(row)(getattr(self, name), f"{name} of conjugate gradients")
        Choice(("cpu", "gpu"))(self.device, "the device")
        if self.device == "gpu" and (self.preconditioner != "block_jacobi" or self.matrix_free):
            raise VisceraError('the device "gpu" takes the preconditioner "block_jacobi" and an assembled matrix')
        if self.matrix_free and self.preconditioner != "block_jacobi":
            raise VisceraError(
                f"{self.preconditioner!r} is made from the matrix, and matrix_free=True leaves none; "
                'choose preconditioner="block_jacobi"'
            )


Solver: TypeAlias = str | ConjugateGradients
""""auto" for what is likely to be the fastest (not in frames), "cholesky", "cg" for `ConjugateGradients()`, "multigrid"
for that preconditioner with a tolerance of 1e-8, "gpu" for `GPU`, or settings of its own."""

NAMES = ("auto", "cholesky", "cg", "multigrid", "gpu")
"""Solvers that have a name."""

GPU = ConjugateGradients("block_jacobi", max_iterations=5_000, device="gpu")
"""What `solver="gpu"` stands for."""


def core_solver(solver: Solver) -> _core.Solver:
    """A solver as the core knows it; raises `VisceraError` naming the known ones."""
    if isinstance(solver, ConjugateGradients):
        if solver.device == "gpu":
            gpu.load()
        settings = {name: float(getattr(solver, name)) for name in _CG}
        return {"name": solver.preconditioner, "settings": settings, "device": solver.device}
    if solver == "gpu":
        return core_solver(GPU)
    if solver == "cg":
        return core_solver(ConjugateGradients())
    if solver == "multigrid":
        return core_solver(ConjugateGradients("multigrid", tolerance=1e-8, max_iterations=2000))
    if solver in ("cholesky", "auto"):
        return {"name": solver, "settings": {}, "device": "cpu"}
    if solver in PRECONDITIONERS:
        remedy = f"viscera.ConjugateGradients({solver!r})" + (' or "cg"' if solver == LAGGED else "")
        raise VisceraError(f"{brief(solver)} is a preconditioner of conjugate gradients; give {remedy}")
    hint = did_you_mean(str(solver), NAMES)
    raise VisceraError(f"no solver is called {brief(solver)}; {hint}; or give a viscera.ConjugateGradients")


def newton_settings(given: Mapping[str, Any] | None) -> dict[str, float]:
    """Settings of Newton's iteration as the core takes them; raises `VisceraError` naming one that is wrong."""
    if not isinstance(given or {}, Mapping):
        raise refused("settings", "a mapping, such as {'tolerance': 1e-10}", given)
    for name in given or {}:
        if name not in NEWTON:
            raise VisceraError(f"Newton's iteration has no setting {brief(name)}; {did_you_mean(str(name), NEWTON)}")
    return {name: float(NEWTON[name][0](value, f"{name} in settings")) for name, value in (given or {}).items()}
