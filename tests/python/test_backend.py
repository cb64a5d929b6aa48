"""Pictures need no backend of matplotlib: MPLBACKEND, as a notebook or a shell sets it, does not matter to them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import viscera as vs

PLOT = """
import viscera as vs
beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
beam.plot("rest.png")
import matplotlib.pyplot
print(matplotlib.pyplot.get_backend())
"""


def run(folder: Path, backend: str, *words: str) -> str:
    """What a program of its own prints: here matplotlib is imported already."""
    done = subprocess.run(
        [sys.executable, *words],
        cwd=folder,
        env={**os.environ, "MPLBACKEND": backend},
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def test_commands_draw_whatever_the_backend(bar: vs.Mesh, tmp_path: Path) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    organ.to_case(tmp_path / "bar.toml", loads={"force": {"tip": (0, 0, -1.0)}})
    run(tmp_path, "no_such_backend", "-m", "viscera", "compare", "bar.toml", "--models", "Linear", "--quiet")
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["compare.csv", "compare.png"]


@pytest.mark.parametrize(("backend", "used"), [("no_such_backend", None), ("svg", "svg")])
def test_a_picture_leaves_the_windows_of_a_script_to_it(backend: str, used: str | None, tmp_path: Path) -> None:
    printed = run(tmp_path, backend, "-c", PLOT).strip()
    assert used in (None, printed)
    assert (tmp_path / "rest.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    "program", ["vs.NeoHookean(young=1e5, poisson=0.3).plot()", "from viscera.fitting import plot"], ids=["law", "fit"]
)
def test_curves_need_no_backend(program: str, tmp_path: Path) -> None:
    run(tmp_path, "no_such_backend", "-c", f"import viscera as vs; {program}")
