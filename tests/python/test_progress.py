"""Long work is seen wherever it runs, by lines or by a bar; Ctrl-C ends a command that has just begun."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
from time import sleep
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

import viscera as vs
from viscera import progress


def wait_for(condition: Any) -> None:
    for _ in range(1000):
        if condition():
            return
        sleep(0.01)
    pytest.fail("nothing was shown within ten seconds")


def test_without_a_terminal_there_are_lines(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(progress, "LINE_EVERY", 0.02)
    told: list[str] = []

    def has_told(words: str) -> bool:
        told.append(capsys.readouterr().err)
        return words in "".join(told)

    with progress.bar() as show:
        wait_for(lambda: has_told("working, 0 s\n"))  # before the first event
        show(3, 10, "positions")
        wait_for(lambda: has_told("positions 3/10, 0 s\n"))
    capsys.readouterr()
    sleep(0.1)
    assert capsys.readouterr().err == ""


def test_quiet_is_silent(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(progress, "LINE_EVERY", 0.01)
    with progress.bar(is_quiet=True) as show:
        show(3, 10, "positions")
        sleep(0.1)
    assert capsys.readouterr().err == ""


class Display:
    """What a notebook's cell shows."""

    def __init__(self) -> None:
        self.states: list[str] = []
        self.bars = 0

    def __call__(self, drawn: str, display_id: bool) -> Display:
        self.bars += 1
        self.update(drawn)
        return self

    def update(self, drawn: str) -> None:
        self.states.append(drawn)


@pytest.fixture
def cell(monkeypatch: pytest.MonkeyPatch) -> Display:
    """As if a Jupyter kernel ran this, in a hurry."""
    shown = Display()
    notebook, display = ModuleType("IPython"), ModuleType("IPython.display")
    vars(notebook).update(get_ipython=lambda: SimpleNamespace(kernel=object()), display=display)
    vars(display).update(HTML=str, display=shown)
    monkeypatch.setitem(sys.modules, "IPython", notebook)
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    monkeypatch.setattr(progress, "PATIENCE", 0.02)
    monkeypatch.setattr(progress, "REDRAW_EVERY", 0.02)
    return shown


def test_a_notebook_shows_one_bar_by_itself(cell: Display) -> None:
    """One for the work, none for the work within it; nothing after it."""

    @progress.shown
    def inner(progress: progress.Progress | None = None) -> None:
        assert progress is None
        sleep(0.1)

    @progress.shown
    def outer(progress: progress.Progress | None = None) -> int:
        inner()
        assert progress is not None
        progress(1, 2, "<stage>")
        wait_for(lambda: "&lt;stage&gt; 1/2, 0 s" in cell.states[-1])
        return 7

    assert outer() == 7
    assert cell.bars == 1
    assert "outer, 0 s" in cell.states[0]
    seen = len(cell.states)
    sleep(0.1)
    assert len(cell.states) == seen
    assert threading.active_count() < 10


def test_what_is_quick_or_watched_shows_no_bar(cell: Display, monkeypatch: pytest.MonkeyPatch, bar: vs.Mesh) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    seen: list[int] = []

    def mine(done: int, total: int, stage: str) -> None:
        seen.append(done)
        sleep(0.1)

    organ.solve(force={"tip": (0, 0, -1)}, progress=mine)
    assert seen
    monkeypatch.setattr(progress, "PATIENCE", 60.0)
    organ.solve(force={"tip": (0, 0, -1)})
    assert cell.bars == 0


def test_a_solution_in_a_notebook_tells_its_load(cell: Display, bar: vs.Mesh) -> None:
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    organ.solve(force={"tip": (0, 0, -2)}, steps=200)
    assert cell.bars == 1
    assert any("load " in state for state in cell.states)


@pytest.mark.skipif(sys.platform == "win32", reason="its Ctrl-C goes to the whole console")
def test_ctrl_c_while_modules_load_is_no_traceback() -> None:
    words = [sys.executable, "-X", "importtime", "-m", "viscera", "--version"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as command:
        assert command.stderr is not None
        before = iter(command.stderr.readline, "")
        assert any("viscera.startup" in line for line in before)
        command.send_signal(signal.SIGINT)
        _, rest = command.communicate(timeout=30)
    assert "Traceback" not in rest
    assert command.returncode == -signal.SIGINT


DROPPED = """
import os, signal, sys, time, weakref
sys.argv = ["viscera", "doctor"]
from viscera import cli
from viscera.cli.output import Outcome

class Body:
    def __del__(self):
        if way == "del":
            interrupt()

def interrupt(_=None):
    os.kill(os.getpid(), signal.SIGINT)
    for _ in range(10**9):
        pass

def run(args, output):
    body = Body()
    watch = weakref.ref(body, interrupt if way == "callback" else None)
    del body
    print("dropped", flush=True)
    end = time.monotonic() + seconds
    if waits:
        time.sleep(seconds)
    while time.monotonic() < end:
        pass
    return Outcome("done")

cli.doctor.run = run
sys.exit(cli.main())
"""


@pytest.mark.skipif(sys.platform == "win32", reason="its Ctrl-C goes to the whole console")
@pytest.mark.parametrize(
    ("way", "seconds", "waits"),
    [("callback", 30, False), ("del", 30, False), ("del", 30, True), ("callback", 0, False)],
)
def test_ctrl_c_is_heard_where_python_drops_it(way: str, seconds: int, waits: bool) -> None:
    """In callbacks of weak references and in __del__, while the command works or waits, and as it ends."""
    program = f"way, seconds, waits = {way!r}, {seconds}, {waits}\n{DROPPED}"
    command = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=20)
    assert command.stdout == "dropped\n"
    assert command.stderr == "viscera doctor: interrupted; nothing was left half-written\n"
    assert command.returncode == 130


def test_what_else_python_drops_is_told_as_ever() -> None:
    program = """
import sys
from viscera.cli import interrupt

class Body:
    def __del__(self):
        raise ValueError("of a body")

before = sys.unraisablehook
with interrupt.heard():
    Body()
assert sys.unraisablehook is before
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=20)
    assert "ValueError: of a body" in done.stderr
    assert done.returncode == 0


@pytest.mark.skipif(sys.platform == "win32", reason="its Ctrl-C goes to the whole console")
def test_ctrl_c_while_the_command_line_is_read_is_no_traceback() -> None:
    program = """
import os, signal, sys
sys.argv = ["viscera", "--version"]
from viscera import cli
cli.command_line = lambda: os.kill(os.getpid(), signal.SIGINT)
cli.main()
"""
    command = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert "Traceback" not in command.stderr
    assert command.returncode == -signal.SIGINT
