"""What the package loads before it is asked for anything."""

from __future__ import annotations

import subprocess
import sys

import pytest

HEAVY = {"anywidget", "IPython", "matplotlib", "meshio", "rich", "scipy", "websockets"}
"""Each is loaded by the functions that need it, so that `import viscera` takes a fifth of a second."""


@pytest.mark.parametrize("module", ["viscera", "viscera.cli"])
def test_nothing_heavy_is_loaded_before_it_is_used(module: str) -> None:
    program = f"import sys, {module}; print(*sorted(sys.modules))"
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    loaded = set(found.split())
    assert module in loaded
    assert not HEAVY & loaded
