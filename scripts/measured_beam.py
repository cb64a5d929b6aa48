"""Facts of the measured silicone beam for `viscera study measured-beam`, from the published recordings.

    python scripts/measured_beam.py FOLDER

FOLDER holds gravity_a.csv, gravity_b.csv, load52_a.csv, load52_b.csv: 100 Hz, mm, in the beam's axes. What is kept of a
run are the displacements of three markers and fifty heights of one of them, so the recordings themselves stay out.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

TARGET = Path(__file__).resolve().parents[1] / "python" / "viscera" / "study" / "measured_beam.json"
RUNS = {"gravity a": ("gravity_a", 71, 2), "gravity b": ("gravity_b", 63, 2),
        "load a": ("load52_a", 43, 3), "load b": ("load52_b", 58, 3)}  # fmt: skip
"""File, frame at which the beam is let go, and every how many frames one is kept."""
SOURCE = {
    "source": "github.com/srl-ethz/diffPD_sim2real, python/realbeam_experiments/Measurement_data, commit 825e7b7",
    "paper": "Dubied, Michelis, Spielberg, Katzschmann: Sim-to-Real for Differentiable Projective Dynamics on Soft "
    "Robots: Meshing, Damping, and Actuation. IEEE Robotics and Automation Letters 7 (2022) 5014",
    "licence": "MIT, Copyright (c) 2021 Soft Robotics Lab, ETH Zürich",
    "changes": "rotated into the beam's axes; displacement: mean of the last 100 frames less mean of the first 20; "
    "height of the top marker above its mean over the last 100 frames, every second or third frame, 50 in all",
}


def facts(path: Path, released: int, every: int) -> dict[str, Any]:
    """What is kept of a recording."""
    table = np.genfromtxt(path, delimiter=",", names=True)
    columns = [[f"{marker}_{axis}_mm" for axis in "xyz"] for marker in ("top", "left", "right")]
    track = np.array([[table[name] for name in names] for names in columns])
    rest = track[:, :, -100:].mean(axis=2)
    kept = slice(released, released + 50 * every, every)
    return {
        "displacement_mm": (rest - track[:, :, :20].mean(axis=2)).round(3).tolist(),
        "time_s": (table["time_s"][kept] - table["time_s"][released]).round(3).tolist(),
        "height_mm": (track[0, 2, kept] - rest[0, 2]).round(3).tolist(),
    }


def runs(folder: Path) -> dict[str, Any]:
    """The facts of all runs."""
    return {name: facts(folder / f"{file}.csv", released, every) for name, (file, released, every) in RUNS.items()}


if __name__ == "__main__":
    TARGET.write_text(
        json.dumps(SOURCE | {"runs": runs(Path(sys.argv[1]))}, ensure_ascii=False) + "\n", encoding="utf-8"
    )
