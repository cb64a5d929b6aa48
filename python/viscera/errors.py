"""Errors, each in one clear sentence: the place, the value, what to do.

Bad input raises `VisceraError` before any work begins. Failure to converge is a status in the result.
It becomes the exception `NotConverged` only if the caller asks for it.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from viscera.state import State


class VisceraError(ValueError):
    """Bad input. The message gives the place, the value and the remedy.

    >>> import viscera as vs
    >>> try:
    ...     vs.NeoHookean(young=-1.0, poisson=0.3)
    ... except vs.VisceraError as error:
    ...     print(error)
    NeoHookean: young is -1; it must be positive [Pa]
    """


class NotConverged(VisceraError):
    """A solve that did not reach its load; `state` holds the last equilibrium found.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> try:
    ...     beam.solve(force={"tip": (0, 0, -10.0)}, settings={"max_iterations": 1, "smallest_step": 1.0}, throw=True)
    ... except vs.NotConverged as error:
    ...     print(error.state.load < 1.0)
    True
    """

    def __init__(self, state: State) -> None:
        super().__init__(f"the solve did not converge: {state.message or state.status}")
        self.state = state

    def __reduce__(self) -> tuple[type[NotConverged], tuple[State]]:
        """Copied and pickled by its state: an exception is made again of its message otherwise, which is none."""
        return type(self), (self.state,)


@contextmanager
def naming(where: str) -> Iterator[None]:
    """Bad input in this block is told with where it stands: a file, a table, a key. Without one it is told as it is.

    >>> with naming("liver.toml"), naming("fixed"):
    ...     raise VisceraError("the mesh has no node set 'hillum'")
    Traceback (most recent call last):
    viscera.errors.VisceraError: liver.toml: fixed: the mesh has no node set 'hillum'
    """
    try:
        yield
    except VisceraError as error:
        # A file may be named within already; what is no bad input has a class of its own.
        if not where or type(error) is not VisceraError or str(error).startswith(f"{where}: "):
            raise
        raise VisceraError(f"{where}: {error}") from error


def refuse_case_file(path: str | Path, wanted: str) -> None:
    """Raise `VisceraError` if a path is that of a case file, which stands where another file is `wanted`.

    >>> refuse_case_file("liver.toml", "a mesh")
    Traceback (most recent call last):
    viscera.errors.VisceraError: liver.toml is a case file, not a mesh; `viscera solve`, `reduce`, `compare`, ...
    """
    if Path(path).suffix.lower() == ".toml":
        raise VisceraError(
            f"{path} is a case file, not {wanted}; `viscera solve`, `reduce`, `compare`, `register` and `view` take "
            "case files, and `reduce` makes a model of one"
        )


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """The end of an error about an unknown name: the most similar known one, and all of them.

    >>> did_you_mean("hillum", ["anterior", "hilum"])
    "did you mean 'hilum'? (known: 'anterior', 'hilum')"
    """
    words = sorted(known)
    if not words:
        return "there are none to choose from"
    listing = f"known: {', '.join(map(repr, words))}"
    near = difflib.get_close_matches(name, words, n=1, cutoff=0.4)
    return f"did you mean {near[0]!r}? ({listing})" if near else listing
