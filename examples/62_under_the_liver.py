"""Under the liver: a rod lifts the gallbladder, and the gallbladder lifts the liver.

The gallbladder, here an ellipsoid on a soft neck, hangs under its bed in the lower face of the liver. A rod along it, a
capsule, pushes it up. Rod, gallbladder and liver touch one after the other and slide with friction. What the rod gives
to the gallbladder, the liver and the neck take.
"""

import itertools

import numpy as np
from matplotlib.figure import Figure

import viscera as vs

LIFT, FRAMES = 0.02, 40
CENTER = np.array((-0.026, -0.035, -0.047))  # of the gallbladder [m]


def ellipsoid(half_axes: np.ndarray) -> vs.Mesh:
    """Around the origin, its half axes in the rows [m]: an octahedron, each triangle cut in four, three times."""
    triangles = np.array([np.diag(s)[:: round(np.prod(s))] for s in itertools.product((1.0, -1.0), repeat=3)])
    for _ in range(3):
        a, b, c = triangles.swapaxes(0, 1)
        ab, bc, ca = a + b, b + c, c + a
        parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        triangles = np.concatenate([np.stack(part, axis=1) for part in parts])
        triangles /= np.linalg.norm(triangles, axis=2, keepdims=True)
    points, numbers = np.unique(triangles.reshape(-1, 3).round(9), axis=0, return_inverse=True)
    return vs.mesh_surface((points @ half_axes, numbers.reshape(-1, 3)), edge="8 mm")


built_in = vs.organs.liver()
mesh = vs.mesh_surface((built_in.points, built_in.surface), edge="15 mm")
porta = built_in.points[built_in.nodes("hilum")].mean(axis=0)
mesh = vs.mesh(mesh.points, mesh.cells, {"hilum": np.linalg.norm(mesh.points - porta, axis=1) < 0.02})

along = np.array((0.2, 0.9, 0.4)) / np.linalg.norm((0.2, 0.9, 0.4))  # from the fundus to the neck, as the bed lies
across = np.cross(along, (0, 0, 1)) / np.linalg.norm(np.cross(along, (0, 0, 1)))
bladder = ellipsoid(np.array((0.033 * along, 0.013 * across, 0.013 * np.cross(along, across))))
points = bladder.points + CENTER
bladder = vs.mesh(points, bladder.cells, {"neck": bladder.points @ along > 0.024})

neck = vs.ElasticSupport("neck", stiffness=1e5)
pair = vs.ContactPair("liver", "gallbladder", friction=0.1)
organs = {
    "liver": vs.Organ(mesh, vs.NeoHookean(young=5e3, poisson=0.45), fixed="hilum"),
    "gallbladder": vs.Organ(bladder, vs.NeoHookean(young=10e3, poisson=0.45), supports=[neck]),
}
scene = vs.Scene(organs, contacts=[pair])
stepper = scene.stepper(iterations=40, settled=1e-5)
start = CENTER - 0.01 * along - 0.0205 * np.cross(across, along)
turn = -across * np.arccos(along[2])  # its axis, z, along the gallbladder
rod = stepper.tool(vs.Capsule("6 mm", "30 mm"), position=start, rotation=turn, friction=0.3)
rows, settled = [], []
for _ in range(FRAMES):
    rod.move((0, 0, LIFT / FRAMES))
    frame = stepper.frame()
    settled.append(frame.is_settled)
    rows.append((frame.force(rod), frame.force(pair), frame.support_force(neck)))
pushed, on_liver, held = np.array(rows).transpose(1, 0, 2)
rise = 1e3 * frame["liver"].displacement[:, 2].max()
print(f"the rod rises by {1e3 * LIFT:.0f} mm and pushes with {1e3 * pushed[-1, 2]:.0f} mN: the liver takes", end=" ")
print(f"{1e3 * on_liver[-1, 2]:.0f} mN and rises by up to {rise:.1f} mm, the neck takes {-1e3 * held[-1, 2]:.0f} mN")

figure = Figure(figsize=(6.4, 2.8), layout="constrained")
side, axes = figure.subplots(1, 2)
for name, color in (("liver", "tab:red"), ("gallbladder", "tab:green")):
    mesh, moved = scene.organ(name).mesh, frame[name].displacement
    for x, paint in ((mesh.points, "0.8"), (mesh.points + moved, color)):
        side.triplot(1e3 * x[:, 1], 1e3 * x[:, 2], mesh.surface, color=paint, linewidth=0.3)
side.set(xlabel="to the back [mm]", ylabel="to the head [mm]", aspect="equal")
lift = 1e3 * LIFT / FRAMES * np.arange(1, FRAMES + 1)
for name, forces in (("rod", pushed), ("liver", on_liver), ("neck", -held)):
    axes.plot(lift, 1e3 * forces[:, 2], label=name)
axes.set(xlabel="lift of the rod [mm]", ylabel="force upwards [mN]")
axes.legend()
assert sum(settled) >= FRAMES - 2  # a frame in which the gallbladder slips may need more iterations
assert np.linalg.norm(pushed - on_liver + held, axis=1)[settled].max() < 1e-4 * pushed[-1, 2]
assert settled[-1]
assert rise > 5.0
