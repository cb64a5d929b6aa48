"""Where is it now? A liver found again from the part of its surface that a camera sees, with a band of 95 %.

    scan -> mesh -> law            the organ as it was imaged
    gravity turned, table moved    what happens to it, which nobody measures
    points on its front            what the camera sees: noise of 1 mm, one point in twenty is not the liver's

The registration knows the mesh, a law and the points. It looks for a rigid motion and for forces on the surface and in
the volume under which the organ, in equilibrium, passes through the points, mostly of one cause: here, gravity. The
targets that are compared lie everywhere in the organ, most of them where no camera sees.
"""

import numpy as np

import viscera as vs

rng = np.random.default_rng(1)
mesh = vs.organs.liver()
truth = vs.Organ(mesh, vs.Ogden(mu=500.0, alpha=6.0, poisson=0.46), fixed="hilum")
organ = vs.Organ(mesh, vs.NeoHookean(young=3e3, poisson=0.45), fixed="hilum")

moved = mesh.points + truth.solve(gravity=(6.0, 0.0, 3.0), density=1060.0, throw=True).displacement
c, s = np.cos(0.3), np.sin(0.3)
moved = moved @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]).T + [0.03, -0.02, 0.05]

seen = mesh.surface[np.isin(mesh.surface, mesh.nodes("anterior")).all(axis=1)]
corners = moved[rng.choice(seen, size=4000)]
cloud = np.einsum("ka,kai->ki", rng.dirichlet(np.ones(3), size=4000), corners)
cloud += rng.normal(scale=1e-3, size=cloud.shape)
cloud[::20] += rng.uniform(-0.03, 0.03, size=cloud[::20].shape)

found = organ.register(cloud, noise=1e-3)
error = np.linalg.norm(mesh.points + found.displacement - moved, axis=1)

a, b = mesh.points - mesh.points.mean(axis=0), moved - moved.mean(axis=0)
u, _, vt = np.linalg.svd(b.T @ a)
best = a @ (u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt).T - b
print(f"{found.status}: {found.message}")
print(f"mean error {1e3 * error.mean():.1f} mm, at most {1e3 * error.max():.1f} mm")
print(f"the best rigid motion that there is leaves {1e3 * np.linalg.norm(best, axis=1).mean():.1f} mm on average")
inside = (error < found.band)[found.is_observed].mean()
print(f"{100 * inside:.0f} % of the nodes that are observed lie in their band of 95 %")

figure = found.plot()
assert error.mean() < 0.75 * np.linalg.norm(best, axis=1).mean()
assert inside > 0.9
