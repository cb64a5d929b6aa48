"""Laws fitted to measured silicones, beside the published fits; and what sticking to the plates would change.

    python benchmarks/silicones.py [FOLDER]

FOLDER: the compression tests of Dawood et al. 2026 (CC BY 4.0; repository
abubakardawood/tissue-phantom-material-database), `<material>_<casting><run>.csv` and `published_fits.json`; by default
`measured/silicone_compression` in $VISCERA_SHARED. Cylinders of 50 mm diameter and 30 mm height, compressed to 67 %.
The published standard errors are those of single tests.
"""

import json
import os
import sys
from pathlib import Path

import machine
import numpy as np

import viscera as vs
from viscera.fitting import Fit, MaterialTest, fit
from viscera.fitting.homogeneous import incompressible_stress
from viscera.fitting.materialtest import read_columns

RADIUS, HEIGHT = 0.025, 0.03
ACROSS, UP = 6, 4
"""Bricks of the finite-element cylinder."""
SHARED = Path(os.environ.get("VISCERA_SHARED", "../shared")) / "measured" / "silicone_compression"
LAWS = (
    ("NeoHookean", None, "Neo Hookean"),
    ("MooneyRivlin", None, "Mooney Rivlin_o1"),
    ("Yeoh", 1, "Yeoh_o1"),
    ("Yeoh", 2, "Yeoh_o2"),
    ("Yeoh", 3, "Yeoh_o3"),
    ("Ogden", 1, "Ogden_o1"),
    ("Ogden", 2, "Ogden_o2"),
    ("Ogden", 3, "Ogden_o3"),
)


def read(path: Path) -> MaterialTest:
    """A compression test."""
    columns = read_columns(path)
    return MaterialTest.from_force(
        "uniaxial", 1e-3 * columns["compression_mm"], columns["load_N"],
        length=HEIGHT, area=np.pi * RADIUS**2, compression=True, name=path.stem,
    )  # fmt: skip


def cylinder(across: int, up: int) -> vs.Mesh:
    """A cylinder of linear cells: a cube of bricks, each of six cells, its square sections mapped to discs."""
    grid = np.linspace(-1.0, 1.0, across + 1)
    x, y, z = np.meshgrid(grid, grid, np.linspace(0.0, HEIGHT, up + 1), indexing="ij")
    disc_x, disc_y = x * np.sqrt(1.0 - 0.5 * y**2), y * np.sqrt(1.0 - 0.5 * x**2)
    points = np.column_stack([RADIUS * disc_x.ravel(), RADIUS * disc_y.ravel(), z.ravel()])
    number = np.arange(len(points)).reshape(x.shape)
    bricks = [number[i : i + across, j : j + across, k : k + up].ravel() for i, j, k in np.ndindex(2, 2, 2)]
    paths = ((0, 1, 3, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 6, 4, 7), (0, 4, 5, 7), (0, 5, 1, 7))
    cells = np.concatenate([np.column_stack([bricks[b] for b in path]) for path in paths])
    return vs.mesh(points, cells)


def force_of_cylinder(law: vs.laws.Law, compressions: list[float], *, sticks: bool) -> list[float | None]:
    """Force [N] on the upper plate at growing compression of an FE cylinder that slides on its plates or sticks."""
    mesh = cylinder(ACROSS, UP)
    r = np.linalg.norm(mesh.points[:, :2], axis=1)
    bottom = np.flatnonzero(mesh.points[:, 2] < 1e-9)
    top = np.flatnonzero(mesh.points[:, 2] > HEIGHT - 1e-9)
    centre = bottom[[r[bottom].argmin()]]
    organ = vs.Organ(mesh, law, fixed=bottom if sticks else centre, element="P1 mean volume")
    # One node of the rim may not turn about the axis; the plate carries its height.
    rim = bottom[[mesh.points[bottom, 0].argmax()]]
    sliding = np.setdiff1d(bottom, [*centre, *rim])
    forces: list[float | None] = []
    state = None
    for compression in compressions:
        down = -compression * HEIGHT
        held = {tuple(top): (0, 0, down) if sticks else (None, None, down)}
        if not sticks:
            held |= {tuple(sliding): (None, None, 0.0), tuple(rim): (None, 0.0, 0.0)}
        state = organ.solve(displacement=held, start=state, steps=2)
        if not state.is_converged:
            return forces + [None] * (len(compressions) - len(forces))
        forces.append(-float(state.reaction(tuple(top))[2]))
    return forces


def main() -> None:
    """The tables."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else SHARED
    if not folder.is_dir():
        sys.exit(f"no measured curves in {folder}: give their folder")
    print(machine.describe())
    published = json.loads((folder / "published_fits.json").read_text())
    print("\nstandard error [kPa] of single tests, median over a material's tests, and over the published one")
    print(f"{'':12s}" + "".join(f"{name + (f' {terms}' if terms else ''):>17s}" for name, terms, _ in LAWS))
    worst = 0.0
    for material in published:
        tests = [read(path) for path in sorted(folder.glob(f"{material}_??.csv"))]
        cells = []
        for name, terms, key in LAWS:
            error = 1e-3 * float(np.median([fit(name, test, terms=terms).standard_error for test in tests]))
            ratio = error / published[material][key]["standard_error_kPa"]
            worst = max(worst, ratio)
            cells.append(f"{error:9.3f} ({ratio:4.2f})")
        print(f"{material:12s}" + "".join(f"{cell:>17s}" for cell in cells), flush=True)
    print(f"largest ratio {worst:.2f}")
    print("\nall tests of a material together: the best law by AIC, its error, and the scatter between castings [kPa]")
    for material in published:
        tests = [read(path) for path in sorted(folder.glob(f"{material}_??.csv"))]
        fits = sorted((fit(name, tests, terms=terms) for name, terms, _ in LAWS), key=lambda found: found.aic)
        best = fits[0]
        values = ", ".join(f"{name} {value:.5g}" for name, value in best.parameters.items())
        print(
            f"{material:12s} {best.name:10s} {1e-3 * best.standard_error:7.3f}   scatter {1e-3 * scatter(tests):7.3f}"
            f"   {'stable' if best.is_stable else 'NOT stable'}   {values}",
            flush=True,
        )
    plates(best)


def scatter(tests: list[MaterialTest]) -> float:
    """Root-mean-square difference [Pa] between the castings' mean curves over what all tests cover."""
    low = max(test.stretch.min() for test in tests)
    grid = np.linspace(low, 0.99, 60)
    means = {}
    for casting in ("A", "B"):
        curves = [test for test in tests if f"_{casting}" in test.name]
        means[casting] = np.mean(
            [np.interp(grid, c.stretch[c.stretch.argsort()], c.stress[c.stretch.argsort()]) for c in curves], axis=0
        )
    return float(np.sqrt(np.mean((means["A"] - means["B"]) ** 2)))


def plates(found: Fit) -> None:
    """An FE cylinder that slides, against the closed form; one that sticks, and how much stiffer it is."""
    law = found.law
    compressions = [0.1, 0.2, 0.35, 0.5, 0.6]
    test = MaterialTest("uniaxial", [1.0 - c for c in compressions], np.ones(len(compressions)))
    area = cylinder(ACROSS, UP).volume / HEIGHT  # of the polygon that the mesh has for a circle
    closed = -area * incompressible_stress(law, test)
    slides = force_of_cylinder(law, compressions, sticks=False)
    sticks = force_of_cylinder(law, compressions[:3], sticks=True)
    print(f"\nthe cylinder by finite elements ({law!r}): force [N]")
    print("compression   closed form   FE, slides   difference   FE, sticks   over closed form")
    for k, compression in enumerate(compressions):
        slid, stuck = slides[k], sticks[k] if k < len(sticks) else None
        slip = "not solved".rjust(12) if slid is None else f"{slid:10.3f} N"
        off = "-" if slid is None else f"{100 * (slid / closed[k] - 1):.3f} %"
        stick = "-" if stuck is None else f"{stuck:.3f} N"
        over = "-" if stuck is None else f"{stuck / closed[k]:.3f}"
        print(f"{100 * compression:9.0f} % {closed[k]:11.3f} N {slip} {off:>12s} {stick:>12s} {over:>12s}")


if __name__ == "__main__":
    main()
