"""Sizes of the C library as `make c-library` builds it, and of a program with it:

python benchmarks/c_library.py
"""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BUILT = ROOT / "target" / "c"
SOURCES = ROOT / "bindings" / "c"


def sizes(folder: Path) -> dict[str, int]:
    """Bytes of the libraries."""
    end = "so" if (folder / "libviscera.so").exists() else "dylib"
    names = [f"libviscera.{end}", "libviscera.a", f"libviscera_hands.{end}"]
    return {name: (folder / name).stat().st_size for name in names}


def program(folder: Path, flags: list[str]) -> int:
    """Bytes of the example of a haptic loop, linked statically."""
    system = (folder / "viscera.pc").read_text().split("Libs.private:")[1].split()
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "haptic"
        sources = [f"-I{SOURCES / 'include'}", str(SOURCES / "examples" / "haptic.c"), str(folder / "libviscera.a")]
        subprocess.run(["cc", "-O2", *flags, *sources, *system, "-lm", "-o", str(path)], check=True)
        return path.stat().st_size


def main() -> None:
    """Print the table of docs/c-library.md."""
    rows = sizes(BUILT)
    rows["haptic.c with libviscera.a"] = program(BUILT, [])
    rows["the same, cc -s"] = program(BUILT, ["-s"])
    rows = {name: rows[name] for name in sorted(rows, key=lambda name: "hands" in name)}
    for name, size in rows.items():
        print(f"{name:<28} {size / 1e6:5.2f} MB")


if __name__ == "__main__":
    main()
