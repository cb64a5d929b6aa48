"""The page as a folder of static files: any web server can offer it, and Viscera need not be installed."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from viscera.atomic import replacing
from viscera.case import Case
from viscera.errors import VisceraError
from viscera.progress import shown
from viscera.touch import Touch
from viscera.viewer import page
from viscera.viewer.live import PAGE_UNKNOWNS, live_case
from viscera.viewer.web import WebModel, web_model


@dataclass(frozen=True)
class Exported:
    """What was written for a model."""

    folder: Path
    files: list[str]
    model: WebModel


@dataclass(frozen=True)
class ExportedCase:
    """What was written for a case, which the page steps itself."""

    folder: Path
    files: list[str]
    bytes: int
    """Of the case and of all that steps it."""


@shown
def export(touch: Touch, folder: str | os.PathLike[str], name: str = "Organ") -> Exported:
    """Write the page and the web version of a model (below 25 MB) into a folder, which is created where needed."""
    target, files = _folder(folder), page.files()
    model = web_model(touch, name)
    return Exported(target, _write(target, {**files, page.MODEL: model.data}), model)


def export_case(case: Case, folder: str | os.PathLike[str], name: str = "Organ") -> ExportedCase:
    """Write the page and a case that it steps in real time; raises `VisceraError` where the organ is too large."""
    target, files = _folder(folder), page.stepping_files()
    live = live_case(case, name)
    if not live.fits_a_page:
        raise VisceraError(
            f"this organ has {live.unknowns} degrees of freedom, and a page steps up to {PAGE_UNKNOWNS} in real time; "
            "reduce it first, then export the model"
        )
    written = {**files, page.CASE: live.data}
    stepping = sum(len(written[file]) for file in (page.CASE, *page.STEPPER))
    return ExportedCase(target, _write(target, written), stepping)


def _folder(name: str | os.PathLike[str]) -> Path:
    folder = Path(name)
    if folder.exists() and not folder.is_dir():
        raise VisceraError(f"{folder} is a file; name a folder for the page")
    return folder


def _write(folder: Path, files: Mapping[str, bytes]) -> list[str]:
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        with replacing(folder / name) as scratch:
            scratch.write_bytes(content)
    return sorted(files)
