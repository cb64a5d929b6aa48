"""What the header of a NRRD file says of its space, and SimpleITK does not pass on: its unit, whether it says where it
lies in the patient, and the axes of its vectors. SimpleITK takes every unit for millimetres, every space that it does
not know for LPS, puts an image without an origin at that of the space, and turns positions into LPS, but no vectors.

NRRD format, version 5: `space`, `space units`, `space origin`, `space directions`, `measurement frame`
(teem.sourceforge.net/nrrd/format.html, section 5).
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from viscera.errors import VisceraError
from viscera.files.mesh import METRES
from viscera.mesh import Floats

PATIENT = {
    **dict.fromkeys(("left-posterior-superior", "lps"), (1.0, 1.0, 1.0)),
    **dict.fromkeys(("right-anterior-superior", "ras"), (-1.0, -1.0, 1.0)),
    **dict.fromkeys(("left-anterior-superior", "las"), (1.0, -1.0, 1.0)),
}
"""Spaces with the patient's axes, all of which SimpleITK turns into LPS, with the sign of each axis there."""
FRAME = "measurement frame"
"""The field with the directions, in the space, along which the components of vectors are measured."""
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


def turn_of_vectors(path: Path) -> Floats:
    """The matrix (3, 3) that takes the components of the vectors of a NRRD file into LPS: `v_LPS = S F v`.

    S has the signs of the axes of its space (`PATIENT`); the columns of F are the vectors of the measurement frame, by
    default the axes of the space. Raises `VisceraError` for a frame whose vectors are not independent.
    """
    fields, _ = header(path)
    signs = np.diag(PATIENT[fields["space"].lower()])
    if FRAME not in fields:
        return signs
    # SimpleITK has read three vectors of three numbers there.
    vectors = [[float(x) for x in one.split(",")] for one in re.findall(r"\(([^()]*)\)", fields[FRAME])]
    frame = np.array(vectors).T
    if not (np.isfinite(frame).all() and np.linalg.matrix_rank(frame) == 3):
        raise VisceraError(
            f"its header has `{FRAME}: {fields[FRAME][:80]}`; write three independent vectors there, "
            "`(1,0,0) (0,1,0) (0,0,1)` if its vectors are along the axes of its space"
        )
    return np.asarray(signs @ frame)


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
