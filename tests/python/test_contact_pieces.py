"""Contact pairs are in equilibrium on the pieces where their surfaces end, however many iterations that takes."""

from __future__ import annotations

import numpy as np

import viscera as vs


def crossed(beam: vs.Mesh) -> vs.Scene:
    """A beam on another, turned by 0.2 rad: each iteration changes the pieces that they share."""
    law, (c, s) = vs.NeoHookean(young=1e5, poisson=0.3), (np.cos(0.2), np.sin(0.2))
    turned = beam.points * [0.9, 1, 0.8] @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    upper = vs.mesh(turned + np.array([0, 0, 0.21]), beam.cells, beam.sets)
    held = vs.Organ(upper, law, supports=[vs.ElasticSupport("clamp", 1e4)])
    organs = {"lower": vs.Organ(beam, law, fixed="clamp"), "upper": held}
    return vs.Scene(organs, contacts=[vs.ContactPair("lower", "upper")])


def test_a_solution_of_many_iterations_is_one_where_it_is_solved_again() -> None:
    scene = crossed(vs.organs.beam())
    force = {"upper/tip": (0, 0, -5)}
    first = scene.solve(force=force, throw=True)
    assert sum(map(len, first.residuals)) > 25
    again = scene.solve(force=force, start=first, throw=True)
    reach = 0.05 * min(organ.mesh.diagonal for organ in scene.organs.values())
    # On pieces that the surfaces have moved away from by a hundred-thousandth of the reach at most.
    assert first.residuals[-1][-1] <= 1e-9
    assert again.residuals[0][0] <= 1e-7
    assert np.abs(again.displacement - first.displacement).max() < 2e-5 * reach


def test_a_hand_at_rest_comes_to_a_settled_frame_by_one_iteration_each(bar: vs.Mesh) -> None:
    """The last step leads to pieces whose step leads back: they stay, over frames as over the iterations of one."""
    law = vs.NeoHookean(young=1e5, poisson=0.3)
    upper = vs.mesh(bar.points + np.array([0, 0, 0.11]), bar.cells, bar.sets)
    organs = {"lower": vs.Organ(bar, law, fixed="root"), "upper": vs.Organ(upper, law, fixed="root")}
    scene = vs.Scene(organs, contacts=[vs.ContactPair("lower", "upper")])
    stepper = scene.stepper(iterations=1)
    hand = stepper.grasp(scene.patch((0.35, 0.05, 0.21), 0.04, "upper"))
    for part in (0, 1, 1, 2, 2, 3, 4, 5, 6):
        hand.displacement = part * np.array([0.00088, -0.00086, -0.00329])
        frame = stepper.frame()
    frames = 0
    while not frame.is_settled and frames < 100:
        frame, frames = stepper.frame(), frames + 1
    assert frame.is_settled
    exact = scene.solve(displacement={scene.patch((0.35, 0.05, 0.21), 0.04, "upper"): hand.displacement}, throw=True)
    assert np.abs(frame.displacement - exact.displacement).max() < 1e-3 * np.abs(exact.displacement).max()
