"""The page as a folder for any web server, or as one file that opens from a disk; Viscera need not be installed."""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from viscera.cases.case import Case
from viscera.cases.scene_case import SceneCase
from viscera.errors import VisceraError
from viscera.files.atomic import making, replacing
from viscera.progress import shown
from viscera.quantity import path_of
from viscera.reduced.touch import Touch
from viscera.viewer import page
from viscera.viewer.hybrid import page_of
from viscera.viewer.live import PAGE_UNKNOWNS, live_case, require_for_a_page
from viscera.viewer.web import WebModel, web_model


@dataclass(frozen=True)
class Exported:
    """The result of exporting a model."""

    folder: Path
    """The folder, or the one file, that was written."""
    files: list[str]
    """Files in the folder; none if it is one file."""
    model: WebModel


@dataclass(frozen=True)
class ExportedCase:
    """The result of exporting a case, which the page steps itself."""

    folder: Path
    files: list[str]
    bytes: int
    """Size of the case and of the code that steps it."""


@shown
def export(touch: Touch, folder: str | os.PathLike[str], name: str = "Organ") -> Exported:
    """Write the page and the web version of a model (below 25 MB) into a folder, which is created where needed.

    A name that ends in `.html` or `.htm` is one file with all of it, which opens from a disk. A folder also holds what
    steps the organ until the model has arrived, where the model is the larger of the two (`page_of`).
    """
    target = _target(folder)
    page.files()  # before the work on the model
    model = web_model(touch, name)
    files = page_of(touch, model.data, name, is_hybrid=False if is_single(target) else None)
    return Exported(target, _write(target, files, page.MODEL), model)


def export_case(case: Case | SceneCase, folder: str | os.PathLike[str], name: str = "Organ") -> ExportedCase:
    """Write the page and a case that it steps in real time, likewise.

    Raises `VisceraError` if the case is too large, or is a scene or has elastic supports, which no page can step.
    """
    require_for_a_page(case)
    target, files = _target(folder), page.stepping_files()
    live = live_case(case, name)
    if not live.fits_a_page:
        raise VisceraError(
            f"this organ has {live.unknowns} degrees of freedom, and a page steps up to {PAGE_UNKNOWNS} in real time; "
            "reduce it first, then export the model"
        )
    written = {**files, page.CASE: live.data}
    stepping = sum(len(written[file]) for file in (page.CASE, *page.STEPPER))
    return ExportedCase(target, _write(target, written, page.CASE), stepping)


def _target(name: str | os.PathLike[str]) -> Path:
    target = path_of(name, "the page")
    if is_single(target) and target.is_dir():
        raise VisceraError(f"{target} is a folder; name a file for the page, or a folder that does not end in .html")
    if not is_single(target) and target.exists() and not target.is_dir():
        raise VisceraError(f"{target} is a file; name a folder for the page, or a file that ends in .html")
    if target.is_dir():
        _require_own(target)
    return target


def _require_own(folder: Path) -> None:
    """Raise `VisceraError` where a page in the folder would replace files that are not of an earlier export."""
    start = folder / page.START
    if start.is_file() and page.is_own(start.read_bytes()):
        return
    if others := sorted(name for name in page.names() if (folder / name).exists()):
        raise VisceraError(
            f"{folder} holds {', '.join(others)}, which no earlier export wrote and the page would replace; "
            "name another folder, or move them away"
        )


def is_single(target: str | os.PathLike[str]) -> bool:
    """Whether a name is that of a page in one file, not of a folder."""
    return Path(target).suffix.lower() in {".html", ".htm"}


def _write(folder: Path, files: Mapping[str, bytes], part: str) -> list[str]:
    """Write the files of a page that opens `part`, all or none; their names."""
    if is_single(folder):
        with making(folder.parent), replacing(folder) as scratch:
            scratch.write_bytes(page.single(files, part))
        return []
    files = {**files, page.START: page.watched(files[page.START])}
    # Renamed in the reverse order: the page comes when all that it needs is there, and nothing if one does not fit.
    with making(folder), ExitStack() as stack:
        for name in sorted(files, key=lambda name: name != page.START):
            stack.enter_context(replacing(folder / name)).write_bytes(files[name])
    return sorted(files)
