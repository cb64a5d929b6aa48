"""The voxels that a header of NRRD or MetaImage names: in which files, and whether these hold all of them unharmed.

ITK reads whatever path a header names, a pipe or a device too; MetaIO writes the sizes of more than ten dimensions
beyond its arrays. Neither says a word where compressed voxels were changed, and MetaIO none where it cannot
unpack them.
"""

from __future__ import annotations

import os
import re
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from viscera.errors import VisceraError
from viscera.scans import metaspace, nrrdspace

MOST_DIMENSIONS = 5
"""Of an image that SimpleITK reads; a NRRD file counts several values at a voxel as one."""
NUMBERED = re.compile(r"([^%]*%0?\d{0,2}d[^%]*?)\s+(-?\d+)\s+(-?\d+)(?:\s+(-?\d+))?(?:\s+\d+)?")
"""Files by number: the form of their names, the first number, the last, and the step."""
EITHER = 47
"""Of zlib: a stream of zlib or of gzip, by its first bytes."""
GZIP = b"\x1f\x8b"
"""The first bytes of such a stream."""
CHUNK = 1 << 20
"""Bytes that are read at once."""


@dataclass(frozen=True)
class Stored:
    """Where the voxels of an image are."""

    files: list[Path]
    """One, or several with a part each."""
    start: int = 0
    """Bytes of the file before them."""
    lines: int = 0
    """Lines of the file before them, after these bytes."""
    skipped: int = 0
    """Bytes before them that are stored as they are."""
    length: int | None = None
    """Bytes of the file that are compressed voxels; None are all that follow."""
    encoding: str = "raw"
    """`raw`, `zlib`, or another that is not compared."""

    def require(self, size: int) -> int | None:
        """The CRC-32 of the first `size` bytes that compressed files hold; None for voxels as they are.

        Raises `VisceraError` unless the files hold so many bytes of voxels, unharmed if they have a checksum.
        """
        checksum = None
        if self.encoding == "zlib":
            held, checksum = 0, 0
            for path in self.files:
                held, checksum = self._inflated(path, size, held, checksum)
        elif self.encoding == "raw" and len(self.files) == 1:
            held = self.files[0].stat().st_size - self.start
        else:
            return None
        if held < size + self.skipped * len(self.files):
            name = self.files[0].name if len(self.files) == 1 else f"{self.files[0].name}, ..., {self.files[-1].name}"
            raise VisceraError(
                f"its header declares {size} bytes of voxels, and {name} holds {held}: it is cut short or damaged; "
                "copy it anew"
            )
        return checksum

    def _inflated(self, path: Path, size: int, count: int, checksum: int) -> tuple[int, int]:
        """Bytes after those of the compressed stream of a file, and the CRC-32 of the first `size` of them."""
        stream = zlib.decompressobj(EITHER)
        try:
            for chunk in self._chunks(path):
                pending = chunk
                while pending:
                    if stream.eof:  # gzip may go on in another part, as tools that compress in parallel write it
                        if not pending.startswith(GZIP):
                            return count, checksum
                        stream = zlib.decompressobj(EITHER)
                    block = stream.decompress(pending, CHUNK)
                    checksum = zlib.crc32(block[: max(size - count, 0)], checksum)
                    count += len(block)
                    pending = stream.unused_data if stream.eof else stream.unconsumed_tail
        except zlib.error as error:
            raise VisceraError(f"{path.name} is damaged, so its voxels may be wrong ({error}); copy it anew") from error
        if stream.eof:
            return count, checksum
        raise VisceraError(f"{path.name} is cut short: its compressed voxels have no end; copy it anew")

    def _chunks(self, path: Path) -> Iterator[bytes]:
        left = path.stat().st_size if self.length is None else self.length
        with path.open("rb") as file:
            file.seek(self.start)
            for _ in range(self.lines):
                if not file.readline():
                    return
            while left > 0 and (chunk := file.read(min(left, CHUNK))):
                left -= len(chunk)
                yield chunk


def voxels_of(path: Path, ending: str) -> Stored:
    """Where the voxels of an image are.

    Raises `VisceraError` for a header whose dimensions or sizes are none, and for a file that is not there, no regular
    file, or outside the header's folder.
    """
    if ending in (".nrrd", ".nhdr"):
        header, start = nrrdspace.header(path)
        _require_sizes(header, "dimension", "sizes", ending)
        return _of_nrrd(path, header, start)
    header, start = metaspace.header(path)
    _require_sizes(header, "NDims", "DimSize", ending)
    return _of_metaimage(path, header, start)


def _of_metaimage(path: Path, header: Mapping[str, str], start: int) -> Stored:
    name = header.get(metaspace.DATA, "")
    is_compressed = header.get("CompressedData", "").lower().startswith(("t", "1"))
    is_text = header.get("BinaryData", "True").lower().startswith(("f", "0"))
    encoding = "text" if is_text else "zlib" if is_compressed else "raw"
    length = _count(header, metaspace.COMPRESSED) or None
    if name.upper() == "LOCAL":
        return Stored([path], start, length=length, encoding=encoding)
    return Stored(_named(path, name, start), length=length, encoding=encoding)


def _of_nrrd(path: Path, header: Mapping[str, str], start: int) -> Stored:
    said = header.get("encoding", "raw").lower()
    encoding = "zlib" if said in ("gz", "gzip") else said
    lines = _count(header, "line skip", "lineskip")
    skipped = _count(header, "byte skip", "byteskip")
    name = header.get("data file", header.get("datafile"))
    files, start = ([path], start) if name is None else (_named(path, name, start), 0)
    return Stored(files, start, lines, skipped, encoding=encoding)


def _require_sizes(header: Mapping[str, str], dimension: str, sizes: str, ending: str) -> None:
    """Raises `VisceraError` unless a header has a number of dimensions, and a size along each."""
    if dimension not in header:
        raise VisceraError(f"not a readable {ending} image (its header has no line `{dimension}`)")
    said = header[dimension]
    if not said.isdecimal() or not 1 <= int(said[:9]) <= MOST_DIMENSIONS:
        raise VisceraError(f"its header has `{dimension}: {said[:40]}`; a volume has three dimensions")
    counts = header.get(sizes, "").split()
    if len(counts) != int(said) or not all(count.isdecimal() and int(count[:19]) > 0 for count in counts):
        raise VisceraError(
            f"its header has `{sizes}: {header.get(sizes, '')[:80]}`; it needs {said} whole numbers above zero"
        )


def _count(header: Mapping[str, str], *names: str) -> int:
    """A whole number of a header; 0 where there is none, or one below zero."""
    said = next((header[name] for name in names if name in header), "0")
    return int(said) if said.isdecimal() and len(said) < 19 else 0


def _named(path: Path, name: str, start: int) -> list[Path]:
    """The files that a header names: one, one in each line after it, or one for each number of a range."""
    files = []
    for each in _names(path, name, start):
        file = Path(os.path.normpath(path.absolute().parent / each))
        if not file.is_relative_to(os.path.normpath(path.absolute().parent)):
            raise VisceraError(f"its header names {each[:200]!r}, outside its folder; put that file beside it")
        if not file.is_file():
            raise VisceraError(f"its header names {each[:200]!r}, and there is no such file beside it")
        files.append(file)
    if not files:
        raise VisceraError("its header names no file with the voxels")
    return files


def _names(path: Path, name: str, start: int) -> Iterator[str]:
    if name.startswith("LIST"):
        with path.open("rb") as file:
            file.seek(start)
            yield from filter(None, (line.decode("utf-8", "replace").strip() for line in file))
    elif "%" in name:
        found = NUMBERED.fullmatch(name)
        if found is None:
            raise VisceraError(
                f"its header names {name[:200]!r}; files by number have a form such as `slice%03d.raw 1 64 1`"
            )
        form, first, last, step = found[1].strip(), int(found[2]), int(found[3]), int(found[4] or 1)
        yield from (form % number for number in range(first, last + (1 if step > 0 else -1), step or 1))
    else:
        yield name
