"""What the header of a MetaImage says of its place, and SimpleITK does not pass on: its unit, and whether it says where
it lies. SimpleITK takes every unit for millimetres, and puts an image that does not say where it lies at the origin.

MetaIO (itk.org/Wiki/ITK/MetaIO/Documentation). Later names of a field are what it was called in older files.
"""

from __future__ import annotations

import re
import shutil
from pathlib import Path

from viscera.errors import VisceraError
from viscera.files.mesh import METRES

PLACE = {
    ("Offset", "Position", "Origin", "ImagePosition"): (3, "the centre of its first voxel in LPS"),
    ("TransformMatrix", "Rotation", "Orientation"): (9, "the directions of its axes in LPS"),
    ("ElementSpacing", "ElementSize"): (3, "the distances of its voxels"),
}
"""The names of each field that says where an image lies, with the count of its numbers and what they are."""
DATA = "ElementDataFile"
"""The last field of a header, after which the voxels may follow."""
SIZES = ("NDims", "DimSize")
"""Fields that say how many numbers others have."""
COMPRESSED = "CompressedDataSize"
"""Bytes of the compressed voxels, without which MetaIO takes the header for a part of them."""
UNIT = "DistanceUnits"
UNSAID = ("", "?")
"""Units that say nothing: millimetres."""


def unit_of_space(path: Path) -> float:
    """Metres per unit of the positions in a MetaImage.

    Raises `VisceraError` for a file that does not say where it lies, and for a unit that is unknown.
    """
    fields, _ = header(path)
    for names, (count, means) in PLACE.items():
        if not any(len(fields.get(name, "").split()) == count for name in names):
            raise VisceraError(
                f"its header does not say where the image lies; write `{names[0]} = ` there with {count} numbers, "
                f"{means}, or give its values and axes to vs.Scan"
            )
    unit = fields.get(UNIT, "")
    if unit in UNSAID:
        return METRES["mm"]
    if unit not in METRES:
        raise VisceraError(f"its header has `{UNIT} = {unit}`; write one of {', '.join(METRES)} there")
    return METRES[unit]


def header(path: Path) -> tuple[dict[str, str], int]:
    """The fields by name, up to that of the data, and the bytes that they take.

    Raises `VisceraError` for a size that is there twice: MetaIO would make room for the one and fill in the other.
    """
    fields: dict[str, str] = {}
    with path.open("rb") as file:
        for line in file:
            name, *value = map(str.strip, re.split("[=:]", line.decode("utf-8", "replace"), maxsplit=1))
            if name in SIZES and name in fields:
                raise VisceraError(f"its header has two lines `{name}`; leave one")
            fields[name] = "".join(value)
            if name == DATA:
                break
        return fields, file.tell()


def write_with_size(path: Path, copy: Path) -> None:
    """Copies a file whose voxels are compressed and follow its header, which then says how many bytes they take."""
    _, start = header(path)
    with path.open("rb") as file, copy.open("wb") as written:
        *lines, data = file.read(start).splitlines(keepends=True)
        kept = [line for line in lines if not re.match(rb"\s*%b\s*[=:]" % COMPRESSED.encode(), line)]
        size = f"{COMPRESSED} = {path.stat().st_size - start}\n"
        written.writelines([*kept, size.encode(), data])
        shutil.copyfileobj(file, written)
