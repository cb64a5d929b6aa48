"""A law from a measurement: four laws fitted to one compression test, and which of them to take.

The file is a compression test of a silicone tissue phantom (its source is in docs/measured-laws.md). Each fit reports
its standard error, Akaike's criterion and whether the law is stable over the fitted range.
"""

from pathlib import Path

import numpy as np

import viscera as vs

FILE = Path(__file__).parent / "silicone_compression.csv"
displacement, force = np.loadtxt(FILE, delimiter=",", skiprows=1, unpack=True)  # mm and N, positive in compression
HEIGHT, AREA = 0.030, np.pi * 0.025**2  # m, m^2
test = vs.MaterialTest("uniaxial", 1 - 1e-3 * displacement / HEIGHT, -force / AREA, "silicone")

fits = {
    "neo-Hookean": vs.fit(vs.NeoHookean, test),
    "Yeoh, 2 terms": vs.fit(vs.Yeoh, test, terms=2),
    "Yeoh, 3 terms": vs.fit(vs.Yeoh, test, terms=3),
    "Ogden, 1 term": vs.fit(vs.Ogden, test, terms=1),
}
print("law              standard error      AIC  stable")
for name, fit in fits.items():
    print(f"{name:15s} {fit.standard_error:11.0f} Pa {fit.aic:8.0f}  {fit.is_stable}")
best = min((name for name, fit in fits.items() if fit.is_stable), key=lambda name: fits[name].aic)
print(f"take {best}")

figure = fits[best].plot()
assert fits["Yeoh, 3 terms"].standard_error < fits["neo-Hookean"].standard_error
assert np.isfinite(fits[best].aic)
