"""Ticks of two hands in C, on the built-in liver with linear cells and with the element that does not lock:

python benchmarks/c_hands.py > benchmarks/results/c_hands.txt

The program is bindings/c/examples/hands.c: three seconds at 1 kHz with 24 snapshots at most, while another
thread assesses answers. The times are of the loop's own processor time.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from machine import describe

import viscera as vs

ROOT = Path(__file__).resolve().parent.parent
BUILT = ROOT / "target" / "c"
SOURCES = ROOT / "bindings" / "c"


def program(folder: Path) -> Path:
    """The example, compiled as a user would."""
    path = folder / "hands"
    flags = [f"-I{SOURCES / 'include'}", f"-L{BUILT}", "-lviscera_hands", f"-Wl,-rpath,{BUILT}", "-lpthread", "-lm"]
    subprocess.run(["cc", "-O2", str(SOURCES / "examples" / "hands.c"), *flags, "-o", str(path)], check=True)
    return path


def model(element: str, folder: Path) -> Path:
    """The built-in liver, reduced on the middle of its anterior face."""
    organ = vs.Organ(vs.organs.liver(), vs.NeoHookean(young=0.17e6, poisson=0.48), fixed="hilum", element=element)
    path = folder / f"{element}.viscera"
    organ.reduce("anterior", order=3).save(path)
    return path


def main() -> None:
    """Print a table for each element."""
    print(describe())
    with tempfile.TemporaryDirectory() as scratch:
        hands = program(Path(scratch))
        for element in sys.argv[1:] or ["P1", "P1 mean volume"]:
            done = subprocess.run([hands, model(element, Path(scratch))], capture_output=True, text=True, check=True)
            print(f"\nthe built-in liver, {element}")
            print("\n".join(done.stdout.splitlines()[-2:]))


if __name__ == "__main__":
    main()
