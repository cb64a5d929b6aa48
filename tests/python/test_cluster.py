"""Work spread over threads, processes, Dask and MPI gives what one process gives, bit by bit."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import viscera as vs
from viscera import _core, cluster
from viscera.reduced.checkpoint import Batches, Checkpoint
from viscera.reduced.offline import Offline
from viscera.reduced.regions import positions_of, regions_of
from viscera.study import beam, curves

PLACE = "top and x > 60%"
SETTINGS: dict[str, Any] = {"order": 2, "depth": 0.03, "radius": 0.06}
SPAWN = multiprocessing.get_context("spawn")


@pytest.fixture(scope="module")
def organ() -> vs.Organ:
    return vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")


@pytest.fixture(scope="module")
def whole(organ: vs.Organ) -> vs.Touch:
    return organ.reduce(PLACE, **SETTINGS)


@pytest.fixture(scope="module")
def pool() -> Iterator[Executor]:
    """Its workers import this module by its name, so they need the folder that holds `tests`."""
    with pytest.MonkeyPatch.context() as patch, ProcessPoolExecutor(2, mp_context=SPAWN) as pool:
        patch.syspath_prepend(str(Path(__file__).resolve().parents[2]))
        yield pool


def arrays(touch: vs.Touch) -> bytes:
    """All of a model but its metadata, which hold the time it took."""
    data = touch._model.to_bytes()
    return data[8 + int.from_bytes(data[:8], "little") :]


def twice(shared: list[int], task: int) -> int:
    if task < 0:
        raise ValueError("a task that fails")
    return 2 * shared[0] + task


class Simulated(Executor):
    """Workers without processes, which take turns; after `restart_at` submissions all are new ones."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, count: int, restart_at: int = 10**9) -> None:
        self._monkeypatch, self._count, self._restart_at = monkeypatch, count, restart_at
        self._memory: dict[int, dict[str, Any]] = {}
        self.calls = 0
        self.sent = 0

    def submit(self, fn: Any, /, *arguments: Any, **words: Any) -> Future[Any]:
        worker = self.calls % self._count + (1000 if self.calls >= self._restart_at else 0)
        self.calls += 1
        self.sent += any(isinstance(argument, bytes) for argument in arguments)
        future: Future[Any] = Future()
        with self._monkeypatch.context() as there:
            there.setattr(cluster, "_shared", self._memory.setdefault(worker, {}))
            there.setattr(os, "getpid", lambda: worker)
            try:
                future.set_result(fn(*pickle.loads(pickle.dumps(arguments)), **words))
            except Exception as error:
                future.set_exception(error)
        return future


@pytest.mark.parametrize("workers", [1, 2, 3, 7])
@pytest.mark.parametrize("tasks", [1, 5, 40])
def test_what_tasks_share_travels_once_to_each_worker(
    monkeypatch: pytest.MonkeyPatch, workers: int, tasks: int
) -> None:
    executor = Simulated(monkeypatch, workers)
    assert vs.sweep(twice, [21], range(tasks), executor=executor) == [42 + task for task in range(tasks)]
    assert executor.sent <= min(workers, tasks)
    assert executor.calls <= 4 * tasks


def test_new_workers_get_it_too(monkeypatch: pytest.MonkeyPatch) -> None:
    executor = Simulated(monkeypatch, 2, restart_at=30)
    assert vs.sweep(twice, [21], range(20), executor=executor) == [42 + task for task in range(20)]
    assert 2 < executor.sent < 10


def test_what_fails_ends_the_sweep(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ValueError, match="a task that fails"):
        vs.sweep(twice, [21], [1, -1, 2], executor=Simulated(monkeypatch, 2))
    assert cluster._shared == {}
    with pytest.raises(vs.VisceraError, match=r"must be a concurrent.futures.Executor, got 'many'"):
        vs.sweep(twice, [21], [1], executor="many")  # type: ignore[arg-type]


def test_what_cannot_travel_is_named(pool: Executor) -> None:
    """Threads take any function; what it raises is told as it is."""
    local: Any = lambda a, b: a[0] + b  # noqa: E731
    for work, shared, task, named in (
        (local, [21], 1, r"the work cannot travel .*no lambda"),
        (twice, local, 1, r"what the tasks share cannot travel"),
        (twice, [21], local, r"task 0 cannot travel"),
    ):
        with pytest.raises(vs.VisceraError, match=named):
            vs.sweep(work, shared, [task], executor=pool)
    with pytest.raises(vs.VisceraError, match="the work of a sweep must be a function"):
        vs.sweep(3, [21], [1], executor=pool)  # type: ignore[arg-type]
    surface: Any = _core.Surface(np.eye(3), np.array([[0, 1, 2]], dtype=np.uint32))
    with pytest.raises(vs.VisceraError, match=r"task 0 cannot travel .*: send what it is made of"):
        vs.sweep(twice, [21], [surface], executor=pool)
    with pytest.raises(TypeError, match="not subscriptable"):
        vs.sweep(twice, 21, [1], executor=pool)  # type: ignore[arg-type]
    with ThreadPoolExecutor(1) as threads:
        assert vs.sweep(local, [21], [1], executor=threads) == [22]
        with pytest.raises(TypeError, match="not subscriptable"):
            vs.sweep(local, 21, [1], executor=threads)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no forks on this system")
def test_forks_are_refused(organ: vs.Organ) -> None:
    """They lack the threads of the core, and would wait for them without end."""
    fork = multiprocessing.get_context("fork")
    with (
        ProcessPoolExecutor(1, mp_context=fork) as pool,
        pytest.raises(vs.VisceraError, match=r"get_context\(.spawn.\)"),
    ):
        vs.sweep(twice, [21], [1], executor=pool)


def pushed(organ: vs.Organ) -> float:
    return organ.solve(force={"tip": (0, 0, -1.0)}).max_displacement


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no forks on this system")
def test_a_fork_of_a_process_that_has_threads_is_refused_and_one_before_is_not(organ: vs.Organ) -> None:
    """Other pools than those of a sweep, too: not with a worker that waits for ever."""
    fork = multiprocessing.get_context("fork")
    expected = pushed(organ)
    with ProcessPoolExecutor(1, mp_context=fork) as pool:
        asked = pool.submit(pushed, organ)
        try:
            with pytest.raises(vs.VisceraError, match=r"fork of process \d+, .*get_context\(.spawn.\)"):
                asked.result(timeout=120)
        finally:
            for worker in pool._processes.values():
                worker.kill()
    program = (
        "import multiprocessing, sys; from concurrent.futures import ProcessPoolExecutor; import viscera as vs\n"
        "organ = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed='clamp')\n"
        "def push(x): return organ.solve(force={'tip': (0, 0, x)}).max_displacement\n"
        "with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context('fork')) as pool:\n"
        "    print(pool.submit(push, -1.0).result(timeout=60))\n"
    )
    printed = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120)
    assert float(printed.stdout) == pytest.approx(expected), printed.stderr


def test_the_tasks_of_a_sweep_may_come_one_by_one() -> None:
    with ThreadPoolExecutor(2) as threads:
        assert vs.sweep(twice, [21], (task for task in range(3)), executor=threads) == [42, 43, 44]
        with pytest.raises(vs.VisceraError, match=r"tasks of a sweep must be a sequence .*got 5"):
            vs.sweep(twice, [21], 5, executor=threads)  # type: ignore[arg-type]


def test_regions_are_those_of_the_core(organ: vs.Organ) -> None:
    """In number, members and order; also of a loaded shape, with zeros of either sign."""
    kept: list[bytes] = []

    class Keeper:
        def finished(self) -> list[bytes]:
            return []

        def keep(self, batch: bytes) -> None:
            kept.append(batch)

    nodes = organ.touchable(PLACE)
    settings = {"touchable": nodes, "radius": 0.06, "depth": 0.03, "order": 2, "tolerance": 1e-2, "pade": True}
    settings["memory"] = 1e9
    organ._body.reduce(**settings, preload=None, family=None, metadata="{}", on_progress=None, batches=Keeper())  # type: ignore[arg-type]
    regions = regions_of(organ.mesh.surface, organ.mesh.points, nodes)
    assert sorted(positions_of(batch) for batch in kept) == sorted(regions)
    assert positions_of(b"no batch") == []
    alone = Offline(organ, None, {**settings, "preload": None}).solve(2)
    assert alone in kept
    assert positions_of(alone) == regions[2]


def test_a_reduction_is_the_same_on_any_workers(organ: vs.Organ, whole: vs.Touch, pool: Executor) -> None:
    seen: list[tuple[int, int, str]] = []
    touch = organ.reduce(PLACE, **SETTINGS, executor=pool, progress=lambda *step: seen.append(step))
    assert arrays(touch) == arrays(whole)
    assert (len(whole._model.array("positions")),) * 2 in {step[:2] for step in seen}
    with ThreadPoolExecutor(3) as threads:
        assert arrays(organ.reduce(PLACE, **SETTINGS, executor=threads)) == arrays(whole)


def test_a_reduction_is_the_same_within_any_memory(organ: vs.Organ, whole: vs.Touch, tmp_path: Path) -> None:
    assert arrays(organ.reduce(PLACE, **SETTINGS, memory=1.0)) == arrays(whole)
    assert arrays(organ.reduce(PLACE, **SETTINGS, memory=1e12)) == arrays(whole)
    # What was kept by a run with more memory is not solved again.
    path = tmp_path / "beam.batches"

    def stop(done: int, total: int, stage: str) -> None:
        if stage == "check":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        organ.reduce(PLACE, **SETTINGS, checkpoint=path, progress=stop)
    said: list[str] = []
    again = organ.reduce(PLACE, **SETTINGS, memory=1.0, checkpoint=Checkpoint(path, said.append))
    assert "continuing after" in said[0]
    assert arrays(again) == arrays(whole)


def test_a_family_and_a_loaded_organ(organ: vs.Organ, pool: Executor) -> None:
    place = "top and x > 85%"
    vary = vs.Vary("young", 5e4, 2e5, nodes=2, part="x > 50%")
    assert arrays(organ.reduce(place, **SETTINGS, vary=vary, executor=pool)) == arrays(
        organ.reduce(place, **SETTINGS, vary=vary)
    )
    start = organ.solve(force={"tip": (0, 0, -20)})
    assert arrays(organ.reduce(place, **SETTINGS, start=start, executor=pool)) == arrays(
        organ.reduce(place, **SETTINGS, start=start)
    )


def test_what_was_stopped_goes_on_from_its_batches_with_workers_or_without(
    organ: vs.Organ, whole: vs.Touch, pool: Executor, tmp_path: Path
) -> None:
    class Enough(Exception):
        pass

    def stop(done: int, total: int, stage: str) -> None:
        if 0 < done < total:
            raise Enough

    path, said = tmp_path / "beam.batches", list[str]()
    with pytest.raises(Enough):
        organ.reduce(PLACE, **SETTINGS, executor=pool, checkpoint=path, progress=stop)
    shutil.copy(path, tmp_path / "copy.batches")
    again = organ.reduce(PLACE, **SETTINGS, executor=pool, checkpoint=Checkpoint(path, said.append))
    alone = organ.reduce(PLACE, **SETTINGS, checkpoint=Checkpoint(tmp_path / "copy.batches", said.append))
    assert arrays(again) == arrays(alone) == arrays(whole)
    assert [text.partition(",")[0] for text in said] == [said[0].partition(",")[0]] * 2
    assert "continuing after" in said[0]
    for touch in (again, alone):
        touch.save(tmp_path / "beam.viscera")
    assert [each.name for each in tmp_path.iterdir()] == ["beam.viscera"]


def test_only_what_is_missing_is_solved(organ: vs.Organ, tmp_path: Path, pool: Executor) -> None:
    settings = {"touchable": organ.touchable(PLACE), "radius": 0.06, "depth": 0.03, "order": 2, "preload": None}
    offline = Offline(organ, None, {**settings, "tolerance": 1e-2, "pade": True, "memory": 1e9})
    first = offline.batches(pool, None, None)

    class Nobody(Executor):
        pass

    path = tmp_path / "beam.batches"
    with Checkpoint(path).batches("case") as kept:
        assert isinstance(kept, Batches)
        kept._found = first
        assert offline.batches(Nobody(), kept, None) == first


def test_a_check_asks_the_same_questions_on_any_workers(whole: vs.Touch, pool: Executor) -> None:
    here = whole.check(touches=3)
    assert whole.check(touches=3, executor=pool).rows == here.rows


def test_dask_completes_though_a_worker_is_killed(organ: vs.Organ, whole: vs.Touch) -> None:
    distributed = pytest.importorskip("distributed", reason="pip install viscera[cluster]")
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None, "host": "127.0.0.1"}
    with distributed.LocalCluster(**options) as workers, distributed.Client(workers) as client:
        victims = list(client.run(os.getpid).values())

        def kill_one(done: int, total: int, stage: str) -> None:
            if stage == "solve" and 0 < done < total and len(victims) == 2:
                os.kill(victims.pop(), signal.SIGKILL)

        with client.get_executor() as executor:
            touch = organ.reduce(PLACE, **SETTINGS, executor=executor, progress=kill_one)
        assert len(victims) == 1
    assert arrays(touch) == arrays(whole)


MPI = """
from mpi4py.futures import MPIPoolExecutor

import viscera as vs

if __name__ == "__main__":
    organ = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    with MPIPoolExecutor() as executor:
        organ.reduce("top and x > 60%", order=2, depth=0.03, radius=0.06, executor=executor).save("beam.viscera")
"""


def test_mpi(whole: vs.Touch, tmp_path: Path) -> None:
    pytest.importorskip("mpi4py", reason="pip install mpi4py mpich")
    mpiexec = shutil.which("mpiexec", path=f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    if mpiexec is None:
        pytest.skip("no mpiexec on this machine")
    (tmp_path / "beam.py").write_text(MPI, encoding="utf-8")
    words = [mpiexec, "-n", "3", sys.executable, "-m", "mpi4py.futures", "beam.py"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert arrays(vs.load(tmp_path / "beam.viscera")) == arrays(whole)


def test_states_of_a_sweep_come_back(organ: vs.Organ, pool: Executor) -> None:
    tips = [-1.0, -2.0, -3.0]
    states = vs.sweep(bent, organ, tips, executor=pool)
    for tip, state in zip(tips, states, strict=True):
        assert np.array_equal(state.displacement, bent(organ, tip).displacement)


def bent(organ: vs.Organ, tip: float) -> vs.State:
    return organ.solve(force={"tip": (0, 0, tip)})


def test_a_study_is_the_same_on_any_workers(pool: Executor) -> None:
    key = "neo_hookean"
    case = beam.beam_case(key, *beam.LAWS[key])
    here, there = curves.compute(case, 3), curves.compute(case, 3, pool)
    assert there.in_one_step == here.in_one_step
    assert there.increments == here.increments
    assert any(here.in_one_step)
