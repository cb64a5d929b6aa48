"""Several touches at once in C: the same answers as in Python, refusals, and what a tick asks of the system."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import viscera as vs

Build = Callable[..., Path]
Block = Callable[..., tuple[np.ndarray, np.ndarray]]
FROM_LAST, WITH_STIFFNESS = 1, 2
TRUST = {"": 0, "no equilibrium": 11, "the time": 12, "a sampled cell": 13, "a contact": 1, "the whole organ": 14}
TRUST |= {"the expected error": 2}


def status(reason: str) -> int:
    """Of the header, for a reason that Python gives."""
    return next(code for start, code in reversed(TRUST.items()) if reason.startswith(start))


def run(program: Path, *arguments: object) -> str:
    done = subprocess.run([str(part) for part in (program, *arguments)], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, f"exit {done.returncode}: {done.stdout}{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module", params=["P1", "P1 mean volume", "P2"])
def held(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[vs.Touch, Path]:
    """A model of each kind of element that a grasp sums over in its own way."""
    poisson = 0.3 if request.param == "P1" else 0.48
    organ = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=poisson), fixed="clamp", element=request.param)
    touch = organ.reduce("z > 99% and x > 30% and x < 70%", radius=0.1, depth=0.08, order=4)
    path = tmp_path_factory.mktemp("held") / "beam.viscera"
    touch.save(path)
    return touch, path


def write_searches(touch: vs.Touch, path: Path) -> int:
    """Searches of a moving pair of hands, one beyond the depth and one anew, with what Python answers.

    How many of them have a stress that is not balanced.
    """
    points = np.array([[0.4, 0.1, 0.2], [0.6, 0.08, 0.2]])
    inside = np.array([[0.5, 0.1, 0.15], [0.41, 0.02, 0.2], [0.9, 0.13, 0.04]])
    grasp = touch.galerkin().grasp(points)
    direction = np.array([[0.2, 0.1, -1.0], [0.0, 0.2, 0.7]])
    verdict = unbalanced = 0
    with path.open("w") as file:
        file.write(f"{len(points)} {len(inside)}\n")
        np.savetxt(file, np.vstack([points, inside]), fmt="%.17g")
        for n, share in enumerate((0.1, 0.12, 0.15, 0.2, 0.3, 0.35, 1.3, 0.2)):
            from_last, stiffness = n % 7 != 0, n % 3 == 0
            pushes = share * touch.depth * direction
            answer = grasp.solve(pushes, from_last=from_last, stiffness=stiffness)
            own = 11 if not answer.is_converged else 13 if answer.smallest_jacobian <= 0 else int(share > 1)
            at_once = own or verdict  # the verdict on an equilibrium stays until there is another one
            verdict = verdict if own else status(answer.reason)
            asked = FROM_LAST * from_last + WITH_STIFFNESS * stiffness
            file.write(f"{asked} ")
            np.savetxt(file, [pushes.ravel()], fmt="%.17g", newline=" ")
            file.write(f"{at_once} ")
            numbers = [answer.force.ravel()]
            if stiffness:
                assert answer.stiffness is not None
                numbers.append(answer.stiffness.ravel())
            numbers += [np.array([answer.energy, max(answer.error_estimate, answer.shape_error_estimate)])]
            np.savetxt(file, [np.concatenate(numbers)], fmt="%.17g", newline=" ")
            file.write(f"{status(answer.reason)} ")
            numbers = [answer.at(inside).displacement.ravel(), answer.displacement.ravel(), answer.von_mises()]
            numbers.append(np.array([answer.stress_error_estimate]))
            unbalanced += answer.stress_error_estimate > 0.15
            np.savetxt(file, [np.concatenate(numbers)], fmt="%.17g")
    return unbalanced


def test_several_touches_in_c_are_answered_as_in_python(
    held: tuple[vs.Touch, Path], build: Build, tmp_path: Path
) -> None:
    touch, model = held
    unbalanced = write_searches(touch, tmp_path / "answers.txt")
    program = build("tests/hands.c", "device/allocations.c", linkage="hands")
    output = run(program, model, tmp_path / "answers.txt")
    assert "8 searches; largest difference from Python" in output
    assert f"stress that is not balanced: {unbalanced}\n" in output


def test_misuse_of_hands_is_told_by_a_status(model: Path, build: Build) -> None:
    assert run(build("tests/hands_refusals.c", linkage="hands"), model) == "0 faults\n"


def test_a_model_without_cells_is_refused(touch: vs.Touch, build: Build, tmp_path: Path) -> None:
    from viscera.viewer.web import web_model

    path = tmp_path / "web.viscera"
    path.write_bytes(web_model(touch, "beam").data)
    source = tmp_path / "refused.c"
    source.write_text(
        """#include <stdio.h>
#include "viscera_hands.h"
int main(int argc, char **argv) {
    char message[256];
    viscera_model *model;
    viscera_hands *hands;
    viscera_sampling sampling;
    if (argc != 2 || viscera_load_file(argv[1], &model, message, sizeof message) != VISCERA_OK) return 2;
    viscera_sampling_init(model, &sampling);
    const int status = viscera_hands_new(model, &sampling, &hands, message, sizeof message);
    puts(message);
    viscera_free(model);
    return status == VISCERA_BAD_SETTING && !hands ? 0 : 1;
}
"""
    )
    assert "has no cells" in run(build(str(source), linkage="hands"), path)


SET = """#include <stdio.h>
#include <stdlib.h>
#include "viscera_hands.h"
int main(int argc, char **argv) {
    char message[256] = "";
    viscera_model *first, *model;
    viscera_sampling sampling;
    viscera_hands *hands;
    viscera_grasp *grasp;
    viscera_held *held;
    const double point[3] = {0.2, 0.05, 0.1}, push[3] = {0, 0, -0.005};
    double force[3], error, field[3 * 256], stress[9 * 256];
    if (argc != 3 || viscera_load_file(argv[1], &first, message, sizeof message)) return puts(message);
    if (viscera_set_parameter(first, atof(argv[2]), message, sizeof message)) return puts(message);
    if (viscera_copy(first, &model, message, sizeof message)) return puts(message);
    viscera_free(first);
    viscera_sampling_init(model, &sampling);
    if (viscera_hands_new(model, &sampling, &hands, message, sizeof message)) return puts(message);
    if (viscera_grasp_new(hands, point, 1, NULL, NULL, &grasp, message, sizeof message)) return puts(message);
    if (viscera_held_new(grasp, &held, message, sizeof message)) return puts(message);
    if (viscera_grasp_solve(grasp, push, 3, 0, 0, held) || viscera_held_forces(held, force, 3)) return 2;
    if (viscera_held_assess(held, &error)) return 3;
    viscera_info_t info;
    viscera_info(model, &info);
    const size_t cells = viscera_cell_count(model);
    if (info.points > 256 || cells > 256 || viscera_held_field(held, field, 3 * info.points)) return 4;
    if (viscera_hands_stress(hands, field, 3 * info.points, stress, 9 * cells)) return 5;
    for (int i = 0; i < 3; i++) printf("%.17g ", force[i]);
    for (size_t i = 0; i < 9 * cells; i++) printf("%.17g ", stress[i]);
    viscera_held_free(held);
    viscera_grasp_free(grasp);
    viscera_hands_free(hands);
    viscera_free(model);
    return 0;
}
"""


VARIED = [vs.Vary("young", 5e3, 2e4, "x > 50%", nodes=3), vs.Vary("poisson", 0.2, 0.4, nodes=3)]


@pytest.mark.parametrize("vary", VARIED, ids=["young", "poisson"])
def test_hands_have_the_law_of_the_value(vary: vs.Vary, block: Block, build: Build, tmp_path: Path) -> None:
    """In a part of the organ and in all of it, with forces and stresses as of the organ that Python makes.

    The law is the same to the last bit: rounded otherwise, forces differ by some 1e-14 here, and by up to the tolerance
    of a search in larger organs.
    """
    beam = vs.mesh(*block((6, 1, 1), (0.4, 0.1, 0.1)))
    organ = vs.Organ(beam, vs.NeoHookean(young=1e4, poisson=0.3), fixed="x < 1%", element="P1")
    touch = organ.reduce("z > 99% and x > 30% and x < 70%", radius=0.05, depth=0.02, order=2, vary=vary)
    touch.save(tmp_path / "beam.viscera")
    (tmp_path / "set.c").write_text(SET)
    program = build(str(tmp_path / "set.c"), linkage="hands")
    low, high = float(vary.low), float(vary.high)
    for part in (0.0, 0.1, 0.2, 0.5, 0.6, 0.8, 1.0):
        value = low + part * (high - low)
        found = np.array(run(program, tmp_path / "beam.viscera", value).split(), dtype=float)
        held = touch.at(value).galerkin().solve([((0.2, 0.05, 0.1), (0, 0, -0.005))])
        of_cells = held.stress().reshape(-1)
        np.testing.assert_allclose(found[:3], held.force[0], rtol=0, atol=1e-15 * np.abs(held.force).max())
        np.testing.assert_allclose(found[3:], of_cells, rtol=0, atol=1e-15 * np.abs(of_cells).max())


PLACES = """#include <stdio.h>
#include "viscera_hands.h"
int main(int argc, char **argv) {
    char message[256] = "";
    viscera_model *model, *copy, *other;
    viscera_sampling sampling;
    viscera_hands *hands;
    viscera_grasp *grasp;
    viscera_held *held;
    viscera_places *of[3];
    const double point[3] = {0.2, 0.05, 0.1}, push[3] = {0, 0, -0.005}, place[3] = {0.21, 0.05, 0.05};
    if (argc != 3 || viscera_load_file(argv[1], &model, message, sizeof message)) return puts(message);
    if (viscera_load_file(argv[2], &other, message, sizeof message)) return puts(message);
    if (viscera_copy(model, &copy, message, sizeof message)) return puts(message);
    viscera_sampling_init(model, &sampling);
    if (viscera_hands_new(model, &sampling, &hands, message, sizeof message)) return puts(message);
    if (viscera_grasp_new(hands, point, 1, NULL, NULL, &grasp, message, sizeof message)) return puts(message);
    if (viscera_held_new(grasp, &held, message, sizeof message)) return puts(message);
    if (viscera_grasp_solve(grasp, push, 3, 0, 0, held)) return 2;
    viscera_model *models[3] = {model, copy, other};
    for (int k = 0; k < 3; k++) {
        double moved[3] = {1, 1, 1};
        if (viscera_places_at(models[k], place, 1, &of[k], message, sizeof message)) return puts(message);
        printf("%d ", viscera_held_places(held, of[k], moved, 3));
        printf("%.17g\\n", moved[2]);
        viscera_places_free(of[k]);
    }
    viscera_held_free(held);
    viscera_grasp_free(grasp);
    viscera_hands_free(hands);
    viscera_free(copy);
    viscera_free(other);
    viscera_free(model);
    return 0;
}
"""


def test_places_in_another_mesh_are_refused(block: Block, build: Build, tmp_path: Path) -> None:
    """Also one with as many nodes; those of a copy of the model are in the same mesh."""
    for name, width in (("model", 0.1), ("other", 0.11)):
        beam = vs.mesh(*block((6, 1, 1), (0.4, width, 0.1)))
        organ = vs.Organ(beam, vs.NeoHookean(young=1e4, poisson=0.3), fixed="x < 1%", element="P1")
        organ.reduce("z > 99% and x > 30% and x < 70%", radius=0.05, depth=0.02, order=2).save(
            tmp_path / f"{name}.viscera"
        )
    (tmp_path / "places.c").write_text(PLACES)
    program = build(str(tmp_path / "places.c"), linkage="hands")
    lines = run(program, tmp_path / "model.viscera", tmp_path / "other.viscera").split("\n")
    own, copy, other = (line.split() for line in lines[:3])
    assert own[0] == "0"
    assert float(own[1]) < 0
    assert copy == own
    assert other == ["8", "0"]


def test_the_wrapper_of_hands_in_cpp(model: Path, build: Build) -> None:
    assert "in millimetres" in run(build("tests/hands.cpp", linkage="hands"), model)


def test_two_hands_in_a_loop_with_a_second_thread(model: Path, build: Build) -> None:
    output = run(build("examples/hands.c", linkage="hands"), model)
    assert len(re.findall(r"the hands feel", output)) == 6
    trusted, assessed = map(int, re.findall(r"(\d+) of \d+ ticks trusted, \d+ of (\d+) answers", output)[0])
    assert trusted > 1500, "a machine that does much else at once makes some ticks late"
    assert assessed > 0


@pytest.mark.parametrize("sanitizer", ["address,undefined", "thread"])
def test_sanitizers_find_nothing_in_hands(
    model: Path, build: Build, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, sanitizer: str
) -> None:
    """The C side is instrumented, and all memory of both sides is the sanitizer's.

    The thread sanitizer does not see the atomics of the library, so it looks at the C side alone.
    """
    monkeypatch.setenv("TSAN_OPTIONS", "ignore_noninstrumented_modules=1")
    flags = ("-g", f"-fsanitize={sanitizer}", "-fno-sanitize-recover=all")
    probe = tmp_path / "probe.c"
    probe.write_text("int main(void) { return 0; }\n")
    if subprocess.run(["cc", *flags, probe, "-o", tmp_path / "probe"], capture_output=True).returncode != 0:
        pytest.skip(f"the compiler has no -fsanitize={sanitizer}")
    # Training takes minutes under the thread sanitizer.
    for source in ("examples/hands.c", "tests/hands_refusals.c")[: 1 if sanitizer == "thread" else 2]:
        run(build(source, linkage="hands", flags=flags), model)
