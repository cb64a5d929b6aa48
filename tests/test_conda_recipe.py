"""The conda recipe asks for what the package asks for."""

from __future__ import annotations

import re
import sys
from pathlib import Path

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parent.parent
RECIPE = (ROOT / "packaging/conda/recipe.yaml").read_text(encoding="utf-8")
CONDA_NAMES = {"matplotlib": "matplotlib-base"}
"""Where conda-forge calls a package otherwise."""


def requirements(text: str) -> set[tuple[str, str]]:
    """Name and versions of each requirement in a list of lines."""
    return {
        (name, versions) for name, versions in re.findall(r"^\s*(?:- |then: )?([\w.-]+) ?([<>=][^;\n]*)$", text, re.M)
    }


def test_it_asks_for_what_the_package_asks_for() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    wanted = requirements("\n".join(line.partition(";")[0] for line in project["project"]["dependencies"]))
    wanted = {(CONDA_NAMES.get(name, name), versions) for name, versions in wanted}
    wanted.add(("python", project["project"]["requires-python"]))
    assert requirements(RECIPE.partition("  run:")[2].partition("tests:")[0]) == wanted
    assert requirements(RECIPE.partition("  host:")[2].partition("  run:")[0]) == requirements(
        "\n".join(project["build-system"]["requires"])
    )


def test_it_is_of_this_version() -> None:
    cargo = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))
    assert f"version: {cargo['workspace']['package']['version']}\n" in RECIPE
