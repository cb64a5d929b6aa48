"""On the table: a liver laid down under its weight, once on its back and once on its lower face.

No node is fixed. The vessels at the hilum hold the organ softly, as a bed of springs, and the table only pushes. In
frames with inertia the liver sinks onto the table, spreads, and comes to rest; its weight then lies on the table and, a
little, on the vessels.
"""

import numpy as np
from matplotlib.figure import Figure

import viscera as vs

DENSITY, G = 1060.0, 9.81
POSTURES = {"on its back": ((0, 1, 0), (np.pi / 2, 0, 0)), "on its lower face": ((0, 0, -1), (0, 0, 0))}
"""Which way is down in the axes of the organ, and the rotation that makes the top of a half-space face upwards."""

built_in = vs.organs.liver()
mesh = vs.mesh_surface((built_in.points, built_in.surface), edge="18 mm")
porta = built_in.points[built_in.nodes("hilum")].mean(axis=0)
mesh = vs.mesh(mesh.points, mesh.cells, {"hilum": np.linalg.norm(mesh.points - porta, axis=1) < 0.02})
vessels = vs.ElasticSupport("hilum", stiffness=1e5)
liver = vs.Organ(mesh, vs.NeoHookean(young=20e3, poisson=0.45), supports=[vessels])
weight = mesh.volume * DENSITY * G
print(f"a liver of {weight:.1f} N")

figure = Figure(figsize=(6.4, 2.6), layout="constrained")
panels = figure.subplots(1, len(POSTURES), sharey=True)
for axes, (name, (down, rotation)) in zip(panels, POSTURES.items(), strict=True):
    height = -mesh.points @ np.array(down)
    stepper = liver.stepper(dynamics="backward_euler", time_step=0.02, density=DENSITY, iterations=20)
    place = (1e-4 - height.min()) * np.array(down)
    table = stepper.tool(vs.HalfSpace(), position=place, rotation=rotation, friction=0.3)
    frames = [stepper.frame(gravity=G * np.array(down)) for _ in range(150)]
    frame = frames[-1]
    assert frame.is_settled
    assert sum(frame.is_settled for frame in frames) >= 148  # while it rolls, a frame may need more iterations
    told = frame.contact(table)
    carried, held = (force @ -np.array(down) for force in (told.force, frame.support_force(vessels)))
    lying = -(mesh.points + frame.displacement) @ np.array(down)
    print(
        f"{name}: {np.ptp(height) * 1e3:.0f} mm high at rest, {np.ptp(lying) * 1e3:.0f} mm under its weight,", end=" "
    )
    print(f"{carried:.2f} N on {1e4 * told.area:.0f} cm2 of the table, {held:.2f} N on the vessels")
    for points, level, color in ((mesh.points, height, "0.7"), (mesh.points + frame.displacement, lying, "tab:red")):
        axes.triplot(1e3 * points[:, 0], 1e3 * (level - lying.min()), mesh.surface, color=color, linewidth=0.4)
    axes.axhline(0.0, color="black")
    axes.set(title=name, xlabel="[mm]", aspect="equal")
    assert abs(carried + held - weight) < 1e-3 * weight
    assert told.gap > -1e-3 * mesh.diagonal
