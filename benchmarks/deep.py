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

import numpy as np
from depth import DEPTHS, _gap
from machine import describe

import viscera as vs
from viscera.check import Full, allowed_error, surface_points, unit_vectors
from viscera.galerkin import GalerkinAnswer, HyperReducedModel
from viscera.mesh import Floats

ORDER, TOLERANCE, STEPS, TRIES = 4, 0.01, 30, 3

Answer = tuple[Floats, Floats, bool]
"""Field, force and trust."""

Row = tuple[float, bool, list[tuple[float, float, bool]]]
"""Depth, whether Newton met no instability, and of all methods error of field and force and trust."""


def main(touches: int, snapshots: int, first: int) -> None:
    """Reduce, then compare."""
    liver = vs.organs.liver()
    organ = vs.Organ(liver, vs.NeoHookean(young=0.17e6, poisson=0.48), fixed="hilum", element="P1")
    print(describe())
    depth = max(DEPTHS) * liver.diagonal
    series = organ.reduce("anterior", depth=depth, order=ORDER, tolerance=TOLERANCE)
    size = 1e-6 * len(series._model.to_bytes())
    print(f"order {ORDER}, {series.summary()['positions']} positions, {size:.0f} MB")
    fingers = series.galerkin(snapshots=snapshots)
    random = np.random.default_rng(0)
    points, directions = surface_points(series, touches, random), unit_vectors(touches, random)
    full = Full(series)
    others: list[tuple[int, float, bool, float, float, float]] = []
    holds: list[tuple[float, int, int, int]] = []
    ticks: list[float] = []
    tries: list[float] = []

    def follow(grasp: HyperReducedModel, k: int, ticks: list[float]) -> Iterator[tuple[float, GalerkinAnswer]]:
        """The answers at the depths, along the path of a finger."""
        for step in range(1, STEPS + 1):
            share = max(DEPTHS) * step / STEPS
            held = grasp.solve([share * liver.diagonal * directions[k]], from_last=step > 1, stiffness=False)
            ticks.append(1e3 * held.seconds)
            at = np.isclose(share, DEPTHS)
            if at.any():
                yield DEPTHS[int(at.argmax())], held

    def push(k: int) -> dict[float, tuple[Answer, Answer]]:
        """Answers of the Galerkin model at the depths, before and after further snapshots there."""
        grasp = fingers.grasp([points[k]])
        holds.append((grasp.seconds, grasp.modes, grasp.cells, grasp.snapshots))
        first = {share: _answer(held) for share, held in follow(grasp, k, ticks)}
        again = ((share, held) for share, held in follow(grasp, k, []) if not first[share][2])
        retrained = {share: retrain(grasp, share * liver.diagonal * directions[k], held) for share, held in again}
        return {share: (first[share], retrained.get(share, first[share])) for share in DEPTHS}

    def retrain(grasp: HyperReducedModel, there: Floats, held: GalerkinAnswer) -> Answer:
        """The answer after further snapshots where the finger is."""
        for _ in range(TRIES):
            began = perf_counter()
            if not grasp.add_snapshot():
                break
            tries.append(perf_counter() - began)
            held = grasp.solve([there], from_last=True, stiffness=False)
        return _answer(held)

    def ask(k: int) -> list[Row]:
        patch, state, rows, held = series.patch(points[k]), None, [], push(k)
        for share in DEPTHS:
            there = share * liver.diagonal * directions[k]
            state = full.solve(patch, there, state)
            if not state.is_converged:
                break
            field, force, answer = full.added(state), state.reaction(patch), series(points[k], there)
            three = [(answer.displacement, answer.force, answer.is_shape_trusted), *held[share]]
            errors = [(_gap(u, field), _gap(f, force), trust) for u, f, trust in three]
            rows.append((share, state.status == "converged", errors))
            (place, _, is_trusted), far = held[share][0], errors[1][0]
            if (is_trusted or state.status == "converged") and far > allowed_error(share):
                try:
                    near = full.solve(patch, there, place)
                except vs.VisceraError:  # the answer turns a cell of the organ inside out
                    others.append((k, share, is_trusted, far, np.inf, np.nan))
                    continue
                away = _gap(place, full.added(near)) if near.is_converged else np.inf
                others.append((k, share, is_trusted, far, away, near.energy / state.energy - 1.0))
        return rows

    rows = [row for k in range(first, touches) for row in ask(k)]
    print(f"Galerkin with up to {snapshots} snapshots              median      90 %      99 %     worst")
    names = ("taking hold [s]", "modes", f"sampled cells of {len(liver.cells)}", "snapshots")
    measured = [*zip(names, np.transpose(holds), strict=True), ("a step of half a per cent [ms]", ticks)]
    for name, values in measured + [(f"adding a snapshot [s], {len(tries)} tries", tries)] * bool(tries):
        print(f"      {name:40s}" + "".join(f"{np.quantile(values, q):10.2f}" for q in (0.5, 0.9, 0.99, 1.0)))
    print("depth                    touches    field median / 90 % / worst     force median / 90 % / worst")
    for share in DEPTHS:
        at = [row for row in rows if row[0] == share]
        unstable = sum(not row[1] for row in at)
        print(
            f"{share:5.0%}, Newton converged for {len(at)} of {touches - first}, {unstable} of them past an instability"
        )
        for method, name in enumerate(("series", "Galerkin", "retrained")):
            kinds = {"all": at, "stable": [r for r in at if r[1]], "trusted": [r for r in at if r[2][method][2]]}
            for words, some in kinds.items():
                errors = np.array([r[2][method][:2] for r in some])
                print(f"      {name:10s}{words:8s}{len(some):5d}  {_errors(errors)}")

    trusted = sum(is_trusted for _, _, is_trusted, *_ in others)
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
