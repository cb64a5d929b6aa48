"""Meshes from label maps: angles, volumes and time; a ball in a ball, the built-in liver, a human abdomen.

    python benchmarks/meshing.py

The pair of balls is that on which Cleaver was measured (itk-cleaver 1.3.1, with itk 5.3 and NumPy 1.23, the numbers of
that one run are repeated here). The human label map is TotalSegmentator's example, looked for in `scans/` of the folder
that VISCERA_SHARED names; without it its rows are left out, with a line that says so.
"""

import os
from pathlib import Path
from time import perf_counter, process_time

import numpy as np
from machine import ROOT, describe

import viscera as vs
from viscera.scans.meshing import least_angles

RADII, VOXELS = (8.0, 14.0), 40
CLEAVER = "Cleaver, 8 voxels in a larger one     28.5 k           5.8      15   -1.1   -5.9      57"
HUMAN = Path(os.environ.get("VISCERA_SHARED", ROOT.parent / "shared")) / "scans/totalsegmentator_example_seg.nii.gz"
HEAD = "                                       cells  least  first %   volumes, in order       wall     all"
UNITS = "                                              [deg]   [deg]    [%]                      [s]  threads [s]"


def balls() -> vs.Scan:
    """A ball of 8 voxels radius in one of 14, voxels of 1 mm: labels 2 and 1."""
    distance = np.linalg.norm(np.indices((VOXELS,) * 3) - 0.5 * (VOXELS - 1), axis=0)
    return vs.Scan(np.select([distance < radius for radius in RADII], [2, 1]), 1e-3 * np.eye(3, 4))


def with_vein(liver: vs.Scan) -> vs.Scan:
    """The liver with a vein of 16 mm through it: label 2."""
    x, y, z = (
        np.moveaxis(np.indices(liver.values.shape), 0, -1).reshape(-1, 3).T * liver.spacing[0] + liver.affine[:, 3:]
    )
    is_vein = (np.hypot(x + 0.03, y - 0.01) < 0.008) & (z > -0.05)
    return vs.Scan(np.where(is_vein.reshape(liver.values.shape), 2, liver.values), liver.affine)


def row(name: str, scan: vs.Scan, labels: dict[str, int], edge: float | dict[str, float]) -> str:
    """Cells, angles, volumes against the voxels', seconds of the clock and of all threads."""
    clock, work = perf_counter(), process_time()
    mesh = scan.mesh(labels, edge=edge)
    clock, work = perf_counter() - clock, process_time() - work
    angles, voxel = least_angles(mesh.points, mesh.cells), abs(np.linalg.det(scan.affine[:, :3]))
    cells = mesh.facts["cell_volumes"]
    errors = [cells[mesh.cell_sets[part]].sum() / (voxel * scan.labels[n]) - 1.0 for part, n in labels.items()]
    told = " ".join(f"{100 * error:+6.2f}" for error in errors)
    lengths = dict.fromkeys(edge.values()) if isinstance(edge, dict) else [edge]
    what = f"{name}, {' and '.join(f'{1e3 * length:.3g}' for length in lengths)} mm"
    shape = f"{len(cells):7d}  {angles.min():5.1f}   {np.percentile(angles, 1):5.1f}"
    return f"{what:37s}{shape}    {told:21s}  {clock:6.1f}  {work:6.1f}"


print(describe())
print(HEAD, UNITS, CLEAVER, sep="\n")
print(row("the inner and the outer ball", balls(), {"inner": 2, "outer": 1}, 1.55e-3))
liver = vs.Scan.of(vs.organs.liver())
for edge in (0.010, 0.0052):
    print(row("built-in liver", liver, {"liver": 1}, edge))
vein = with_vein(liver)
for edge in (0.003, {"vein": 0.003, "liver": 0.012}, {"vein": 0.003, "liver": 0.008}):
    print(row("liver, vein", vein, {"vein": 2, "liver": 1}, edge))
if not HUMAN.exists():
    print(f"no human scan: {HUMAN.name} is not in scans/ of the folder that VISCERA_SHARED names")
else:
    human = vs.scan(HUMAN)
    for name, label in (("spleen", 1), ("right kidney", 2), ("left kidney", 3), ("gallbladder", 4), ("liver", 5)):
        radius = (0.75 / np.pi * human.labels[label] * np.prod(human.spacing)) ** (1 / 3)
        for edge in (0.008, radius / 6.0):
            print(row(name, human, {name: label}, edge))
    five = {"spleen": 1, "right kidney": 2, "left kidney": 3, "gallbladder": 4, "liver": 5}
    veins = {"portal vein": 64, "vena cava": 63}
    for edge in (0.003, dict.fromkeys(veins, 0.003) | {"liver": 0.008}, dict.fromkeys(veins, 0.003) | {"liver": 0.012}):
        print(row("veins, liver", human, {**veins, "liver": 5}, edge))
    print(row("these five at once", human, five, 0.006))
