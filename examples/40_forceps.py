"""Forceps lift the lobe: grasp, lift, let go, frame by frame, and every frame says whether it has settled.

The stepper advances the full organ. A frame takes Newton iterations until its residual is small or the budget is spent,
so a simulator can show what it knows: the force in black once it has settled, in grey before.
"""

import numpy as np
from matplotlib.figure import Figure

import viscera as vs

liver = vs.Organ(vs.organs.liver(), vs.NeoHookean(young=5e3, poisson=0.45), fixed="hilum")
gravity = (0, 0, -9.81)
sagged = liver.solve(gravity=gravity, density=1060, throw=True)
stepper = liver.stepper(start=sagged, density=1060, solver="cg", iterations=8)

forceps = stepper.grasp("tip")
lift, force, settled = [], [], []
for n in range(30):
    forceps.move((0, 0, 0.001))
    frame = stepper.frame(gravity=gravity)
    lift.append(n + 1.0)
    force.append(frame.reaction(forceps)[2])
    settled.append(frame.is_settled)

forceps.release()
for _ in range(30):
    frame = stepper.frame(gravity=gravity)
back = np.abs(frame.displacement - sagged.displacement).max()
print(f"lifted by 30 mm with {force[-1]:.2f} N; {sum(settled)} of {len(settled)} frames settled")
print(f"let go, it is back within {1e3 * back:.2f} mm")

figure = Figure(figsize=(6.4, 4.4), layout="constrained")
axes = figure.subplots()
axes.plot(lift, force, color="#0b4f6c")
axes.set(xlabel="lift [mm]", ylabel="force of the forceps [N]")
assert all(settled)
assert back < 1e-3
