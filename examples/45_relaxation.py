"""Tissue that relaxes: the force of a dent that is held fades, as a Prony series says.

A beam's end is pushed aside and held. The stress that acts at once is that of the law; parts of it fade with times of
0.05 and 1 s. What stays in the end is the law's stress times 1 - g1 - g2.
"""

import numpy as np
from matplotlib.figure import Figure

import viscera as vs

SHARES, TIMES, STEP = (0.4, 0.2), (0.05, 1.0), 0.02
beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
stepper = beam.stepper(time_step=STEP, relaxation=vs.Prony(g=SHARES, tau=TIMES), iterations=4)

times, force = [], []
for n in range(300):
    frame = stepper.frame({"tip": (None, None, -0.01)})
    times.append(STEP * (n + 1))
    force.append(-frame.reaction("tip")[2])

at_once = -beam.solve(displacement={"tip": (None, None, -0.01)}, throw=True).reaction("tip")[2]
print(f"law alone {at_once:.3f} N, after {times[-1]:.0f} s {force[-1]:.3f} N: {force[-1] / at_once:.3f} of it")
print(f"1 - g1 - g2 = {1 - sum(SHARES):.3f}")

figure = Figure(figsize=(6.4, 4.4), layout="constrained")
axes = figure.subplots()
axes.semilogx(times, force, color="#0b4f6c", label="force")
axes.axhline(at_once * (1 - sum(SHARES)), color="#a31f3a", lw=0.8, label="law times 1 - g1 - g2")
axes.set(xlabel="time [s]", ylabel="force [N]")
axes.legend(frameon=False)
assert np.all(np.diff(force) < 0)
assert abs(force[-1] / at_once - (1 - sum(SHARES))) < 0.005
