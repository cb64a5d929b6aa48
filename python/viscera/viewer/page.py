"""The files of the page, as they were built into the package."""

from __future__ import annotations

from importlib import resources

from viscera.errors import VisceraError

CONTENT_TYPES = {
    "html": "text/html; charset=utf-8",
    "css": "text/css; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "svg": "image/svg+xml",
    "viscera": "application/octet-stream",
}
MODEL = "organ.viscera"
"""Name under which the page looks for its model."""


def files() -> dict[str, bytes]:
    """Name and content of every file of the page, its model left out."""
    folder = resources.files("viscera.viewer") / "static"
    found = {entry.name: entry.read_bytes() for entry in folder.iterdir()} if folder.is_dir() else {}
    if "viewer.js" not in found:
        raise VisceraError("this package was built without its viewer: install Node.js, then run 'make viewer'")
    return found


def content_type(name: str) -> str:
    """The content type of a file of the page."""
    return CONTENT_TYPES[name.rpartition(".")[2]]
