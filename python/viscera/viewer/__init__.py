"""The viewer: a page on which a reduced model is touched, served on this machine, exported, or in a notebook.

The page itself is TypeScript (`viewer/` in the repository), built into `static/`; it evaluates the model in the browser
by the same Rust code. Here it is only given the files it needs.
"""

from viscera.viewer.export import export
from viscera.viewer.server import Server, serve, serve_live

__all__ = ["Server", "export", "serve", "serve_live"]
