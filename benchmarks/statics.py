"""Full solutions of the built-in organs under their own weight: time of each stage, median and worst of many runs; and
what power series cost, those that predict a load step and those that follow a path of equilibria.

Wall time on all cores, neo-Hookean, E = 0.2 MPa, nu = 0.45, from rest to equilibrium in as few load steps as Newton
needs. It does not show larger meshes, where the factorisation takes nearly all the time. Series: the liver pulled at
its tip, processor time, the least of three runs; `solve` by `cholesky`, whose load steps are predicted, and `path`.
"""

from time import process_time

import numpy as np
from machine import describe

import viscera as vs

RUNS = 20
STAGES = ("analysis", "assembly", "factorization", "solve", "total")

print(describe())
print(f"ms, median / worst of {RUNS} runs")
print("organ    nodes   cells  iterations" + "".join(f"{stage:>18}" for stage in STAGES))
for name, held in (("beam", "clamp"), ("artery", "bottom"), ("liver", "hilum")):
    mesh = getattr(vs.organs, name)()
    organ = vs.Organ(mesh, vs.NeoHookean(young=0.2e6, poisson=0.45), fixed=held)
    states = [organ.solve(gravity=(0, 0, -9.81), density=1060, throw=True) for _ in range(RUNS)]
    print(f"{name:7s}{len(mesh.points):7d}{len(mesh.cells):8d}{states[0].iterations:12d}", end="")
    for stage in STAGES:
        times = 1e3 * np.array([state.timings[stage] for state in states])
        print(f"{np.median(times):10.2f} /{times.max():6.1f}", end="")
    print()

LAWS = (
    vs.SaintVenantKirchhoff(young=4.1e3, poisson=0.3),
    vs.NeoHookean(young=4.1e3, poisson=0.48),
    vs.MooneyRivlin(c1=600.0, c2=200.0, kappa=15e3, volumetric="ln J"),
    vs.Ogden(mu=[500.0, -100.0], alpha=[3.0, -4.0], poisson=0.45),
)
PULL = 0.5  # [N]
print("\ntime [s]              solve    path  iterations  expansions of the path")
for law in LAWS:
    organ = vs.Organ(vs.organs.liver(), law, fixed="hilum", element="P1")
    seconds = np.full((3, 2), np.inf)
    for run in seconds:
        began = process_time()
        state = organ.solve(force={"tip": (0, 0, PULL)}, solver="cholesky")
        run[0] = process_time() - began
        began = process_time()
        path = organ.path(force={"tip": (0, 0, PULL)})
        run[1] = process_time() - began
    solve, follow = seconds.min(axis=0)
    name = type(law).__name__
    print(f"{name:20s}{solve:7.2f}{follow:8.2f}{state.iterations:12d}{len(path.expansions):24d}", flush=True)
