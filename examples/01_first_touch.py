"""The first touch: a liver reduced once, then pressed with a fingertip at any point and in any direction.

Off-line, Viscera solves the power series of every contact on the left lobe. On-line, a touch is a polynomial: force,
stiffness and the whole deformed shape in microseconds, with an estimate of their error.
"""

import numpy as np

import viscera as vs

# A soft liver: a Young's modulus of a few kilopascals, as elastography measures it.
liver = vs.Organ(vs.organs.liver(), vs.NeoHookean(young=5e3, poisson=0.45), fixed="hilum")
touch = liver.reduce("tip", radius="12 mm", depth="15 mm", order=4)

point = liver.mesh.points[liver.mesh.nodes("tip")].mean(axis=0)
inward = np.array([-0.5, 0.4, -0.75])
answer = touch(point, 0.005 * inward / np.linalg.norm(inward))
print(answer)
print(f"estimated error {answer.error_estimate:.1%}, largest displacement {1e3 * answer.max_displacement:.1f} mm")

# The full model agrees. It took Newton's method seconds; the answer took microseconds.
full = liver.solve(displacement={touch.patch(answer.contact_point): 0.005 * inward / np.linalg.norm(inward)})
difference = np.linalg.norm(answer.displacement - full.displacement) / np.linalg.norm(full.displacement)
print(f"difference from the full solution {difference:.1%}")

figure = touch.plot(point, 0.005 * inward / np.linalg.norm(inward), title="5 mm into the left lobe")
assert answer.is_trusted
assert difference < 0.01
