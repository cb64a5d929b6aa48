"""Can the finger feel it? A stiff nodule under the surface of a liver, palpated point by point.

The same liver is reduced twice, once healthy and once with a nodule fifteen times as stiff, 20 mm across. Pressing both
in a row of places shows where the hand feels more resistance, and by how much.
"""

import numpy as np
from matplotlib.figure import Figure

import viscera as vs

YOUNG, DENT = 5e3, 0.003
mesh = vs.organs.liver()
tip = mesh.nodes("tip")
centre = mesh.points[tip].mean(axis=0) + np.array([-0.005, 0.008, -0.008])
nodule = mesh.cells_in(lambda x: np.linalg.norm(x - centre, axis=1) < 0.012)
mesh = mesh.with_cell_sets(nodule=nodule)

forces = {}
for name, young in (("healthy", YOUNG), ("with nodule", mesh.per_cell(YOUNG, {"nodule": 15 * YOUNG}))):
    liver = vs.Organ(mesh, vs.NeoHookean(young=young, poisson=0.45), fixed="hilum")
    touch = liver.reduce("tip", radius="8 mm", depth="5 mm", order=3)
    places = mesh.points[liver.touchable("tip")]
    normal = mesh.points.mean(axis=0) - places
    pushes = DENT * normal / np.linalg.norm(normal, axis=1, keepdims=True)
    answers = [(touch(x, d), d) for x, d in zip(places, pushes, strict=True)]
    forces[name] = np.array([answer.force @ d / DENT if answer.is_trusted else np.nan for answer, d in answers])

contrast = forces["with nodule"] / forces["healthy"] - 1
above = np.linalg.norm(places - centre, axis=1)
felt = np.isfinite(contrast)
contrast, above = contrast[felt], above[felt]
print(
    f"pressed by {1e3 * DENT:.0f} mm at {len(places)} places, {felt.sum()} answers trusted; {len(nodule)} stiff cells"
)
print(f"felt most {1e3 * above[contrast.argmax()]:.0f} mm from the nodule's centre: {contrast.max():+.0%} force")
print(f"farthest place, {1e3 * above.max():.0f} mm away: {contrast[above.argmax()]:+.0%}")

figure = Figure(figsize=(6.4, 4.4), layout="constrained")
axes = figure.subplots()
axes.scatter(1e3 * above, 100 * contrast, s=18, color="#0b4f6c")
axes.axhline(10, color="#a31f3a", lw=0.8, label="10 %, about what a fingertip can tell")
axes.set(xlabel="distance from the nodule's centre [mm]", ylabel="additional force [%]")
axes.legend(frameon=False)
assert contrast.max() > 0.1 > contrast[above.argmax()]
assert above[contrast.argmax()] < np.median(above)
