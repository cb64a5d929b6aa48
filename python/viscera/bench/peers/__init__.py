"""The codes that solve the problem: a module for each, with `solve(problem, option) -> Solution`, and its options.

Each runs in a process of its own, on one thread; see `viscera.bench.measure`.
"""

from __future__ import annotations

from dataclasses import dataclass

from viscera.mesh import Floats


@dataclass(frozen=True, eq=False)
class Solution:
    """What a code found, and what it took."""

    displacement: Floats
    """(n, 3) [m] at the full load."""
    iterations: int
    """Newton iterations of all load steps, each with an assembly and a linear solution."""
    seconds: float
    """Processor time of the whole solution, from the mesh in the code's own form to equilibrium [s]."""
    version: str


@dataclass(frozen=True)
class Peer:
    """A code with one of its linear solvers."""

    name: str
    module: str
    """Of `viscera.bench.peers`."""
    option: str
    requires: tuple[str, ...]
    """Packages, or programs on the path, without which it cannot run."""
    is_program: bool = False
    """Whether it runs in a process of its own."""
    volumetric: str = "ln J"
    """Of its neo-Hookean energy. The displacement is compared with that of Viscera for the same energy."""


PEERS = (
    Peer("viscera cholesky", "viscera", "cholesky", ()),
    Peer("viscera cg", "viscera", "cg", ()),
    Peer("viscera incomplete", "viscera", "incomplete_cholesky", ()),
    Peer("viscera multigrid", "viscera", "multigrid", ()),
    Peer("felupe superlu", "felupe", "superlu", ("felupe", "scipy")),
    Peer("felupe pardiso", "felupe", "pardiso", ("felupe", "pypardiso")),
    Peer("scikit-fem superlu", "skfem", "superlu", ("skfem", "scipy")),
    Peer("scikit-fem pardiso", "skfem", "pardiso", ("skfem", "pypardiso")),
    Peer("ngsolve", "ngsolve", "sparsecholesky", ("ngsolve",)),
    Peer("calculix", "calculix", "spooles", ("ccx",), is_program=True, volumetric="J - 1"),
)
