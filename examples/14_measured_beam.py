"""Validation: a silicone beam that others measured. One number is fitted to its weight; the hanging load is predicted.

A block of Dragon Skin 10, 30 x 30 x 100 mm, sags under its own weight, then under 0.51 N more at its free end. Motion
capture followed three markers, twice each (Dubied, Michelis, Spielberg and Katzschmann, IEEE Robotics and Automation
Letters 7 (2022) 5014). Young's modulus is fitted to the weight alone. With it the load is a prediction, to be held
against what was measured; the experiment tells about a millimetre. `viscera study measured-beam` has meshes, elements
and the free swing.
"""

import numpy as np
from matplotlib.figure import Figure

from viscera.study.measured_beam import LOAD, MARKERS, RESOLUTION, fitted_modulus, hanging, markers, measured, organ_of

runs = measured()
weight, loaded = ([runs[f"{kind} {letter}"].displacement for letter in "ab"] for kind in ("gravity", "load"))

young = fitted_modulus([runs["gravity a"], runs["gravity b"]], element="P2", across=2)
beam = organ_of(young, element="P2", across=2)
predicted = {0.0: markers(beam, hanging(beam)), LOAD: markers(beam, hanging(beam, LOAD))}  # (3, 3) [mm] each
print(f"E = {1e-3 * young:.0f} kPa from the weight; the authors' own fit is 263.8 kPa")

print("marker, upwards [mm]   run a    run b   predicted under 0.51 N")
for k, name in enumerate(MARKERS):
    print(f"{name:18s}{loaded[0][k, 2]:10.2f}{loaded[1][k, 2]:9.2f}{predicted[LOAD][k, 2]:9.2f}")

figure = Figure(figsize=(6.4, 4.4), layout="constrained")
axes = figure.subplots()
places = np.arange(len(MARKERS))
for shift, run, letter in ((-0.06, 0, "a"), (0.06, 1, "b")):
    for both, colour in ((weight, "#7a8793"), (loaded, "#0b4f6c")):
        label = f"measured, run {letter}" if both is loaded else None
        axes.plot(places + shift, both[run][:, 2], "os"[run], color=colour, mfc="none", label=label)
axes.plot(places, predicted[0.0][:, 2], "_", ms=40, color="#7a8793", label="under its weight, fitted")
axes.plot(places, predicted[LOAD][:, 2], "_", ms=40, color="#a31f3a", label="with 0.51 N more, predicted")
axes.set(
    xticks=places, xticklabels=list(MARKERS), xlim=(-0.5, 2.5), ylim=(-20, 0), ylabel="marker moves upwards by [mm]"
)
axes.legend(frameon=False, fontsize=8, ncols=2, markerscale=0.4)
error = predicted[LOAD][:, 2] - np.mean(loaded, axis=0)[:, 2]
print(f"errors {np.round(error, 2).tolist()} mm of {abs(np.mean(loaded, axis=0)[:, 2]).max():.0f} mm")
assert np.abs(error).max() < RESOLUTION
