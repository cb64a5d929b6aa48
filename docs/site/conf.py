"""The documentation site. `make docs` builds it from docs/, docstrings, the C header, the examples and the results.

Everything it shows is in the repository. Nothing is fetched, neither when it is built nor when it is read.
"""

import sys
from pathlib import Path

SITE = Path(__file__).resolve().parent
ROOT = SITE.parent.parent
sys.path[:0] = [str(SITE), str(ROOT / "python")]

import docstrings  # noqa: E402
import generate  # noqa: E402

import viscera  # noqa: E402

project = "Viscera"
author = "the Viscera maintainers"
release = version = viscera.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx_copybutton", "sphinx_design"]
exclude_patterns = ["site", "pictures"]
source_suffix = {".md": "markdown"}

myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 4

default_role = "py:obj"
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
ALIASES = (
    "ArrayLike",
    "Displacements",
    "Floats",
    "Forces",
    "Indices",
    "Pressures",
    "Progress",
    "Solver",
    "Tractions",
    "Where",
)
autodoc_type_aliases = {name: name for name in ALIASES}
python_use_unqualified_type_names = True
python_display_short_literal_types = True
toc_object_entries_show_parents = "hide"

html_theme = "furo"
html_title = f"Viscera {release}"
html_static_path = ["static"]
html_css_files = ["viscera.css"]
html_show_copyright = False
html_theme_options = {"navigation_with_keys": True}
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True


def relink(app, name, source):
    """Links to pages that stand elsewhere in the repository lead to where the site shows them."""
    path = Path(app.env.doc2path(name))
    if "generated" not in path.parts:
        source[0] = generate.relinked(source[0], path, ROOT, path.parent)


def setup(app):
    app.connect("builder-inited", lambda app: generate.everything(ROOT, Path(app.srcdir) / "generated"))
    app.connect("source-read", relink)
    app.connect("autodoc-process-docstring", docstrings.process)
