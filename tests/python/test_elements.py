"""Elements: convergence on manufactured solutions, locking, the quadratic mesh, and every door that takes a name."""

from __future__ import annotations

from collections.abc import Callable
from itertools import permutations

import numpy as np
import pytest
from numpy.typing import NDArray

import viscera as vs
from viscera.rotation import rotation_matrix

Array = NDArray[np.float64]

YOUNG, NEARLY_INCOMPRESSIBLE = 1e5, 0.49
LAWS: dict[str, Callable[[float], vs.laws.Law]] = {
    "Linear": lambda nu: vs.Linear(young=YOUNG, poisson=nu),
    "Corotated": lambda nu: vs.Corotated(young=YOUNG, poisson=nu),
    "SaintVenantKirchhoff": lambda nu: vs.SaintVenantKirchhoff(young=YOUNG, poisson=nu),
    "NeoHookean": lambda nu: vs.NeoHookean(young=YOUNG, poisson=nu),
    "MooneyRivlin": lambda nu: vs.MooneyRivlin(
        0.2 * YOUNG / (1 + nu), 0.05 * YOUNG / (1 + nu), kappa=YOUNG / (3 - 6 * nu)
    ),
}


def box(counts: tuple[int, int, int], size: tuple[float, float, float]) -> vs.Mesh:
    """Bricks cut into six tetrahedra each, with the sets `clamp`, `tip` (ends along x) and `boundary`."""
    n = np.array(counts)
    corners = np.stack(np.meshgrid(*(np.arange(k) for k in n), indexing="ij"), -1).reshape(-1, 3)
    grid = np.stack(np.meshgrid(*(np.arange(k + 1) for k in n), indexing="ij"), -1).reshape(-1, 3)
    stride = np.array([(n[1] + 1) * (n[2] + 1), n[2] + 1, 1])
    walks = np.cumsum([[0, *stride[list(axes)]] for axes in permutations(range(3))], axis=1)
    cells = ((corners @ stride)[:, None, None] + walks).reshape(-1, 4)
    ends = {"clamp": np.flatnonzero(grid[:, 0] == 0), "tip": np.flatnonzero(grid[:, 0] == n[0])}
    boundary = np.flatnonzero(((grid == 0) | (grid == n)).any(axis=1))
    return vs.mesh(grid * np.array(size) / n, cells, {**ends, "boundary": boundary})


# A displacement without divergence at small strain, of a wave in each direction, that leaves the origin where it is.
AMPLITUDE = 0.1
WAVES = np.array([[0.0, 1.5, 0.5], [0.5, 0.0, 1.5], [1.5, 0.5, 0.0]])


def manufactured(x: Array) -> tuple[Array, Array, Array]:
    """Displacement (k, 3), its gradient (k, 3, 3) and the gradient of that (k, 3, 3, 3) at points (k, 3)."""
    phase = x @ WAVES.T
    first = AMPLITUDE * np.cos(phase)[:, :, None] * WAVES
    second = -AMPLITUDE * np.sin(phase)[:, :, None, None] * (WAVES[:, :, None] * WAVES[:, None, :])
    return AMPLITUDE * np.sin(phase), first, second


def conical_rule() -> tuple[Array, Array]:
    """Barycentric coordinates (64, 4) and weights of sum 1, exact to degree 5."""
    nodes, weights = np.polynomial.legendre.leggauss(4)
    s, w = (nodes + 1) / 2, weights / 2
    x, y, z = (grid.ravel() for grid in np.meshgrid(s, s, s, indexing="ij"))
    wx, wy, wz = (grid.ravel() for grid in np.meshgrid(w, w, w, indexing="ij"))
    l1, l2, l3 = x, y * (1 - x), z * (1 - x) * (1 - y)
    return np.column_stack([1 - l1 - l2 - l3, l1, l2, l3]), 6 * wx * wy * wz * (1 - x) ** 2 * (1 - y)


def shapes(element: str, at: Array) -> tuple[Array, Array]:
    """Shape functions (q, N) and their derivatives (q, N, 4) by the barycentric coordinates `at` (q, 4)."""
    unit = np.broadcast_to(np.eye(4), (len(at), 4, 4))
    if element != "P2":
        return at, unit
    edges = np.array(vs.files.mesh.EDGES)
    a, b = edges.T
    slopes = np.concatenate(
        [(4 * at - 1)[:, :, None] * unit, 4 * (at[:, a, None] * unit[:, b] + at[:, b, None] * unit[:, a])], 1
    )
    return np.concatenate([at * (2 * at - 1), 4 * at[:, a] * at[:, b]], axis=1), slopes


def cell_nodes(mesh: vs.Mesh) -> NDArray[np.uint32]:
    return vs._core.quadratic(mesh.n_corners, mesh.cells)[1] if len(mesh.edges) else mesh.cells


def errors(law: vs.laws.Law, element: str, n: int) -> tuple[float, float]:
    """Relative errors of displacement and of its gradient against the manufactured solution."""
    organ = vs.Organ(box((n, n, n), (1, 1, 1)), law, fixed=lambda x: (x == 0).all(axis=1), element=element)
    mesh, nodes = organ.mesh, cell_nodes(organ.mesh)
    rule, weights = conical_rule()
    values, slopes = shapes(element, rule)
    corners = mesh.points[mesh.cells]
    volume = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6
    of_l = np.linalg.inv(np.concatenate([corners, np.ones((len(corners), 4, 1))], axis=2).transpose(0, 2, 1))[:, :, :3]
    x = np.einsum("qa,mai->mqi", rule, corners).reshape(-1, 3)
    u, gradient, second = manufactured(x)
    body_force = np.zeros_like(u)
    for chunk in np.array_split(np.arange(len(x)), max(1, len(x) // 50_000)):
        tangent = law.tangent(np.eye(3) + gradient[chunk])
        body_force[chunk] = -np.einsum("kijpq,kpqj->ki", tangent, second[chunk])
    m, q = len(mesh.cells), len(weights)
    shares = np.einsum("m,q,qa,mqi->mai", volume, weights, values, body_force.reshape(m, q, 3))
    force = np.zeros_like(mesh.points)
    np.add.at(force, nodes, shares)
    boundary = mesh.surface_nodes
    moved = {tuple(boundary): manufactured(mesh.points[boundary])[0]}
    found = organ.solve(displacement=moved, force=force, throw=True).displacement[nodes]
    grads = np.einsum("qal,mlj->mqaj", slopes, of_l)
    u_error = np.einsum("qa,mai->mqi", values, found) - u.reshape(m, q, 3)
    F_error = np.einsum("mqaj,mai->mqij", grads, found) - gradient.reshape(m, q, 3, 3)

    def norm(field: Array) -> float:
        return float(np.sqrt(np.einsum("m,q,mq->", volume, weights, (field.reshape(m, q, -1) ** 2).sum(axis=2))))

    return norm(u_error) / norm(u), norm(F_error) / norm(gradient)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(
    ("element", "poisson", "meshes", "rates"),
    [
        ("P1", 0.3, (3, 6), (1.7, 0.9)),
        ("P1 mean volume", NEARLY_INCOMPRESSIBLE, (3, 6), (1.7, 0.9)),
        ("P2", NEARLY_INCOMPRESSIBLE, (2, 4), (2.6, 1.8)),
    ],
)
def test_errors_fall_at_the_order_of_the_element(
    law: str, element: str, poisson: float, meshes: tuple[int, int], rates: tuple[float, float]
) -> None:
    """Linear cells gain two orders in the displacement and one in its gradient, quadratic ones three and two."""
    coarse, fine = [np.array(errors(LAWS[law](poisson), element, n)) for n in meshes]
    found = np.log(coarse / fine) / np.log(meshes[1] / meshes[0])
    assert (found > rates).all(), f"rates {found}, errors {coarse} {fine}"


def test_the_default_element_does_not_depend_on_how_stiff_the_tissue_is() -> None:
    """Poisson's ratio comes back from Lame's parameters with a rounding that depends on Young's modulus."""
    mesh = box((1, 1, 1), (1.0, 1.0, 1.0))
    moduli = np.geomspace(1e2, 1e7, 200)
    at_limit = {vs.Organ(mesh, vs.NeoHookean(young=young, poisson=0.45), fixed="clamp").element for young in moduli}
    beyond = {vs.Organ(mesh, vs.NeoHookean(young=young, poisson=0.4501), fixed="clamp").element for young in moduli}
    assert at_limit == {"P1"}
    assert beyond == {"P1 mean volume"}


FIBRES = np.array([(1.0, 0.5, 0.0), (1.0, -0.5, 0.2)])


@pytest.mark.parametrize("per_cell", [False, True])
@pytest.mark.parametrize("element", [None, "P1", "P1 mean volume", "P2"])
def test_a_body_with_fibres_turns_with_its_fibres(element: str | None, per_cell: bool) -> None:
    """Turned with its fibres and its load, in cells of another order, it moves as before."""
    bar, random = box((4, 2, 2), (2, 1, 1)), np.random.default_rng(0)
    fibres = random.normal(size=(2, len(bar.cells), 3)) if per_cell else FIBRES

    def solved(turn: Array, order: NDArray[np.intp]) -> tuple[str, Array, Array]:
        given = (fibres[:, order] if per_cell else fibres) @ turn.T
        law = vs.HolzapfelGasserOgden(1e4, 5e4, 1.0, fibres=given, poisson=0.46)
        assert law.poisson == pytest.approx(0.46)
        turned = vs.mesh(bar.points @ turn.T, bar.cells[order], sets={"root": np.flatnonzero(bar.points[:, 0] == 0)})
        organ = vs.Organ(turned, law, fixed="root", element=element)
        result = organ.solve(gravity=turn @ (0, 0, -9.0), density=30, throw=True)
        return organ.element, result.displacement @ turn, result.von_mises()[np.argsort(order)]

    same = np.arange(len(bar.cells))
    name, expected, stress = solved(np.eye(3), same)
    assert name == (element or "P1 mean volume")
    for angles in ((0, np.pi / 4, 0), (0.3, 1.1, -0.7)):
        found, displacement, turned_stress = solved(rotation_matrix(angles), random.permutation(same))
        assert found == name
        assert np.abs(displacement - expected).max() < 1e-9 * np.abs(expected).max()
        assert turned_stress == pytest.approx(stress, rel=1e-7)
