"""Docstrings as they are written here, in the markup that the site reads.

A parameter is a line `name: what it is`, continued by indented lines. A formula or a table is an indented block. Names
of the package and code stand between single backticks. All of it becomes reStructuredText.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

PARAMETER = re.compile(
    r"^(?P<names>[a-z_]\w*(?:(?:, | and | or )[a-z_]\w*)*)(?P<shape> [(\[][^)\]]*[)\]])?: (?P<text>\S.*)$"
)
DOTTED = re.compile(r"^~?[A-Za-z_]\w*(\.[A-Za-z_]\w*)*$")


def process(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Sphinx's hook: rewrites the docstring in place."""
    lines[:] = list(markup(lines))


def markup(lines: list[str]) -> Iterator[str]:
    """The docstring's lines in reStructuredText."""
    previous, in_parameters, in_literal, in_example = "", False, False, False
    for line in lines:
        is_indented = line.startswith("    ")
        if not line.strip():
            in_parameters = in_example = False
            yield ""
        elif in_example or line.lstrip().startswith(">>> "):
            in_example = True
            yield line
        elif is_indented and (in_literal or not previous.strip()):
            if not in_literal:
                yield from ("::", "")
            in_literal = True
            yield line
        elif is_indented:
            yield ("    " if in_parameters else "") + inline(line.strip())
        else:
            match = PARAMETER.match(line) if in_parameters or not previous.strip() else None
            if in_parameters and match is None:
                yield ""
            in_parameters, in_literal = match is not None, False
            yield inline(line) if match is None else field(match)
        previous = line


def field(match: re.Match[str]) -> str:
    """A parameter as a field, or several; their shape or unit goes to the text."""
    shape = f"{match['shape'].strip()} " if match["shape"] else ""
    # Of words with spaces between them Sphinx takes all but the last for a type, and looks for it.
    names = re.sub(r", | and | or ", ",\u200b", match["names"])
    return f":param {names}: {inline(shape + match['text'])}"


def inline(text: str) -> str:
    """Code between backticks; whatever else would be markup is plain text."""
    pieces = text.split("`")
    return "".join(plain(piece) if n % 2 == 0 else code(piece) for n, piece in enumerate(pieces))


def plain(text: str) -> str:
    return re.sub(r"([*|\\]|(?<=\w)_(?!\w))", r"\\\1", text)


def code(text: str) -> str:
    return f"`{text}`" if DOTTED.match(text) else f"``{text}``"
