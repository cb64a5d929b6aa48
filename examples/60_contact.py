"""Contact: a capsule is pressed into the liver and dragged along it, without friction, with it, and bonded.

The same way of the same tool: 6 mm down, then 12 mm across. Without friction the drag is what the slope of the dent
gives. With a coefficient of 0.3 the surface sticks, is carried along, and slips when the force along it reaches 0.3
times the pressure. Bonded, it must follow all the way.
"""

import numpy as np
from matplotlib.figure import Figure

import viscera as vs

DOWN, ACROSS, FRAMES = 0.006, 0.012, 20

liver = vs.Organ(vs.organs.liver(), vs.NeoHookean(young=5e3, poisson=0.45), fixed="hilum")
top = liver.mesh.points[liver.mesh.points[:, 2].argmax()]
start = top + np.array((0, 0, 0.0102))

drags, presses = {}, {}
cases: dict[str, float | str] = {"frictionless": 0.0, "friction 0.3": 0.3, "bonded": "bonded"}
for name, friction in cases.items():
    stepper = liver.stepper(iterations=20)
    tool = stepper.tool(vs.Capsule("10 mm", "60 mm"), position=start, rotation=(0, np.pi / 2, 0), friction=friction)
    drag, press = [], []
    for n in range(2 * FRAMES):
        tool.move((0, 0, -DOWN / FRAMES) if n < FRAMES else (0, ACROSS / FRAMES, 0))
        frame = stepper.frame()
        assert frame.is_settled
        drag.append(frame.force(tool)[1])
        press.append(-frame.force(tool)[2])
    drags[name], presses[name] = np.array(drag), np.array(press)
    print(f"{name:13} pressed with {press[FRAMES - 1]:.2f} N, then {drag[-1]:.2f} N along under {press[-1]:.2f} N")

figure = Figure(figsize=(6.4, 4.4), layout="constrained")
axes = figure.subplots()
for name, forces in drags.items():
    axes.plot(1e3 * ACROSS / FRAMES * np.arange(FRAMES + 1), forces[FRAMES - 1 :], label=name)
axes.set(xlabel="way across [mm]", ylabel="force along the surface [N]")
axes.legend()
assert drags["frictionless"][-1] < drags["friction 0.3"][-1] < drags["bonded"][-1]
