"""A sweep on a cluster: the same organ under many loads, on the workers of Dask.

All work that consists of independent tasks takes an executor: `reduce`, `check`, and `vs.sweep` for your own. Here two
workers of this machine share a sweep of loads over a beam, and a reduction. On a cluster the only line that changes is
the one that makes the client. The results do not depend on the workers: they are those of one process, bit by bit.
"""

import numpy as np
from matplotlib.figure import Figure

import viscera as vs

try:
    from distributed import Client, LocalCluster
except ImportError:
    raise SystemExit("this example needs Dask: pip install distributed") from None

HERE = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None, "host": "127.0.0.1"}


def tip(organ: vs.Organ, force: float) -> float:
    """How far the beam's end moves down under a force [N]."""
    state = organ.solve(force={"tip": (0.0, 0.0, -force)}, throw=True)
    return float(-state.displacement[organ.mesh.nodes("tip"), 2].mean())


if __name__ == "__main__":  # the workers import this file for what it defines
    beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    forces = [0.5 * n for n in range(1, 13)]
    place = "top and x > 80%"
    with LocalCluster(**HERE) as workers, Client(workers) as client, client.get_executor() as executor:
        moved = vs.sweep(tip, beam, forces, executor=executor)
        touch = beam.reduce(place, depth="2 cm", order=2, executor=executor)

    print("\n".join(f"{force:4.1f} N  {1e3 * z:6.2f} mm" for force, z in zip(forces, moved, strict=True)))
    here = beam.reduce(place, depth="2 cm", order=2)
    point, push = beam.mesh.points[beam.mesh.nodes("tip")].max(axis=0), (0.0, 0.0, -0.01)
    force, expected = (model(point, push).force[2] for model in (touch, here))
    print(f"10 mm down at the tip: {force:.6f} N, reduced by the workers; {expected:.6f} N, reduced here")

    figure = Figure(figsize=(6.4, 4.4), layout="constrained")
    axes = figure.subplots()
    axes.plot(forces, 1e3 * np.array(moved), "o-", color="#0b4f6c", label="full solutions, by two workers")
    axes.plot(forces, 1e3 * moved[0] / forces[0] * np.array(forces), "--", color="#7a8793", label="linear")
    axes.set(xlabel="force [N]", ylabel="the end moves by [mm]")
    axes.legend(frameon=False)
    assert moved == [tip(beam, force) for force in forces]
    assert np.array_equal(touch(point, push).displacement, here(point, push).displacement)
