"""What a notebook shows of an object by itself: a picture of an object with a shape, a table of one with rows."""

from __future__ import annotations

import html
import io
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH = 560
"""Of a picture in a notebook [pixels of the page]; it is stored with twice as many."""


class Pictured:
    """Objects with a `plot()` appear as that picture when they are the last line of a notebook's cell."""

    plot: Callable[..., Figure]
    """Draws the picture."""

    def _picture(self) -> Figure:
        """The picture that is shown by default."""
        return self.plot()

    def _repr_png_(self) -> tuple[bytes, dict[str, int]]:
        return png(self._picture()), {"width": WIDTH}


def png(figure: Figure) -> bytes:
    """A figure as it is stored in a notebook."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=2 * WIDTH / figure.get_figwidth())
    return buffer.getvalue()


class Tabled:
    """Objects with a `table()` appear as that table."""

    table: Callable[[], str]
    """Aligned text."""

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(self.table())}</pre>"
