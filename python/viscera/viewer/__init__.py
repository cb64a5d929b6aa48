"""The viewer: a page on which an organ is touched, served on this machine, exported, or in a notebook.

The page itself is TypeScript (`viewer/` in the repository), built into `static/`; in the browser it evaluates a model,
and steps a small case, by the same Rust code. Here it is only given the files it needs.
"""

from viscera.viewer.export import export, export_case
from viscera.viewer.server import Server, serve, serve_live

__all__ = ["Server", "export", "export_case", "serve", "serve_live"]
