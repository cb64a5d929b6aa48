"""Built-in organs, so that a first touch needs no file: a liver, a branching artery, a beam.

Shapes of our own, made by `organs/generate.py` in the source repository; axes: x to the patient's left, y to the
back, z to the head.
"""

from __future__ import annotations

from pathlib import Path

from viscera.mesh import Mesh, read

__all__ = ["artery", "beam", "liver"]

FOLDER = Path(__file__).parent


def liver() -> Mesh:
    """An adult human liver of 1.5 litres, 0.22 x 0.14 x 0.15 m: 2,613 points, 11,714 cells.

    Sets: `hilum`, where it is held (the porta hepatis and the bare area at the back); `anterior`, the face that a
    surgeon touches; `tip`, the end of the left lobe.

    >>> import viscera as vs
    >>> sorted(vs.organs.liver().sets)
    ['anterior', 'hilum', 'tip']
    """
    return read(FOLDER / "liver.vtu")


def artery() -> Mesh:
    """A bent vessel with a branch, 40 mm high, 7 mm wide, its wall 1 mm and one cell thick: 402 points, 1,104 cells.

    After the artery of paper B (401 points, 1,101 cells). Sets: the rings `bottom` (z = 0), `middle` (z = 20 mm) and
    `top` (z = 40 mm), `branch`, the free end of the side branch, and `lumen`, the surface that the blood wets.

    >>> import viscera as vs
    >>> sorted(vs.organs.artery().sets)
    ['bottom', 'branch', 'lumen', 'middle', 'top']
    """
    return read(FOLDER / "artery.vtu")


def beam() -> Mesh:
    """A beam of 1 x 0.2 x 0.2 m along x: 525 points, 1,920 cells. Sets: `clamp` (x = 0), `tip` (x = 1 m), `top`.

    >>> import viscera as vs
    >>> sorted(vs.organs.beam().sets)
    ['clamp', 'tip', 'top']
    """
    return read(FOLDER / "beam.vtu")
