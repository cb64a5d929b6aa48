"""A haptic loop in C: a hand presses the liver a thousand times a second, and the loop allocates no memory.

A device needs a force every millisecond, from a program without Python. The model is saved once; `haptic.c`, in
`bindings/c/examples`, loads it, answers 3,000 ticks of a moving hand, guards the force and draws the surface now and
then. This script compiles it against the C library (`make c-library` builds that), runs it, and compares its answers
with those of Python.
"""

import re
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import viscera as vs

ROOT = Path(__file__).resolve().parents[1]
LIBRARY = ROOT / "target" / "c"
if shutil.which("cc") is None or not (LIBRARY / "libviscera.a").is_file():
    raise SystemExit("this example needs a C compiler and the C library; `make c-library` builds it")

liver = vs.Organ(vs.organs.liver(), vs.NeoHookean(young=4.1e3, poisson=0.45), fixed="hilum")
touch = liver.reduce("anterior and within 2 cm of (0, -50, 40) mm", depth="40 mm", order=3)

with tempfile.TemporaryDirectory() as folder:
    model, program = Path(folder) / "liver.viscera", Path(folder) / "haptic"
    touch.save(model)
    private = (LIBRARY / "viscera.pc").read_text().split("Libs.private:")[1].split()  # what a static link needs
    source, header = ROOT / "bindings/c/examples/haptic.c", f"-I{ROOT / 'bindings/c/include'}"
    subprocess.run(["cc", "-O2", header, source, LIBRARY / "libviscera.a", *private, "-lm", "-o", program], check=True)
    printed = subprocess.run([program, model], check=True, capture_output=True, text=True).stdout
print(printed)

# The hand of haptic.c: a quarter of the depth in and out once a second, with a small circle across.
above = np.array([0.4, 0.1, 10.0])
contact = touch.locate(above)
inward = (contact - above) / np.linalg.norm(contact - above)


def felt(seconds: float) -> np.ndarray:
    """The force on the hand [N], by Python."""
    turn = 2 * np.pi * seconds
    circle = 0.02 * touch.depth * np.array([np.sin(turn), np.cos(turn) - 1, 0.0])
    return -touch(contact, 0.125 * touch.depth * (1 - np.cos(turn)) * inward + circle).force


rows = re.findall(r"([\d.]+) s: the hand feels \(\s*(\S+),\s*(\S+),\s*(\S+)\) N", printed)
times, forces = np.array(rows, dtype=float)[:, 0], np.array(rows, dtype=float)[:, 1:]
difference = np.abs(forces - [felt(t) for t in times]).max()
print(f"C and Python differ by {1e3 * difference:.2f} mN of {np.abs(forces).max():.2f} N, printed to 0.1 mN")

figure = Figure(figsize=(6.4, 4.4), layout="constrained")
axes = figure.subplots()
fine = np.linspace(0.0, times[-1], 200)
for k, (axis, colour) in enumerate(zip("xyz", ("#7a8793", "#a31f3a", "#0b4f6c"), strict=True)):
    axes.plot(fine, [felt(t)[k] for t in fine], color=colour, label=f"{axis}, Python")
    axes.plot(times, forces[:, k], "o", color=colour, label=f"{axis}, C")
axes.set(xlabel="time [s]", ylabel="force on the hand [N]")
figure.legend(loc="outside upper center", frameon=False, ncols=6, fontsize=8)
assert len(times) == 12
assert difference < 1e-4
