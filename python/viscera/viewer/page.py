"""The files of the page, as they were built into the package."""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Mapping
from importlib import resources

from viscera.errors import VisceraError

CONTENT_TYPES = {
    "html": "text/html; charset=utf-8",
    "css": "text/css; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "svg": "image/svg+xml",
    "wasm": "application/wasm",
    "viscera": "application/octet-stream",
    "case": "application/octet-stream",
}
START = "index.html"
"""The file that a browser opens."""
MODEL = "organ.viscera"
"""Name under which the page looks for its model."""
CASE = "organ.case"
"""Name under which it looks for a case that it steps itself."""
STEPPER = ("stepper.js", "stepper.wasm")
"""Files that only a page that steps a case needs."""
END = '<i id="end" hidden></i>'
"""What comes last in a page of one file."""
WATCH = """<script>
      addEventListener("DOMContentLoaded", () => {
        const loading = document.querySelector(".loading");
        if (%s) return;
        const sentence = document.createElement("p");
        sentence.className = "sentence";
        sentence.textContent = %s;
        if (loading) loading.remove();
        document.body.append(sentence);
      });
    </script>
    """
"""Says why a page has not started, where its script cannot: a browser does not run one whose end is missing."""
OF_ONE_FILE = WATCH % (
    'document.querySelector("script[data-opens]") && !loading',
    """document.getElementById("end")
          ? "This page cannot start. Use a newer browser."
          : "The end of this file is missing. Copy or download it again.\"""",
)
OF_A_FOLDER = WATCH % (
    "!loading || loading.dataset.begun",
    '"This page cannot start: page.js is missing beside it, or cut. Load the page again, or copy its folder anew."',
)
ICON = '<link rel="icon" href="icon.svg" type="image/svg+xml" />'
TITLE = b"<title>Viscera</title>"


def names() -> set[str]:
    """Names of all files that a page may have."""
    return {*_built(), MODEL, CASE, *STEPPER}


def is_own(start: bytes) -> bool:
    """Whether a file is that with which a page starts, of this version or another one."""
    return TITLE in start and b'src="page.js"' in start


def watched(start: bytes) -> bytes:
    """The file with which an exported page starts: it says what is missing where page.js does not come."""
    return start.replace(ICON.encode(), f"{OF_A_FOLDER}{ICON}".encode())


def files() -> dict[str, bytes]:
    """Name and content of every file of the page that shows a model, its model left out."""
    return {name: content for name, content in _built().items() if name not in STEPPER}


def live_files() -> dict[str, bytes]:
    """The same for the page of a case that is stepped on the server."""
    return {**files(), "page.js": _script("openLive", "live")}


def stepping_files() -> dict[str, bytes]:
    """The same for the page of a case that it steps itself, its case left out."""
    return {**_stepping(), "page.js": _script("openCase", CASE)}


def hybrid_files(model: bytes, case: bytes) -> dict[str, bytes]:
    """All files of the page that steps the organ of a model by itself until the model has arrived."""
    return {**_stepping(), "page.js": _script("openHybrid", CASE, MODEL), CASE: case, MODEL: model}


def two_handed_files(model: bytes, case: bytes) -> dict[str, bytes]:
    """All files of the page of a model that steps its organ while two hands hold on."""
    return {**_stepping(), "page.js": _script("open", MODEL, CASE), CASE: case, MODEL: model}


def can_step() -> bool:
    """Whether what steps a case in a page was built."""
    return _built().keys() >= set(STEPPER)


def stepping_bytes() -> float:
    """Of what steps a case in a page, the case left out; infinite if that was not built."""
    built = _built()
    return sum(len(built[name]) if name in built else math.inf for name in STEPPER)


def single(files: Mapping[str, bytes], part: str) -> bytes:
    """The page as one file that a browser opens from a disk: style and script within it, all else as base64.

    files: of the page, with the model or the case that it opens, which is `part`.
    """
    opens = "openCase" if part == CASE else "open"
    icon = base64.b64encode(files["icon.svg"]).decode()
    within = "".join(
        f'<script type="text/plain" id="{name}">{base64.b64encode(files[name]).decode()}</script>\n'
        for name in (part, *STEPPER)
        if name in files
    )
    # Nothing in the script may look like its end, or like a comment of the page.
    script = files["viewer.js"].decode().replace("</script", "<\\/script").replace("<!--", "<\\!--")
    html = files[START].decode()
    for old, new in (
        (
            ICON,
            f'{OF_ONE_FILE}<link rel="icon" href="data:image/svg+xml;base64,{icon}" />',
        ),
        ('<link rel="stylesheet" href="page.css" />', f"<style>{files['page.css'].decode()}</style>"),
        (
            '<script src="page.js"></script>',
            f'{within}<script type="module" data-opens="{opens}" data-part="{part}">{script}</script>{END}',
        ),
    ):
        if html.count(old) != 1:
            raise VisceraError(f"the built page has no {old}: run 'make viewer'")
        html = html.replace(old, new)
    return html.encode()


def content_type(name: str) -> str:
    """The content type of a file of the page."""
    return CONTENT_TYPES[name.rpartition(".")[2]]


def _script(function: str, *addresses: str) -> bytes:
    """The script that opens a model, as built, opening something else."""
    script = _built()["page.js"].decode()
    return script.replace(_opening("open", MODEL), _opening(function, *addresses)).encode()


def _opening(function: str, *addresses: str) -> str:
    return f"({{ {function} }}) => {function}(document.body, {', '.join(map(json.dumps, addresses))})"


def _built() -> dict[str, bytes]:
    folder = resources.files("viscera.viewer") / "static"
    found = {entry.name: entry.read_bytes() for entry in folder.iterdir()} if folder.is_dir() else {}
    if "viewer.js" not in found:
        raise VisceraError("this package was built without its viewer: install Node.js, then run 'make viewer'")
    return found


def _stepping() -> dict[str, bytes]:
    built = _built()
    if not built.keys() >= set(STEPPER):
        raise VisceraError("this package was built without what steps a case in the page: run 'make viewer'")
    return built
