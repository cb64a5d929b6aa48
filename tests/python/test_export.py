"""A page that is exported into a folder: it replaces an earlier export, and nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest

import viscera as vs
from viscera.cases.case import Case
from viscera.viewer import page
from viscera.viewer.export import export_case


@pytest.fixture
def case(bar: vs.Mesh, tmp_path: Path) -> Case:
    try:
        page.stepping_files()
    except vs.VisceraError as error:
        pytest.skip(str(error))
    return vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.4), fixed="root").to_case(tmp_path / "bar.toml")


def test_an_earlier_export_is_replaced(case: Case, tmp_path: Path) -> None:
    site = tmp_path / "site"
    names = export_case(case, site, "Bar").files
    (site / "CNAME").write_text("organs.example")
    (site / page.CASE).write_bytes(b"an earlier organ")
    assert export_case(case, site, "Bar").files == names
    assert (site / page.CASE).stat().st_size > 1000
    assert (site / "CNAME").read_text() == "organs.example"


def test_a_folder_that_is_somebody_elses_is_refused_and_stays_as_it_is(case: Case, tmp_path: Path) -> None:
    site = tmp_path / "site"
    site.mkdir()
    own = {"index.html": "<title>My page</title>", "page.css": "p { color: red }", "photo.txt": "a liver"}
    for name, content in own.items():
        (site / name).write_text(content)
    with pytest.raises(vs.VisceraError, match=r"holds index\.html, page\.css, which no earlier export wrote"):
        export_case(case, site, "Bar")
    assert {path.name: path.read_text() for path in site.iterdir()} == own


def test_a_folder_with_other_files_alone_takes_a_page(case: Case, tmp_path: Path) -> None:
    site = tmp_path / "site"
    site.mkdir()
    (site / "README.md").write_text("about this site")
    assert "index.html" in export_case(case, site, "Bar").files
    assert (site / "README.md").read_text() == "about this site"
