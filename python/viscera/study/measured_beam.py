"""A silicone beam measured by others, clamped, loaded, swinging: one modulus fitted to its weight, the rest predicted.

Dragon Skin 10, 30 x 30 x 100 mm, motion capture of three markers at the free end. Data, facts of which are kept in
`measured_beam.json` (`docs/validation.md` says how): Dubied, Michelis, Spielberg and Katzschmann, *Sim-to-Real for
Differentiable Projective Dynamics on Soft Robots: Meshing, Damping, and Actuation* (2022), MIT licence.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from importlib import resources
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from viscera.errors import VisceraError
from viscera.law import NeoHookean
from viscera.mesh import Floats, Mesh, mesh
from viscera.organ import Organ
from viscera.study.case import Say
from viscera.study.report import Cell, Report

SIZE = np.array([0.1, 0.03, 0.03])  # [m]
DENSITY, GRAVITY, LOAD = 1070.0, 9.80709, 0.51012  # [kg/m^3], [m/s^2], [N]
POISSON = 0.499
MARKERS = {"top": ((0.0, 0.015, 0.03), (0, 0, 1)), "left": ((0.0, 0.0, 0.024), (0, -1, 0)),
           "right": ((0.0, 0.03, 0.006), (0, 1, 0))}  # fmt: skip
"""Position of each marker on the beam [m], and the direction in which it stands off."""
ARM, SEAT = 0.006, 0.012
"""Distance of a marker's centre from the surface, and radius of the surface that carries it [m]."""
RESOLUTION = 1.0
"""Accuracy of the experiment [mm]: markers at the clamp move by up to 0.4 mm, and the hand may have bent the beam."""
SETTLED = 1e-9
"""Residual of a frame; a looser one takes energy from the swing, or gives it."""
DOWN = (0.0, 0.0, -GRAVITY)


@dataclass(frozen=True, eq=False)
class Measured:
    """One run: displacement of the markers from held to hanging, and the swing of the top marker between."""

    displacement: Floats
    """Of the markers, in the order of `MARKERS` (3, 3) [mm]."""
    time: Floats
    """After it was let go (k,) [s]."""
    height: Floats
    """Of the top marker above where it comes to rest (k,) [mm]."""


def measured() -> dict[str, Measured]:
    """The runs by name: `gravity a`, `gravity b` under its weight, `load a`, `load b` with 0.51 N more."""
    text = resources.files("viscera.study").joinpath("measured_beam.json").read_text(encoding="utf-8")
    return {name: run_of(**facts) for name, facts in json.loads(text)["runs"].items()}


def run_of(displacement_mm: Any, time_s: Any, height_mm: Any) -> Measured:
    """A run as the file gives it."""
    return Measured(np.array(displacement_mm), np.array(time_s), np.array(height_mm))


def block(across: int) -> Mesh:
    """The beam of bricks of six tetrahedra, `across` of them over its width, clamped at x = -100 mm, free at x = 0."""
    n = np.array([round(across * SIZE[0] / SIZE[1]), across, across])
    corners = np.stack(np.meshgrid(*(np.arange(k) for k in n), indexing="ij"), -1).reshape(-1, 3)
    points = np.stack(np.meshgrid(*(np.arange(k + 1) for k in n), indexing="ij"), -1).reshape(-1, 3)
    stride = np.array([(n[1] + 1) * (n[2] + 1), n[2] + 1, 1])
    walks = np.cumsum([[0, *stride[list(axes)]] for axes in permutations(range(3))], axis=1)
    walks[[1, 2, 5]] = walks[[1, 2, 5]][:, [0, 2, 1, 3]]  # odd permutations are turned round
    cells = ((corners @ stride)[:, None, None] + walks).reshape(-1, 4)
    x, _, z = points.T
    ends = {"clamp": np.flatnonzero(x == 0), "edge": np.flatnonzero((x == n[0]) & (z == n[2]))}
    return mesh(points / n * SIZE - [SIZE[0], 0.0, 0.0], cells, ends)


def organ_of(young: float, element: str, across: int) -> Organ:
    """The beam of a Young's modulus [Pa]."""
    return Organ(block(across), NeoHookean(young=young, poisson=POISSON), fixed="clamp", element=element)


def markers(organ: Organ, displacement: Floats) -> Floats:
    """Displacement (3, 3) [mm] of the markers: each stands off from the rigid motion of the surface that carries it."""
    points, moved = organ.mesh.points, []
    surface = organ.mesh.surface_nodes
    for seat, normal in MARKERS.values():
        place = surface[np.linalg.norm(points[surface] - seat, axis=1) <= SEAT]
        arm = np.array(seat) + ARM * np.array(normal) - points[place].mean(axis=0)
        turned = _rotation(points[place], displacement[place]) @ arm - arm
        moved.append(displacement[place].mean(axis=0) + turned)
    return 1e3 * np.array(moved)


def _rotation(points: Floats, displacement: Floats) -> Floats:
    """The rotation closest to a motion of points (k, 3) by least squares (Kabsch 1976)."""
    rest, now = (x - x.mean(axis=0) for x in (points, points + displacement))
    left, _, right = np.linalg.svd(now.T @ rest)
    return np.asarray(left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right)


def hanging(organ: Organ, load: float = 0.0) -> Floats:
    """Displacement (n, 3) [m] at rest under the weight and a force [N] on the upper edge of the free end."""
    force: dict[Any, Any] = {"edge": (0.0, 0.0, -load)} if load else {}
    return organ.solve(gravity=DOWN, density=DENSITY, force=force, steps=4, throw=True).displacement


def fitted_modulus(runs: Iterable[Measured], element: str, across: int, guess: float = 2.6e5) -> float:
    """Young's modulus [Pa] whose displacements under the weight are nearest to those of all markers and runs.

    Gauss-Newton in ln E; the derivative is a difference over 2 %.
    """
    target = np.mean([run.displacement for run in runs], axis=0)
    for _ in range(20):
        here, there = (markers(o, hanging(o)) for o in (organ_of(guess * f, element, across) for f in (1.0, 1.02)))
        slope = (there - here) / np.log(1.02)
        step = float(((target - here) * slope).sum() / (slope**2).sum())
        guess *= float(np.exp(np.clip(step, -0.5, 0.5)))
        if abs(step) < 1e-5:
            return guess
    raise VisceraError(f"the modulus does not settle; the last one was {guess:.6g} Pa")


@dataclass(frozen=True)
class Swing:
    """A damped oscillation."""

    frequency: float
    """[Hz]."""
    decay: float
    """Of its amplitude [1/s]."""


def swing(time: Floats, height: Floats, half_periods: int = 8) -> Swing:
    """Frequency and decay from `half_periods` + 1 extremes of a curve, from the second on.

    The first is that of letting go. From one extreme to the next the curve moves by h_i: ln h_i falls with the time as
    the decay, whatever creep shifts the middle. Extremes are those of parabolas through three samples.
    """
    inner = height[1:-1]
    turns = 1 + np.flatnonzero((inner - height[:-2]) * (inner - height[2:]) > 0)
    turns = turns[1 : half_periods + 2]
    if len(turns) < half_periods + 1:
        raise VisceraError(f"the swing has {len(turns)} extremes, fewer than the {half_periods + 1} asked for")
    before, at, after = height[turns - 1], height[turns], height[turns + 1]
    bend = before - 2 * at + after
    shift = 0.5 * (before - after) / bend
    when = time[turns] + shift * (time[turns + 1] - time[turns])
    value = at - 0.25 * (before - after) * shift
    strokes, middle = np.abs(np.diff(value)), 0.5 * (when[1:] + when[:-1])
    half_period = np.polyfit(np.arange(len(when)), when, 1)[0]
    return Swing(0.5 / float(half_period), -float(np.polyfit(middle, np.log(strokes), 1)[0]))


def let_go(
    organ: Organ, step: float, duration: float, damping: tuple[float, float], load: float = 0.0
) -> tuple[Floats, Floats]:
    """Times (k,) [s] and heights (k,) [mm] of the top marker after the straight beam is let go, by Newmark's rule.

    step: of time [s]; load: [N] that hangs at the upper edge with its mass; damping: Rayleigh's alpha and beta.
    """
    density = np.full(len(organ.mesh.cells), DENSITY)
    if load:
        carrying = np.isin(organ.mesh.cells, organ.mesh.nodes("edge")).sum(axis=1) >= 2
        volume = np.asarray(organ.mesh.facts["cell_volumes"])[carrying].sum()
        density[carrying] += load / GRAVITY / volume
    stepper = organ.stepper(
        dynamics="newmark", time_step=step, density=density, iterations=20, settled=SETTLED, damping=damping
    )
    heights = [0.0]
    for _ in range(round(duration / step)):
        frame = stepper.frame(gravity=DOWN)
        heights.append(float(markers(organ, frame.displacement)[0, 2]))
    return np.linspace(0.0, step * (len(heights) - 1), len(heights)), np.array(heights)


STEP = 2e-3
"""Of time [s], to begin with; halved until frequency and decay move by less than `STEADY`."""
STEADY = 0.01
HALF_PERIODS = 8


@dataclass(frozen=True, eq=False)
class Told:
    """The swing of the model."""

    swing: Swing
    step: float
    """Of time [s]."""
    moved: float
    """Relative change of frequency and decay when the step was halved."""
    time: Floats
    height: Floats


def told_swing(organ: Organ, beta: float, load: float = 0.0) -> Told:
    """The swing with Rayleigh's damping beta [s], the step halved until it no longer matters."""
    duration = (0.75 if load == 0.0 else 1.35) * HALF_PERIODS / 8
    step, before = STEP, None
    while True:
        time, height = let_go(organ, step, duration, (0.0, beta), load)
        found = swing(time, height, HALF_PERIODS)
        if before is not None:
            moved = max(abs(found.frequency / before.frequency - 1), abs(found.decay / before.decay - 1))
            if moved < STEADY:
                return Told(found, step, moved, time, height)
        step, before = step / 2, found


def fitted_damping(organ: Organ, target: Swing) -> float:
    """Rayleigh's beta [s] for which the beam decays as measured under its weight; starts with that of one mode."""
    beta = 2.0 * target.decay / (2.0 * np.pi * target.frequency) ** 2
    for _ in range(10):
        duration = 0.75 * HALF_PERIODS / 8
        ratio = target.decay / swing(*let_go(organ, STEP, duration, (0.0, beta)), HALF_PERIODS).decay
        beta *= ratio
        if abs(ratio - 1.0) < 0.1 * STEADY:
            return beta
    raise VisceraError(f"the damping does not settle; the last one was beta = {beta:.3g} s")


def run(folder: str | Path, quick: bool = False, say: Say = print) -> dict[str, Any]:
    """Write the report into a folder and return its numbers; quick takes coarser meshes."""
    runs = measured()
    weight, loaded = ([runs[f"{kind} {letter}"] for letter in "ab"] for kind in ("gravity", "load"))
    page = Report("A silicone beam, measured by others", folder)
    page.text(
        "Dragon Skin 10, 30 x 30 x 100 mm, clamped at one end, 1070 kg/m3; three markers at the free end. Young's "
        "modulus is fitted to the displacements under the weight alone (all markers, both runs; nu = 0.499, "
        "neo-Hookean), and Rayleigh's beta to the decay of the free swing under the weight; all else is predicted. "
        "The experiment repeats to 0.1 mm under the weight and 0.6 mm under the load; markers at the clamp move by up "
        "to 0.4 mm, and the hand that held the beam at first may have bent or stretched it. Differences below 1 mm "
        "therefore mean nothing."
    )
    element, across = ("P2", 2) if quick else ("P2", 4)
    young = fitted_modulus(weight, element, across)
    organ = organ_of(young, element, across)
    cells = len(organ.mesh.cells)
    say(f"E = {1e-3 * young:.1f} kPa from the weight alone ({element}, {cells} cells)")
    facts: dict[str, Any] = {"status": "reported", "young": young}
    facts["weight"] = _report_hanging(page, say, "weight", "under its weight, fitted", organ, 0.0, weight)
    facts["load"] = _report_hanging(page, say, "load", "with 0.51 N more, predicted", organ, LOAD, loaded)
    facts["meshes"] = _report_meshes(page, say, weight, loaded, quick)
    coarse = organ_of(fitted_modulus(weight, "P2", 2), "P2", 2)  # thousands of frames; its own modulus, its own sag
    facts["swing"] = _report_swing(page, say, coarse, weight, loaded)
    facts["report"] = str(page.write())
    return facts


def _report_hanging(
    page: Report, say: Say, name: str, title: str, organ: Organ, load: float, runs: list[Measured]
) -> dict[str, Any]:
    """Measured and predicted displacements of each marker, with the repeatability of the experiment."""
    found, (a, b) = markers(organ, hanging(organ, load)), (run.displacement for run in runs)
    mean = 0.5 * (a + b)
    rows: list[list[Cell]] = []
    say(f"{title}: displacement upwards [mm]\nmarker  run a   run b  model    error   all axes  runs differ by")
    for marker, *at in zip(MARKERS, a, b, found, found - mean, a - b, strict=True):
        first, second, told, error, spread = at
        far, apart = float(np.linalg.norm(error)), float(np.linalg.norm(spread))
        rows.append([marker, first[2], second[2], told[2], error[2], far, apart])
        say(
            f"{marker:6s} {first[2]:6.2f}  {second[2]:6.2f}  {told[2]:6.2f}  {error[2]:6.2f}  {far:8.2f}  {apart:14.2f}"
        )
    header = ("marker", "run a", "run b", "model", "error", "error, all axes", "runs differ, all axes")
    page.table(name, header, rows, f"The beam {title}: displacement upwards, and errors of the mean of both runs [mm].")
    return {"told": found, "measured": [a, b], "error": found - mean}


def _report_meshes(
    page: Report, say: Say, weight: list[Measured], loaded: list[Measured], quick: bool
) -> list[dict[str, Any]]:
    """The same protocol with other elements and meshes."""
    meshes = {"P2": (2, 3, 4), "P1 mean volume": (3, 6, 9), "P1": (3, 6, 9)}
    chosen = [(element, n) for element, sizes in meshes.items() for n in (sizes[:2] if quick else sizes)]
    target = np.mean([run.displacement for run in loaded], axis=0)
    found: list[dict[str, Any]] = []
    say("the same with other elements and meshes: error upwards under the load [mm]")
    say("element          cells  nodes     E [kPa]    top   left  right")
    for element, across in chosen:
        young = fitted_modulus(weight, element, across)
        organ = organ_of(young, element, across)
        error = (markers(organ, hanging(organ, LOAD)) - target)[:, 2]
        nodes, cells = len(organ.mesh.points), len(organ.mesh.cells)
        say(f"{element:15s}{cells:7d}{nodes:7d}{1e-3 * young:12.1f}" + "".join(f"{e:7.2f}" for e in error))
        found.append({"element": element, "cells": cells, "nodes": nodes, "young": young, "error": error})
    rows: list[list[Cell]] = [
        [row["element"], row["cells"], row["nodes"], 1e-3 * row["young"], *row["error"].tolist()] for row in found
    ]
    header = ("element", "cells", "nodes", "E fitted [kPa]", "top", "left", "right")
    page.table("meshes", header, rows, "Elements and meshes: the modulus fitted to the weight, and the error upwards "
               "under the load [mm]. P1 locks, so its modulus is not a property of the silicone.")  # fmt: skip
    return found


def _report_swing(
    page: Report, say: Say, organ: Organ, weight: list[Measured], loaded: list[Measured]
) -> dict[str, Any]:
    """Frequency and decay of the free swing, under the weight and with the load."""
    seen = {
        name: [swing(run.time, run.height, HALF_PERIODS) for run in runs]
        for name, runs in {"weight": weight, "load": loaded}.items()
    }
    mean = Swing(*(float(np.mean([getattr(s, key) for s in seen["weight"]])) for key in ("frequency", "decay")))
    beta = fitted_damping(organ, mean)
    told = {"weight": told_swing(organ, beta), "load": told_swing(organ, beta, LOAD)}
    say(f"free swing, Newmark, Rayleigh's beta = {1e3 * beta:.2f} ms from the decay under the weight")
    say("under   frequency [Hz]: run a  run b  model   decay [1/s]: run a  run b  model   step, halving it moves")
    rows: list[list[Cell]] = []
    for name, model in told.items():
        (a, b), found = seen[name], model.swing
        say(
            f"{name:6s}{a.frequency:23.2f}{b.frequency:7.2f}{found.frequency:7.2f}{a.decay:20.2f}{b.decay:7.2f}"
            f"{found.decay:7.2f}{1e3 * model.step:8.3g} ms {100 * model.moved:5.2f} %"
        )
        rows.append([name, a.frequency, b.frequency, found.frequency, a.decay, b.decay, found.decay, model.step])
    frequency, decay = [(f"run a [{unit}]", f"run b [{unit}]", f"model [{unit}]") for unit in ("Hz", "1/s")]
    header = ("under", *frequency, *decay, "step [s]")
    page.table("swing", header, rows, "Frequency and decay of the free swing; the decay under the weight is fitted.")
    page.figure("swing", _drawn(told, {"weight": weight, "load": loaded}), "The top marker after the beam is let go.")
    return {"beta": beta, "told": {name: vars(model.swing) for name, model in told.items()},
            "measured": {name: [vars(s) for s in swings] for name, swings in seen.items()}}  # fmt: skip


def _drawn(told: dict[str, Told], runs: dict[str, list[Measured]]) -> Figure:
    figure = Figure(figsize=(9.0, 5.0), layout="constrained")
    for plot, (name, model) in zip(figure.subplots(2, 1), told.items(), strict=True):
        for letter, measurement in zip("ab", runs[name], strict=True):
            plot.plot(measurement.time, measurement.height, ".", label=f"measured, run {letter}")
        rest = model.height[-1]  # the last swings are small beside the first
        plot.plot(model.time, model.height - rest, "-", color="#22262e", linewidth=1.0, label="model")
        plot.set(title=f"under its {name}" if name == "weight" else "with 0.51 N more", ylabel="height [mm]")
    plot.set_xlabel("time [s]")
    plot.legend()
    return figure
