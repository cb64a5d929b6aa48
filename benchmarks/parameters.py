"""One reduced model for a range of a parameter, against Newton at values that it was not solved at.

    python benchmarks/parameters.py [TOUCHES]

The built-in liver, neo-Hookean, E = 0.17 MPa, nu = 0.48, linear cells, touched on a part of the anterior face: the
stiffness of a nodule under it, from that of the liver to fifty times as much; Poisson's ratio of the whole; the radius
of the contact. Beside each, the model of the single value 0.17 MPa, 0.48, a tenth of the diagonal.
"""

from __future__ import annotations

import sys
from time import perf_counter

import numpy as np
from machine import describe

import viscera as vs
from viscera.mesh import Floats
from viscera.study.case import middle

DEPTHS = ("5%", "10%")


def main(touches: int) -> None:
    """Reduce each family, then check it at values between its nodes."""
    liver = vs.organs.liver()
    organ = vs.Organ(liver, vs.NeoHookean(young=0.17e6, poisson=0.48), fixed="hilum", element="P1")
    face = organ.touchable("anterior")
    centre = liver.points[middle(liver, face)]
    near = np.intersect1d(face, liver.near(centre, 0.09 * liver.diagonal))

    def nodule(x: Floats) -> Floats:
        return np.asarray(np.linalg.norm(x - (centre - (0.0, 0.0, 0.012)), axis=1) < 0.015)

    print(describe())
    print(f"{len(liver.points)} nodes; nodule of {int(nodule(liver.centroids).sum())} cells; {touches} touches a value")
    report("no parameter", organ, near, None, [None], touches)
    cases = {
        "young of a nodule [Pa]": (vs.Vary("young", 0.17e6, 8.5e6, part=nodule), [0.17e6, 0.4e6, 1.2e6, 3.5e6, 8.5e6]),
        "Poisson's ratio": (vs.Vary("poisson", 0.40, 0.49), [0.40, 0.43, 0.455, 0.475, 0.49]),
        "contact radius [m]": (vs.Vary("radius", 0.016, 0.030), [0.016, 0.019, 0.0225, 0.0265, 0.030]),
    }
    for name, (vary, values) in cases.items():
        report(name, organ, near, vary, values, touches)


def report(
    name: str, organ: vs.Organ, near: Floats, vary: vs.Vary | None, values: list[float | None], touches: int
) -> None:
    """One table: errors of field and force at each value and depth, worst and median, and the estimate."""
    began = perf_counter()
    touch = organ.reduce(near, tolerance=1e-3, vary=vary)
    seconds, size = perf_counter() - began, len(touch._model.to_bytes())
    errors = touch.metadata["errors"]
    print(
        f"\n{name}: {0 if vary is None else vary.nodes} nodes, {touch.summary()['positions']} positions, "
        f"{touch.summary()['modes']} modes, {1e-6 * size:.1f} MB, {seconds:.0f} s; "
        f"measured off-line between nodes {100 * errors['parameter']:.2f} %"
    )
    print("      value  depth  touches  trusted   field median/worst    force median/worst   worst trusted  estimate")
    for value in values:
        at = touch if value is None else touch.at(value)
        for summary in at.check(touches, seed=3, depths=DEPTHS).depths:
            cells = [
                f"{100 * (summary.median[kind] or 0.0):8.3f} /{100 * (summary.worst[kind] or 0.0):7.2f} %"
                for kind in ("displacement_error", "force_error")
            ]
            worst = max(summary.worst_trusted[kind] or 0.0 for kind in ("displacement_error", "force_error"))
            print(
                f"{'-' if value is None else format(value, 'g'):>11s} {summary.depth_fraction or 0.0:6.0%} "
                f"{summary.converged:8d} {summary.trusted:8d}  {cells[0]}  {cells[1]} {100 * worst:11.2f} % "
                f"{100 * (summary.median['estimate'] or 0.0):9.2f} %",
                flush=True,
            )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 10)
