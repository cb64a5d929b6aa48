"""Uncertainty in stiffness: a thousand samples of Young's modulus on one reduced model.

Nobody knows a patient's stiffness exactly. `Vary` reduces an organ for a range of it, so that a sample costs an
evaluation instead of a nonlinear solution. Here the modulus of the beam's inner half is uncertain by a factor of three,
and the question is what force a 20 mm dent takes.
"""

from time import perf_counter

import numpy as np
from matplotlib.figure import Figure

import viscera as vs

mesh = vs.organs.beam()
beam = vs.Organ(mesh, vs.NeoHookean(young=1e4, poisson=0.3), fixed="clamp")
softer = vs.Vary("young", 3e3, 3e4, part=lambda x: x[:, 0] < 0.5)
touch = beam.reduce("tip", depth=0.05, order=3, vary=softer)

point, dent = mesh.points[mesh.nodes("tip")].mean(axis=0), np.array([0.0, 0.0, -0.02])
random = np.random.default_rng(1)
moduli = np.clip(1e4 * np.exp(random.normal(0.0, np.log(3) / 2, 1000)), 3e3, 3e4)
began = perf_counter()
force = np.array([-touch.at(young)(point, dent).force[2] for young in moduli])
seconds = perf_counter() - began

low, median, high = np.percentile(force, [2.5, 50, 97.5])
print(f"a dent of 20 mm takes {median:.3f} N, 95 % of samples between {low:.3f} and {high:.3f} N")
print(f"time {1e3 * seconds / len(force):.2f} ms a sample")

figure = Figure(figsize=(6.4, 4.4), layout="constrained")
axes = figure.subplots()
axes.hist(1e3 * force, bins=40, color="#0b4f6c")
axes.set(xlabel="force [mN]", ylabel="samples", title="Young's modulus known to a factor of three")

check = vs.Organ(mesh, beam.law, fixed="clamp")
patch = touch.patch(point)
exact = check.solve(displacement={patch: dent}, throw=True)
nominal, truth = -touch.at(1e4)(point, dent).force[2], -exact.reaction(patch)[2]
print(f"at the nominal modulus {nominal:.4f} N, the full solution {truth:.4f} N")
assert abs(nominal / truth - 1) < 0.01
assert low < median < high
