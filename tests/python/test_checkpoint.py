"""A reduction that is interrupted or killed goes on from its finished batches, and ends with the same model."""

from __future__ import annotations

import os
import signal
import socket
import stat
import subprocess
import sys
import time
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import viscera as vs
from viscera.cli import main
from viscera.reduced.checkpoint import RECORD, Checkpoint

PART = "x > 60%"
"""Of the surface: several batches."""
SETTINGS: dict[str, Any] = {"order": 3, "depth": 0.03, "radius": 0.06}


class Enough(Exception):
    """Raised in the middle of the work."""


@pytest.fixture(scope="module")
def organ() -> vs.Organ:
    return vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")


@pytest.fixture(scope="module")
def whole(organ: vs.Organ, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The model file of a reduction that nothing interrupted, without its time."""
    return contents(organ.reduce(PART, **SETTINGS), tmp_path_factory.mktemp("whole"))


def contents(touch: vs.Touch, folder: Path) -> bytes:
    """All arrays of a model's file: what stands after the header, whose metadata hold the time it took."""
    touch.save(folder / "model.viscera")
    text = (folder / "model.viscera").read_bytes()
    return text[8 + int.from_bytes(text[:8], "little") :]


def stop_after(batches: int, path: Path) -> Any:
    """A progress callback that raises once so many batches are on the disk."""
    sizes: set[int] = set()

    def progress(done: int, total: int, stage: str) -> None:
        if path.exists():
            sizes.add(path.stat().st_size)
        if len(sizes) > batches and done < total:
            raise Enough

    return progress


def test_what_was_stopped_goes_on_and_ends_with_the_same_model(organ: vs.Organ, whole: bytes, tmp_path: Path) -> None:
    path, said = tmp_path / "beam.batches", list[str]()
    with pytest.raises(Enough):
        organ.reduce(PART, **SETTINGS, checkpoint=Checkpoint(path, said.append), progress=stop_after(1, path))
    assert said == []
    kept = path.stat().st_size
    assert kept > 1000
    first: list[int] = []
    touch = organ.reduce(
        PART,
        **SETTINGS,
        checkpoint=Checkpoint(path, said.append),
        progress=lambda done, total, stage: first.append(done),
    )
    assert len(said) == 1
    assert "continuing after" in said[0]
    assert first[0] > 0
    assert contents(touch, tmp_path) == whole
    assert not path.exists()


def test_batches_stay_until_the_model_is_saved(organ: vs.Organ, tmp_path: Path) -> None:
    path = tmp_path / "beam.batches"
    settings = {**SETTINGS, "order": 2}
    touch = organ.reduce("tip", **settings, checkpoint=path)
    (tmp_path / "folder.viscera").mkdir()
    with pytest.raises(vs.VisceraError, match="is a folder"):
        touch.save(tmp_path / "folder.viscera")
    said: list[str] = []
    again = organ.reduce("tip", **settings, checkpoint=Checkpoint(path, said.append))
    assert "continuing after" in said[0]
    again.save(tmp_path / "beam.viscera")
    assert not path.exists()
    touch.save(tmp_path / "beam.viscera")  # nothing is left to remove


def test_a_model_removes_no_batches_but_its_own(organ: vs.Organ, tmp_path: Path) -> None:
    """A later reduction may keep its own in the same file, and a model may take its place."""
    path = tmp_path / "beam.viscera"
    first = organ.reduce("tip", **SETTINGS, checkpoint=path)
    first.save(path)
    assert path.stat().st_size > 0
    path.unlink()
    first = organ.reduce("tip", **SETTINGS, checkpoint=path)
    with pytest.warns(UserWarning, match="of another case"):
        second = organ.reduce("tip", **{**SETTINGS, "order": 2}, checkpoint=path)
    first.save(tmp_path / "first.viscera")
    assert path.exists()
    second.save(tmp_path / "second.viscera")
    assert not path.exists()


def test_a_record_cut_short_is_solved_again(organ: vs.Organ, whole: bytes, tmp_path: Path) -> None:
    path = tmp_path / "beam.batches"
    with pytest.raises(Enough):
        organ.reduce(PART, **SETTINGS, checkpoint=path, progress=stop_after(1, path))
    os.truncate(path, path.stat().st_size - 7)
    said: list[str] = []
    assert contents(organ.reduce(PART, **SETTINGS, checkpoint=Checkpoint(path, said.append)), tmp_path) == whole
    assert not path.exists()


def test_a_damaged_record_is_solved_again(organ: vs.Organ, whole: bytes, tmp_path: Path) -> None:
    path = tmp_path / "beam.batches"
    with pytest.raises(Enough):
        organ.reduce(PART, **SETTINGS, checkpoint=path, progress=stop_after(1, path))
    damaged = bytearray(path.read_bytes())
    damaged[len(damaged) // 2] ^= 4
    path.write_bytes(damaged)
    assert contents(organ.reduce(PART, **SETTINGS, checkpoint=path), tmp_path) == whole


def test_only_what_is_a_batch_counts_as_finished(organ: vs.Organ, whole: bytes, tmp_path: Path) -> None:
    """A second record of the same positions adds nothing, and the core ignores what is none of its own."""
    path, said = tmp_path / "beam.batches", list[str]()
    with pytest.raises(Enough):
        organ.reduce(PART, **SETTINGS, checkpoint=path, progress=stop_after(1, path))
    head, _, records = path.read_bytes().partition(b"\n")
    kept, at = list[bytes](), 0
    while at < len(records):
        length, _ = RECORD.unpack_from(records, at)
        kept.append(records[at : at + RECORD.size + length])
        at += len(kept[-1])
    foreign = b"no batch"
    path.write_bytes(head + b"\n" + kept[0] + RECORD.pack(len(foreign), zlib.crc32(foreign)) + foreign + kept[0])
    touch = organ.reduce(PART, **SETTINGS, checkpoint=Checkpoint(path, said.append))
    assert said == [f"continuing after 1 finished batch, from {path}"]
    assert contents(touch, tmp_path) == whole


def test_batches_of_another_case_are_left_out_and_it_is_said(organ: vs.Organ, whole: bytes, tmp_path: Path) -> None:
    path = tmp_path / "beam.batches"
    softer = organ.with_law(vs.NeoHookean(young=0.9e5, poisson=0.3))
    with pytest.raises(Enough):
        softer.reduce(PART, **SETTINGS, checkpoint=path, progress=stop_after(1, path))
    with pytest.warns(UserWarning, match="of another case or version; starting again"):
        touch = organ.reduce(PART, **SETTINGS, checkpoint=path)
    assert contents(touch, tmp_path) == whole


def test_ctrl_c_while_finished_batches_are_read_stops_before_any_is_solved(
    organ: vs.Organ, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(_: Any) -> list[bytes]:
        raise KeyboardInterrupt

    monkeypatch.setattr("viscera.reduced.checkpoint.Batches.finished", interrupted)
    stages: set[str] = set()
    with pytest.raises(KeyboardInterrupt):
        organ.reduce(
            PART,
            **SETTINGS,
            checkpoint=tmp_path / "beam.batches",
            progress=lambda done, total, stage: stages.add(stage),
        )
    assert "solve" not in stages


@pytest.mark.parametrize("text", ["four years of work", "[" * 999])
def test_a_file_of_something_else_is_not_touched(organ: vs.Organ, tmp_path: Path, text: str) -> None:
    path = tmp_path / "thesis.txt"
    path.write_text(text)
    with pytest.raises(vs.VisceraError, match="no file of finished batches"):
        organ.reduce(PART, **SETTINGS, checkpoint=path)
    assert path.read_text() == text
    with pytest.raises(vs.VisceraError, match="the file of finished batches must be named by a text or a path, got 3"):
        organ.reduce(PART, **SETTINGS, checkpoint=3)  # type: ignore[arg-type]
    with pytest.raises(vs.VisceraError, match="batches cannot be kept there"):
        organ.reduce(PART, **SETTINGS, checkpoint=tmp_path / "nowhere" / "beam.batches")


def device(path: Path) -> None:
    try:
        os.mknod(path, 0o600 | stat.S_IFCHR, os.makedev(1, 3))  # swallows what it is given
    except PermissionError:
        pytest.skip("only an administrator makes devices")


def bound(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as held:
        held.bind(path.name)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes among the files of this system")
@pytest.mark.parametrize(
    ("make", "kind"), [(device, "a device"), (os.mkfifo, "a pipe"), (Path.mkdir, "a folder"), (bound, "a socket")]
)
def test_what_is_no_file_is_refused_and_stays(
    organ: vs.Organ, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, make: Callable[[Path], None], kind: str
) -> None:
    monkeypatch.chdir(tmp_path)  # names of sockets are short
    path = Path("beam.batches")
    make(path)
    before = path.stat()
    stages: list[str] = []
    with pytest.raises(vs.VisceraError, match=f"beam.batches is {kind}, .*choose another name"):
        organ.reduce(PART, **SETTINGS, checkpoint=path, progress=lambda done, total, stage: stages.append(stage))
    assert os.path.samestat(path.stat(), before)
    assert stages == []


def test_an_empty_file_is_not_lost_in_an_error(tmp_path: Path) -> None:
    """What the call made goes, and so does the file of a link, but not the link."""
    there, made, link = (tmp_path / name for name in ("there.batches", "made.batches", "link.batches"))
    there.touch()
    link.symlink_to(tmp_path / "far.batches")
    for path in (there, made, link):
        with pytest.raises(Enough), Checkpoint(path).batches("case"):
            raise Enough
    assert there.read_bytes() == b""
    assert sorted(path.name for path in tmp_path.iterdir()) == ["link.batches", "there.batches"]


def test_a_disk_without_room_is_told(tmp_path: Path) -> None:
    """By the limit of a process of its own on the size of its files."""
    pytest.importorskip("resource")
    program = (
        "import resource, sys; import viscera as vs; from viscera.reduced.checkpoint import Checkpoint\n"
        "size = int(sys.argv[1]); resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))\n"
        "try:\n"
        "    with Checkpoint('beam.batches').batches('case') as kept: kept.keep(bytes(1000))\n"
        "except vs.VisceraError as error: print(error)\n"
    )
    for size, told in ((3, "batches cannot be kept there"), (300, "a finished batch could not be kept")):
        words = [sys.executable, "-c", program, str(size)]
        done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=60)
        assert told in done.stdout, done.stderr
        assert list(tmp_path.iterdir()) == []


def test_two_reductions_do_not_share_a_file(organ: vs.Organ, tmp_path: Path) -> None:
    pytest.importorskip("fcntl")
    path = tmp_path / "beam.batches"

    def meanwhile(done: int, total: int, stage: str) -> None:
        with pytest.raises(vs.VisceraError, match="is in use: another reduction writes it"):
            organ.reduce(PART, **SETTINGS, checkpoint=path)
        raise Enough

    with pytest.raises(Enough):
        organ.reduce(PART, **SETTINGS, checkpoint=path, progress=meanwhile)


CASE = """
mesh = "organ:liver"
fixed = "hilum"
element = "P1"
[material]
law = "NeoHookean"
young = 3e3
poisson = 0.45
[reduce]
touchable = "z > 90%"
order = 2
"""


def has_batch(kept: bytes) -> bool:
    """Whether the first record is there to its end."""
    _, _, records = kept.partition(b"\n")
    return len(records) >= RECORD.size and len(records) >= RECORD.size + RECORD.unpack_from(records)[0]


def start(folder: Path) -> subprocess.Popen[str]:
    """`viscera reduce` on the built-in liver, with a batch finished."""
    words = [sys.executable, "-m", "viscera", "reduce", "liver.toml", "-o", "liver.viscera"]
    work = subprocess.Popen(words, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    kept, end = folder / "liver.viscera.batches", time.monotonic() + 300.0
    while not (kept.exists() and has_batch(kept.read_bytes())):
        assert time.monotonic() < end
        assert work.poll() is None, work.communicate()
        time.sleep(0.02)
    return work


@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGKILL], ids=["Ctrl-C", "kill -9"])
def test_the_command_goes_on_after_ctrl_c_and_after_kill(stop: signal.Signals, tmp_path: Path) -> None:
    (tmp_path / "liver.toml").write_text(CASE)
    work = start(tmp_path)
    work.send_signal(stop)
    _, errors = work.communicate(timeout=60)
    if stop == signal.SIGINT:
        assert work.returncode == 130
        last = errors.strip().splitlines()[-1]
        assert last.startswith("viscera reduce: interrupted; finished positions are kept in liver.viscera.batches")
    assert not (tmp_path / "liver.viscera").exists()
    words = [sys.executable, "-m", "viscera", "reduce", "liver.toml", "-o", "liver.viscera"]
    again = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert again.returncode == 0, again.stderr
    assert "continuing after" in again.stdout
    assert sorted(path.name for path in tmp_path.iterdir()) == ["liver.toml", "liver.viscera"]


BEAM = """
mesh = "organ:beam"
fixed = "clamp"
[material]
law = "NeoHookean"
young = 1e5
poisson = 0.3
[reduce]
touchable = "tip"
order = 2
"""


def test_the_command_goes_on_after_a_model_that_could_not_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """By the limit of a process on the size of its files: batches have room, the model lacks a byte."""
    pytest.importorskip("resource")
    monkeypatch.chdir(tmp_path)
    Path("beam.toml").write_text(BEAM)
    command, model = ["reduce", "beam.toml", "-o", "beam.viscera"], Path("beam.viscera")
    assert main(command) == 0
    size = model.stat().st_size
    model.unlink()
    program = (
        "import resource, sys; from viscera.cli import main\n"
        "size = int(sys.argv[1]); resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))\n"
        "sys.exit(main(sys.argv[2:]))\n"
    )
    words = [sys.executable, "-c", program, str(size - 1), *command]
    failed = subprocess.run(words, capture_output=True, text=True, timeout=60)
    assert failed.returncode != 0
    assert "finished positions are kept in beam.viscera.batches, and the same command goes on" in failed.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["beam.toml", "beam.viscera.batches"]
    capsys.readouterr()
    assert main(command) == 0
    assert "continuing after" in capsys.readouterr().out
    assert sorted(path.name for path in tmp_path.iterdir()) == ["beam.toml", "beam.viscera"]
