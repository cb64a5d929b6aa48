"""The compiled core. Private: users import `viscera`. Translation of the crate `viscera-core`, SI units throughout.

Arrays are C-contiguous: points (n, 3) float64 [m], cells (m, 4) uint32, node indices uint32.
Every function raises `ValueError` on bad input (one sentence: the place, the value, what to do).
"""

from collections.abc import Callable, Sequence
from typing import Any, Protocol, TypedDict

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.uint32]

class Batches(Protocol):
    """Finished positions of a reduction, as bytes that mean something to the core alone."""

    def finished(self) -> list[bytes]:
        """Those of an earlier run of the same reduction."""
    def keep(self, batch: bytes) -> None:
        """One more; may raise to stop."""

__version__: str

def laws() -> list[dict[str, Any]]:
    """The rows of the laws: `name`, `parameters` (dicts of `name`, `means`, `kind` "stress", "number" or "fibre",
    `unit`, the bounds `above`, `low`, `high`, `default`, each None where there is none), `is_analytic`, `sample`."""

def law_parameters(name: str) -> list[str]:
    """Names of a law's parameters, in the order of a row; those of a formula as they first appear in it."""

def surface(points: Floats, cells: Indices) -> Indices:
    """Boundary triangles (t, 3), oriented outward."""

def quadratic(n_points: int, cells: Indices) -> tuple[Indices, Indices]:
    """Edges (k, 2), ascending, and the ten nodes (m, 10) of each cell, midpoints numbered from `n_points` by edge."""

def quadratic_surface(points: Floats, cells: Indices) -> Indices:
    """Boundary triangles of a quadratic mesh, four for each face; points with midpoints, corner cells (m, 4)."""

def overlap(points: Floats, first: Indices, second: Indices, reach: float) -> tuple[Indices, Floats, Floats, Floats]:
    """The pieces that two surfaces of triangles (t, 3) have in common: their triangles (p, 2), by corner of a piece its
    barycentric coordinates in both (p, 18) = (p, 3, 2, 3), their areas (p,) [m^2], and how deep the second is behind
    the first (p,) [m]."""

def inspect(points: Floats, cells: Indices) -> dict[str, Any]:
    """Facts about a mesh, no judgement: `volume` [m^3], `cell_volumes` (m,), `quality` (m,) mean ratio in [0, 1],
    `inverted`, `degenerate`, `duplicate`, `overlapping`, `crowded` (cell indices), `loose_points` (point indices),
    `hanging` (k, 2) points with the cells on whose faces they lie, `body` (n,) of each point, joined by shared points,
    -1 for a loose one, `part` (m,) of each cell, joined by shared faces, `n_parts`, `pinches` (points where parts
    meet)."""

def mesh_labels(
    values: NDArray[np.uint16],
    affine: Floats,
    labels: list[tuple[int, str]],
    *,
    volumes: list[float] | None,
    edges: list[float],
    on_progress: Callable[[int, int], None] | None,
) -> dict[str, Any]:
    """Conforming tetrahedra of some labels, by number and name, of a map (i, j, k) with its affine map (3, 4) [m], and
    a mean edge for each [m]: `points` (n, 3), `cells` (m, 4), `owner` (m,) the place of each cell's label in the list,
    `cut` the nodes where the map ends within a label, `edges` that the lattice has for each label, those given or
    shorter [m], `volumes` that each label was to have, those of its voxels unless given [m^3], `dropped` volume of
    each label in separate pieces with less than 5 % of every label, `n_dropped` how many these are, `missed` and
    `n_missed` the same of other separate pieces, for which the edges are too long. `on_progress(done, total)`."""

def winding_numbers(
    points: Floats,
    triangles: Indices,
    shape: Sequence[int],
    affine: Floats,
    *,
    on_progress: Callable[[int, int], None] | None,
) -> NDArray[np.float32]:
    """The generalised winding number of triangles (t, 3) at the voxels of a grid with an affine map (3, 4) [m], with an
    error below 2e-2. `on_progress(done, total)`."""

def vector_pade(series: Floats, a: float) -> Floats:
    """Value (k,) at `a` of the vector Pade form of a series (order + 1, k)."""

def touch_series(body: Body, patches: list[Patch], base: Floats, order: int) -> list[tuple[Floats, Floats]]:
    """Fields (terms, n, 3) and forces (terms, 3) of the series of contacts about the equilibrium `base` (n, 3), which
    may be that of a contact already; monomials as in docs/model-file.md."""

def pgd(
    body: Body,
    *,
    positions: Indices,  # nodes where the load may act
    radius: float,  # of the patch each load is spread over; 0 = the node alone
    load: float,  # at a = 1 [N], along the inward normal
    order: int,
    enrichment: dict[str, float] | None,  # crates/pgd/src/enrichment.rs; None = every position exactly
    on_progress: Callable[[int, int], None] | None,  # order in hand, its pairs so far; may raise to stop
) -> dict[str, Any]:
    """positions (m,) ascending, weights (m,), units [(dofs, forces)] of the unit loads, orders: one dict each with
    F (k, n, 3), G (k, m), sizes, iterations, is_cut, seconds_rhs, seconds_solve."""

def compress(space: Floats, position: Floats, weights: Floats, tolerance: float) -> tuple[Floats, Floats]:
    """F (r, n, 3) and G (r, m) of the field sum_i space[i] position[i] in as few pairs as the tolerance allows;
    space (k, 3 n), position (k, m), weights (m,)."""

def plain_newton(
    body: Body, *, force: Floats, increments: int, max_iterations: int, tolerance: float
) -> tuple[Floats, int, int]:
    """Newton with full steps and equal load increments: the last equilibrium (n, 3), the increments that converged,
    and the iterations in all."""

class Surface:
    """Triangles (t, 3) over points (n, 3), to find the closest point on."""

    def __init__(self, points: Floats, triangles: Indices) -> None: ...
    def closest(self, point: Floats) -> tuple[int, list[float], float]:
        """Triangle, weights of its corners, and distance [m]."""
    def closest_to_each(self, points: Floats) -> tuple[Indices, Floats]:
        """Triangles (k,) and weights (k, 3) of their corners of the points closest to points (k, 3)."""

class Locator:
    """Cells (m, 4) over points (n, 3), to be found by place."""

    def __init__(self, points: Floats, cells: Indices) -> None: ...
    def find(self, places: Floats) -> tuple[NDArray[np.int64], Floats]:
        """The cell (k,) that holds each place (k, 3), -1 where none does, and its barycentric coordinates (k, 4)."""

class Factor:
    """A direct solver of a symmetric matrix, given by its upper triangle in compressed columns, rows ascending and the
    diagonal last in each: "cholesky" where it is positive definite, "ldlt" where it may be indefinite."""

    def __init__(self, kind: str, column_start: Indices, row: Indices) -> None: ...
    @property
    def fill(self) -> int:
        """Entries that the factor stores, zeros within its dense blocks included."""
    @property
    def order(self) -> NDArray[np.uint32]:
        """The rows (n,) in the order in which they are eliminated."""
    @property
    def negative(self) -> int:
        """Negative eigenvalues of the matrix factorised last; 0 for "cholesky"."""
    def factorize(self, values: Floats) -> None: ...
    def solve(self, rhs: Floats) -> Floats:
        """A^-1 rhs (n,)."""

class Law:
    """A constitutive law by name with its parameters, one row for all cells or one row per cell.

    name and parameter columns: "linear", "corotated", "saint_venant_kirchhoff", "neo_hookean" (mu, lam);
    "mooney_rivlin J-1", "mooney_rivlin J^2-1", "mooney_rivlin ln J" (c1, c2, kappa), kappa the bulk modulus at small
    strain.
    """

    def __init__(self, name: str, parameters: Floats) -> None: ...
    @property
    def name(self) -> str: ...
    @property
    def parameters(self) -> Floats: ...
    def stresses(self) -> list[int]:
        """The columns of the parameters to which, together, the energy is proportional."""
    def resists_collapse(self) -> list[bool]:
        """By row, whether the energy grows without bound as the volume vanishes."""
    def moduli(self) -> Floats:
        """Shear and bulk modulus at rest (rows, 2) [Pa]."""
    def energy(self, F: Floats) -> Floats:
        """psi (k,) [J/m^3] of deformation gradients F (k, 3, 3), law of the first cell."""
    def stress(self, F: Floats) -> Floats:
        """First Piola-Kirchhoff stress P (k, 3, 3) [Pa]."""
    def tangent(self, F: Floats) -> Floats:
        """dP/dF (k, 3, 3, 3, 3) [Pa]."""

class Patch:
    """A weighted mean over surface nodes: sum_i w_i u_i."""

    def __init__(self, nodes: Indices, weights: Floats) -> None: ...
    nodes: Indices
    weights: Floats

class Shape:
    """A rigid shape in axes of its own."""

    @staticmethod
    def rounded(half: tuple[float, float, float], radius: float) -> Shape:
        """All points within a radius of a box of these half sides around the origin."""
    @staticmethod
    def half_space() -> Shape:
        """z <= 0."""
    @staticmethod
    def solid(points: Floats, triangles: Indices) -> Shape:
        """The inside of a closed surface."""
    def distance(self, points: Floats) -> Floats:
        """Signed distance (n,) of points (n, 3) [m], negative inside."""

Tool = tuple[Shape, float | None, float, list[list[float]], list[float], list[float], list[float]]
"""Shape, friction (None where bonded), stiffness of the layer, rotation, position, displacement [m] and turn [rad]."""

Anchored = tuple[int, float, float, list[float]]
"""A sample that sticks to a tool: its number, area [m^2], pressure [Pa] and point (3,) in the axes of the tool [m]."""

Link = tuple[list[tuple[int, float]], list[float], float, float, bool]
"""Ends, rest vector, stiffness, length and kind of a spring."""

ContactPair = tuple[Indices, Indices | None, float, float, float]
"""Triangles (t, 3) of both surfaces, or of one that may touch itself, reach [m], stiffness of the layer, coefficient of
friction."""

Ties = tuple[Indices, Indices, Floats, Floats, list[Link], list[ContactPair]]
"""Starts, nodes, weights and stiffnesses of samples; springs; contact pairs."""

class Body:
    """Mesh + law + fixed nodes, with the sparsity pattern and the symbolic factorisation made once."""

    def __init__(
        self,
        points: Floats,
        cells: Indices,
        law: Law,
        fixed: Indices,
        element: str,
        ties: Ties | None = None,
    ) -> None:
        """Points and cells of the linear mesh; fixed nodes of the element's own: "P1", "P1 mean volume" or "P2"; ties
        are `viscera.ties.Ties.core`."""
    def solve(
        self,
        *,
        prescribed: Indices,  # (k,) degrees of freedom 3 * node + component
        values: Floats,  # (k,) displacement there at full load [m]
        force: Floats,  # (n, 3) nodal forces, scaled by the load [N]
        body_force: Floats,  # (n, 3) nodal forces in full at every load level (gravity) [N]
        pressed: Indices,  # (t, 3) or (t, 6) faces under follower pressure, outward: corners, then midpoints
        pressure: Floats,  # (t,) the pressure on each [Pa], positive against the outward normal
        patches: list[tuple[Patch, Floats]],  # weighted mean displacement d (3,) prescribed at full load [m]
        tools: list[Tool],
        anchored: list[list[Anchored]],  # what sticks to each tool since the solve that this one continues
        start: Floats | None,  # (n, 3) displacement to start from; None = rest
        steps: int,
        settings: dict[str, float],  # see `Newton` in crates/solid/src/equilibrium/newton.rs
        solver: Solver,
        on_progress: Callable[[float], None] | None,  # load fraction reached; may raise to stop
    ) -> dict[str, Any]:
        """displacement (n, 3), internal_force (n, 3), external_force (n, 3), patch_forces (k, 3), energy, volume,
        status (str), is_converged, message, device_fault, tangent_on_device (str | None), load (fraction reached),
        iterations, factorizations, linear_iterations, solver (str), load_steps, residuals (list of lists per load step,
        relative), seconds (dict), contact (a dict for each tool, see `viscera.contact.Contact`), anchored (what sticks
        to each tool at the end)."""
    def internal_force(self, displacement: Floats) -> Floats: ...
    def energy(self, displacement: Floats) -> float: ...
    def responses(self, displacement: Floats) -> tuple[Floats, Floats, Floats]:
        """Deformation gradient F (m, q, 3, 3), first Piola-Kirchhoff stress P (m, q, 3, 3) [Pa] of the element and
        strain energy density (m, q) [J/m^3] at the q quadrature points of each cell, of equal weight."""
    def gravity(self, gravity: Floats, density: Floats) -> Floats:
        """Nodal forces (n, 3) of a body force density * gravity; density (1,) or (m,) [kg/m^3]."""
    def lumped_areas(self) -> Floats:
        """(n,) a third of the area of the adjacent boundary triangles [m^2]."""
    def path(
        self,
        *,
        force: Floats,  # (n, 3) at load 1
        pressed: Indices,  # faces as in `solve`
        pressure: Floats,  # (t,) at load 1
        order: int,
        parameter: str,  # "load" | "arc length"
        until: float,  # load factor to reach
        tolerance: float,
        max_expansions: int,
    ) -> list[dict[str, Any]]:
        """ANM continuation: one dict per expansion with `displacement` (order + 1, n, 3), `load` (order + 1,),
        `range` (a_max of the Pade form), `taylor_range`, `residual` (relative, at the end of the range)."""
    def patch(self, point: Floats, radius: float) -> Patch:
        """The smooth contact patch of the given radius [m] around a surface point."""
    def reduce(
        self,
        *,
        touchable: Indices,  # nodes of the touchable surface
        radius: float,
        depth: float,
        order: int,
        tolerance: float,
        pade: bool,  # whether orders are summed in their Pade form
        memory: float,  # what positions in progress may take [bytes]
        preload: Floats | None,  # (n, 3) displacement of the equilibrium to start from [m]; None = rest
        family: dict[str, Any] | None,  # `Vary.family`; members and unseen: [(value, body, radius)]
        metadata: str,  # JSON kept in the file under "user"
        on_progress: Callable[[int, int, str], None] | None,  # done, total, stage; may raise to stop
        batches: Batches | None = None,  # keeps finished positions; None = nobody does
        on_gpu: bool = False,  # whether a graphics processor expands the force
    ) -> tuple[Model, str | None]:
        """The reduced model of all positions of a touchable surface, and the fault of the device."""

class Live:
    """A case in real time for one page (live/): requests in, frames out; raises `ValueError` with a sentence."""

    def __init__(self, case: bytes) -> None: ...
    def describe(self) -> str: ...  # JSON
    def answer(self, request: str) -> bytes: ...  # JSON object; little-endian float32

class Solver(TypedDict):
    """A linear solver: "cholesky", "auto" or the preconditioner of conjugate gradients, their settings by name, and
    where they run ("cpu" or "gpu")."""

    name: str
    settings: dict[str, float]
    device: str

class Setting(TypedDict):
    """A setting of a solver."""

    name: str
    means: str
    kind: str  # "fraction", "part", "whole" or "flag"
    low: float
    high: float
    default: float

def elements() -> list[tuple[str, str]]: ...  # name, what it is
def preconditioners() -> list[str]: ...
def solver_settings() -> dict[str, list[Setting]]: ...  # of "newton", "conjugate_gradients", "enrichment"
def load_gpu(path: str) -> None:
    """Load the library of `gpu/`, if it is not loaded yet; raises `VisceraError`."""

def gpu() -> tuple[str, str, str, bool]:
    """Name, driver and interface of the graphics processor, and whether it is software; raises `VisceraError`."""

def gpu_traffic() -> tuple[int, int, int]:
    """Bytes written to graphics processors since the library was loaded, after their buffers were made; bytes read;
    kernels dispatched."""

def lose_gpu() -> None:
    """Shut the graphics processor down, as after a fault of its driver."""

class Compliance:
    """Displacements by small forces about one state of a body after another; the tangent's pattern is analysed once."""

    def __init__(self, body: Body) -> None: ...
    def responses(self, displacement: Floats, force: Floats) -> Floats:
        """Displacements K^-1 f (k, n, 3) [m] by small nodal forces f (k, n, 3) [N], with the tangent K of a state
        that need not be stable; zero on fixed nodes. Raises for fields of another shape, for a singular tangent, and
        while it is at work in another thread."""

class Stepper:
    """One Newton iteration a frame; the fixed nodes of the body are held beside what is grasped."""

    def __init__(
        self,
        body: Body,
        *,
        start: Floats | None,  # (n, 3) displacement to start from; None = rest
        solver: Solver,
        iterations: int,  # Newton iterations a frame at most
        settled: float,  # residual at which a frame ends, and counts as settled
        extrapolate: bool,  # frames set out from where the last motion leads
        budget: float | None,  # wall time of a frame [s]
        density: Floats,  # (0,), (1,) or (m,) [kg/m^3]
        time_step: float | None,  # [s]
        dynamics: tuple[tuple[float, float] | None, bool, tuple[float, float]] | None,
        # Newmark's beta and gamma (None = backward Euler), lumped mass, Rayleigh's alpha [1/s] and beta [s]
        relaxation: tuple[list[float], list[float]] | None,  # Prony's g and tau [s]
    ) -> None: ...
    def grasp(self, prescribed: Indices, patches: list[Patch]) -> None:
        """Hold these degrees of freedom and patch means, and nothing else beside the fixed nodes."""
    def press(self, pressed: Indices, pressure: Floats) -> None:
        """From the next frame on this pressure pushes, and no other; faces and values as in `Body.solve`."""
    def add_tool(self, tool: Tool) -> int:
        """Adds a rigid tool; its number."""
    def place_tool(self, tool: int, rotation: list[list[float]], position: list[float]) -> None: ...
    def remove_tool(self, tool: int) -> None: ...
    def contact(self, tools: list[int]) -> list[dict[str, Any]]:
        """What these tools did in the last frame, see `viscera.contact.Contact`."""
    def contact_pairs(self) -> list[dict[str, Any]]:
        """What each contact pair of the body did in the last frame."""
    def set_velocity(self, velocity: Floats) -> None: ...
    def displacement(self) -> Floats: ...
    def velocity(self) -> Floats | None: ...
    def reactions(self) -> Floats:
        """(n, 3) internal force and inertia less the forces applied [N]."""
    def frame(
        self,
        *,
        values: Floats,  # (k,) displacements of the grasped degrees of freedom [m]
        means: Floats,  # (p, 3) of the patches [m]
        turns: list[tuple[int, Floats]],  # patches that hold their rotation, and where their arms (k, 3) point [m]
        force: Floats | None,  # (n, 3) nodal forces [N]
        torques: list[tuple[Patch, list[float]]],  # on places that nothing holds (3,) [N m]
        gravity: tuple[float, float, float],  # [m/s^2]
    ) -> dict[str, Any]:
        """displacement (n, 3), reactions (n, 3), supports (n, 3: reactions without those of patches), damping (of
        `viscera.boundary.ties`: beta, velocity, displacement, is_convex; None without beta or ties),
        patch_forces and patch_torques (p, 3), residual (left, relative),
        is_settled, steps (Newton iterations), cells_at_bound, taken (part of the step), is_unstable, iterations (of the
        linear solver), is_solved, floor, within_budget, seconds, energy, kinetic_energy, device_fault (str | None: why
        the graphics processor that was asked for takes no part), tangent_on_device (str | None)."""

class Model:
    """A loaded reduced model and its evaluator."""

    @staticmethod
    def from_bytes(data: bytes) -> Model: ...
    def to_bytes(self) -> bytes: ...
    @property
    def metadata(self) -> str:
        """JSON string: format_version, law, radius, depth, order, tolerance, errors, seconds, user, ...
        The package reads law (its name here), radius, depth, order, errors."""
    def array(self, name: str) -> NDArray[Any]:
        """A named array of the file (docs/model-file.md): points, cells, surface, touchable, positions, ...
        The package reads points (n, 3), cells (m, 4), positions (p,), touchable (q, 3) by position, surface_nodes,
        mode_scale, and to rebuild the full organ fixed (f,) and law_parameters (1 or m, parameters)."""
    def evaluate(self, point: Floats, displacement: Floats, field: bool) -> dict[str, Any]:
        """force (3,) [N], stiffness (3, 3) [N/m], contact_point (3,), and with `field` displacement (n, 3) [m]; of the
        force error_estimate, is_trusted, reason (str, empty when trusted), of the displacement the same with `shape_`:
        shape_error_estimate, is_shape_trusted, shape_reason."""
    def energy(self, point: Floats, displacement: Floats) -> float:
        """Work [J] of the force on the straight way to the displacement."""
    def surface_displacement(self, point: Floats, displacement: Floats, order: int) -> Floats:
        """Displacements of the surface nodes only, in the order of `array("surface_nodes")`."""
    def at(self, value: float, law_parameters: list[float]) -> Model:
        """The model at another value of its parameter."""
    def compressed(self, tolerance: float) -> Model:
        """With the fewest modes that leave less than the tolerance of the field."""
    def surface_alone(self, inside: Indices) -> Model:
        """With these of the nodes inside alone, and set to its value for good."""
    def with_user(self, user: str) -> Model:
        """With other notes (JSON) under `user` in its metadata."""
    def weights(self, point: Floats) -> Patch:
        """The contact patch the model uses at this point: what a full solution must prescribe to compare."""

CONTACT_ERROR: float
VOLUME_BOUNDS: list[float]
PROBE_TOLERANCE: float

class Probe:
    """A rigid sphere on a model. The coupling is stiffness [N/m] and damping [N s/m]."""

    def __init__(
        self, model: Model, radius: float, friction: float, tolerance: float, coupling: tuple[float, float] | None
    ) -> None: ...
    def place(self, center: list[float]) -> dict[str, Any]:
        """center, contact_point, push (displacement of the patch), force, torque (3,), gap, grip (str), and of force
        and shape what `Model.evaluate` gives: error_estimate, is_trusted, reason."""
    def follow(self, device: list[float], dt: float) -> dict[str, Any]:
        """The same after a step towards a device."""
    def lift(self) -> None: ...

class Probes:
    """Several probes on one model that feel each other."""

    def __init__(self, probes: list[Probe]) -> None: ...
    def place(self, centers: list[list[float]]) -> list[dict[str, Any]]:
        """What each feels, as `Probe.place` tells it."""
    def follow(self, devices: list[list[float]], dt: float) -> list[dict[str, Any]]:
        """The same after a step towards their devices."""

class Galerkin:
    """The series model of an organ with its body, for several touches at once."""

    def __init__(
        self,
        model: Model,
        *,
        order: int,  # of the series fields
        tolerance: float,  # of the forces of the sampled cells
        depth: float,  # [m]
        snapshots: int,
    ) -> None: ...
    def grasp(self, points: Floats, wait: bool) -> HyperReducedModel:
        """Contacts at points (k, 3) [m] take hold; without `wait`, snapshots follow while they are in use."""

class HyperReducedModel:
    """Contacts that hold an organ."""

    modes: int
    cells: int  # that the energy is summed over
    snapshots: int  # solved on the whole organ
    seconds: float  # from taking hold to the modes as they are
    def is_training(self) -> bool:
        """Whether better modes are still to come; those that are ready are taken over."""
    def add_snapshot(self) -> bool:
        """Takes in the equilibrium next to the last answer, where that is wrong; whether it was."""
    def patches(self) -> list[Patch]: ...
    def solve(
        self, displacements: Floats, from_last: bool, with_stiffness: bool, budget: float | None
    ) -> GalerkinAnswer:
        """Equilibrium under mean displacements (k, 3) [m], searched for `budget` seconds and a step at most."""
    def superposed(self, displacements: Floats) -> Floats:
        """Field (n, 3) [m] of the superposed series with their coupling."""

class GalerkinAnswer:
    """An answer of a grasp."""

    facts: dict[str, Any]
    """force (k, 3), stiffness (3 k, 3 k) if asked for, energy, status, is_converged, smallest_jacobian, iterations,
    tangents, residual, seconds."""
    def displacement(self) -> Floats:
        """Field (n, 3) [m]."""
    def assess(self) -> tuple[float, float, str]:
        """Expected error of the field, and why not to rely on it: empty where one may."""
