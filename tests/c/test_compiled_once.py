"""The C library with solvers and the Python extension share what they are built from: crates are compiled once for both
if and only if the two ask for the same features of every dependency.
"""

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def asked_for(package: str) -> dict[str, set[str]]:
    """By dependency and version, the features that a package of the workspace leads to, of programs and of macros."""
    if shutil.which("cargo") is None:
        pytest.skip("no cargo here to tell what is compiled")
    command = ["cargo", "tree", "--locked", "--package", package, "--edges", "normal,build", "--no-dedupe"]
    lines = subprocess.run(
        [*command, "--prefix", "none", "--format", "{p}|{f}"], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout.splitlines()
    features: dict[str, set[str]] = {}
    for line in lines:
        name, _, found = line.partition("|")
        features.setdefault(" ".join(name.split()[:2]), set()).add(found)
    return features


def test_laws_and_solvers_are_compiled_once() -> None:
    here, there = asked_for("viscera-c"), asked_for("viscera-python")
    both = here.keys() & there.keys()
    assert {"viscera-law", "viscera-solid"} <= {name.split()[0] for name in both}
    other = {name: (here[name], there[name]) for name in both if here[name] != there[name]}
    assert other == {}, "name their features in bindings/c/Cargo.toml"
