"""Examples in docstrings run in a folder of their own, where they may write; each process has one thread of BLAS."""

import os

import pytest

# Tests run side by side; threads of BLAS would wait for each other's cores. NumPy reads it once.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import viscera  # noqa: F401  before pytest imports a module of it, which would take the place of `viscera.mesh()`

collect_ignore_glob = ["python/viscera/bench/peers/[!_]*.py"]
"""Each imports a code that need not be installed."""


@pytest.fixture(autouse=True)
def _folder_of_an_example(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if isinstance(request.node, pytest.DoctestItem):
        monkeypatch.chdir(request.getfixturevalue("tmp_path"))
