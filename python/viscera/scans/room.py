"""Memory for the voxels of an image: what is too large for it is no damaged file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from viscera.errors import VisceraError

ITK_FAILS = "Failed to allocate memory"
"""What ITK says of it."""


@contextmanager
def in_memory(shape: Sequence[int], size: int) -> Iterator[None]:
    """Raises `VisceraError` in place of what a library raises when voxels of `size` bytes do not fit into memory."""
    try:
        yield
    except (MemoryError, RuntimeError) as error:
        if isinstance(error, RuntimeError) and ITK_FAILS not in str(error):
            raise
        raise VisceraError(
            f"its {' x '.join(map(str, shape))} voxels need {size / 1e9:.3g} GB at least, more memory than there is; "
            "crop it to the organ or resample it to larger voxels"
        ) from error
