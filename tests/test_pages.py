"""README and documentation keep their word: programs run, outputs are shown, links lead somewhere."""

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parent.parent


def _load(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


pages = _load(ROOT / "scripts" / "pages.py")
figures = _load(ROOT / "scripts" / "figures.py")
every_page = pytest.mark.parametrize("page", [*pages.PAGES, ROOT / "CONTRIBUTING.md"], ids=lambda page: page.name)


@every_page
def test_programs_print_what_the_page_shows(page: Path, tmp_path: Path) -> None:
    """All Python programs run, too; `make check-pages` adds the programs that take minutes."""
    differences = pages.untrue(page.read_text(encoding="utf-8"), pages.furnish(tmp_path), with_long=False)
    assert not differences, "run `make pages`, or find out why:\n" + "\n".join(differences)


@every_page
def test_marked_programs_show_an_output(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    shown = [match["output"].strip() for match in pages.MARKED.finditer(text)]
    assert len(shown) == text.count("<!-- run"), "a mark that is none"
    assert all(shown), f"run `make pages`: {page.name} has a program without its output"


STAMP = re.compile(
    r"^printed (on \d{4}-\d\d-\d\d at|by \d{4}-\d\d-\d\d, kept in) commit [0-9a-f]{7,40}( with changes)?; "
    r"load (\d+\.\d\d|not recorded), (\d+ threads?|threads not recorded)$",
    re.MULTILINE,
)
RESULTS = ROOT / "benchmarks" / "results"


@pytest.mark.parametrize("path", sorted(RESULTS.rglob("*.*")), ids=lambda path: str(path.relative_to(RESULTS)))
def test_a_kept_result_says_when_and_how_it_was_printed(path: Path) -> None:
    """In one of its first lines; JSON in those of its table, the tables of a study have one stamp for their folder."""
    stamped = path.with_suffix(".txt") if path.suffix in {".txt", ".json"} else path.with_name("printed.txt")
    assert STAMP.search("\n".join(stamped.read_text(encoding="utf-8").splitlines()[:3]))


def test_the_stamp_of_a_benchmark_is_what_kept_results_need(monkeypatch: pytest.MonkeyPatch) -> None:
    if not (ROOT / ".git").exists():
        pytest.skip("no working copy of git, so no commit to name")
    monkeypatch.setenv("RAYON_NUM_THREADS", "1")
    machine = _load(ROOT / "benchmarks" / "machine.py")
    assert STAMP.fullmatch(machine.stamp())
    assert machine.stamp().endswith(", 1 thread")
    assert machine.stamp(3).endswith(", 3 threads")
    assert machine.describe().splitlines()[1:] == [machine.stamp()]


@pytest.mark.parametrize(
    ("shown", "printed"),
    [
        ("force 149.1 N, 6 iterations", "force  149.2 N,  6 iterations"),
        ("energy 15.61 J in 0.16 s", "energy 15.61 J in 12.9 s"),
        ("8.76e-12, -8.3e-13 N", "-3.1e-11, 2.2e-13 N"),
        ("residual 5e-03", "residual 6e-03"),
        ("2613 points", "2613 points"),
        ("time in units of one\nLinear  1.2  20\nerror 3.1 %", "time in units of one\nLinear  0.8  20\nerror 3.1 %"),
    ],
)
def test_what_another_machine_may_print(shown: str, printed: str) -> None:
    assert pages.differences(shown, printed) == []


@pytest.mark.parametrize(
    ("shown", "printed"),
    [
        ("force 149.1 N", "force 149.4 N"),
        ("6 iterations", "7 iterations"),
        ("converged", "step too small"),
        ("residual 5e-03", "residual 5e-02"),
        ("a reaction of -0.2024 N", "a reaction of 0.2024 N"),
        ("one\ntwo", "one"),
        ("time in units of one\nLinear  1.2  20\nerror 3.1 %", "time in units of one\nLinear  0.8  20\nerror 3.5 %"),
        ("0.16 s", "0.16 m"),
    ],
)
def test_what_no_machine_may_print(shown: str, printed: str) -> None:
    assert len(pages.differences(shown, printed)) == 1


def test_a_page_that_tells_a_falsehood_is_found(tmp_path: Path) -> None:
    def page(marks: str, output: str) -> str:
        return (
            f"<!-- run{marks} -->\n```sh\necho 41 nodes\n```\n<!-- output -->\n```text\n{output}\n```\n<!-- end -->\n"
        )

    run = pages.runner(tmp_path)
    assert pages.untrue(page("", "41 nodes"), run, with_long=False) == []
    assert pages.untrue(page("", "42 nodes"), run, with_long=False) == ["shown: 42 nodes\nprinted: 41 nodes"]
    assert pages.untrue(page(", varying", "42 nodes"), run, with_long=False) == []
    assert pages.untrue(page(", varying", "41 cells"), run, with_long=False) != []
    assert pages.untrue(page(", long", "42 nodes"), run, with_long=False) == []
    assert pages.untrue(page(", long", "42 nodes"), run, with_long=True) != []


@every_page
def test_figures_of_a_page_stand_in_a_result(page: Path) -> None:
    """Two pages that quote one result quote it alike."""
    assert figures.unfounded(page.name, page.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    ("prose", "unfounded"),
    [
        ("It takes 0.08 us.", []),
        ("It takes 76 ns.", []),
        ("It takes 0.11 us.", ["0.11 us"]),
        ("It takes 81 ns.", ["81 ns"]),
        ("It takes 46 s and 12 MB.", ["46 s", "12 MB"]),
        ("Every 8 mm, at 60 Hz, as in 1.5e-3 s of code.", []),
        ("It is 7.6 % of that.", []),
        ("It is 7.5 % of that.", ["7.5 %"]),
    ],
)
def test_a_figure_from_nowhere_is_found(
    prose: str, unfounded: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(figures, "RESULTS", tmp_path)
    (tmp_path / "cell.txt").write_text("microseconds per cell\nneo_hookean  0.076\n", encoding="utf-8")
    page = f"# Cells\nSee [the table](../benchmarks/results/cell.txt). {prose}\n# Others\nNothing.\n"
    assert figures.unfounded("cells.md", page) == [f"{figure} (under 'Cells')" for figure in unfounded]


@every_page
def test_relative_links_lead_somewhere(page: Path) -> None:
    targets = re.findall(r"\]\((?!https?:|#)([^)#]+)", page.read_text(encoding="utf-8"))
    missing = [target for target in targets if not (page.parent / target).exists()]
    assert not missing


def test_the_reference_of_case_files_is_what_they_are_checked_against() -> None:
    case_page = _load(ROOT / "scripts" / "case_page.py")
    assert case_page.PAGE.read_text(encoding="utf-8") == case_page.page(), "run `make pages`"


def test_the_law_that_contributors_are_shown_is_the_one_in_use() -> None:
    shown = pages.programs((ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"), "rust")
    assert shown == [(ROOT / "crates" / "law" / "src" / "yeoh.rs").read_text(encoding="utf-8")]


def test_the_readme_has_a_program() -> None:
    assert pages.programs((ROOT / "README.md").read_text(encoding="utf-8"), "python")


def test_outputs_are_replaced_by_what_the_programs_print(tmp_path: Path) -> None:
    page = """
<!-- run -->
```sh
echo "two ${COLUMNS}" > note; cat note
```
<!-- output -->
stale
<!-- end -->
<!-- run -->
```python
print(open("note").read().split())
```
<!-- output -->
<!-- end -->
"""
    renewed = pages.render(page, pages.runner(tmp_path))
    assert "stale" not in renewed
    assert "```text\ntwo 100\n```" in renewed
    assert "```text\n['two', '100']\n```" in renewed
    assert pages.render(renewed, pages.runner(tmp_path)) == renewed
