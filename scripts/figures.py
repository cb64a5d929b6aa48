"""Finds measured figures that a page quotes from nowhere, so that no two pages quote different ones for one thing.

A time, a rate or a size in bytes in the prose of a page stands in a kept result that its section names, or in a program
or an output that the section shows, in the same or a related unit, to the digits quoted. So does a percentage with
decimals where its section names a result. What is chosen, not measured, is listed in `CHOSEN`.

    python scripts/figures.py [PAGE ...]
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "benchmarks" / "results"
CHOSEN = {
    "contact.md": {"1.5 %"},  # height of the layer at most, of the diagonal
    "real-time.md": {"8 ms"},  # budget of a frame
    "solvers.md": {"0.1 us"},  # the aim of the project
    # Budget of a frame, limits of an export and of a film, memory of a browser.
    "viewer.md": {"8 ms", "25 MB", "20 seconds", "2 GB"},
}
"""Figures of a page that are aims, budgets and limits."""
FAMILIES = (
    {"ns": 1e-9, "us": 1e-6, "microseconds": 1e-6, "ms": 1e-3, "s": 1.0, "seconds": 1.0, "minutes": 60.0},
    {"kB": 1e3, "MB": 1e6, "GB": 1e9},
    {"MB/s": 1e6, "GB/s": 1e9},
)
UNITS = {unit: family for family in FAMILIES for unit in family}
NAMED = re.compile(r"benchmarks/results/([\w./-]+\.(?:txt|csv))")
BLOCK = re.compile(r"^```.*?^```\s*$", re.DOTALL | re.MULTILINE)
FIGURE = re.compile(rf"(?<![\w.,/^-])(\d+(?:\.\d+)?)\s+({'|'.join(sorted(UNITS, key=len, reverse=True))}|%)(?![\w/])")
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def unfounded(page: str, text: str) -> list[str]:
    """The figures of a page that no result, program or output of their section has."""
    found = []
    for section in re.split(r"^#+ ", text, flags=re.MULTILINE):
        named = {RESULTS / name for name in NAMED.findall(section)}
        results = [path.read_text(encoding="utf-8") for path in sorted(named) if path.is_file()]
        shown = results + BLOCK.findall(section)
        for value, unit in FIGURE.findall(BLOCK.sub("", section)):
            is_measured = unit != "%" or (bool(results) and "." in value)
            figure = f"{value} {unit}"
            if is_measured and figure not in CHOSEN.get(page, set()) and not _stands_in(value, unit, shown):
                found.append(f"{figure} (under {section.splitlines()[0]!r})")
    return found


def _stands_in(value: str, unit: str, texts: list[str]) -> bool:
    half = 0.5 * 10.0 ** -len(value.partition(".")[2]) * (1 + 1e-9)
    return any(
        abs(abs(float(number)) * scale - float(value)) <= half
        for text in texts
        for scale in _scales(unit, text)
        for number in NUMBER.findall(text)
    )


def _scales(unit: str, text: str) -> list[float]:
    """Factors from the units that a text names to the one asked for; of a share also from a fraction."""
    if unit == "%":
        return [100.0, *([1.0] if re.search("%|per cent", text) else [])]
    family = UNITS[unit]
    return [size / family[unit] for each, size in family.items() if re.search(rf"(?<![A-Za-z/]){each}(?![\w/])", text)]


def main(pages: list[Path]) -> int:
    """Print what stands on nothing."""
    wrong = [
        f"{page.name}: {each}" for page in pages for each in unfounded(page.name, page.read_text(encoding="utf-8"))
    ]
    print("\n".join(wrong) or "every figure stands in a result")
    return 1 if wrong else 0


if __name__ == "__main__":
    given = [Path(name) for name in sys.argv[1:]]
    sys.exit(main(given or [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]))
