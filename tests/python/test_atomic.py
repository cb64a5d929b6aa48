"""Files that appear whole or not at all, wherever they go."""

from __future__ import annotations

import json
import os
import stat
import subprocess
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from time import time

import pytest
from tests.conftest import full_disk

import viscera as vs
from viscera.cli import main
from viscera.files.atomic import STALE, NotWritten, replacing, writable


def put(target: Path, text: str) -> None:
    with replacing(target) as scratch:
        scratch.write_text(text)


def interrupted(target: Path) -> None:
    with replacing(target) as scratch:
        scratch.write_text("half")
        raise KeyboardInterrupt


def test_a_file_replaces_the_old_one_only_when_it_is_whole(tmp_path: Path) -> None:
    target = tmp_path / "model.viscera"
    target.write_text("old")
    with pytest.raises(KeyboardInterrupt):
        interrupted(target)
    assert target.read_text() == "old"
    put(target, "new")
    assert target.read_text() == "new"
    assert list(tmp_path.iterdir()) == [target]


def test_a_missing_folder_and_a_folder_in_the_way_are_named(tmp_path: Path) -> None:
    with pytest.raises(vs.VisceraError, match="does not exist"):
        put(tmp_path / "no" / "file", "")
    with pytest.raises(vs.VisceraError, match="is a folder"):
        put(tmp_path, "")
    (tmp_path / "file").write_text("")
    with pytest.raises(vs.VisceraError, match="no file can be written there"):
        put(tmp_path / "file" / "under", "")


@pytest.mark.skipif(sys.platform == "win32", reason="a folder in use cannot be removed there")
def test_a_working_folder_that_was_removed_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    with pytest.raises(vs.VisceraError, match=r"the working folder was removed; change to one that exists"):
        writable("model.viscera")


def test_a_file_that_cannot_be_opened_is_named_as_it_was_asked_for(tmp_path: Path) -> None:
    """The scratch file, of which nobody has heard, stays out of the sentence."""
    target = tmp_path / f"model.{'x' * 240}"  # a name so long that none longer can be made, which nothing says before
    with pytest.raises(vs.VisceraError, match=r"model\.x+: no file can be written there \(.+\)$") as told:
        put(target, "")
    assert ".part" not in str(told.value)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="this system has no /proc")
def test_a_folder_that_takes_no_files_is_one_sentence() -> None:
    """Those who may do everything learn of it when the file is opened."""
    with pytest.raises(vs.VisceraError, match=r"^/proc/x\.viscera: (no file can be written|you may not write)") as told:
        put(Path("/proc/x.viscera"), "")
    assert ".part" not in str(told.value)


def blocked(target: Path) -> None:
    with replacing(target) as scratch:
        scratch.write_text("whole")
        target.mkdir()


def test_a_file_that_cannot_be_renamed_is_named_as_it_was_asked_for(tmp_path: Path) -> None:
    target = tmp_path / "model.viscera"
    with pytest.raises(vs.VisceraError, match=r"model\.viscera: no file can be written there \(.+\)$") as told:
        blocked(target)
    assert ".part" not in str(told.value)
    assert list(tmp_path.iterdir()) == [target]


def test_a_link_is_followed(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    link, target = tmp_path / "link.json", tmp_path / "folder" / "target.json"
    link.symlink_to(target)
    for text in ("first", "second"):  # the target is made, then replaced
        put(link, text)
        assert link.is_symlink()
        assert target.read_text() == text
    (tmp_path / "astray").symlink_to(tmp_path / "no" / "where")
    with pytest.raises(vs.VisceraError, match="no' does not exist"):
        put(tmp_path / "astray", "")
    (tmp_path / "round").symlink_to(tmp_path / "round")
    with pytest.raises(vs.VisceraError, match="no file can be written there"):
        put(tmp_path / "round", "")


def test_a_file_that_is_protected_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Root may write to every file; here nobody may whom the file itself does not let."""
    may = os.access
    monkeypatch.setattr(os, "access", lambda path, mode: may(path, mode) and bool(os.stat(path).st_mode & stat.S_IWUSR))
    kept, link = tmp_path / "kept.json", tmp_path / "link.json"
    kept.write_text("{}")
    link.symlink_to(kept)
    kept.chmod(0o444)
    for path in (kept, link):
        with pytest.raises(vs.VisceraError, match=rf"{path.name}: you may not write to it$"):
            put(path, "new")
        assert main(["inspect", "organ:beam", "--json", str(path)]) == 2
        printed = capsys.readouterr()
        assert (printed.out, printed.err) == ("", f"viscera inspect: {path}: you may not write to it\n")
    assert kept.read_text() == "{}"
    kept.chmod(0o644)
    put(link, "new")
    assert kept.read_text() == "new"


@pytest.mark.parametrize("name", ["a.vtu", "a.vtk", "a.msh", "a.ply", "a.glb", "a.png", "a.viscera"])
def test_what_does_not_fit_on_the_disk_is_named_and_the_old_file_stays(name: str, bar: vs.Mesh, tmp_path: Path) -> None:
    """Some writers raise an error of the system, NumPy one that has no number."""
    organ = vs.Organ(bar, vs.NeoHookean(young=1e5, poisson=0.3), fixed="root")
    target = tmp_path / name
    target.write_text("old")
    shape = organ.solve(force={"tip": (0.0, 0.0, -1.0)})
    write: Callable[[Path], object] = {".png": shape.plot}.get(target.suffix, shape.write)
    if name.endswith(".viscera"):
        write = organ.reduce("tip", depth="2%", order=2).save
    with full_disk(), pytest.raises(NotWritten, match=rf"{name}: could not be written .*; see that the folder") as told:
        write(target)
    assert ".part" not in str(told.value)
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize(
    "error", [vs.VisceraError("cell 3"), OSError("odd"), PermissionError(13, "no", "other.csv"), OSError(5, "broken")]
)
def test_an_error_of_something_else_stays_what_it_is(error: Exception, tmp_path: Path) -> None:
    def raising() -> None:
        with replacing(tmp_path / "a.json"):
            raise error

    with pytest.raises(type(error)) as told:
        raising()
    assert told.value is error
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_no_bad_input(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "case.toml").write_text(
        'mesh = "organ:beam"\nfixed = "x < 1%"\nmaterial = {law = "NeoHookean", young = 1e5, poisson = 0.3}\n'
    )
    with full_disk():
        assert main(["solve", "case.toml", "--quiet", "-o", "a.vtk", "--json", "a.json"]) == 2
    facts = json.loads((tmp_path / "a.json").read_text())
    assert facts["status"] == "not written"
    assert facts["message"].startswith("a.vtk: could not be written whole (")


def test_a_pipe_stays_a_pipe(tmp_path: Path) -> None:
    pipe, read = tmp_path / "pipe.json", list[str]()
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: read.append(pipe.read_text()), daemon=True)
    reader.start()
    put(pipe, "through\n")
    reader.join(timeout=20.0)
    assert read == ["through\n"]
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert list(tmp_path.iterdir()) == [pipe]


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="this system has no /dev/full")
def test_a_device_stays_a_device() -> None:
    put(Path("/dev/null"), "gone")
    with pytest.raises(vs.VisceraError, match=r"/dev/full: could not be written \(No space left on device\)"):
        put(Path("/dev/full"), "too much")
    assert all(stat.S_ISCHR(os.stat(device).st_mode) for device in ("/dev/null", "/dev/full"))


PRINTING = ("inspect organ:beam", "inspect organ:beam --json - --quiet", "completion bash", "--help")
COMMAND = "import sys; from viscera.cli import main; sys.exit(main(sys.argv[1:]))"


def shell(line: str, folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["bash", "-c", line, "bash", sys.executable, "-c", COMMAND],
        cwd=folder, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip


def test_json_goes_where_the_shell_says(tmp_path: Path) -> None:
    done = shell('"$@" inspect organ:beam --quiet --json >(cat > seen.json); sleep 1', tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert '"status": "sound"' in (tmp_path / "seen.json").read_text()
    done = shell('"$@" inspect organ:beam --json /dev/stdout > all.txt', tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    lines = (tmp_path / "all.txt").read_text()
    assert lines.index("organ:beam: ") < lines.index('"status": "sound"'), "what was printed before is still there"


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="this system has no /dev/full")
def test_json_to_a_full_device_is_one_sentence(tmp_path: Path) -> None:
    done = shell('"$@" inspect organ:beam --quiet --json /dev/full', tmp_path)
    assert done.returncode == 2
    assert done.stderr == "viscera inspect: /dev/full: could not be written (No space left on device)\n"


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="this system has no /dev/full")
@pytest.mark.parametrize("words", PRINTING)
def test_a_full_standard_output_is_named(words: str, tmp_path: Path) -> None:
    done = shell(f'"$@" {words} > /dev/full', tmp_path)
    verb = "" if words == "--help" else f" {words.split()[0]}"
    assert done.returncode == 2
    assert done.stderr.endswith(f"viscera{verb}: standard output: could not be written (No space left on device)\n")
    assert done.stderr.count("viscera") == 1, "once, and without a traceback"


@pytest.mark.parametrize("words", PRINTING)
def test_a_closed_standard_output_is_named_before_the_work(words: str, tmp_path: Path) -> None:
    done = shell(f'"$@" {words} >&-', tmp_path)
    verb = "" if words == "--help" else f" {words.split()[0]}"
    assert done.returncode == 2
    assert done.stderr.startswith(f"viscera{verb}: standard output: could not be written (it is closed); ")
    assert done.stderr.count("\n") == 1, "once, and without a traceback"
    assert shell(f'"$@" {words} >&- 2>&-', tmp_path).returncode == 2


def test_a_command_that_prints_nothing_needs_no_standard_output(tmp_path: Path) -> None:
    done = shell('"$@" inspect organ:beam --quiet --json seen.json >&-', tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert '"status": "sound"' in (tmp_path / "seen.json").read_text()


def test_without_standard_error_nothing_is_said_there(tmp_path: Path) -> None:
    """Nor on standard output, where progress and messages would be among the JSON."""
    (tmp_path / "case.toml").write_text(
        'mesh = "organ:beam"\nfixed = "x < 1%"\nmaterial = {law = "NeoHookean", young = 1e5, poisson = 0.3}\n'
    )
    done = shell('"$@" solve case.toml --json - 2>&-', tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["status"] == "converged"
    for words in ("inspect none.vtu", "inspect"):
        done = shell(f'"$@" {words} 2>&-', tmp_path)
        assert (done.returncode, done.stdout, done.stderr) == (2, "", "")


@pytest.mark.parametrize("words", PRINTING)
def test_a_closed_pipe_ends_a_command_without_a_word(words: str, tmp_path: Path) -> None:
    done = shell(f'"$@" {words} | exec 0<&-; exit "${{PIPESTATUS[0]}}"', tmp_path)
    assert (done.returncode, done.stderr) == (141, "")


def test_a_closed_pipe_behind_both_streams_does_not_raise(tmp_path: Path) -> None:
    done = shell('"$@" inspect none.vtu 2>&1 | exec 0<&-; exit "${PIPESTATUS[0]}"', tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (141, "", "")


def test_many_writers_of_one_file_never_tear_it(tmp_path: Path) -> None:
    target, pages = tmp_path / "model.viscera", [digit * 200_000 for digit in "0123"]
    put(target, pages[0])
    torn, is_done = list[int](), threading.Event()

    def watch() -> None:
        while not is_done.is_set():
            text = target.read_text()
            if text not in pages:
                torn.append(len(text))

    reader = threading.Thread(target=watch)
    reader.start()
    try:
        with ThreadPoolExecutor(4) as pool:
            list(pool.map(lambda k: put(target, pages[k % 4]), range(120)))
    finally:
        is_done.set()
        reader.join()
    assert torn == []
    assert list(tmp_path.iterdir()) == [target]


def test_scratch_names_do_not_depend_on_the_process_number(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Containers on one volume all have the number 1."""
    monkeypatch.setattr(os, "getpid", lambda: 1)
    with replacing(tmp_path / "a.json") as first, replacing(tmp_path / "a.json") as second:
        assert first != second
        first.write_text("first")
        second.write_text("second")
    assert (tmp_path / "a.json").read_text() == "first"


def aged(path: Path, seconds: float) -> Path:
    path.write_text("left behind")
    os.utime(path, (time() - seconds,) * 2)
    return path


def test_what_a_killed_program_left_is_swept_and_nothing_else(tmp_path: Path) -> None:
    old = aged(tmp_path / ".viscera-0123456789abcdef.part.viscera", STALE + 60)
    kept = [
        aged(tmp_path / ".viscera-fedcba9876543210.part.json", STALE - 60),
        aged(tmp_path / ".notes.part.json", 10 * STALE),
        aged(tmp_path / "viscera-0123456789abcdef.part", 10 * STALE),
    ]
    put(tmp_path / "model.viscera", "new")
    assert not old.exists()
    assert sorted(tmp_path.iterdir()) == sorted([*kept, tmp_path / "model.viscera"])


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def test_a_file_keeps_its_permissions_and_a_new_one_has_the_usual(tmp_path: Path) -> None:
    usual = tmp_path / "usual"
    usual.write_text("")
    put(tmp_path / "new", "")
    assert mode(tmp_path / "new") == mode(usual)
    usual.chmod(0o640)
    put(usual, "")
    assert mode(usual) == 0o640


def test_where_a_file_can_go_is_asked_before_the_work(tmp_path: Path) -> None:
    assert writable(tmp_path / "model.viscera") == tmp_path / "model.viscera"
    assert list(tmp_path.iterdir()) == []
