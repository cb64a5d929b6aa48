"""How soon a command ends after Ctrl-C: the seconds from the signal to the end of the process, command by command.

Every command works on the built-in liver, for long enough that the signal finds it at work: once while it starts, then
at seeded times up to ten seconds. It must end by itself, with the exit code of an interrupt and no traceback.

    python benchmarks/interrupt.py            # a minute and a half
"""

import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter, sleep

import meshio
import numpy as np
from machine import describe

import viscera as vs

LIMIT = 1.0
"""A person who presses Ctrl-C waits so long [s] without pressing it again."""
TIMES = [0.3, *np.random.default_rng(12).uniform(1.0, 10.0, 4).round(1).tolist()]
"""Of the signal, after the start of the command [s]."""

CASE = """
mesh = "organ:liver"
fixed = "hilum"
[material]
law = "NeoHookean"
young = 3e3
poisson = 0.45
[loads]
gravity = [0, 0, -9.81]
density = 1060
[settings]
steps = 10000
[reduce]
touchable = "anterior"
"""

COMMANDS = {
    "solve": ["solve", "liver.toml", "-o", "liver.vtu"],
    "solve, P2": ["solve", "quadratic.toml", "-o", "quadratic.vtu"],
    "reduce": ["reduce", "liver.toml", "-o", "liver.viscera"],
    "compare": ["compare", "liver.toml", "-o", "compared"],
    "mesh": ["mesh", "liver.stl", "--units", "m", "--edge", "2mm", "-o", "fine.vtu"],
    "study": ["study", "liver", "-o", "study"],
}


def interrupted(words: list[str], after: float, folder: Path) -> float | None:
    """Seconds [s] that a command takes to end after Ctrl-C; None if it had ended before."""
    command = [sys.executable, "-m", "viscera", *words]
    work = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    sleep(after)
    if work.poll() is not None:
        if work.returncode != 0:
            sys.exit(f"{words[0]} ended by itself: {work.communicate()[0]}")
        return None
    began = perf_counter()
    work.send_signal(signal.SIGINT)
    output, _ = work.communicate(timeout=300)
    waited = perf_counter() - began
    if work.returncode not in (130, -signal.SIGINT) or "Traceback" in output:
        sys.exit(f"{words[0]}, interrupted after {after} s, ended with code {work.returncode}:\n{output}")
    return waited


print(describe())
print("Ctrl-C after [s]" + "".join(f"{after:9.1f}" for after in TIMES) + "     largest [s]")
slow = []
with tempfile.TemporaryDirectory() as scratch:
    folder = Path(scratch)
    (folder / "liver.toml").write_text(CASE)
    (folder / "quadratic.toml").write_text('element = "P2"\n' + CASE)
    liver = vs.organs.liver()
    meshio.write(folder / "liver.stl", meshio.Mesh(liver.points, [("triangle", liver.surface)]))
    for name, words in COMMANDS.items():
        waits = [interrupted(words, after, folder) for after in TIMES]
        told = "".join("    ended" if wait is None else f"{wait:9.2f}" for wait in waits)
        largest = max((wait for wait in waits if wait is not None), default=0.0)
        print(f"{name:16s}{told}{largest:16.2f}", flush=True)
        if largest > LIMIT:
            slow.append(name)
sys.exit(f"slower than {LIMIT:.0f} s: {', '.join(slow)}" if slow else 0)
