"""What the header of a NRRD file says of its space, and SimpleITK does not pass on: its unit, and whether it says where
it lies in the patient. SimpleITK takes every unit for millimetres, every space that it does not know for LPS, and puts
an image without an origin at that of the space.

NRRD format, version 5: `space`, `space units`, `space origin`, `space directions`
(teem.sourceforge.net/nrrd/format.html, section 5).
"""

from __future__ import annotations

import re
from pathlib import Path

from viscera.errors import VisceraError
from viscera.files.mesh import METRES

PATIENT = ("left-posterior-superior", "right-anterior-superior", "left-anterior-superior", "lps", "ras", "las")
"""Spaces with the patient's axes, all of which SimpleITK turns into LPS."""
PLACE = {
    "space origin": ("(x,y,z)", "the centre of its first voxel"),
    "space directions": ("(x,y,z) (x,y,z) (x,y,z)", "the steps between its voxels"),
}
"""The fields that say where an image lies, with their form and what they are."""
DATA = ("data file", "datafile")
"""Names of the field that says which files hold the voxels, if not this one."""
UNSAID = ("", "???")
"""Units that say nothing: millimetres, as all tools of medical images take them."""


def unit_of_space(path: Path) -> float:
    """Metres per unit of the space of a NRRD file.

    Raises `VisceraError` for a unit that is unknown or not the same along all axes, for a space without the patient's
    axes, and for an image that does not say where it lies in it.
    """
    fields, _ = header(path)
    space = fields.get("space", "")
    if space.lower() not in PATIENT:
        said = f"the space {space!r}, which is not that of a patient" if space else "no space"
        raise VisceraError(
            f"its header states {said}; write `space: left-posterior-superior` there if x points left, y back and z "
            "to the head (or `right-anterior-superior`), or give its values and axes to vs.Scan"
        )
    for name, (form, means) in PLACE.items():
        if "(" not in fields.get(name, ""):
            raise VisceraError(
                f"its header does not say where the image lies; write `{name}: {form}` there, {means}, or give its "
                "values and axes to vs.Scan"
            )
    units = [unit for unit in re.findall(r'"([^"]*)"', fields.get("space units", "")) if unit not in UNSAID]
    if not units:
        return METRES["mm"]
    if len(set(units)) > 1 or units[0] not in METRES:
        raise VisceraError(
            f"its header has `space units: {fields['space units']}`; write one of {', '.join(METRES)} there, the same "
            "for each axis"
        )
    return METRES[units[0]]


def header(path: Path) -> tuple[dict[str, str], int]:
    """The fields by name, and the bytes that they take: the lines up to the first empty one or that of a list of files,
    without comments and the keys of other programs."""
    fields = {}
    with path.open("rb") as file:
        for line in file:
            text = line.decode("utf-8", "replace").strip()
            if not text:
                break
            name, colon, value = text.partition(": ")
            if colon and not text.startswith("#"):
                fields[name.lower()] = value.strip()
                if name.lower() in DATA and value.startswith("LIST"):
                    break
        return fields, file.tell()
