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
from threading import Thread

from viscera import progress
from viscera.cases.case import PLACED, Case
from viscera.cases.scene_case import SceneCase, read_any
from viscera.cli.options import add_value, model_at
from viscera.cli.output import Outcome, Output, put
from viscera.errors import VisceraError
from viscera.output.kind import CASE, MODEL, kind_of, require
from viscera.reduced.touch import Touch


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `viscera view`."""
    parser.add_argument("model", metavar="organ.viscera|CASE.toml")
    add_value(parser)
    parser.add_argument("--port", type=_port, help="port of the page's server on 127.0.0.1 (default: any free one)")
    parser.add_argument(
        "--no-browser", action="store_true", help="print the address, also with --quiet, and open no browser"
    )
    parser.add_argument(
        "--export",
        metavar="DIR|FILE.html",
        help="write the page there: static files for a web server, or one file that opens from a disk",
    )


def _port(text: str) -> int:
    """A port, refused before the work on the model."""
    from viscera.viewer.server import PORT

    try:
        return PORT(int(text), "it")
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text.strip()} is no port; give {PORT}, 0 for any free one") from error


def run(args: argparse.Namespace, output: Output) -> Outcome:
    """Serve until Ctrl-C, or export."""
    if args.export is not None and args.port is not None:
        raise VisceraError("--port is that of the server on this machine, and --export needs none; leave one out")
    written = [("--export", path) for path in _exported(args.export)]
    output.spare([args.model], *written)
    require(args.model, MODEL, CASE)
    name = Path(args.model).stem.replace("_", " ").replace("-", " ").capitalize()
    shown: Touch | Case | SceneCase
    if kind_of(args.model) == CASE:
        if args.value is not None:
            raise VisceraError(f"{args.model} is a case file, and --value is that of a model's parameter; leave it out")
        shown = read_any(args.model)
        output.spare(shown.files, *written)
    else:
        shown = model_at(args.model, args.value)
    if args.export is None:
        show(shown, name, output, args.port or 0, opens_browser=not args.no_browser)
        return Outcome("closed")
    if isinstance(shown, Touch):
        return export_page(shown, name, args.export, output)
    return export_stepped(shown, name, args.export, output)


def _exported(export: str | None) -> list[str | Path]:
    """Files of an export that could be one of those read: the page in one file, or a folder's model or case."""
    from viscera.viewer import page
    from viscera.viewer.export import is_single

    if export is None:
        return []
    if not export or is_single(export):
        return [export]
    return [Path(export, name) for name in (page.MODEL, page.CASE)]


def export_page(touch: Touch, name: str, folder: str, output: Output) -> Outcome:
    """Write the page of a model into a folder."""
    from viscera.viewer import export

    with progress.bar(output.is_quiet) as bar:
        bar(0, 1, "web version of the model")
        written = export(touch, folder, name)
        bar(1, 1, "web version of the model")
    web = written.model
    output.say(
        f"{_written(written.folder, written.files)}\n"
        f"web version of the model: {len(web.data) / 1e6:.1f} MB, {web.modes} modes, at most "
        f"{100 * web.worst_error:.2g} % from the full model on the surface in {web.touches} touches"
    )
    facts = {"files": written.files, "model_bytes": len(web.data), "modes": web.modes, "worst_error": web.worst_error}
    return Outcome("exported", facts={"folder": str(written.folder), **facts})


def export_stepped(case: Case | SceneCase, name: str, folder: str, output: Output) -> Outcome:
    """Write the page of a case, which steps it, into a folder."""
    from viscera.viewer import export_case

    written = export_case(case, folder, name)
    output.say(
        f"{_written(written.folder, written.files)}\n"
        f"the page steps the case itself: {written.bytes / 1e6:.1f} MB with the stepper"
    )
    _say_left_out(case, output)
    return Outcome("exported", facts={"folder": str(written.folder), "files": written.files, "bytes": written.bytes})


def _written(place: Path, files: list[str]) -> str:
    """The files of a folder, or the size of one file."""
    return f"{place}: {', '.join(files) or f'one file of {place.stat().st_size / 1e6:.1f} MB'}"


def show(
    shown: Touch | Case | SceneCase, name: str, output: Output, port: int = 0, *, opens_browser: bool = True
) -> None:
    """Serve the page of a model, of a case or of a scene, until Ctrl-C."""
    from viscera.viewer import serve, serve_live

    server = serve(shown, name, port) if isinstance(shown, Touch) else serve_live(shown, name, port)
    if output.is_quiet and not opens_browser:  # nobody else knows the address, which is random
        put(f"{server.url}\n", is_error=output.json_path == "-")
    output.say(f"{server.url}\nCtrl-C ends the viewer")
    if not isinstance(shown, Touch):
        _say_left_out(shown, output)
    if opens_browser:
        # A browser in this terminal returns when it is left, and the page must be served until then.
        Thread(target=webbrowser.open, args=(server.url,), daemon=True).start()
    try:
        server.run()
    except KeyboardInterrupt:
        output.say("the viewer is closed")


def _say_left_out(case: Case | SceneCase, output: Output) -> None:
    """The loads of a case that its page does not apply."""
    kinds = [kind for kind in PLACED if case.loads.get(kind)]
    if kinds:
        output.say(f"the page leaves out {' and '.join(kinds)} of the case's [loads]; it takes gravity and density")
