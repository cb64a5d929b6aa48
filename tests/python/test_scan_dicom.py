"""DICOM segmentations: names and places of their segments, and those that are no labels."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import viscera as vs


def segmentation(
    path: Path, voxels: Any, kind: str = "BINARY", *, leaves_out: bool = False, places: Sequence[int] = range(4)
) -> None:
    """Writes segments (k, 6, 8, n), the first of which is the liver, on slices of 6 x 8 voxels at places 3 mm apart."""
    highdicom = pytest.importorskip("highdicom")
    from highdicom.sr.coding import CodedConcept
    from pydicom.dataset import Dataset, FileMetaDataset
    from pydicom.uid import CTImageStorage, ExplicitVRLittleEndian, generate_uid

    study, series, frame = (generate_uid(entropy_srcs=[word]) for word in ("study", "series", "frame"))
    slices = []
    for k in places:
        ct = Dataset()
        ct.file_meta = FileMetaDataset()
        ct.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
        ct.SOPClassUID, ct.SOPInstanceUID = CTImageStorage, generate_uid(entropy_srcs=[f"slice {k}"])
        ct.StudyInstanceUID, ct.SeriesInstanceUID, ct.FrameOfReferenceUID = study, series, frame
        ct.PatientID, ct.PatientName, ct.PatientBirthDate, ct.PatientSex = "1", "A^B", "", ""
        ct.StudyID, ct.StudyDate, ct.StudyTime, ct.AccessionNumber = "1", "20260101", "000000", ""
        ct.ReferringPhysicianName, ct.Modality, ct.SeriesNumber, ct.InstanceNumber = "", "CT", 1, k + 1
        ct.ImagePositionPatient, ct.ImageOrientationPatient = [10.0, 20.0, 30.0 + 3.0 * k], [1, 0, 0, 0, 1, 0]
        ct.PixelSpacing, ct.SliceThickness, ct.Rows, ct.Columns = [2.0, 1.5], 3.0, 6, 8
        ct.SamplesPerPixel, ct.PhotometricInterpretation = 1, "MONOCHROME2"
        ct.BitsAllocated, ct.BitsStored, ct.HighBit, ct.PixelRepresentation = 16, 16, 15, 0
        ct.PixelData = np.zeros((6, 8), dtype=np.uint16).tobytes()
        slices.append(ct)
    code = CodedConcept("10200004", "SCT", "Liver")
    organ = CodedConcept("123037004", "SCT", "Anatomical Structure")
    names = ("liver", "tumour", "vein")[: voxels.shape[3]]
    described = [
        highdicom.seg.SegmentDescription(n, name, organ, code, "MANUAL") for n, name in enumerate(names, start=1)
    ]
    highdicom.seg.Segmentation(
        slices, voxels, kind, described, generate_uid(), 1, generate_uid(), 1, "M", "M", "1", "1",
        content_creator_name="A^B", omit_empty_frames=leaves_out,
    ).save_as(path)  # fmt: skip


@pytest.mark.parametrize("leaves_out", [False, True])
def test_a_dicom_segmentation_brings_names(tmp_path: Path, leaves_out: bool) -> None:
    """Slices without labels, which a file may leave out, lie between the organ and the edge of the scan."""
    voxels = np.zeros((4, 6, 8, 1), dtype=np.uint8)
    voxels[1:3, 2:4, 5:7] = 1
    segmentation(tmp_path / "liver.dcm", voxels, leaves_out=leaves_out)
    found = vs.scan(tmp_path / "liver.dcm")
    assert found.names == {1: "liver"}
    assert found.labels == {1: 8}
    assert found.axes == "LPS"
    first = 1e-3 * np.array([10.0 + 1.5 * 5, 20.0 + 2.0 * 2, 33.0])
    assert found.at([first, first - [1.5e-3, 0, 0]]).tolist() == [1, 0]
    assert (found.values[[0, -1]] == 0).all()
    assert "cut" not in found.mesh(edge="2 mm").sets


def test_segments_that_overlap_or_are_fractions_are_refused(tmp_path: Path) -> None:
    voxels = np.zeros((4, 6, 8, 3), dtype=np.uint8)
    voxels[1:3, 2:4, 3:7, 0] = voxels[1:3, 2:4, 6:8, 1] = voxels[1, 2, 3, 2] = 1
    segmentation(tmp_path / "several.dcm", voxels)
    words = r"several.dcm: its segments 1 'liver' and 2 'tumour' overlap in 4 voxels \(and others elsewhere\), .*cut"
    with pytest.raises(vs.VisceraError, match=words):
        vs.scan(tmp_path / "several.dcm")
    segmentation(tmp_path / "part.dcm", 0.7 * voxels[..., :1].astype(float), "FRACTIONAL")
    with pytest.raises(vs.VisceraError, match=r"part.dcm: it says how much of each voxel .* save it as a binary"):
        vs.scan(tmp_path / "part.dcm")


GAPS = {
    "left out": (range(6), [1, 2, 4], ""),
    "lacking": ([0, 1, 2, 4, 5], [1, 2, 4], "the slice at [10.0, 20.0, 39.0] mm"),
    "from above": ([7, 5, 4, 1, 0], [5, 4, 1], "the slices at [10.0, 20.0, 39.0], [10.0, 20.0, 36.0] mm"),
    "one of two": ([0, 1, 2, 4, 5], [0, 1, 4], "1 of the slices at [10.0, 20.0, 39.0], [10.0, 20.0, 36.0] mm"),
    "in no order": ([4, 0, 2, 1, 5], [0, 1, 2, 4, 5], "the slice at [10.0, 20.0, 39.0] mm"),
    "in no order, left out": ([4, 0, 2, 1, 5, 3], [0, 1, 2, 4, 5], ""),
}
"""The slices of a scan, those of the organ, and what is said: those that the scan lacks, not those left out."""


@pytest.mark.parametrize("gap", GAPS)
def test_a_slice_that_the_scan_lacks_is_named(tmp_path: Path, caplog: pytest.LogCaptureFixture, gap: str) -> None:
    places, drawn, lacks = GAPS[gap]
    voxels = np.zeros((len(places), 6, 8, 1), dtype=np.uint8)
    voxels[np.isin(places, drawn), 2:4, 5:7] = 1
    path = tmp_path / "liver.dcm"
    segmentation(path, voxels, leaves_out=True, places=places)
    caplog.clear()
    found = vs.scan(path)
    assert found.labels == {1: 4 * len(drawn)}
    said = [f"{path}: the scan in which it was drawn lacks {lacks}, between others that it has"] if lacks else []
    assert [message.partition(", where no organ")[0] for message in caplog.messages] == said


def test_slices_that_are_not_neighbours_do_not_pass_for_them(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Without the distance of slices, that of two stored ones is taken, which has images between them here."""
    voxels = np.zeros((5, 6, 8, 1), dtype=np.uint8)
    voxels[[1, 3], 2:4, 5:7] = 1
    segmentation(tmp_path / "far.dcm", voxels, leaves_out=True, places=[0, 1, 2, 4, 5])
    caplog.clear()
    vs.scan(tmp_path / "far.dcm")
    words = (
        "images of the scan in which it was drawn lie between its slices at [10.0, 20.0, 42.0] and [10.0, 20.0, 33.0]"
    )
    assert [words in message for message in caplog.messages] == [True]


def drawn(path: Path) -> Path:
    """A file with two slices of one segment."""
    voxels = np.zeros((4, 6, 8, 1), dtype=np.uint8)
    voxels[1:3, 2:4, 5:7] = 1
    segmentation(path, voxels)
    return path


def test_what_is_no_segmentation_is_told_apart(tmp_path: Path) -> None:
    pydicom = pytest.importorskip("pydicom")
    path = drawn(tmp_path / "liver.dcm")
    whole = path.read_bytes()

    def refused(words: str) -> None:
        with pytest.raises(vs.VisceraError, match=rf"liver\.dcm: {words}") as caught:
            vs.scan(path)
        assert "force" not in str(caught.value), "no advice on a call that the user does not make"

    path.write_bytes(b"hello")
    refused("not a DICOM file: .*; export it anew")
    path.write_bytes(whole[:-40])
    refused("a DICOM segmentation that is damaged, or of a form that is not read .*; export it anew")
    for kind, words in (("CTImageStorage", "is of the kind CT Image Storage"), (None, "does not say of which kind")):
        path.write_bytes(whole)
        data = pydicom.dcmread(path)
        if kind is None:
            del data.SOPClassUID
        else:
            data.SOPClassUID = getattr(pydicom.uid, kind)
        data.save_as(path)
        refused(f"a DICOM file, but no segmentation of voxels: it {words}.*; export the segmentation as DICOM SEG")


def test_a_slice_that_is_there_twice_is_named(tmp_path: Path) -> None:
    pydicom = pytest.importorskip("pydicom")
    path = drawn(tmp_path / "liver.dcm")
    data = pydicom.dcmread(path)
    frames = data.PerFrameFunctionalGroupsSequence
    frames[2].PlanePositionSequence = frames[1].PlanePositionSequence
    data.save_as(path)
    place = [float(x) for x in frames[1].PlanePositionSequence[0].ImagePositionPatient]
    words = f"its frames 2 and 3 are both the slice at {place} mm; leave one of them out"
    with pytest.raises(vs.VisceraError, match=re.escape(words)):
        vs.scan(path)
