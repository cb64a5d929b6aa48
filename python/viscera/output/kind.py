"""What a file is, by the ending of its name: said before a reader of something else fails over what it holds."""

from __future__ import annotations

import os
from pathlib import Path

from viscera.errors import VisceraError, refuse_case_file
from viscera.files.atomic import Name, writable
from viscera.files.mesh import FORMATS
from viscera.output import state as statefile
from viscera.quantity import path_of
from viscera.scans import image as imagefile

CASE, MODEL, MESH, SURFACE, IMAGE = "a case file", "a model", "a mesh", "a surface", "an image"
KINDS = {
    ".toml": CASE,
    ".viscera": MODEL,
    **dict.fromkeys(statefile.SURFACES, SURFACE),
    **dict.fromkeys((*FORMATS, *statefile.VOLUMES), MESH),
    **dict.fromkeys(imagefile.FORMATS, IMAGE),
}
TAKERS = {
    MODEL: "`viscera check`, `touch` and `view` take models",
    MESH: "`viscera inspect` and `reduce` take meshes, and a case file names one",
    SURFACE: "`viscera mesh` makes a mesh inside a surface",
    IMAGE: "`viscera mesh` makes a mesh of a label map",
}
"""What to do with a file that came to the wrong place."""
MISSING: dict[tuple[str, ...], str] = {(CASE,): "case file", (MODEL,): "model file"}


def kind_of(path: Name) -> str:
    """One of the kinds, or nothing for an ending that belongs to none.

    >>> kind_of("liver.viscera"), kind_of("labels.nii.gz"), kind_of("liver")
    ('a model', 'an image', '')
    """
    name = os.fspath(path).lower()
    return next((kind for ending, kind in KINDS.items() if name.endswith(ending)), "")


def require(path: Name, *wanted: str, advice: str = "") -> None:
    """Raises `VisceraError` for a folder, for what does not exist, and for a file of another kind than those wanted.

    A file whose ending belongs to no kind is left to its reader.
    """
    source = path_of(path, "the file to read")
    told, kind = " or ".join(wanted), kind_of(source)
    if source.is_dir():
        raise VisceraError(f"{source}: is a folder, not {told}")
    if not source.exists() and source.name.startswith("organ:"):
        raise VisceraError(
            f"{source}: a built-in organ is a mesh, not {told}; `viscera inspect` and `reduce` take it, and a case "
            f'file names it: mesh = "{source}"'
        )
    if not source.exists():
        raise VisceraError(f"{source}: no such {MISSING.get(wanted, 'file')}")
    if not kind or kind in wanted:
        return
    if kind == CASE and not advice:
        refuse_case_file(source, told)
    raise VisceraError(f"{source}: is {kind}, not {told}; {advice or TAKERS[kind]}")


def check_picture(path: Name | None) -> None:
    """Raises `VisceraError` if a picture cannot be written there, or has another ending than PNG's. None is none.

    A name without an ending is taken: it may be that of a device.

    >>> check_picture("liver.pdf")
    Traceback (most recent call last):
    viscera.errors.VisceraError: liver.pdf: a picture is written as PNG; end its name in .png, not in .pdf
    """
    if path is None:
        return
    ending = path_of(path, "the file to write").suffix
    if ending.lower() not in {"", ".png"}:
        raise VisceraError(f"{os.fspath(path)}: a picture is written as PNG; end its name in .png, not in {ending}")
    writable(path)


def model_path(path: Name) -> Path:
    """The path for a model to be written. It is an error if its ending says that it is something else."""
    target = writable(path)
    if (other := kind_of(target)) not in {"", MODEL}:
        raise VisceraError(f"{target}: that is the name of {other}, and a model is written; end it in .viscera")
    return target
