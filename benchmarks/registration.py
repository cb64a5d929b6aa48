"""How well `Organ.register` finds the built-in liver: target error inside it over seeded truths.

    python benchmarks/registration.py [FOLDER [so-far]]

Twenty truths of four kinds are made on a mesh of edges 0.6 times as long, under another law and with another stiffness
than what registers, and moved rigidly. What is seen of each is a contiguous patch of its front, a point per 3 mm^2,
with noise and 5 % of points that are something else's. Target error: the mean distance of 500 places in the organ from
where they are. It is compared with the rigid motion that the registration starts from, and with a thin-plate spline
through the pairs of closest points after that. Then each truth is seen wrongly, mirrored or in another scale: is it
said that the organ does not fit? Truths and rows are kept in FOLDER, out/registration by default, and what is there is
not computed again: the study may be interrupted. With `so-far` the tables are those of the rows that are there, and say
how many.
"""

from __future__ import annotations

import csv
import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from machine import describe

import viscera as vs
from viscera import _core
from viscera.mesh import Floats
from viscera.registration import observed
from viscera.registration.rigid import Rigid, Shape, rotation_of, starts

KINDS = ("pressure from outside", "support moved", "gravity turned", "lobe mobilised")
COUNT = 20
COVERAGES = (0.2, 0.3, 0.5, 1.0)
NOISES = (0.0, 2e-3, 5e-3)
TYPICAL = (0.3, 2e-3)
"""Coverage and noise [m] of the pass; the other coverages are with this noise, the other noises with this coverage."""
WRONG = {"mirrored": (-1.0, 1.0, 1.0), "10 % too large": 1.1, "30 % too large": 1.3, "30 % too small": 0.7}
"""Factors of a cloud that is seen wrongly, about its middle, along the axes of the organ."""
OUTLIERS, AREA = 0.05, 3e-6
SUPPORTS = np.array([[0, 0, 1], [-1, 0, 1], [-1, 0.5, 0], [0.5, 0, 1], [1, 0, 0.3]])
"""The organ reaches farthest in these directions where ligaments hold it."""
FRONT = np.array([0.0, -0.75, 0.66])


@dataclass
class Truth:
    """Where the organ is, and on which mesh."""

    kind: str
    mesh: vs.Mesh
    shape: Floats
    """Nodes (n, 3) [m] in the organ's axes, deformed."""
    motion: Rigid


def fine_liver(share: float = 0.6) -> vs.Mesh:
    """The built-in liver with edges so many times as long, by another mesher."""
    coarse = vs.organs.liver()
    edges = coarse.points[coarse.cells[:, [0, 0, 0, 1, 1, 2]]] - coarse.points[coarse.cells[:, [1, 2, 3, 2, 3, 3]]]
    edge = share * float(np.linalg.norm(edges, axis=2).mean())
    fine = vs.mesh_surface((coarse.points, coarse.surface), edge=edge)
    surface = fine.surface_nodes
    near = np.linalg.norm(fine.points[surface][:, None] - coarse.points[coarse.surface_nodes], axis=2).argmin(axis=1)
    nearest = coarse.surface_nodes[near]
    return fine.with_sets(**{name: surface[np.isin(nearest, nodes)] for name, nodes in coarse.sets.items()})


def truth(seed: int, mesh: vs.Mesh, folder: Path) -> Truth:
    """A liver that something happened to; from the folder where it was made before."""
    rng = np.random.default_rng(seed)
    kind = KINDS[seed % len(KINDS)]
    motion = Rigid(rotation_of(np.radians(30.0) * _direction(rng) * rng.random()), rng.uniform(-0.05, 0.05, size=3))
    kept = folder / f"truth_{seed:02d}.npy"
    if not kept.exists():
        state = _happened(kind, mesh, seed)
        if not state.is_converged:
            raise SystemExit(f"truth {seed}, {kind}: {state.message}")
        np.save(kept, mesh.points + state.displacement)
    return Truth(kind, mesh, np.load(kept), motion)


def _happened(kind: str, mesh: vs.Mesh, seed: int) -> vs.State:
    """The equilibrium, by Newton's method from that on the mesh which registers, where it is found quickly."""
    coarse = vs.organs.liver()
    organ, loads = _case(kind, coarse, np.random.default_rng((seed, 0)))
    short: dict[str, Any] = {"steps": 8, "settings": {"tolerance": 1e-6, "max_iterations": 8}}
    first = organ.solve(**loads, **short, throw=True)
    cells, shares = _core.Locator(coarse.points, coarse.cells).find(mesh.points)
    for node in np.flatnonzero(cells < 0):  # beside the surface: the nearest cell, continued
        cells[node] = np.linalg.norm(coarse.centroids - mesh.points[node], axis=1).argmin()
        corners = np.column_stack([coarse.points[coarse.cells[cells[node]]], np.ones(4)])
        shares[node] = np.linalg.solve(corners.T, [*mesh.points[node], 1.0])
    start = np.einsum("ka,kai->ki", shares, first.displacement[coarse.cells[cells]])
    organ, loads = _case(kind, mesh, np.random.default_rng((seed, 0)))
    start[organ.fixed] = 0.0
    quick = {"tolerance": 1e-6, "smallest_step": 1.0, "max_iterations": 12}
    try:
        state = organ.solve(**loads, start=start, settings=quick, solver="multigrid")
        if state.is_converged:
            return state
    except vs.VisceraError:  # a large motion, interpolated, turns a cell inside out
        pass
    return organ.solve(**loads, steps=8, settings={"tolerance": 1e-6, "max_iterations": 20})


def _case(kind: str, mesh: vs.Mesh, rng: np.random.Generator) -> tuple[vs.Organ, dict[str, Any]]:
    young, poisson, alpha = 6e3 * rng.uniform(0.5, 1.5), rng.uniform(0.44, 0.47), rng.uniform(4.0, 9.0)
    organ = vs.Organ(mesh, vs.Ogden(mu=young / (1 + poisson) / alpha, alpha=alpha, poisson=poisson), fixed="hilum")
    x = mesh.points[mesh.surface_nodes]
    loads: dict[str, Any] = {}
    if kind == "pressure from outside":
        centre = x[np.linalg.norm(x - rng.uniform(*mesh.bounding_box), axis=1).argmin()]
        place = mesh.surface_nodes[np.linalg.norm(x - centre, axis=1) < rng.uniform(0.05, 0.08)]
        loads["pressure"] = [(place, young * rng.uniform(0.1, 0.25))]
    elif kind == "support moved":
        step = rng.uniform(0.01, 0.02) * _direction(rng)
        loads["displacement"] = [(organ.patch(x[(x @ way).argmax()], 0.03), step) for way in SUPPORTS]
    elif kind == "gravity turned":
        loads = {"gravity": 9.81 * rng.uniform(0.3, 0.6) * _direction(rng), "density": 1060.0}
    else:
        lifted = np.array([-0.3, -0.6, 0.7]) + 0.5 * rng.normal(size=3)
        tip = organ.patch(mesh.points[mesh.nodes("tip")].mean(axis=0), 0.05)
        loads["displacement"] = [(tip, rng.uniform(0.05, 0.07) * lifted / np.linalg.norm(lifted))]
    return organ, loads


def _direction(rng: np.random.Generator) -> Floats:
    vector = rng.normal(size=3)
    return np.asarray(vector / np.linalg.norm(vector))


def cloud_of(truth: Truth, seed: int, coverage: float, noise: float, seen_as: str = "") -> Floats:
    """What is seen: points (k, 3) [m] on triangles that grow from the middle of the front, backs last."""
    rng = np.random.default_rng((seed, 1))
    corners = truth.shape[truth.mesh.surface]
    area = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(area, axis=1)
    facing = area @ FRONT / (size * np.linalg.norm(FRONT))
    centres = corners.mean(axis=1)
    front = np.flatnonzero(facing > 0.6)
    middle = centres[front].mean(axis=0) + rng.normal(scale=0.015, size=3)
    middle = centres[front[np.linalg.norm(centres[front] - middle, axis=1).argmin()]]
    away = np.linalg.norm(centres - middle, axis=1) + 0.08 * (1.0 - np.minimum(facing, 0.5))
    order = np.argsort(away)
    seen = order[: np.searchsorted(np.cumsum(size[order]), coverage * size.sum()) + 1]
    count = int(size[seen].sum() / AREA)
    triangles = rng.choice(seen, size=count, p=size[seen] / size[seen].sum())
    cloud = np.einsum("ka,kai->ki", rng.dirichlet(np.ones(3), size=count), corners[triangles])
    cloud = cloud + rng.normal(scale=noise, size=cloud.shape)
    wrong = rng.random(count) < OUTLIERS
    cloud[wrong] += rng.uniform(-0.03, 0.03, size=(wrong.sum(), 3))
    if seen_as:
        cloud = cloud.mean(axis=0) + np.asarray(WRONG[seen_as]) * (cloud - cloud.mean(axis=0))
    return truth.motion(cloud)


def targets(truth: Truth, organ: vs.Organ, count: int = 500) -> tuple[Floats, Floats]:
    """Places (k, 3) in the organ at rest, even in its volume, and where they are."""
    rng = np.random.default_rng(0)
    mesh = truth.mesh
    volumes = np.asarray(mesh.facts["cell_volumes"])
    cells = mesh.cells[rng.choice(len(mesh.cells), size=count, p=volumes / volumes.sum())]
    share = rng.dirichlet(np.ones(4), size=count)
    at, now = (np.einsum("ka,kai->ki", share, x[cells]) for x in (mesh.points, truth.shape))
    inside = _core.Locator(organ.mesh.points, organ.mesh.cells).find(at)[0] >= 0
    return at[inside], truth.motion(now[inside])


def spline(places: Floats, found: Floats, at: Floats) -> Floats:
    """The thin-plate spline (phi = -r) through pairs of places (p, 3), at other places (k, 3).

    Its smoothing is chosen by generalised cross-validation (Wahba 1990, chapter 4).
    """
    r = np.linalg.norm(places[:, None] - places, axis=2)
    flat = np.column_stack([np.ones(len(places)), places])
    bent = np.linalg.qr(flat, mode="complete")[0][:, 4:]  # what no affine map can fit
    stiffness, modes = np.linalg.eigh(-bent.T @ r @ bent)
    parts = np.square(modes.T @ bent.T @ (found - places)).sum(axis=1)
    smoothings = np.geomspace(1e-6, 1e3, 46) * stiffness[-1]
    left = smoothings[:, None] / (stiffness + smoothings[:, None])
    smooth = smoothings[(np.square(left) @ parts / np.square(left.sum(axis=1))).argmin()]
    matrix = np.block([[smooth * np.eye(len(r)) - r, flat], [flat.T, np.zeros((4, 4))]])
    c = np.linalg.solve(matrix, np.concatenate([found - places, np.zeros((4, 3))]))
    far = np.linalg.norm(at[:, None] - places, axis=2)
    return np.asarray(at + np.column_stack([-far, np.ones(len(at)), at]) @ c)


def score(
    organ: vs.Organ, truth: Truth, seed: int, coverage: float, noise: float, seen_as: str = ""
) -> dict[str, float]:
    """Mean target errors [m] of three registrations, the band, and the time [s] of one thread."""
    at, now = targets(truth, organ)
    cloud = cloud_of(truth, seed, coverage, noise, seen_as)
    told = max(noise, 5e-4)
    shape = Shape(organ.mesh.points, organ.mesh.surface)
    rigid = starts(shape, observed(organ.mesh, cloud, None, None, None, told, told), None)[0]
    z = rigid.back(cloud[:: max(1, len(cloud) // 400)])
    p = shape.closest(z)[3]
    near = np.linalg.norm(z - p, axis=1) < 0.02
    splined = rigid(spline(p[near], z[near], at))
    began = time.process_time()
    found = organ.register(cloud, noise=told)
    seconds = time.process_time() - began
    return {
        "rigid": float(np.linalg.norm(rigid(at) - now, axis=1).mean()),
        "spline": float(np.linalg.norm(splined - now, axis=1).mean()),
        **outcome(found, at, now),
        "seconds": seconds,
    }


def outcome(found: vs.Registered, at: Floats, now: Floats) -> dict[str, float]:
    """Mean target error [m], how many targets are in the band, and what is said of the fit."""
    error = np.linalg.norm(at + found.at(at).displacement - now, axis=1)
    band = found.band_at(at)
    known = np.isfinite(band)
    return {
        "error": float(error.mean()),
        "in_band": float((error < band)[known].sum()),
        "observed": float(known.sum()),
        "targets": float(len(at)),
        "converged": float(found.is_converged),
        "misfit": np.nan if found.misfit is None else found.misfit,
        "systematic": np.nan if found.systematic_residual is None else found.systematic_residual,
        "poor": float(found.is_poor_fit),
    }


def settings() -> list[tuple[float, float]]:
    """Coverage and noise of each line of the table."""
    rows = [TYPICAL, *((coverage, TYPICAL[1]) for coverage in COVERAGES), *((TYPICAL[0], noise) for noise in NOISES)]
    return list(dict.fromkeys(rows))


Key = tuple[float, float, str, int]
"""Coverage, noise [m], how a cloud is seen wrongly, and the seed."""
NAMES = ("coverage", "noise", "seen_as", "seed")


def kept_rows(path: Path) -> dict[Key, dict[str, float]]:
    """What was computed before."""
    if not path.exists():
        return {}
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    found = {}
    for row in rows:
        coverage, noise, seen_as, seed = (row.pop(name) for name in NAMES)
        key = (float(coverage), float(noise), seen_as, int(seed))
        found[key] = {name: float(value) for name, value in row.items()}
    return found


@cache
def meshes() -> tuple[vs.Mesh, vs.Organ]:
    """That of the truths, and what registers."""
    return fine_liver(), vs.Organ(vs.organs.liver(), vs.NeoHookean(young=6e3, poisson=0.45), fixed="hilum")


def computed(folder: Path, key: Key) -> tuple[Key, dict[str, float]]:
    """A row, in a process of its own."""
    coverage, noise, seen_as, seed = key
    mesh, organ = meshes()
    return key, score(organ, truth(seed, mesh, folder), seed, coverage, noise, seen_as)


def compute(folder: Path) -> dict[Key, dict[str, float]]:
    """All rows, by as many processes of one thread as there are cores; each is written as soon as it is there."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "rows.csv"
    rows = kept_rows(path)
    wanted = [(*setting, "", seed) for setting in settings() for seed in range(COUNT)]
    wanted += [(*TYPICAL, seen_as, seed) for seen_as in WRONG for seed in range(COUNT)]
    os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "RAYON_NUM_THREADS"), "1"))
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        # First the truths, which many rows read.
        for made in [pool.submit(truth, seed, meshes()[0], folder) for seed in range(COUNT)]:
            made.result()
        for done in as_completed([pool.submit(computed, folder, key) for key in wanted if key not in rows]):
            key, row = done.result()
            rows[key] = row
            with path.open("a", newline="") as file:
                if not file.tell():
                    print(*[*NAMES, *row], sep=",", file=file)
                print(*key, *row.values(), sep=",", file=file)
            print(f"{key} {1e3 * row['error']:.1f} mm", file=sys.stderr, flush=True)
    return rows


def line(rows: list[dict[str, float]]) -> str:
    """Median (95th percentile) of mean target errors [mm] over cases, the band, and failures."""
    words = []
    for name in ("rigid", "spline", "error"):
        errors = 1e3 * np.array([row[name] for row in rows])
        words.append(f"{np.median(errors):5.1f} ({np.percentile(errors, 95):4.1f})")
    total = {name: sum(row[name] for row in rows) for name in rows[0]}
    worse = sum(row["error"] > row["rigid"] for row in rows)
    return (
        f"{'  '.join(words)}  {100 * total['in_band'] / max(total['observed'], 1.0):6.0f}"
        f"{100 * total['observed'] / total['targets']:9.0f}{len(rows) - int(total['converged']):11d}{worse:7d}"
        f"{np.median([row['seconds'] for row in rows]):10.1f}"
    )


HEAD = (
    "     rigid       spline   registered   in band  observed  not conv.  worse   time [s]\n"
    "                                           [%]       [%]   [cases] than rigid"
)


def spanned(values: list[float]) -> str:
    """Median and range."""
    return f"{np.nanmedian(values):8.2f} ({np.nanmin(values):.2f} to {np.nanmax(values):.2f})"


def fits(rows: dict[Key, dict[str, float]]) -> str:
    """What is said of the fit, of clouds as they are and of those that are seen wrongly."""
    lines = [
        "",
        "                                                     systematic               of the others",
        "cloud           coverage  noise  misfit (range)        [mm] (range)   poor fits  error [mm]  in band [%]",
    ]
    for coverage, noise, seen_as in [
        *((*each, "") for each in sorted(settings())),
        *((*TYPICAL, as_) for as_ in WRONG),
    ]:
        of = [row for key, row in rows.items() if key[:3] == (coverage, noise, seen_as)]
        if not of:
            continue
        passed = [row for row in of if not row["poor"]]
        band = 100 * sum(row["in_band"] for row in passed) / max(sum(row["observed"] for row in passed), 1.0)
        error = 1e3 * np.median([row["error"] for row in passed]) if passed else np.nan
        others = f"{error:12.1f}{band:13.0f}" if passed else f"{'-':>12s}{'-':>13s}"
        spans = spanned([row["misfit"] for row in of]), spanned([1e3 * row["systematic"] for row in of])
        lines.append(
            f"{seen_as or 'as it is':16s}{100 * coverage:6.0f} %{1e3 * noise:4.0f} mm{'  '.join(spans)}"
            f"{f'{len(of) - len(passed)}/{len(of)}':>12s}{others}"
        )
    return "\n".join(lines)


def main() -> None:
    """Compute what is missing, unless asked not to, then print the tables."""
    folder = Path(sys.argv[1] if sys.argv[1:] else "out/registration")
    rows = kept_rows(folder / "rows.csv") if sys.argv[2:] == ["so-far"] else compute(folder)
    print(describe())
    print("mean target error [mm], median over truths (95th percentile); time: of a processor\n")
    print(f"coverage  noise  truths{HEAD}".replace("\n", "\n" + 23 * " "))
    for coverage, noise in sorted(settings()):
        of = [row for key, row in rows.items() if key[:3] == (coverage, noise, "")]
        if of:
            print(f"{100 * coverage:6.0f} %{1e3 * noise:4.0f} mm{len(of):5d}/{COUNT} {line(of)}")
    coverage, noise = TYPICAL
    keys = {seed: (coverage, noise, "", seed) for seed in range(COUNT)}
    typical = {seed: rows[key] for seed, key in keys.items() if key in rows}
    print(f"\nby what happened, {100 * coverage:.0f} % and {1e3 * noise:.0f} mm")
    for k, kind in enumerate(KINDS):
        of = [row for seed, row in typical.items() if seed % len(KINDS) == k]
        if of:
            print(f"{kind:24s}{line(of)}")
    print("\nseed  what happened            rigid  spline  registered  in band  observed")
    for seed, row in typical.items():
        errors = [f"{1e3 * row[name]:.1f}" for name in ("rigid", "spline", "error")]
        band = f"{100 * row['in_band'] / row['observed']:7.0f} %" if row["observed"] else "        -"
        print(
            f"{seed:4d}  {KINDS[seed % len(KINDS)]:23s}{errors[0]:>7s}{errors[1]:>8s}{errors[2]:>12s}{band}"
            f"{100 * row['observed'] / row['targets']:8.0f} %{'' if row['converged'] else '  not converged'}"
        )
    print(fits(rows))
    hard = [row["error"] for row in typical.values() if row["rigid"] >= 8e-3]
    if hard:
        print(
            f"\nwhere rigid leaves 8 mm or more ({len(hard)} of {len(typical)} truths): median "
            f"{1e3 * np.median(hard):.1f} mm"
        )


if __name__ == "__main__":
    main()
