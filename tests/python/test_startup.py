"""What the package loads before it is asked for anything."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import viscera as vs

HEAVY = {"anywidget", "IPython", "matplotlib", "meshio", "rich", "scipy", "websockets"}
"""Each is loaded by the functions that need it, so that `import viscera` takes a fifth of a second."""


@pytest.mark.parametrize("module", ["viscera", "viscera.cli"])
def test_nothing_heavy_is_loaded_before_it_is_used(module: str) -> None:
    program = f"import sys, {module}; print(*sorted(sys.modules))"
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    loaded = set(found.split())
    assert module in loaded
    assert not HEAVY & loaded


def test_a_missing_compiled_part_is_named_with_the_remedy(tmp_path: Path) -> None:
    """A copy of the package whose core was never built."""
    here, copy = Path(vs.__file__).parent, tmp_path / "viscera"
    copy.mkdir()
    for module in here.glob("*.py"):
        shutil.copy(module, copy)
    program = "import sys; sys.path.insert(0, sys.argv[1]); import viscera"
    ran = subprocess.run([sys.executable, "-c", program, str(tmp_path)], capture_output=True, text=True, check=False)
    last = ran.stderr.strip().splitlines()[-1]
    assert last.startswith(f"ImportError: the compiled part of viscera, _core, is missing in {copy}, or is not for ")
    assert "build it in a checkout of Viscera with `make setup`, or install a wheel" in last
    assert last.endswith("(No module named 'viscera._core')")
