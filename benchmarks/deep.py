"""Deep touches of one finger: the series of order 4 in its Padé form, and the Galerkin model that takes hold of it.

    python benchmarks/deep.py [TOUCHES [SNAPSHOTS [FIRST]]]      (FIRST: the number of the first touch, 0 by default)

The built-in liver, neo-Hookean, E = 0.17 MPa, nu = 0.48, linear cells; random touches of the whole anterior face,
between its nodes, in any direction, up to 15 % of the diagonal in steps of half a per cent. The Galerkin model takes
hold once, with at most so many snapshots, and follows the finger from step to step. The rows "retrained" repeat the
answers that were not trusted, after the model has compared itself with the nearest equilibrium of the whole organ and
added that as a snapshot, at most three times.

A touch at which Newton's method passed an instability may have several answers: errors are given with such touches
("all") and without ("stable"). Some answers of the Galerkin model are farther from Newton's than a trusted answer may
be. Where such an answer is trusted, or Newton's method met no instability at the depths compared, Newton's method
starts again from that answer. If it stays near, the answer is another equilibrium, and the energies tell which of the
two is lower.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from time import perf_counter
from typing import NamedTuple

import numpy as np
from depth import DEPTHS, _gap
from machine import describe

import viscera as vs
from viscera.mesh import Floats
from viscera.reduced.check import Full, allowed_error, surface_points, unit_vectors
from viscera.reduced.galerkin import GalerkinAnswer, HyperReducedModel

ORDER, TOLERANCE, STEPS, TRIES = 4, 0.01, 30, 3

Answer = tuple[Floats, Floats, bool]
"""Field, force and trust."""

Row = tuple[float, bool, list[tuple[float, float, bool]]]
"""Depth, whether Newton met no instability, and of all methods error of field and force and trust."""


class Other(NamedTuple):
    """An answer of the Galerkin model that is farther from Newton's than a trusted one may be."""

    touch: int
    depth: float
    is_trusted: bool
    far: float
    away: float
    """From the equilibrium that Newton's method finds from it; infinite if it finds none."""
    energy: float
    """Of that equilibrium, over the other's, less 1."""


class Comparison:
    """Touches that a model has not seen, by its series, by the Galerkin model that takes hold of each, by Newton."""

    def __init__(self, series: vs.Touch, snapshots: int, touches: int, seed: int = 0) -> None:
        random = np.random.default_rng(seed)
        self.series, self.full = series, Full(series)
        self.fingers = series.galerkin(snapshots=snapshots)
        self.points, self.directions = surface_points(series, touches, random), unit_vectors(touches, random)
        self.others: list[Other] = []
        self.holds: list[tuple[float, int, int, int]] = []
        self.ticks: list[float] = []
        self.tries: list[float] = []

    def rows(self, k: int) -> list[Row]:
        """One touch, at every depth to which Newton's method converges."""
        patch, state, rows, held = self.series.patch(self.points[k]), None, [], self._push(k)
        for share in DEPTHS:
            there = self._there(k, share)
            state = self.full.solve(patch, there, state)
            if not state.is_converged:
                break
            field, force, answer = self.full.added(state), state.reaction(patch), self.series(self.points[k], there)
            three = [(answer.displacement, answer.force, answer.is_shape_trusted), *held[share]]
            errors = [(_gap(u, field), _gap(f, force), trust) for u, f, trust in three]
            rows.append((share, state.status == "converged", errors))
            (place, _, is_trusted), far = held[share][0], errors[1][0]
            if (is_trusted or state.status == "converged") and far > allowed_error(share):
                self.others.append(Other(k, share, is_trusted, far, *self._beside(patch, there, place, state)))
        return rows

    def _there(self, k: int, share: float) -> Floats:
        return np.asarray(share * self.series.mesh.diagonal * self.directions[k])

    def _beside(self, patch: vs.Patch, there: Floats, place: Floats, state: vs.State) -> tuple[float, float]:
        """How far Newton's method goes from an answer, and the energy where it ends, relative to that of a state."""
        try:
            near = self.full.solve(patch, there, place)
        except vs.VisceraError:  # the answer turns a cell of the organ inside out
            return np.inf, np.nan
        away = _gap(place, self.full.added(near)) if near.is_converged else np.inf
        return away, near.energy / state.energy - 1.0

    def _push(self, k: int) -> dict[float, tuple[Answer, Answer]]:
        """Answers of the Galerkin model at the depths, before and after further snapshots there."""
        grasp = self.fingers.grasp([self.points[k]])
        self.holds.append((grasp.seconds, grasp.modes, grasp.cells, grasp.snapshots))
        first = {share: _answer(held) for share, held in self._follow(grasp, k, self.ticks)}
        again = ((share, held) for share, held in self._follow(grasp, k, []) if not first[share][2])
        retrained = {share: self._retrain(grasp, self._there(k, share), held) for share, held in again}
        return {share: (first[share], retrained.get(share, first[share])) for share in DEPTHS}

    def _follow(self, grasp: HyperReducedModel, k: int, ticks: list[float]) -> Iterator[tuple[float, GalerkinAnswer]]:
        """The answers at the depths, along the path of a finger."""
        for step in range(1, STEPS + 1):
            share = max(DEPTHS) * step / STEPS
            held = grasp.solve([self._there(k, share)], from_last=step > 1, stiffness=False)
            ticks.append(1e3 * held.seconds)
            at = np.isclose(share, DEPTHS)
            if at.any():
                yield DEPTHS[int(at.argmax())], held

    def _retrain(self, grasp: HyperReducedModel, there: Floats, held: GalerkinAnswer) -> Answer:
        """The answer after further snapshots where the finger is."""
        for _ in range(TRIES):
            began = perf_counter()
            if not grasp.add_snapshot():
                break
            self.tries.append(perf_counter() - began)
            held = grasp.solve([there], from_last=True, stiffness=False)
        return _answer(held)


def main(touches: int, snapshots: int, first: int) -> None:
    """Reduce, then compare."""
    liver = vs.organs.liver()
    organ = vs.Organ(liver, vs.NeoHookean(young=0.17e6, poisson=0.48), fixed="hilum", element="P1")
    print(describe())
    depth = max(DEPTHS) * liver.diagonal
    series = organ.reduce("anterior", depth=depth, order=ORDER, tolerance=TOLERANCE)
    size = 1e-6 * len(series._model.to_bytes())
    print(f"order {ORDER}, {series.summary()['positions']} positions, {size:.0f} MB")
    comparison = Comparison(series, snapshots, touches)
    rows = [row for k in range(first, touches) for row in comparison.rows(k)]
    print(f"Galerkin with up to {snapshots} snapshots              median      90 %      99 %     worst")
    print_times(comparison)
    print("depth                    touches    field median / 90 % / worst     force median / 90 % / worst")
    print_errors(rows, touches - first)
    print_others(comparison.others)


def print_times(comparison: Comparison) -> None:
    """What taking hold, a step and a further snapshot take."""
    names = ("taking hold [s]", "modes", f"sampled cells of {len(comparison.series.mesh.cells)}", "snapshots")
    measured = [*zip(names, np.transpose(comparison.holds), strict=True)]
    measured.append(("a step of half a per cent [ms]", np.array(comparison.ticks)))
    if tries := comparison.tries:
        measured.append((f"adding a snapshot [s], {len(tries)} tries", np.array(tries)))
    for name, values in measured:
        print(f"      {name:40s}" + "".join(f"{np.quantile(values, q):10.2f}" for q in (0.5, 0.9, 0.99, 1.0)))


def print_errors(rows: list[Row], touches: int) -> None:
    """Errors of the three methods by depth."""
    for share in DEPTHS:
        at = [row for row in rows if row[0] == share]
        unstable = sum(not row[1] for row in at)
        print(f"{share:5.0%}, Newton converged for {len(at)} of {touches}, {unstable} of them past an instability")
        for method, name in enumerate(("series", "Galerkin", "retrained")):
            kinds = {"all": at, "stable": [r for r in at if r[1]], "trusted": [r for r in at if r[2][method][2]]}
            for words, some in kinds.items():
                errors = np.array([r[2][method][:2] for r in some])
                print(f"      {name:10s}{words:8s}{len(some):5d}  {_errors(errors)}")


def print_others(others: list[Other]) -> None:
    """Answers that are farther from Newton's than a trusted one may be."""
    trusted = sum(other.is_trusted for other in others)
    counts = f"{trusted} trusted, {len(others) - trusted} not"
    print(f"answers of the Galerkin model farther from Newton's than allowed: {counts}")
    for k, share, is_trusted, far, away, energy in others:
        beside = f"{away:.2%} from the equilibrium next to it, whose energy is {energy:+.2%} of the other's"
        print(
            f"      touch {k:3d} at {share:.0%}, {'' if is_trusted else 'not '}trusted: {far:.1%} from Newton's, "
            + (beside if np.isfinite(away) else "which finds no equilibrium from there")
        )


def _answer(held: GalerkinAnswer) -> Answer:
    return held.displacement, held.force[0], held.is_trusted


def _errors(table: Floats) -> str:
    if not len(table):
        return "-"
    cells = [f"{100 * np.median(e):8.3f} /{100 * np.quantile(e, 0.9):7.2f} /{100 * e.max():8.2f} %" for e in table.T]
    return "   ".join(cells)


if __name__ == "__main__":
    words = [int(word) for word in sys.argv[1:]]
    main(*(words + [200, 48, 0][len(words) :]))
