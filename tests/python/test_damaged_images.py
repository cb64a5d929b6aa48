"""Images that are damaged, cut short or name what is no file of theirs: none is read as another organ."""

from __future__ import annotations

import gzip
import os
import re
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest

import viscera as vs
from viscera.scans.room import in_memory

nibabel = pytest.importorskip("nibabel", reason="images need nibabel: pip install viscera[scan]")
sitk = pytest.importorskip("SimpleITK", reason="images need SimpleITK: pip install viscera[scan]")

NII = "labels.nii"
COMPRESSED = ["labels.nii.gz", "labels.nrrd", "labels.mha", "labels.nhdr", "labels.mhd"]
HEADERS = ["labels.nhdr", "labels.mhd"]
LABELS = np.random.default_rng(3).integers(0, 4, (12, 11, 10), dtype=np.uint8)


def write(path: Path, compress: bool = True) -> Path:
    """The file with the voxels of an image at this path."""
    if ".nii" in path.name:
        nibabel.save(nibabel.Nifti1Image(LABELS, np.diag([5.0, 5.0, 5.0, 1.0])), path)
        return path
    sitk.WriteImage(sitk.GetImageFromArray(LABELS.transpose(2, 1, 0)), str(path), useCompression=compress)
    beside = [other for other in path.parent.iterdir() if other.suffix in (".raw", ".zraw", ".gz")]
    return beside[0] if beside else path


def rewrite(path: Path, pattern: str, text: str) -> None:
    path.write_bytes(re.sub(pattern.encode(), text.encode(), path.read_bytes(), count=1))


@pytest.mark.parametrize("name", COMPRESSED)
def test_no_flipped_bit_of_compressed_voxels_is_other_labels(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    file = write(path)
    whole, rng = file.read_bytes(), np.random.default_rng(0)
    assert np.array_equal(vs.scan(path).values, LABELS)
    refused = 0
    for place in rng.integers(len(whole) // 2, len(whole) - 8, 40).tolist():
        file.write_bytes(whole[:place] + bytes([whole[place] ^ 1 << int(rng.integers(8))]) + whole[place + 1 :])
        try:
            found = vs.scan(path).values
        except vs.VisceraError:
            refused += 1
        else:
            assert np.array_equal(found, LABELS)
    assert refused > 30


@pytest.mark.parametrize("name", COMPRESSED)
@pytest.mark.parametrize("cut", [1, 8, 100])
def test_compressed_voxels_without_their_end_are_refused(tmp_path: Path, name: str, cut: int) -> None:
    path = tmp_path / name
    file = write(path)
    file.write_bytes(file.read_bytes()[:-cut])
    with pytest.raises(vs.VisceraError, match=rf"{name}: .* cut short.*copy it anew"):
        vs.scan(path)


@pytest.mark.parametrize("name", ["labels.nii", "labels.nrrd", "labels.mha", *HEADERS])
def test_voxels_that_are_not_all_there_are_counted(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    file = write(path, compress=False)
    assert np.array_equal(vs.scan(path).values, LABELS)
    file.write_bytes(file.read_bytes()[:-500])
    with pytest.raises(vs.VisceraError, match=rf"{name}: its header declares .*1320 bytes.*hold.*it is cut short"):
        vs.scan(path)


@pytest.mark.parametrize("name", ["labels.nii", "labels.nii.gz"])
def test_no_room_is_made_for_voxels_that_a_file_cannot_hold(tmp_path: Path, name: str) -> None:
    whole = write(tmp_path / NII).read_bytes()
    huge = whole[:42] + struct.pack("<3h", 32767, 32767, 32767) + whole[48:]
    (tmp_path / name).write_bytes(gzip.compress(huge) if name.endswith(".gz") else huge)
    with pytest.raises(vs.VisceraError, match=rf"{name}: its header declares 32767 x 32767 x 32767 voxels of 35181"):
        vs.scan(tmp_path / name)


@pytest.mark.parametrize("error", [MemoryError(), RuntimeError("ITK ERROR: Failed to allocate memory for image.")])
def test_a_sound_image_that_is_too_large_says_what_it_needs(error: Exception) -> None:
    words = "its 4000 x 4000 x 4000 voxels need 128 GB at least, more memory than there is"
    with pytest.raises(vs.VisceraError, match=words), in_memory((4000, 4000, 4000), 128_000_000_000):
        raise error


@pytest.mark.parametrize(
    ("name", "pattern", "text", "words"),
    [
        ("labels.mhd", "NDims = 3", "NDims = 99999", "its header has `NDims: 99999`; a volume has three dimensions"),
        ("labels.mha", "NDims = 3", "NDims = 100", "its header has `NDims: 100`"),
        ("labels.mhd", "NDims = 3", "NDims = 3\nNDims = 9", "its header has two lines `NDims`; leave one"),
        ("labels.mhd", "NDims = 3\n", "", r"not a readable \.mhd image \(its header has no line `NDims`\)"),
        ("labels.mhd", "DimSize = 12", "DimSize = -1", "its header has `DimSize: -1 11 10`; it needs 3 whole numbers"),
        ("labels.mhd", "DimSize = 12", "DimSize =", "its header has `DimSize: 11 10`; it needs 3 whole numbers"),
        ("labels.nrrd", "dimension: 3", "dimension: 1000000", "its header has `dimension: 1000000`"),
        ("labels.nhdr", "sizes: 12", "sizes: -12", "its header has `sizes: -12 11 10`; it needs 3 whole numbers"),
    ],
)
def test_a_header_that_overflows_is_not_given_to_itk(
    tmp_path: Path, name: str, pattern: str, text: str, words: str
) -> None:
    write(tmp_path / name)
    rewrite(tmp_path / name, pattern, text)
    with pytest.raises(vs.VisceraError, match=rf"{name}: {words}"):
        vs.scan(tmp_path / name)


@pytest.mark.parametrize("name", HEADERS)
@pytest.mark.parametrize(
    ("named", "words"),
    [
        ("../labels.raw", r"names '\.\./labels\.raw', outside its folder; put that file beside it"),
        ("/dev/zero", "names '/dev/zero', outside its folder"),
        ("pipe", "names 'pipe', and there is no such file beside it"),
        ("f%d.raw 1 2000000000 1", r"names 'f1\.raw', and there is no such file"),
        ("f%s.raw 1 2 1", r"names 'f%s\.raw 1 2 1'; files by number have a form such as"),
        ("LIST\n\n/dev/zero\n", "names '/dev/zero', outside its folder"),
    ],
)
def test_a_header_names_files_of_its_folder_alone(tmp_path: Path, name: str, named: str, words: str) -> None:
    (tmp_path / "labels.raw").write_bytes(LABELS.tobytes())
    (tmp_path / "scan").mkdir()
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "scan" / "pipe")
    path = tmp_path / "scan" / name
    write(path, compress=False)
    rewrite(path, "(data file: |ElementDataFile = ).*\n", rf"\g<1>{named}" + "\n")
    with pytest.raises(vs.VisceraError, match=rf"{name}: its header {words}"):
        vs.scan(path)


@pytest.mark.parametrize("name", HEADERS)
@pytest.mark.parametrize("named", ["s%02d.raw 3 12 1", "LIST\n{}", "{here}/whole.raw"])
def test_a_header_may_name_a_file_for_each_slice(tmp_path: Path, name: str, named: str) -> None:
    write(tmp_path / name, compress=False)
    slices = [f"s{k:02d}.raw" for k in range(3, 13)]
    for k, file in enumerate(slices):
        (tmp_path / file).write_bytes(LABELS[:, :, k].tobytes(order="F"))
    (tmp_path / "whole.raw").write_bytes(LABELS.tobytes(order="F"))
    text = named.format("\n".join(slices), here=tmp_path) if "{" in named else named
    rewrite(tmp_path / name, "(data file: |ElementDataFile = ).*\n", rf"\g<1>{text}" + "\n")
    assert np.array_equal(vs.scan(tmp_path / name).values, LABELS)


@pytest.mark.parametrize("said", ["", "CompressedDataSize = 0\n"])
@pytest.mark.parametrize("name", ["labels.mha", "labels.mhd"])
def test_a_metaimage_need_not_say_how_long_its_compressed_voxels_are(tmp_path: Path, name: str, said: str) -> None:
    write(tmp_path / name)
    rewrite(tmp_path / name, "CompressedDataSize = .*\n", said)
    assert np.array_equal(vs.scan(tmp_path / name).values, LABELS)


def test_the_bytes_of_compressed_voxels_may_be_in_either_order(tmp_path: Path) -> None:
    path, values = tmp_path / "labels.mha", 300 * LABELS.astype(np.uint16)
    sitk.WriteImage(sitk.GetImageFromArray(values.transpose(2, 1, 0)), str(path), useCompression=True)
    start = path.read_bytes().index(b"LOCAL\n") + 6
    path.write_bytes(path.read_bytes()[:start] + zlib.compress(values.astype(">u2").tobytes(order="F")))
    rewrite(path, "MSB = False", "MSB = True")
    rewrite(path, "CompressedDataSize = .*\n", "")
    assert np.array_equal(vs.scan(path).values, values)


def test_what_metaio_does_not_unpack_is_refused(tmp_path: Path) -> None:
    path, data = tmp_path / "labels.mhd", LABELS.tobytes(order="F")
    write(path).write_bytes(gzip.compress(data[:500]) + gzip.compress(data[500:]))
    rewrite(path, "CompressedDataSize = .*\n", "")
    with pytest.raises(vs.VisceraError, match=r"mhd: its compressed voxels \(labels\.zraw\) are stored in a way"):
        vs.scan(path)


@pytest.mark.parametrize("name", HEADERS)
def test_a_file_for_each_slice_may_be_compressed_and_damaged(tmp_path: Path, name: str) -> None:
    write(tmp_path / name)
    files = [tmp_path / f"s{k}.gz" for k in range(10)]
    for k, file in enumerate(files):
        file.write_bytes(gzip.compress(LABELS[:, :, k].tobytes(order="F")))
    rewrite(tmp_path / name, "CompressedDataSize = .*\n", "")
    rewrite(tmp_path / name, "(data file: |ElementDataFile = ).*\n", "\\g<1>s%d.gz 0 9 1\n")
    assert np.array_equal(vs.scan(tmp_path / name).values, LABELS)
    whole = files[4].read_bytes()
    files[4].write_bytes(whole[:-8] + bytes([whole[-8] ^ 8]) + whole[-7:])
    with pytest.raises(vs.VisceraError, match=rf"{name}: s4\.gz is damaged.*copy it anew"):
        vs.scan(tmp_path / name)
    files[4].write_bytes(gzip.compress(b"\0" * 100))
    with pytest.raises(vs.VisceraError, match=rf"{name}: .* 1320 bytes .*s0\.gz, \.\.\., s9\.gz holds 1288: it"):
        vs.scan(tmp_path / name)


def test_voxels_may_be_compressed_in_parts(tmp_path: Path) -> None:
    path, data = tmp_path / "labels.nhdr", LABELS.tobytes(order="F")
    write(path).write_bytes(gzip.compress(data[:500]) + gzip.compress(data[500:]) + b"\0\0")
    assert np.array_equal(vs.scan(path).values, LABELS)
