"""Processor time of what `make` compiles, each target in turn, from an empty folder.

    python scripts/build_times.py [TARGET ...]

`make build-times` keeps it in benchmarks/results/build.txt.

What a target shares with those before it is compiled with the first, as in `make test`. Processor time depends less on
what else the machine does than time on the wall; on several cores the latter is shorter.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

ROOT = Path(__file__).resolve().parent.parent
PAGE = [
    *("build", "--profile", "wasm", "--package", "viscera-wasm", "--target", "wasm32-unknown-unknown"),
    *("--no-default-features", "--features"),
]
TARGETS = {
    "extension": ["build", "--release", "--package", "viscera-python"],
    "Rust tests": ["test", "--release", "--workspace", "--no-run"],
    "C library": ["build", "--release", "--package", "viscera-c"],
    "clippy": ["clippy", "--workspace", "--all-targets"],
    "evaluator.wasm": [*PAGE, "evaluator"],
    "stepper.wasm": [*PAGE, "stepper"],
}
"""Arguments of cargo, as in the Makefile."""


def main(names: list[str]) -> None:
    """Print one line per target: minutes of processor time, minutes on the wall."""
    sys.path.insert(0, str(ROOT / "benchmarks"))
    import machine  # type: ignore[import-not-found]

    print(machine.describe(), flush=True)
    print(f"{'target':15} {'processor [min]':>16} {'wall [min]':>11}", flush=True)
    total = 0.0
    with tempfile.TemporaryDirectory(dir=ROOT / "target") as folder:
        for name in names:
            seconds, wall = measure(name, Path(folder))
            total += seconds
            print(f"{name:15} {seconds / 60:16.1f} {wall / 60:11.1f}", flush=True)
    print(f"{'all':15} {total / 60:16.1f}", flush=True)


def measure(name: str, folder: Path) -> tuple[float, float]:
    """Processor time and time on the wall of one target [s]."""
    flags = "-C target-feature=+simd128" if name.endswith(".wasm") else ""
    # Clippy has a folder of its own in the Makefile, too.
    target = folder / ("lint" if name == "clippy" else "build")
    began, before = perf_counter(), processor_time()
    environment = {**os.environ, "CARGO_TARGET_DIR": str(target), "RUSTFLAGS": flags}
    subprocess.run(["cargo", *TARGETS[name], "--quiet", "--locked"], cwd=ROOT, env=environment, check=True)
    return processor_time() - before, perf_counter() - began


def processor_time() -> float:
    """Of all child processes that have ended [s]."""
    times = os.times()
    return times.children_user + times.children_system


if __name__ == "__main__":
    unknown = sorted(set(sys.argv[1:]) - set(TARGETS))
    if unknown:
        sys.exit(f"no target is called {unknown[0]!r}; there are {', '.join(TARGETS)}")
    main(sys.argv[1:] or list(TARGETS))
