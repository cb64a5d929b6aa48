"""Touch a reduced model in the browser, step a case or a scene in real time, or export the page for any web server.

viscera view liver.viscera
viscera view liver.viscera --export site/
viscera view liver.viscera --export liver.html
viscera view artery.toml
viscera view artery.toml --export site/
viscera view scene.toml
"""

from __future__ import annotations

import argparse
import webbrowser
from pathlib import Path

from viscera import progress
from viscera.cli.output import Outcome, Output
from viscera.filekind import CASE, MODEL, kind_of, require
from viscera.scene_case import read_any
from viscera.touch import load


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `viscera view`."""
    parser.add_argument("model", metavar="organ.viscera|CASE.toml")
    parser.add_argument(
        "--port", type=int, default=0, help="port of the page's server on 127.0.0.1 (default: any free one)"
    )
    parser.add_argument("--no-browser", action="store_true", help="print the address without opening a browser")
    parser.add_argument(
        "--export",
        metavar="DIR|FILE.html",
        help="write the page there: static files for a web server, or one file that opens from a disk",
    )


def run(args: argparse.Namespace, output: Output) -> Outcome:
    """Serve until Ctrl-C, or export."""
    written = [("--export", path) for path in _exported(args.export)]
    output.spare([args.model], *written)
    require(args.model, MODEL, CASE)
    if is_case(args.model):
        output.spare(read_any(args.model).files, *written)
    if args.export is not None:
        write = export_stepped if is_case(args.model) else export_page
        return write(args.model, args.export, output)
    show(args.model, output, args.port, opens_browser=not args.no_browser)
    return Outcome("closed")


def _exported(export: str | None) -> list[str | Path]:
    """Files of an export that could be one of those read: the page in one file, or a folder's model or case."""
    from viscera.viewer import page

    if export is None:
        return []
    if export.endswith(".html") or not export:
        return [export]
    return [Path(export, name) for name in (page.MODEL, page.CASE)]


def export_page(model: str, folder: str, output: Output) -> Outcome:
    """Write the page of a model file into a folder."""
    from viscera.viewer import export

    with progress.bar(output.is_quiet) as bar:
        bar(0, 1, "web version of the model")
        written = export(load(model), folder, name_of(model))
        bar(1, 1, "web version of the model")
    web = written.model
    output.say(
        f"{_written(written.folder, written.files)}\n"
        f"web version of the model: {len(web.data) / 1e6:.1f} MB, {web.modes} modes, at most "
        f"{100 * web.worst_error:.2g} % from the full model on the surface in {web.touches} touches"
    )
    facts = {"files": written.files, "model_bytes": len(web.data), "modes": web.modes, "worst_error": web.worst_error}
    return Outcome("exported", facts={"folder": str(written.folder), **facts})


def export_stepped(case: str, folder: str, output: Output) -> Outcome:
    """Write the page of a case file, which steps it, into a folder."""
    from viscera.viewer import export_case

    written = export_case(read_any(case), folder, name_of(case))
    output.say(
        f"{_written(written.folder, written.files)}\n"
        f"the page steps the case itself: {written.bytes / 1e6:.1f} MB with the stepper"
    )
    return Outcome("exported", facts={"folder": str(written.folder), "files": written.files, "bytes": written.bytes})


def _written(place: Path, files: list[str]) -> str:
    """The files of a folder, or the size of one file."""
    return f"{place}: {', '.join(files) or f'one file of {place.stat().st_size / 1e6:.1f} MB'}"


def show(model: str, output: Output, port: int = 0, *, opens_browser: bool = True) -> None:
    """Serve the page of a model file, of a case or of a scene, until Ctrl-C."""
    from viscera.viewer import serve, serve_live

    name = name_of(model)
    server = serve_live(read_any(model), name, port) if is_case(model) else serve(load(model), name, port)
    output.say(f"{server.url}\nCtrl-C ends the viewer")
    if opens_browser:
        webbrowser.open(server.url)
    try:
        server.run()
    except KeyboardInterrupt:
        output.say("the viewer is closed")


def is_case(path: str) -> bool:
    """Whether a path names a case file."""
    return kind_of(path) == CASE


def name_of(model: str) -> str:
    """The organ's name, after its file."""
    return Path(model).stem.replace("_", " ").replace("-", " ").capitalize()
