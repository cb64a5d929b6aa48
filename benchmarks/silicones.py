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
from viscera.fitting.columns import read_columns
from viscera.fitting.homogeneous import incompressible_stress
from viscera.fitting.specimen import SpecimenTest, cylinder

RADIUS, HEIGHT = 0.025, 0.03
BRICKS = (6, 4)
"""Of the finite-element cylinder, across and up."""
UP_TO = 0.35
"""Compression up to which a cylinder that sticks is fitted: beyond, its side would touch the plates."""
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


def force_of_cylinder(law: vs.laws.Law, compressions: list[float], *, sticks: bool) -> list[float | None]:
    """Force [N] on the upper plate at growing compression of an FE cylinder that slides on its plates or sticks."""
    mesh = cylinder(RADIUS, HEIGHT, BRICKS)
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
    bounds(folder, list(published))
    plates(best)


def bounds(folder: Path, materials: list[str]) -> None:
    """Shear moduli of laws fitted to one test of each material as if it slid on its plates, and as if it stuck."""
    print(f"\nYeoh's law of two terms fitted to the first test up to {UP_TO:.0%}: 2 c10 [kPa] (standard error [kPa])")
    print(f"{'':12s}        sliding          stuck   ratio")
    for material in materials:
        whole = read(sorted(folder.glob(f"{material}_??.csv"))[0])
        near = whole.stretch >= 1.0 - UP_TO
        slides = MaterialTest("uniaxial", whole.stretch[near], whole.stress[near], material)
        travel, force = HEIGHT * (slides.stretch - 1.0), np.pi * RADIUS**2 * slides.stress
        sticks = SpecimenTest.cylinder(RADIUS, HEIGHT, travel, force, bricks=BRICKS, name=material)
        found = [fit("Yeoh", test, terms=2) for test in (slides, sticks)]
        moduli = [2e-3 * each.parameters["c10"] for each in found]
        cells = [f"{m:8.3f} ({1e-3 * each.standard_error:4.2f})" for m, each in zip(moduli, found, strict=True)]
        print(f"{material:12s}{cells[0]:>15s}{cells[1]:>15s}{moduli[0] / moduli[1]:8.2f}", flush=True)


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
    area = cylinder(RADIUS, HEIGHT, BRICKS).volume / HEIGHT  # of the polygon that the mesh has for a circle
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
