"""A vessel clamped shut: forceps press a soft tube flat, until its walls lie on each other.

The upper and the lower half of the lumen are two places of one organ, and a contact pair lets them touch. The tube
gives way softly while it is open. Once it is shut, the forceps press both walls on each other, and their force rises
steeply. Without the pair the walls would pass through each other, and the forceps would feel nothing of that.
"""

import itertools

import numpy as np
from matplotlib.figure import Figure

import viscera as vs

RADIUS, WALL, LENGTH = 0.004, 0.001, 0.03
ROUND, ALONG, THROUGH = 24, 12, 2
STEP, FRAMES = 0.00025, 34


def tube() -> vs.Mesh:
    """Along y. The nodes of the lumen above and below its middle are sets; those at half height are in neither."""
    i, j, k = np.meshgrid(range(THROUGH + 1), range(ROUND), range(ALONG + 1), indexing="ij")
    radius, angle = RADIUS + WALL * i / THROUGH, 2 * np.pi * j / ROUND
    points = np.stack([radius * np.cos(angle), LENGTH * k / ALONG, radius * np.sin(angle)], axis=-1)
    number = np.arange(i.size).reshape(i.shape)
    cells = []
    for order in itertools.permutations(np.eye(3, dtype=int)):
        corners = np.cumsum([np.zeros(3, dtype=int), *order], axis=0)
        ways = [np.roll(number, -corner[1], axis=1) for corner in corners]
        inner = [w[c[0] : THROUGH + c[0], :, c[2] : ALONG + c[2]].ravel() for w, c in zip(ways, corners, strict=True)]
        cells.append(np.stack(inner, axis=1))
    height = np.sin(angle).round(9)
    sets = {"upper": (i == 0) & (height > 0), "lower": (i == 0) & (height < 0), "ends": (k == 0) | (k == ALONG)}
    return vs.mesh(points.reshape(-1, 3), np.vstack(cells), {name: number[where] for name, where in sets.items()})


vessel = vs.Organ(tube(), vs.NeoHookean(young=2e5, poisson=0.45), fixed="ends")
pair = vs.ContactPair(("vessel", "upper"), ("vessel", "lower"))
openings = 2 * (RADIUS + WALL) - STEP * np.arange(1, FRAMES + 1)


def clamp(contacts: list[vs.ContactPair]) -> tuple[list[float], vs.Frame]:
    """The grip [N] at every opening, and the last frame."""
    stepper = vs.Scene({"vessel": vessel}, contacts=contacts).stepper(iterations=40)
    jaw = vs.Box(("3 mm", "6 mm", "14 mm"), rounding="1 mm")
    forceps = stepper.forceps(jaw, (0, LENGTH / 2, 0), (0, np.pi / 2, 0), opening=2 * (RADIUS + WALL))
    grips = []
    for _ in range(FRAMES):
        forceps.close(STEP)
        frame = stepper.frame()
        assert frame.is_settled
        grips.append(forceps.grip)
    return grips, frame


shut, frame = clamp([pair])
through, _ = clamp([])
told = frame.contact(pair)
print(f"{1e3 * openings[-1]:.1f} mm open, the forceps press with {shut[-1]:.1f} N, else with {through[-1]:.1f} N")
print(f"the walls press on each other with {told.force[2]:.1f} N; their depth is {-1e6 * told.gap:.0f} um")

figure = Figure(figsize=(6.4, 2.8), layout="constrained")
side, axes = figure.subplots(1, 2)
middle = np.flatnonzero(vessel.mesh.points[:, 1] == LENGTH / 2).reshape(THROUGH + 1, ROUND)
for x, color in ((vessel.mesh.points, "0.7"), (vessel.mesh.points + frame.displacement, "tab:red")):
    for ring in middle[[0, -1]]:
        side.plot(*1e3 * x[np.append(ring, ring[0])][:, ::2].T, color=color)
side.set(xlabel="across [mm]", ylabel="height [mm]", aspect="equal", title="section in the middle")
axes.plot(1e3 * openings, shut, label="walls touch")
axes.plot(1e3 * openings, through, "--", label="no contact pair")
axes.set(xlabel="opening of the forceps [mm]", ylabel="grip [N]")
axes.invert_xaxis()
axes.legend()
assert told.force[2] > 5.0
assert shut[-1] > 2 * through[-1]
assert shut[:20] == through[:20]  # what does not touch is not felt
assert told.gap > -1e-3 * vessel.mesh.diagonal
