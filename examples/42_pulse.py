"""An artery with a pulse: pressure follows the deforming wall, frame by frame, 60 frames to a beat.

The pressure inside swings between 80 and 120 mmHg. It acts along the normal of the wall as the wall moves, so it is a
follower load, and its part of the tangent is in every Newton step.
"""

import numpy as np
from matplotlib.figure import Figure

import viscera as vs

mmHg, BEAT = 133.322, 60
mesh = vs.organs.artery()
rims = np.concatenate([mesh.nodes(name) for name in ("bottom", "top", "branch")])
artery = vs.Organ(mesh, vs.NeoHookean(young=1e6, poisson=0.45), fixed=rims)

start = artery.solve(pressure={"lumen": 80 * mmHg}, throw=True)
stepper = artery.stepper(start=start, iterations=3)
pressures, moved, settled = [], [], []
for n in range(2 * BEAT + 1):
    pressures.append(100 - 20 * np.cos(2 * np.pi * n / BEAT))
    frame = stepper.frame(pressure={"lumen": pressures[-1] * mmHg})
    moved.append(1e6 * np.linalg.norm(frame.displacement, axis=1).max())
    settled.append(frame.is_settled)

systole = artery.solve(pressure={"lumen": 120 * mmHg}, throw=True)
static = 1e6 * systole.max_displacement
print(f"the wall moves by {min(moved):.0f} um at 80 mmHg and {max(moved):.0f} um at 120 mmHg")
print(f"static solution at 120 mmHg: {static:.0f} um; {sum(settled)} of {len(settled)} frames settled")

figure = Figure(figsize=(6.4, 4.4), layout="constrained")
axes = figure.subplots()
time = np.arange(len(moved)) / BEAT
axes.plot(time, moved, color="#0b4f6c", label="wall [um]")
axes.plot(time, pressures, color="#a31f3a", label="pressure [mmHg]")
axes.set(xlabel="beats")
axes.legend(frameon=False)
assert abs(max(moved) / static - 1) < 1e-3
assert all(settled)
