"""What the header of a NRRD file says of its space, and SimpleITK does not pass on: its unit, and whether it has
the patient's axes. SimpleITK takes every unit for millimetres, and every space that it does not know for LPS.

NRRD format, version 5: `space`, `space units` (teem.sourceforge.net/nrrd/format.html, section 5).
"""

from __future__ import annotations

import re
from pathlib import Path

from viscera.errors import VisceraError
from viscera.files.mesh import METRES

PATIENT = ("left-posterior-superior", "right-anterior-superior", "left-anterior-superior", "lps", "ras", "las")
"""Spaces with the patient's axes, all of which SimpleITK turns into LPS."""
UNSAID = ("", "???")
"""Units that say nothing: millimetres, as all tools of medical images take them."""


def unit_of_space(path: Path) -> float:
    """Metres per unit of the space of a NRRD file.

    Raises `VisceraError` for a unit that is unknown or not the same along all axes, and for a space without the
    patient's axes.
    """
    header = _header(path)
    space = header.get("space", "")
    if space.lower() not in PATIENT:
        said = f"the space {space!r}, which is not that of a patient" if space else "no space"
        raise VisceraError(
            f"its header states {said}; write `space: left-posterior-superior` there if x points left, y back and z "
            "to the head (or `right-anterior-superior`), or give its values and axes to vs.Scan"
        )
    units = [unit for unit in re.findall(r'"([^"]*)"', header.get("space units", "")) if unit not in UNSAID]
    if not units:
        return METRES["mm"]
    if len(set(units)) > 1 or units[0] not in METRES:
        raise VisceraError(
            f"its header has `space units: {header['space units']}`; write one of {', '.join(METRES)} there, the same "
            "for each axis"
        )
    return METRES[units[0]]


def _header(path: Path) -> dict[str, str]:
    """The fields by name: the lines up to the first empty one, without comments and the keys of other programs."""
    fields = {}
    with path.open("rb") as file:
        for line in file:
            text = line.decode("utf-8", "replace").strip()
            if not text:
                break
            name, colon, value = text.partition(": ")
            if colon and not text.startswith("#"):
                fields[name.lower()] = value.strip()
    return fields
