"""What a case file holds of the wrong kind is refused in a sentence that names it, and so is what is no case file."""

from __future__ import annotations

from pathlib import Path

import pytest

import viscera as vs
from viscera.cases.case import read_case

HEAD = 'mesh = "organ:beam"\nfixed = "clamp"\nmaterial = {law = "Linear", mu = 1e5, lam = 1e5}\n'
MADE = 'mesh = "organ:beam"\nfixed = "clamp"\nmaterial = {law = "NeoHookean", poisson = 0.3, '

OWN = MADE.replace('"NeoHookean", poisson = 0.3', '"StrainEnergy", energy = "stiff*(I1bar - 3) + 1e4*(J - 1)**2"')


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (HEAD.replace('"Linear"', "1"), "law 1 is unknown; known: 'ArrudaBoyce'"),
        (HEAD.replace('"organ:beam"', "1"), "mesh must be words in quotes, got 1"),
        ("units = []\n" + HEAD, r"units, .*must be a number above 0 .*, got \[\]"),
        ("units = true\n" + HEAD, "units.* must be a number above 0 .*, got True"),
        (HEAD + "loads = {density = {}}", r"density in \[loads\] must be a number above 0 .*, got {}"),
        (HEAD + 'loads = {density = "1000"}', r"density in \[loads\] must be a number above 0 .*, got '1000'"),
        (HEAD + "settings = {newton = 1}", "'settings.newton' is a table, written as"),
        (HEAD + "reduce = {tolerance = []}", r"tolerance in \[reduce\] must be a number above 0 and below 1, got \[\]"),
        (HEAD + "reduce = {start = []}", r"start in \[reduce\] \[\] is unknown; known: 'loads', 'rest', 'scan'"),
        (HEAD + 'reduce.vary = {parameter = "young", low = "a", high = 2}', r"low in \[reduce.vary\]"),
        (
            HEAD + 'reduce.vary = {parameter = "young", low = "5%", high = 2}',
            r"low in \[reduce.vary\] must be a number",
        ),
        (
            HEAD + 'reduce.vary = {parameter = "young", low = "1 kPa", high = 2e3}',
            r"low in \[reduce.vary\] must be a number in Pa, as every stiffness is, .* got '1 kPa'",
        ),
        (
            HEAD + 'reduce.vary = {parameter = "poisson", low = 0.3, high = "40%"}',
            r"high in \[reduce.vary\] must be a number without unit, got '40%'",
        ),
        (
            HEAD + 'reduce.vary = {parameter = "poisson", low = 0.1, high = 0.6}',
            r"high in \[reduce.vary\] must be a number above -1 and below 0.5, got 0.6",
        ),
        (
            HEAD + 'reduce.vary = {parameter = "young", low = 0, high = 2}',
            r"low in \[reduce.vary\] must be a number above 0 and at most 1e\+15 \[Pa\], got 0",
        ),
        (
            HEAD + 'reduce.vary = {parameter = "young", low = 1e5, high = 1e4}',
            r"\[reduce.vary\]: the range of young runs from 100000 to 10000; it must ascend",
        ),
        (
            HEAD + 'reduce.vary = {parameter = "radius", low = "5 cm", high = "20 mm"}',
            r"\[reduce.vary\]: the range of radius runs from 5 cm to 20 mm; it must ascend",
        ),
        (
            HEAD + 'reduce.vary = {parameter = "radius", low = "5%", high = "8%", part = "x < 1%"}',
            r"\[reduce.vary\]: the contact radius belongs to no part of the organ",
        ),
        (HEAD + 'reduce.start = "loads"', r'start = "loads" in \[reduce\] needs loads in a table \[loads\]; give them'),
        (HEAD + 'reduce.start = "loads"\nloads.density = 1e3', r'start = "loads" in \[reduce\] needs loads'),
        (HEAD + 'reduce.start = "scan"', r'start = "scan" in \[reduce\] needs the loads of the scan'),
        (HEAD + "reduce.order = 2\nscan.force.tip = [0, 0, 1]", r"a case with a \[scan\] must say what is touched"),
        (
            HEAD + 'reduce.vary = {parameter = "radius", low = "1 kPa", high = "2 cm"}',
            r"low in \[reduce.vary\] '1 kPa' is not a length",
        ),
        (MADE + "young = true}", r"young in \[material\] must be a number above 0 .*, got True"),
        (MADE + 'young = "1e5"}', r"young in \[material\] must be a number above 0 .*, got '1e5'"),
        (HEAD + "loads = {gravity = [true, false, true], density = 1}", r"gravity in \[loads\] must be three finite"),
        (HEAD + "loads = {gravity = [0, true, 1], density = 1}", r"gravity in \[loads\] must be three finite numbers"),
        (HEAD + 'reduce = {pade = "no"}', r"pade in \[reduce\] must be true or false, got 'no'"),
        (HEAD + "settings = {steps = true}", r"steps in \[settings\] must be a whole number from 1 to 10000, got True"),
        (HEAD + "settings = {steps = 99999999}", "steps .* must be a whole number from 1 to 10000, got 99999999"),
        (HEAD + "settings.newton = {max_iterations = 1.5}", "max_iterations .* must be a whole number from 1 to 10000"),
        (
            HEAD + "settings.newton = {max_iterations = 1e300}",
            "max_iterations .* must be a whole number from 1 to 10000",
        ),
        (
            HEAD + "loads.displacement.tip = [0, 0, -1e100]",
            r"displacement of 'tip' must be a number from -1000 to 1000 \[m\], got -1e\+100",
        ),
        (HEAD + "loads.force.tip = [0, 0, -1e100]", "force of 'tip' must be three finite numbers"),
        (MADE + "young = {}}", r"young in \[material\] must be a number above 0 .*, got {}"),
        (MADE + "young = {poisson = 0.3}}", r"young in \[material\] must be a number above 0 .*, got {'poisson': 0.3}"),
        (MADE + 'young = {law = "Yeoh"}}', r"young in \[material\] must be a number above 0 .*, got {'law': 'Yeoh'}"),
        (MADE + "young = 1e5, kappa = {young = 1e4}}", r"\[material.kappa\] is no table of a part, for 'kappa' is the"),
        (MADE + "young = 1e5, lam = {}}", r"lam in \[material\] must be a number .*, got {}"),
        (OWN + "stiff = {}}", r"stiff in \[material\] must be a number .*, got {}"),
        (OWN + "stiff = 1e3, c = {stiff = 1e4}}", r"\[material.c\] is no table of a part, for 'c' is the name of a"),
        (
            OWN.replace('"stiff', '{}, b = "') + "stiff = 1e3}",
            r"energy in \[material\] must be a formula in quotes, got {}",
        ),
    ],
)
def test_what_is_of_the_wrong_kind_is_refused_in_words(tmp_path: Path, words: str, sentence: str) -> None:
    (tmp_path / "case.toml").write_text(words, encoding="utf-8")
    with pytest.raises(vs.VisceraError, match=f"case.toml: {sentence}"):
        read_case(tmp_path / "case.toml")


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"mesh = " + b"[" * 100_000, "not a TOML file"),
        (b"mesh = \xff", "not in UTF-8"),
        (b"mesh = 1" + b"0" * 5000, "not a TOML file|mesh must be words"),
    ],
)
def test_what_is_no_case_file_is_refused_in_words(tmp_path: Path, content: bytes, sentence: str) -> None:
    (tmp_path / "case.toml").write_bytes(content)
    with pytest.raises(vs.VisceraError, match=f"case.toml: ({sentence})"):
        read_case(tmp_path / "case.toml")
    with pytest.raises(vs.VisceraError, match="is a folder"):
        read_case(tmp_path)
