"""Two fingers at once: what they do together is not the sum of what each does alone.

One finger presses the beam from above, the other lifts it next to the first. Adding the two single answers moves each
finger's place by what the other does. The Galerkin model of both contacts holds both places where the hands are.
"""

import numpy as np

import viscera as vs
from viscera.output.picture import draw_side_by_side

mesh = vs.organs.beam()
beam = vs.Organ(mesh, vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp", element="P1")
touch = beam.reduce("top", depth=0.06, order=3)
fingers = touch.galerkin(snapshots=60)

top = mesh.points[mesh.sets["top"]]
left, right = top[np.abs(top - (0.45, 0.1, 0.2)).sum(1).argmin()], top[np.abs(top - (0.8, 0.1, 0.2)).sum(1).argmin()]
push, pull = np.array([0.0, 0.0, -0.025]), np.array([0.0, 0.0, 0.025])

held = fingers.solve([(left, push), (right, pull)])
full = beam.solve(displacement={touch.patch(left): push, touch.patch(right): pull}, throw=True)
summed = touch(left, push).displacement + touch(right, pull).displacement


def error(displacement: np.ndarray) -> float:
    """Relative to the full solution."""
    return float(np.linalg.norm(displacement - full.displacement) / np.linalg.norm(full.displacement))


print(f"forces {np.round(held.force[:, 2], 2).tolist()} N, trusted: {held.is_trusted}")
print(f"off the full solution: two fingers together {error(held.displacement):.1%}, answers summed {error(summed):.0%}")

shapes = {"together": held.displacement, "single answers summed": summed, "full solution": full.displacement}
figure = draw_side_by_side(mesh.points, mesh.surface, shapes)
assert error(held.displacement) < 0.01 < 0.1 < error(summed)
