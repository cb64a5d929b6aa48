"""Paper A's liver, sections 5.1.3 and 5.2.2: a load anywhere on the face that a surgeon touches.

E = 0.17 MPa and nu = 0.48 are the paper's, for the neo-Hookean liver; Saint Venant-Kirchhoff is given the same.
"""

from __future__ import annotations

from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import numpy as np

from viscera import organs
from viscera.law import Law, NeoHookean, SaintVenantKirchhoff
from viscera.mesh import Floats, Indices, Mesh, Where
from viscera.organ import Organ
from viscera.output.picture import draw_panels
from viscera.pgd import Pgd
from viscera.study import curves, separation
from viscera.study.case import ORDER, Case, Say, calibrated, middle
from viscera.study.curves import Curves, partial_sum
from viscera.study.report import Report

YOUNG, POISSON = 0.17e6, 0.48
DRAWN_AT = 0.4
STATIONS = 4
VIEW = (20.0, -60.0)
LAWS: dict[str, tuple[str, Law]] = {
    "svk": ("Saint Venant-Kirchhoff", SaintVenantKirchhoff(young=YOUNG, poisson=POISSON)),
    "neo_hookean": ("Neo-Hookean", NeoHookean(young=YOUNG, poisson=POISSON)),
}


def run(
    folder: str | Path,
    quick: bool = False,
    say: Say = print,
    *,
    mesh: Mesh | None = None,
    fixed: Where = "hilum",
    touchable: Where | None = "anterior",
    executor: Executor | None = None,
) -> dict[str, Any]:
    """Write the report into a folder and return its numbers; quick takes fewer positions, to show what is written.

    mesh: another organ than the built-in liver, held at `fixed` and loaded anywhere on `touchable`.
    executor: whose workers do what is not timed.
    """
    page = Report("A liver under a load anywhere on its surface", folder)
    mesh = organs.liver() if mesh is None else mesh
    page.text(
        f"{len(mesh.points)} nodes, {len(mesh.cells)} linear tetrahedra, {1e6 * mesh.volume:.4g} ml, diagonal "
        f"{1e3 * mesh.diagonal:.4g} mm; E = {YOUNG:g} Pa, nu = {POISSON:g}. A force normal to the surface acts on a "
        "single node s of the touchable face. The curves are for the node in its middle; the separated series hold "
        "for all. The paper gives neither mesh nor load; here a = 0.5 is where the series of the curves ceases to "
        "converge."
    )
    facts: dict[str, Any] = {"status": "reported"}
    for key, (law, material) in LAWS.items():
        page.heading(law)
        case = liver_case(key, law, Organ(mesh, material, fixed, element="P1"), touchable, quick)
        say(f"{law}: curves up to {case.load:.3g} N")
        found = curves.compute(case, 8 if quick else 20, executor)
        facts[key] = curves.report(page, case, found, {"svk": "figure 6", "neo_hookean": "figure 14"}[key])
        _report_vertical(page, case, found)
        pgd, direct, routes = separation.report_routes(page, case, (0.1,) if quick else (0.1, 0.03, 0.01), say)
        facts[key] |= routes
        modes = separation.report_modes(page, case, say)
        separation.report_errors(page, case, direct, (2, 20) if quick else (1, 2, 5, 10, 20, 50, 100, 200))
        models = {
            "PGD": pgd,
            "PGD, 20 pairs an order": modes,
            "every position": direct,
        }
        facts[key] |= separation.report_rate(page, case, models, 0.1 if quick else 2.0)
        _report_path(page, case, direct, Path(folder))
        say(f"{law}: ParaView files")
        modes.write(Path(folder) / f"paraview_{key}")
    page.heading("Neo-Hookean, load spread over a patch")
    page.text(
        "The same load spread over a smooth patch with a radius of a tenth of the diagonal. It depends less on the "
        "mesh than a force on one node, and its fields differ less from position to position."
    )
    organ = Organ(mesh, LAWS["neo_hookean"][1], fixed, element="P1")
    patch = liver_case("patch", "Neo-Hookean, patch", organ, touchable, quick, radius=0.1 * mesh.diagonal)
    _, direct, routes = separation.report_routes(page, patch, (0.1,) if quick else (0.1, 0.03, 0.01), say)
    separation.report_errors(page, patch, direct, (2, 20) if quick else (1, 2, 5, 10, 20, 50, 100, 200))
    facts["patch"] = {"load": patch.load, **routes}
    facts["report"] = str(page.write())
    return facts


def liver_case(key: str, law: str, organ: Organ, touchable: Where | None, quick: bool, radius: float = 0.0) -> Case:
    """The organ loaded in the middle of its touchable face; quick keeps only the positions near it."""
    positions = organ.touchable(touchable)
    node = middle(organ.mesh, positions)
    if quick:
        near = organ.mesh.near(organ.mesh.points[node], 0.15 * organ.mesh.diagonal)
        positions = np.intersect1d(positions, near).astype(np.uint32)
    return calibrated(Case(key, law, organ, positions, node, 1.0, VIEW, radius))


def _report_vertical(page: Report, case: Case, found: Curves) -> None:
    """The vertical displacement by the series, its Padé form and Newton (figure 7)."""
    index = int(np.argmin(np.abs(found.loads - DRAWN_AT)))
    a = float(found.loads[index])
    fields = {"order 1": partial_sum(found.series, a, 1), "order 4": partial_sum(found.series, a, 4)}
    fields["Padé 15"] = partial_sum(found.series, a, ORDER, True)
    exact = found.newton[index]
    if exact is not None:
        fields["Newton"] = exact
    caption = f"{case.law}: vertical displacement at a = {a:.3g} (figure 7)."
    page.figure(f"vertical_{case.key}", case.draw_vertical(fields), caption)


def _report_path(page: Report, case: Case, model: Pgd, folder: Path) -> None:
    """The organ under a load that moves along a path over its surface, displacement scaled by 2 (figure 15)."""
    stations = load_path(case.mesh, case.positions, STATIONS)
    fields = {f"load at station {k + 1}": model.displacement(node, DRAWN_AT) for k, node in enumerate(stations)}
    length = {title: 1e3 * np.linalg.norm(u, axis=1) for title, u in fields.items()}
    twofold = {title: 2.0 * u for title, u in fields.items()}
    marks = {
        title: case.mesh.points[[node]] + 2.0 * fields[title][[node]]
        for title, node in zip(fields, stations, strict=True)
    }
    picture = draw_panels(
        case.mesh.points, case.mesh.surface, length, label="displacement [mm]", displacements=twofold, marks=marks,
        view=case.view,
    )  # fmt: skip
    caption = f"{case.law}: a load on its way over the organ, a = {DRAWN_AT:g}, displacement scaled by 2 (figure 15)."
    page.figure(f"load_path_{case.key}", picture, caption)
    model.write_path(folder / f"paraview_{case.key}", load_path(case.mesh, case.positions, 5 * STATIONS), DRAWN_AT)


def load_path(mesh: Mesh, positions: Indices, count: int) -> list[int]:
    """Nodes at equal steps along the longest direction of the positions, through their middle."""
    points: Floats = mesh.points[positions]
    centred = points - points.mean(axis=0)
    axis = np.linalg.svd(centred, full_matrices=False)[2][0]
    along = centred @ axis
    wanted = np.linspace(0.85 * along.min(), 0.85 * along.max(), count)
    across = np.linalg.norm(centred - np.outer(along, axis), axis=1)
    return [int(positions[np.argmin((along - step) ** 2 + 0.3 * across**2)]) for step in wanted]
