"""Forceps lift the lobe: two jaws close on it with friction, lift it, and lose it where it is slippery.

The jaws are rigid boxes with one pose and one opening. They close until they press with the force asked for, and keep
this force while they move. Friction holds the lobe between them: with a grip of 1 N it follows dry jaws (mu = 0.3), and
slides off wet ones (mu = 0.02). Every frame says whether it has settled.
"""

import numpy as np
from matplotlib.figure import Figure

import viscera as vs

GRIP, STEP, FRAMES = 1.0, 0.002, 10

liver = vs.Organ(vs.organs.liver(), vs.NeoHookean(young=5e3, poisson=0.45), fixed="hilum")
gravity = (0, 0, -9.81)
sagged = liver.solve(gravity=gravity, density=1060, throw=True)
tip = liver.mesh.nodes("tip")
middle = (liver.mesh.points + sagged.displacement)[tip].mean(axis=0)


def lift(friction: float) -> tuple[list[float], list[float]]:
    """How far the lobe follows the forceps [m], and the force with which they lift it [N], frame by frame."""
    stepper = liver.stepper(start=sagged, density=1060, solver="cg", iterations=20)
    jaw = vs.Box(("8 mm", "30 mm", "40 mm"), rounding="3 mm")
    forceps = stepper.forceps(jaw, middle, rotation=(0, 0, np.pi / 2), opening="50 mm", friction=friction)
    forceps.squeeze(GRIP, by="5 mm")
    for _ in range(18):
        frame = stepper.frame(gravity=gravity)
    assert abs(forceps.grip - GRIP) < 0.1 * GRIP
    forceps.squeeze(GRIP, by="0.5 mm")  # jaws that lose the lobe in a frame must not catch it again from below
    begin = frame.displacement[tip, 2].mean()
    follows, force, settled = [], [], 0
    for _ in range(FRAMES):
        forceps.move((0, 0, STEP))
        frame = stepper.frame(gravity=gravity)
        settled += frame.is_settled
        follows.append(float(frame.displacement[tip, 2].mean() - begin))
        force.append(float(frame.force(forceps)[2]))
    forceps.remove()
    for _ in range(5):
        frame = stepper.frame(gravity=gravity)
    back = np.abs(frame.displacement - sagged.displacement).max()
    assert settled >= FRAMES - 2  # a frame in which the lobe is lost may need more iterations
    assert back < 1e-4
    rise, last = 1e3 * FRAMES * STEP, 1e3 * follows[-1]
    print(f"friction {friction:g}, jaws lifted by {rise:.0f} mm: the lobe follows by {last:.0f}")
    print(f"  {settled} of {FRAMES} frames settled; let go, it is back within {1e6 * back:.0f} um")
    return follows, force


firm, carried = lift(0.3)
loose, slipping = lift(0.02)

figure = Figure(figsize=(6.4, 5.6), layout="constrained")
above, below = figure.subplots(2, 1, sharex=True)
lifted = 1e3 * STEP * np.arange(1, FRAMES + 1)
for name, lobe, force in (("dry, friction 0.3", firm, carried), ("wet, friction 0.02", loose, slipping)):
    above.plot(lifted, 1e3 * np.array(lobe), label=name)
    below.plot(lifted, force)
above.set(ylabel="lift of the lobe [mm]")
above.legend()
below.set(xlabel="lift of the forceps [mm]", ylabel="force upwards [N]")
assert firm[-1] > 0.9 * FRAMES * STEP
assert max(loose) < 0.7 * FRAMES * STEP
