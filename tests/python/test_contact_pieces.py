"""Contact pairs are in equilibrium on the pieces where their surfaces end, however many iterations that takes."""

from __future__ import annotations

import numpy as np
import pytest

import viscera as vs

HELD = (0.35, 0.05, 0.21)
MOVE = np.array([0.00088, -0.00086, -0.00329])


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


def moved(bar: vs.Mesh, friction: float, iterations: int) -> tuple[vs.Scene, vs.Frame, float]:
    """A bar that a hand has pushed down on another, frames after that until one has settled, and what friction took."""
    law = vs.NeoHookean(young=1e5, poisson=0.3)
    upper = vs.mesh(bar.points + np.array([0, 0, 0.11]), bar.cells, bar.sets)
    organs = {"lower": vs.Organ(bar, law, fixed="root"), "upper": vs.Organ(upper, law, fixed="root")}
    scene = vs.Scene(organs, contacts=[vs.ContactPair("lower", "upper", friction=friction)])
    stepper = scene.stepper(iterations=iterations)
    hand = stepper.grasp(scene.patch(HELD, 0.04, "upper"))
    dissipated = 0.0
    for part in (0, 1, 1, 2, 2, 3, 4, 5, *[6] * 100):
        hand.displacement = part * MOVE
        frame = stepper.frame()
        dissipated += frame.contact(scene.contacts[0]).dissipation
        if part == 6 and frame.is_settled:
            break
    assert frame.is_settled
    return scene, frame, dissipated


@pytest.mark.parametrize("iterations", [1, 3])
def test_a_hand_at_rest_comes_to_a_settled_frame_by_few_iterations_each(bar: vs.Mesh, iterations: int) -> None:
    """The last step leads to pieces whose step leads back: they stay, over frames as over the iterations of one."""
    scene, frame, dissipated = moved(bar, 0.0, iterations)
    exact = scene.solve(displacement={scene.patch(HELD, 0.04, "upper"): 6 * MOVE}, throw=True)
    assert np.abs(frame.displacement - exact.displacement).max() < 1e-3 * np.abs(exact.displacement).max()
    assert dissipated == 0.0


@pytest.mark.parametrize("iterations", [1, 3])
def test_so_it_does_with_friction(bar: vs.Mesh, iterations: int) -> None:
    """Frames on the way are no equilibria, so their slides differ, and forces by a part of those of friction."""
    scene, frame, _ = moved(bar, 0.3, iterations)
    again, whole, dissipated = moved(bar, 0.3, 30)
    force, expected = frame.contact(scene.contacts[0]).force, whole.contact(again.contacts[0]).force
    assert np.linalg.norm(force - expected) < 0.3 * np.linalg.norm(expected)
    assert dissipated > 0.0
