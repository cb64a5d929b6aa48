"""Full solutions of the built-in organs under their own weight: time of each stage, median and worst of many runs.

Wall time on all cores, neo-Hookean, E = 0.2 MPa, nu = 0.45, from rest to equilibrium in as few load steps as Newton
needs. It does not show larger meshes, where the factorisation takes nearly all the time.
"""

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
