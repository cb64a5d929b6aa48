"""From the table to the side: a liver scanned lying on the back, predicted lying on the left side.

    scan, on the back        unloaded            on the left side
    gravity +y (backwards)   no gravity          gravity +x (to the patient's left)
    the mesh that we have -> found by search --> what the surgeon will meet

Gravity has already deformed the scanned mesh. Taking it as free of stress, and applying gravity in the other direction,
would ignore the weight that acted during the scan.
"""

import numpy as np

import viscera as vs
from viscera.output.picture import draw

BACK, LEFT = np.array([0.0, 9.81, 0.0]), np.array([9.81, 0.0, 0.0])  # m/s^2, in the patient's axes
DENSITY = 1060.0

scan = vs.Organ(vs.organs.liver(), vs.NeoHookean(young=20e3, poisson=0.45), fixed="hilum")

rest = scan.unloaded(gravity=BACK, density=DENSITY, throw=True)
turned = rest.organ.solve(gravity=LEFT, density=DENSITY, start=rest.state, throw=True)
moved = rest.from_scan(turned).displacement
print(f"found in {len(rest.errors)} iterations; under its weight again it is {rest.error:.0e} diagonals from the scan")
print(f"its weight moves it by up to {1e3 * rest.state.max_displacement:.1f} mm")
print(f"from the back to the left side it moves by up to {1e3 * np.linalg.norm(moved, axis=1).max():.1f} mm\n")

shortcuts = {
    "the scan taken as unloaded": scan.solve(gravity=LEFT, density=DENSITY, throw=True),
    "only the change of gravity": scan.solve(gravity=LEFT - BACK, density=DENSITY, throw=True),
}
errors = {}
for name, state in shortcuts.items():
    wrong = np.linalg.norm(state.displacement - moved, axis=1)
    errors[name] = wrong.max()
    print(f"{name}: wrong by up to {1e3 * wrong.max():.1f} mm, {1e3 * wrong.mean():.1f} mm on average")

figure = draw(scan.mesh.points, scan.mesh.surface, moved, title="from the back to the left side")
assert rest.error < 1e-9
assert errors["only the change of gravity"] > 1e-3  # a millimetre matters to navigation
