"""A limit point: an artery under pressure softens until no pressure holds it. Arc length goes past that point.

The wall gets thinner as it widens, so there is a largest pressure that the vessel can balance. A static solution beyond
it does not exist, and `solve` says so. The power series of the path in its arc length runs through the limit point and
down the other side.
"""

import numpy as np
from matplotlib.figure import Figure

import viscera as vs

mesh = vs.organs.artery()
rims = np.concatenate([mesh.nodes(name) for name in ("bottom", "top", "branch")])
artery = vs.Organ(mesh, vs.NeoHookean(young=1e6, poisson=0.45), fixed=rims)

path = artery.path(pressure={"lumen": 1e5}, parameter="arc length", until=10.0, max_expansions=16)
load, displacement = path.curve()
widest = 1e3 * np.linalg.norm(displacement, axis=2).max(axis=1)
top = int(load.argmax())
print(f"limit point at {load[top]:.3f} x 100 kPa, where the wall has moved by {widest[top]:.2f} mm")
print(f"the path was followed in {len(path.expansions)} expansions to {widest[-1]:.2f} mm")

beyond = artery.solve(pressure={"lumen": 1.05 * load[top] * 1e5})
print(f"5 % more pressure: {beyond.status}")

figure = Figure(figsize=(6.4, 4.4), layout="constrained")
axes = figure.subplots()
axes.plot(widest, 100 * load, color="#0b4f6c")
axes.plot(widest[top], 100 * load[top], "o", color="#a31f3a", label="limit point")
axes.set(xlabel="largest displacement of the wall [mm]", ylabel="pressure [kPa]")
axes.legend(frameon=False)
assert 0 < top < len(load) - 1
assert not beyond.is_converged
