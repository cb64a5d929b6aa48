"""Case files that are too much for their parser, and errors about entries that are too long to be repeated."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter

import pytest

import viscera as vs
from viscera.cases import toml
from viscera.cases.case import read_case

CASE = """
mesh = "organ:beam"
fixed = "clamp"
material = {law = "NeoHookean", young = 1e5, poisson = 0.3}
"""


def refused(folder: Path, text: str) -> str:
    """The sentence that refuses a case of this text."""
    (folder / "case.toml").write_text(text, encoding="utf-8")
    with pytest.raises(vs.VisceraError) as error:
        read_case(folder / "case.toml").organ()
    told = str(error.value)
    assert told.startswith(f"{folder / 'case.toml'}: "), "the case file is named"
    assert len(told) < len(str(folder)) + 500
    return told


@pytest.mark.parametrize("key", ["{} = 1", "[{}]", "[[{}]]", "x = {{{} = 1}}", "x = {{ 'a' . {} = 1}}"])
def test_a_key_of_many_parts_is_refused_at_once(tmp_path: Path, key: str) -> None:
    began = perf_counter()
    told = refused(tmp_path, CASE + key.format(".".join(["a"] * 100_000)))
    assert perf_counter() - began < 5.0, "the parser needs more than a minute"
    assert "line 5 has a key of 64 parts and more" in told


@pytest.mark.parametrize("text", ["a" * 1_000_000, '"' * 1_000_000, "a. " * 60, '\\"' * 500_000, "." * 1_000_000])
def test_long_texts_take_no_time(tmp_path: Path, text: str) -> None:
    (tmp_path / "case.toml").write_text(f"{CASE}# {text}\n", encoding="utf-8")
    began = perf_counter()
    assert read_case(tmp_path / "case.toml").mesh == "organ:beam"
    assert perf_counter() - began < 5.0


def test_a_key_may_have_as_many_parts_as_any_case_needs(tmp_path: Path) -> None:
    (tmp_path / "case.toml").write_text(f'{CASE}loads.force."x > 90%" = [0, 0, -1]\n# 1.2.3.4.5, v1.2.3\n')
    assert read_case(tmp_path / "case.toml").loads["force"] == {"x > 90%": [0, 0, -1]}


def test_a_file_larger_than_any_case_is_refused(tmp_path: Path) -> None:
    told = refused(tmp_path, CASE + f"# {'a' * toml.LARGEST}\n")
    assert told.endswith("a case file has at most 10 MB; make long lists of nodes and cells sets of the mesh")


LONG = "a" * 5000


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (CASE.replace("organ:beam", f"{LONG}.vtu"), "a... is too long for the name of a file; give a shorter one"),
        (CASE.replace("organ:beam", f"organ:{LONG}"), "mesh: unknown built-in organ 'aaa"),
        (CASE + f"{LONG} = 1", "unknown key 'aaa"),
        (CASE.replace("young", LONG), "unknown key 'aaa"),
        (CASE.replace('"clamp"', f'"x < 1% and ({LONG})"'), "fixed: cannot read '(aaa"),
        (CASE.replace('"clamp"', f'"x < 1% and {LONG}"'), "fixed: 'x < 1% and aaa"),
    ],
)
def test_what_is_too_long_is_not_repeated(tmp_path: Path, text: str, sentence: str) -> None:
    assert sentence in refused(tmp_path, text)
