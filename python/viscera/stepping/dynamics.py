"""Dynamics: rules of time integration, and viscoelasticity."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from viscera.errors import VisceraError, did_you_mean
from viscera.quantity import Number, brief, numbers_of, refused


@dataclass(frozen=True)
class Newmark:
    """Newmark's rule (1959): u' = u + h v + h^2 ((1/2 - beta) a + beta a'), v' = v + h ((1 - gamma) a + gamma a').

    With the defaults it is of second order and without dissipation. It is stable for every step
    if 2 beta >= gamma >= 1/2.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> stepper = beam.stepper(density=1000, time_step=0.01, dynamics=vs.Newmark(beta=0.3, gamma=0.6))
    >>> stepper.frame(gravity=(0, 0, -9.81)).kinetic_energy > 0
    True
    """

    beta: float = 0.25
    gamma: float = 0.5

    def __post_init__(self) -> None:
        for name, value in (("beta", self.beta), ("gamma", self.gamma)):
            Number()(value, f"{name} of Newmark")
        if not (self.gamma >= 0.5 and 2.0 * self.beta >= self.gamma):
            raise VisceraError(
                f"Newmark with beta = {self.beta} and gamma = {self.gamma} is not stable for every time step; choose "
                "2 beta >= gamma >= 1/2"
            )


@dataclass(frozen=True)
class BackwardEuler:
    """v' = (u' - u) / h, a' = (v' - v) / h: first order; damps motions that are fast compared with the time step h.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> stepper = beam.stepper(density=1000, time_step=0.01, dynamics=vs.BackwardEuler())
    >>> stepper.frame(gravity=(0, 0, -9.81)).kinetic_energy > 0
    True
    """


Integration: TypeAlias = str | Newmark | BackwardEuler
""""newmark", "backward_euler", or a rule with its settings."""


@dataclass(frozen=True)
class Prony:
    """Viscoelasticity: the law is the instantaneous response; parts g_i of its stress decay with times tau_i.

    S(t) = integral of G(t - s) dS_law(s), G(t) = 1 - sum_i g_i (1 - exp(-t / tau_i)), S the whole second
    Piola-Kirchhoff stress. Simo and Hughes, Computational Inelasticity (1998), chapter 10.
    g: relative moduli, positive, with a sum below 1; tau: relaxation times [s]. It is for the element "P1" alone.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> stepper = beam.stepper(time_step=0.1, relaxation=vs.Prony(g=[0.5], tau=[0.2]), iterations=4)
    >>> forces = [stepper.frame({"tip": (None, None, -0.01)}).reaction("tip")[2] for _ in range(20)]
    >>> f"{forces[-1] / forces[0]:.2f}"
    '0.56'
    """

    g: Sequence[float]
    tau: Sequence[float]

    def __post_init__(self) -> None:
        for name, values in (("g", self.g), ("tau", self.tau)):
            given = numbers_of(values)
            if given is None or given.ndim != 1 or not np.isfinite(given).all():
                raise refused(f"relaxation {name}", "a list of numbers", values)
        if len(self.g) == len(self.tau) == 0:
            raise VisceraError(
                "relaxation has neither moduli g nor times tau; give one of each at least, or no relaxation"
            )
        if len(self.g) != len(self.tau):
            raise VisceraError(
                f"relaxation has {len(self.g)} moduli g and {len(self.tau)} times tau; give one time for each modulus"
            )
        if not (min(self.g) > 0.0 and sum(self.g) < 1.0):
            raise VisceraError(f"relaxation moduli g must be positive with a sum below 1, got {list(self.g)}")
        if not min(self.tau) > 0.0:
            raise VisceraError(f"relaxation times tau must be positive [s], got {list(self.tau)}")


def core_integration(dynamics: Integration) -> tuple[float, float] | None:
    """Newmark's beta and gamma, None for backward Euler."""
    if isinstance(dynamics, Newmark):
        return dynamics.beta, dynamics.gamma
    if dynamics == "newmark":
        return core_integration(Newmark())
    if isinstance(dynamics, BackwardEuler) or dynamics == "backward_euler":
        return None
    hint = did_you_mean(str(dynamics), ("newmark", "backward_euler"))
    raise VisceraError(f"no integration is called {brief(dynamics)}; {hint}")
