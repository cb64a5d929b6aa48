"""Compressed arrays of VTK's XML files (`.vtu`), inflated no further than they state.

An array is a header and blocks. The header has the number of blocks, the bytes that a block holds, those of the last if
it is a smaller one (else 0), and the compressed bytes of each (VTK file formats, "XML file formats"). meshio inflates
whatever a block holds: a damaged or false one takes all memory.
"""

from __future__ import annotations

import base64
import lzma
import re
import xml.etree.ElementTree as ET
import zlib
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import meshio
import numpy as np
from meshio._exceptions import CorruptionError
from meshio.vtu import _vtu
from numpy.typing import NDArray

from viscera.errors import VisceraError
from viscera.quantity import brief

ROOT = re.compile(rb"<VTKFile\b[^>]*>")
ATTRIBUTE = rb"\b%s\s*=\s*[\"']([^\"']*)"
RAW = re.compile(rb"<AppendedData\b[^>]*\bencoding\s*=\s*[\"']raw[\"'][^>]*>\s*_")
ORDERS: dict[str | None, Literal["<", ">"]] = {"LittleEndian": "<", "BigEndian": ">"}
FIXED = 3
"""Numbers of a header before those of the blocks."""


def read(path: Path) -> meshio.Mesh:
    """What meshio reads of a file of one piece. Raises `VisceraError` for a block that holds more than it states."""
    found = _Reader(str(path))
    data = {"point_data": found.point_data, "cell_data": found.cell_data, "field_data": found.field_data}
    return meshio.Mesh(found.points, found.cells, **data)


def require_stated_sizes(data: bytes) -> None:
    """Raises `VisceraError` if a compressed block among the bytes appended to a file holds more than it states.

    meshio inflates these before it reads arrays. What is malformed otherwise it refuses itself.
    """
    root, appended = ROOT.search(data), RAW.search(data)
    compressor = _attribute(root[0], b"compressor") if root else ""
    if root is None or appended is None or not compressor:
        return
    order = "<" if _attribute(root[0], b"byte_order") != "BigEndian" else ">"
    size = 8 if _attribute(root[0], b"header_type") == "UInt64" else 4
    at, end = appended.end(), data.rfind(b"</AppendedData>")
    while at + size <= end:
        count = int.from_bytes(data[at : at + size], "little" if order == "<" else "big")
        header = data[at : at + (FIXED + count) * size]
        if count == 0 or len(header) < (FIXED + count) * size:
            return
        numbers = np.frombuffer(header, f"{order}u{size}").tolist()
        at += len(header)
        _inflated(numbers, data[at : at + sum(numbers[FIXED:])], compressor)
        at += sum(numbers[FIXED:])


class _Reader(_vtu.VtuReader):  # type: ignore[misc]
    """meshio's reader, with blocks that are inflated as far as they state, and no array left out."""

    def read_data(self, c: ET.Element) -> NDArray[Any]:
        try:
            return np.asarray(super().read_data(c))
        except CorruptionError:  # which meshio prints, and goes on without the array
            name, width = brief(c.get("Name", "")), c.get("NumberOfComponents")
            raise VisceraError(
                f"damaged: its array {name} holds a number of values that is no multiple of its {width} components"
            ) from None

    def read_compressed_binary(self, data: str, dtype: np.dtype[Any]) -> NDArray[Any]:
        order: Literal["<", ">", "="] = ORDERS.get(self.byte_order, "=")
        kind = _vtu.vtu_to_numpy_type[self.header_type].newbyteorder(order)
        first = base64.b64decode(data[: _letters(kind.itemsize)])
        count = int(np.frombuffer(first[: kind.itemsize], kind)[0])
        start = _letters((FIXED + count) * kind.itemsize)
        header = np.frombuffer(base64.b64decode(data[:start]), kind).tolist()
        if len(header) != FIXED + count:
            raise VisceraError(f"damaged: the header of an array declares {count} blocks, which are not there")
        blocks = _inflated(header, base64.b64decode(data[start:]), self.compression)
        return np.frombuffer(b"".join(blocks), dtype=dtype.newbyteorder(order))


def _letters(size: int) -> int:
    """Letters of base 64 that hold so many bytes."""
    return -(-size // 3) * 4


def _attribute(tag: bytes, name: bytes) -> str:
    found = re.search(ATTRIBUTE % name, tag)
    return found[1].decode(errors="replace") if found else ""


def _inflated(header: list[int], data: bytes, compressor: str) -> list[bytes]:
    """The blocks behind a header; raises `VisceraError` for one that holds more than it states."""
    starts = np.cumsum([0, *header[FIXED:]]).tolist()
    blocks = []
    for k, (start, end) in enumerate(pairwise(starts)):
        is_last = k == header[0] - 1
        stated = (header[2] if is_last else 0) or header[1]
        stream = zlib.decompressobj() if compressor == "vtkZLibDataCompressor" else lzma.LZMADecompressor()
        blocks.append(stream.decompress(data[start:end], stated + 1))
        if len(blocks[-1]) > stated:
            raise VisceraError(f"damaged: a compressed block holds more than the {stated} bytes that it states")
        if not stream.eof:
            raise VisceraError("cut short: a compressed block has no end")
    return blocks
