"""The simulated haptic device: a few seconds of the benchmark, and what must hold in any of them."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

DEVICE = Path(__file__).resolve().parents[2] / "bindings" / "c" / "device"
SOURCES = [f"device/{path.name}" for path in sorted(DEVICE.glob("*.c"), key=lambda p: p.stem != "haptic_loop")]
Build = Callable[..., Path]

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the device keeps time with Linux's clock")


def loop(program: Path, model: Path, seconds: float) -> str:
    command = [str(part) for part in (program, model, DEVICE / "palpation.csv", seconds)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, f"exit {done.returncode}: {done.stdout}{done.stderr}"
    return done.stdout


def test_a_loop_asks_for_no_memory_and_tears_no_value(model: Path, build: Build) -> None:
    output = loop(build(*SOURCES, linkage="shared"), model, 2)
    assert "allocations: 0\n" in output
    assert "torn values: 0\n" in output
    ticks = re.findall(r"(\d+) ticks: (\d+) trusted, (\d+) not, (\d+) free; (\d+) missed, 0 of them", output)
    assert len(ticks) == 2
    for total, trusted, *others, missed in ticks:
        assert int(total) == 1000
        assert int(trusted) > 100, "the hand touches"
        assert sum(map(int, [trusted, *others, missed])) == 1000
    assert sum(int(free) for *_, free, _ in ticks) > 50, "the hand lifts off"
    assert re.search(r"silence: the force was zero \d+ ms after", output)


def test_the_counter_counts(build: Build) -> None:
    """Nothing else shows that zero allocations are none."""
    done = subprocess.run([build("tests/counts.c", "device/allocations.c")])
    if done.returncode == 77:
        pytest.skip("allocations are counted with glibc only")
    assert done.returncode == 0


def test_a_recording_that_cannot_be_played_is_refused(model: Path, build: Build, tmp_path: Path) -> None:
    program = build(*SOURCES, linkage="shared")
    for content, sentence in [(None, "cannot be opened"), ("across,across\n1,2\n", "is not a table")]:
        recording = tmp_path / "recording.csv"
        if content is not None:
            recording.write_text(content)
        done = subprocess.run([program, model, recording, "1"], capture_output=True, text=True)
        assert done.returncode == 2
        assert sentence in done.stderr
    assert subprocess.run([program, model, recording, "-1"], capture_output=True).returncode == 2


def test_the_recording_is_what_its_script_writes() -> None:
    sys.path.insert(0, str(DEVICE))
    try:
        import palpation
    finally:
        sys.path.remove(str(DEVICE))
    recorded = np.loadtxt(DEVICE / "palpation.csv", delimiter=",", skiprows=2)
    np.testing.assert_allclose(recorded, palpation.palpation(), atol=6e-5)


@pytest.mark.parametrize("sanitizer", ["address,undefined", "thread"])
def test_sanitizers_find_nothing(model: Path, build: Build, tmp_path: Path, sanitizer: str) -> None:
    """The C side is instrumented, and all memory of both sides is the sanitizer's."""
    flags = ("-g", f"-fsanitize={sanitizer}", "-fno-sanitize-recover=all")
    probe = tmp_path / "probe.c"
    probe.write_text("int main(void) { return 0; }\n")
    if subprocess.run(["cc", *flags, probe, "-o", tmp_path / "probe"], capture_output=True).returncode != 0:
        pytest.skip(f"the compiler has no -fsanitize={sanitizer}")
    loop(build(*SOURCES, flags=flags), model, 1)
    if sanitizer != "thread":
        for source in ("tests/refusals.c", "examples/haptic.c"):
            done = subprocess.run([build(source, flags=flags), model], capture_output=True, text=True)
            assert done.returncode == 0, done.stdout + done.stderr
