"""Images are the same in a process whose numbers have a decimal comma."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import viscera as vs
from viscera.scans import grid

sitk = pytest.importorskip("SimpleITK", reason="images need SimpleITK: pip install viscera[scan]")

SPACING, ORIGIN = (2.5, 1.25, 1.75), (10.5, -3.5, 0.25)
PROGRAM = """
import json, locale, sys
import viscera as vs
from viscera.scans import grid

locale.setlocale(locale.LC_NUMERIC, "de_DE.UTF-8")
source, labels, image = sys.argv[1:]
assert locale.localeconv()["decimal_point"] == ","
scan, read = vs.scan(source), grid.read(source)
scan.write(labels)
grid.write(image, read)
kept = locale.localeconv()["decimal_point"]
print(json.dumps([scan.affine.tolist(), read.GetSpacing(), read.GetOrigin(), kept]))
"""


@pytest.fixture(scope="module")
def comma(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The environment of a process that may set a German locale, made here, since a machine may have none."""
    if not shutil.which("localedef"):
        pytest.skip("NOT TESTED: no `localedef` makes a locale with a decimal comma here")
    folder = tmp_path_factory.mktemp("locales")
    made = subprocess.run(
        ["localedef", "-i", "de_DE", "-f", "UTF-8", str(folder / "de_DE.UTF-8")], capture_output=True, text=True
    )
    if made.returncode:
        pytest.skip(f"NOT TESTED: `localedef` makes no locale with a decimal comma here ({made.stderr.strip()})")
    return os.environ | {"LOCPATH": str(folder)}


@pytest.mark.parametrize("ending", [".nrrd", ".mha"])
def test_decimals_of_voxels_survive_a_decimal_comma(tmp_path: Path, comma: dict[str, str], ending: str) -> None:
    image = sitk.GetImageFromArray(np.ones((2, 3, 4), dtype=np.uint8))
    image.SetSpacing(SPACING)
    image.SetOrigin(ORIGIN)
    source, labels, copy = (tmp_path / f"{name}{ending}" for name in ("source", "labels", "copy"))
    sitk.WriteImage(image, str(source))
    words = [sys.executable, "-c", PROGRAM, str(source), str(labels), str(copy)]
    done = subprocess.run(words, env=comma, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    affine, spacing, origin, point = json.loads(done.stdout)
    exact = 1e-3 * np.column_stack([np.diag(SPACING), ORIGIN])
    assert np.allclose(affine, exact, atol=1e-9)  # rounding of products
    assert np.allclose([spacing, origin], [SPACING, ORIGIN], atol=1e-9)
    assert point == ","
    # Read here, where numbers have a point: what was written there has its decimals.
    assert np.allclose(vs.scan(labels).affine, exact, atol=1e-9)
    assert np.allclose([grid.read(copy).GetSpacing(), grid.read(copy).GetOrigin()], [SPACING, ORIGIN], atol=1e-9)
