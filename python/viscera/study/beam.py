"""Paper A's beam, sections 5.1 and 5.2.1: a cantilever loaded anywhere on its top face."""

from __future__ import annotations

from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import numpy as np

from viscera import organs
from viscera.law import Law, NeoHookean, SaintVenantKirchhoff
from viscera.mesh import Floats, Mesh
from viscera.organ import Organ
from viscera.study import curves, separation
from viscera.study.case import ORDER, PGD_ORDER, Case, Say, calibrated
from viscera.study.curves import Curves, partial_sum
from viscera.study.report import Cell, Report

YOUNG, POISSON = 0.17e6, 0.3
DRAWN_AT = 0.4
"""Load factor of the drawn shapes."""
VIEW = (14.0, -68.0)
LAWS: dict[str, tuple[str, Law]] = {
    "svk": ("Saint Venant-Kirchhoff", SaintVenantKirchhoff(young=YOUNG, poisson=POISSON)),
    "neo_hookean": ("Neo-Hookean", NeoHookean(young=YOUNG, poisson=POISSON)),
}


def run(
    folder: str | Path, quick: bool = False, say: Say = print, *, executor: Executor | None = None
) -> dict[str, Any]:
    """Write the report into a folder and return its numbers; quick samples less, to show what is written.

    executor: whose workers do what is not timed.
    """
    page = Report("A beam under a load anywhere on its top face", folder)
    mesh = organs.beam()
    page.text(
        f"A cantilever of 1 x 0.2 x 0.2 m, {len(mesh.points)} nodes and {len(mesh.cells)} linear tetrahedra, clamped "
        f"at x = 0; E = {YOUNG:g} Pa, nu = {POISSON:g}. A force normal to the top face acts on a single node s of it, "
        "edges left out. The curves are for the node next to the free end; the separated series hold for all. "
        "The paper gives neither mesh nor load; here a = 0.5 is where the series of the curves ceases to converge."
    )
    facts: dict[str, Any] = {"status": "reported"}
    for key, (law, material) in LAWS.items():
        page.heading(law)
        case = beam_case(key, law, material)
        say(f"{law}: curves up to {case.load:.3g} N")
        found = curves.compute(case, 8 if quick else 20, executor)
        facts[key] = curves.report(page, case, found, {"svk": "as figure 6", "neo_hookean": "figure 13"}[key])
        facts[key] |= _report_shapes(page, case, found)
        pgd, direct, routes = separation.report_routes(page, case, (0.05,) if quick else (0.1, 0.03, 0.01), say)
        facts[key] |= routes
        modes = separation.report_modes(page, case, say)
        separation.report_errors(page, case, direct, (2, 20) if quick else (1, 2, 5, 10, 20, 50, 100))
        models = {"PGD, 20 pairs an order": modes, "PGD": pgd, "every position": direct}
        facts[key] |= separation.report_rate(page, case, models, 0.1 if quick else 2.0)
        say(f"{law}: ParaView files")
        modes.write(Path(folder) / f"paraview_{key}")
    facts["report"] = str(page.write())
    return facts


def beam_case(key: str, law: str, material: Law) -> Case:
    """The built-in beam loaded on its axis next to its free end; edges, whose normals are oblique, are left out."""
    mesh = organs.beam()
    organ = Organ(mesh, material, fixed="clamp", element="P1")
    x, y, _ = mesh.points[mesh.nodes("top")].T
    inside = (x > 0.01) & (x < 0.99) & (y > 0.01) & (y < 0.19)
    positions = mesh.nodes("top")[inside]
    to_end = np.linalg.norm(mesh.points[positions] - (1.0, 0.1, 0.2), axis=1)
    return calibrated(Case(key, law, organ, positions, int(positions[np.argmin(to_end)]), 1.0, VIEW))


def _report_shapes(page: Report, case: Case, found: Curves) -> dict[str, Any]:
    """The deformed beam at orders 1 to 4 with its gain of volume (figures 12 and 7), against Newton."""
    index = int(np.argmin(np.abs(found.loads - DRAWN_AT)))
    a = float(found.loads[index])
    shapes = {f"order {p}": partial_sum(found.series, a, p) for p in range(1, PGD_ORDER + 1)}
    shapes["Padé 15"] = partial_sum(found.series, a, ORDER, True)
    exact = found.newton[index]
    if exact is not None:
        shapes["Newton"] = exact
    gains = {name: _volume(case.mesh, u) / case.mesh.volume - 1.0 for name, u in shapes.items()}
    titled = {f"{name}: volume {100 * gains[name]:+.2f} %": u for name, u in shapes.items()}
    caption = f"{case.law}: the beam at a = {a:.3g} and its change of volume (figures 7 and 12)."
    page.figure(f"deformed_{case.key}", case.draw_vertical(titled), caption)
    rows: list[list[Cell]] = [[name, gain] for name, gain in gains.items()]
    page.table(
        f"volume_{case.key}", ("sum", "gain of volume"), rows, f"{case.law}: relative gain of volume, a = {a:.3g}."
    )
    return {"volume_gain": gains}


def _volume(mesh: Mesh, u: Floats) -> float:
    a, b, c, d = (mesh.points + u)[mesh.cells].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", np.cross(b - a, c - a), d - a) / 6.0)
