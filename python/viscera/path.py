"""An equilibrium path as a chain of power series, evaluated in the rational form that reaches beyond their radius."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from viscera.errors import VisceraError
from viscera.mesh import Floats


@dataclass(frozen=True)
class Expansion:
    """One stretch of a path: u(a) = sum_p a^p u_p and the load alike, for 0 <= a <= range."""

    displacement: Floats
    """u_p (order + 1, n, 3) [m]; u_0 is the equilibrium the expansion starts from."""
    load: Floats
    """Load factors (order + 1,)."""
    range: float
    """Largest a of the Padé form."""
    taylor_range: float
    """Largest a of the polynomial itself."""
    residual: float
    """Force residual at the end of the range, relative to the load."""

    def at(self, a: float) -> tuple[float, Floats]:
        """Load factor and displacement (n, 3) [m] at the parameter a, by the vector Padé form."""
        if not 0.0 <= a <= self.range * (1.0 + 1e-12):
            raise VisceraError(f"the expansion holds for 0 <= a <= {self.range:g}, not at {a:g}")
        series = np.column_stack([self.displacement.reshape(len(self.displacement), -1), self.load])
        value = vector_pade(series, a)
        return float(value[-1]), value[:-1].reshape(self.displacement.shape[1:])


@dataclass(frozen=True)
class Path:
    """The expansions of a path, in order; each starts where the one before it ends."""

    expansions: list[Expansion]

    def curve(self, samples: int = 10) -> tuple[Floats, Floats]:
        """Load factors (k,) and displacements (k, n, 3) [m] at equal steps of a within every expansion."""
        points = [expansion.at(a) for expansion in self.expansions for a in np.linspace(0.0, expansion.range, samples)]
        return np.array([load for load, _ in points]), np.array([u for _, u in points])


def vector_pade(series: Floats, a: float) -> Floats:
    """The vector Padé form of sum_p a^p u_p, series (order + 1, k).

    Gram-Schmidt gives u_n = sum_j A_nj q_j; d_0 = 1, d_i = - sum_{j<i} d_j A_{N-j,N-i} / A_{N-i,N-i}; then
    u(a) = u_0 + sum_{i=1}^{N-1} a^i u_i D_{N-1-i}(a) / D_{N-1}(a) with D_k = sum_{j<=k} d_j a^j.
    Where u_1..u_{N-1} are dependent the polynomial is returned.
    Elhage-Hussein, Potier-Ferry and Damil, IJSS 37 (2000) 6981.
    """
    N = len(series) - 1
    A = np.asarray(np.linalg.qr(series[1:].T, mode="r")).T  # A[n - 1, j - 1]: u_n in the orthonormal basis
    powers = float(a) ** np.arange(N + 1)
    divisors = np.abs(np.diag(A))[: N - 1] / np.linalg.norm(A, axis=1)[: N - 1].clip(1e-300)
    if len(divisors) < N - 1 or (divisors < 1e-13).any():
        return np.asarray(powers @ series)
    d = np.zeros(N)
    d[0] = 1.0
    for i in range(1, N):
        d[i] = -sum(d[j] * A[N - j - 1, N - i - 1] for j in range(i)) / A[N - i - 1, N - i - 1]
    D = np.cumsum(d * powers[:N])
    factors = np.array([powers[i] * D[N - 1 - i] / D[N - 1] for i in range(1, N)])
    return np.asarray(series[0] + factors @ series[1:N])
