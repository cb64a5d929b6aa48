"""The page as a folder of static files: any web server can offer it, and Viscera need not be installed."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from viscera.atomic import replacing
from viscera.errors import VisceraError
from viscera.touch import Touch
from viscera.viewer import page
from viscera.viewer.web import WebModel, web_model


@dataclass(frozen=True)
class Exported:
    """What was written."""

    folder: Path
    files: list[str]
    model: WebModel


def export(touch: Touch, folder: str | os.PathLike[str], name: str = "Organ") -> Exported:
    """Write the page and the web version of a model (below 25 MB) into a folder, which is created where needed."""
    target = Path(folder)
    files = page.files()
    if target.exists() and not target.is_dir():
        raise VisceraError(f"{target} is a file; name a folder for the page")
    model = web_model(touch, name)
    target.mkdir(parents=True, exist_ok=True)
    for entry, content in {**files, page.MODEL: model.data}.items():
        with replacing(target / entry) as scratch:
            scratch.write_bytes(content)
    return Exported(target, sorted([*files, page.MODEL]), model)
