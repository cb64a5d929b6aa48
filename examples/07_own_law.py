"""A law of your own, as a formula: tissue that stiffens as it is stretched, and nothing to compile.

`StrainEnergy` takes the energy as text. Stress, tangent and power series are derived from it exactly, so the law
solves, steps and reduces like a built-in one. Here an exponential of the first invariant, as Demiray takes for soft
tissue (Journal of Biomechanical Engineering 103 (1981) 73), with a term that resists a change of volume, is stretched
beside a neo-Hookean law of the same stiffness at rest. The neo-Hookean law is written down, too: a formula gives what
the built-in law gives.
"""

import numpy as np
from matplotlib.figure import Figure

import viscera as vs

MU, LAM, B = 1.4e3, 6e3, 8.0  # Pa, Pa, 1
laws = {
    "neo-Hookean, built in": vs.NeoHookean(mu=MU, lam=LAM),
    "neo-Hookean, a formula": vs.StrainEnergy("mu/2*(I1 - 3) - mu*log(J) + lam/2*log(J)**2", mu=MU, lam=LAM),
    "exponential, a formula": vs.StrainEnergy(
        "mu/(2*b)*(exp(b*(I1bar - 3)) - 1) + kappa/2*log(J)**2", mu=MU, b=B, kappa=LAM + 2 / 3 * MU
    ),
}
pulls = 0.01 * np.arange(1, 31)  # m, of a beam of 1 m
forces = {}
for name, law in laws.items():
    beam = vs.Organ(vs.organs.beam(), law, fixed="clamp")
    state, found = None, []
    for pull in pulls:
        state = beam.solve(displacement={"tip": (pull, "free", "free")}, start=state, throw=True)
        found.append(state.reaction("tip")[0])
    forces[name] = np.array(found)
    print(f"{name:24s} 1 cm: {found[0]:.4f} N   30 cm: {found[-1]:.4f} N   {law!r}")

# The reduced model reads the same formula.
touch = beam.reduce("top and x > 60%", depth="3 cm", order=3)
check = touch.check(touches=4, depths=["1 cm"])
print(f"reduced: {check!r}")

figure = Figure(figsize=(6.4, 4.4), layout="constrained")
axes = figure.subplots()
for (name, force), style in zip(forces.items(), ("-", "o", "-"), strict=True):
    colour = "#a31f3a" if "exponential" in name else "#0b4f6c"
    axes.plot(100 * pulls, force, style, color=colour, mfc="none", markevery=3, label=name)
axes.set(xlabel="stretched by [%]", ylabel="force [N]")
axes.legend(frameon=False)
built_in, written, exponential = forces.values()
assert np.abs(written / built_in - 1).max() < 1e-8
assert abs(exponential[0] / built_in[0] - 1) < 0.02
assert exponential[-1] > 2.0 * built_in[-1]
assert check.is_passed
