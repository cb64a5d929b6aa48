"""CASE.toml: one organ with its loads, settings and reduction, in the words of the Python API.

    mesh = "liver.vtu"            # relative to this file; "organ:liver" takes the built-in one
    units = "mm"                  # m, cm, mm, um, inch, or metres per unit
    fixed = "hilum"               # a set's name, a condition such as "x < 10%", or node indices
    element = "P1 mean volume"          # or "P1", "P2"; without it, what is right for the material

    [material]
    law = "NeoHookean"
    young = 0.17e6
    poisson = 0.48

    [material.nodule]             # what differs in a set of cells, or where a condition such as "x > 80%" holds
    young = 1.7e6

    [supports.capsule]            # springs spread over a piece of surface
    stiffness = 1e6               # N/m^3, along the normal; `tangential` along the surface

    [loads]
    gravity = [0, 0, -9.81]
    density = 1060
    displacement.lobe = [0, "free", -0.01]
    force."z > 90%" = [0, 0, -2.0]
    traction.capsule = [0, 0, 50] # Pa
    pressure.vein = 2e3           # Pa, against the outward normal

    [scan]                        # the mesh was acquired under these loads, in the words of [loads]
    gravity = [0, -9.81, 0]       # `solve` takes them off first, and counts displacements from the scan

    [settings]
    steps = 4

    [reduce]
    touchable = "anterior"
    radius = "12 mm"              # or a number in metres, or a percentage of the bounding-box diagonal
    depth = "10%"
    start = "loads"               # touch the organ as the [loads] leave it, or as it was in the "scan"; or at "rest"

    [reduce.vary]                 # one model for a range of "young", "poisson" or the contact "radius"
    parameter = "young"
    part = "nodule"               # a cell set or a condition; the whole organ without it
    low = 10e3
    high = 100e3

`schema` defines the keys and their values; anything else is refused when the file is read.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from viscera import organs
from viscera.boundary.elastic_support import ElasticSupport
from viscera.boundary.holding import AT_REST
from viscera.cases import schema, toml
from viscera.cases.material import material
from viscera.errors import VisceraError, did_you_mean, naming
from viscera.files.atomic import followed
from viscera.files.mesh import metres_per_unit
from viscera.members import words_of
from viscera.mesh import Mesh, read
from viscera.navigation import Unloaded
from viscera.organ import Organ
from viscera.progress import Progress
from viscera.quantity import brief, path_of
from viscera.reduced.checkpoint import Checkpoint
from viscera.reduced.touch import Touch
from viscera.reduced.vary import of_words
from viscera.state import State

Made = TypeVar("Made", bound="Solvable")
PLACED = ("displacement", "force", "traction", "pressure")
"""Loads that act at a place."""
NAMES = {"reduce": "reduction"}
"""Attributes of a case whose name differs from the key in the file."""
OF_SCENES = ("bonds", "springs", "contacts", "bodies")
"""Tables that only a scene has."""
BUILT_IN: dict[str, Callable[[], Mesh]] = {"liver": organs.liver, "beam": organs.beam, "artery": organs.artery}


class Solvable:
    """What a case of an organ and one of a scene have in common: loads and settings, and a solution under them."""

    loads: Mapping[str, Any]
    settings: Mapping[str, Any]
    file: str
    """Name of the file that was read, for errors; empty if none was."""

    @property
    def files(self) -> list[Path]:
        """The files that the case reads."""
        raise NotImplementedError

    def loading(self) -> dict[str, Any]:
        """Loads and settings as `Organ.solve` and `Scene.solve` take them.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> case = beam.to_case("beam.toml", loads={"force": {"tip": (0, 0, -10.0)}})
        >>> case.organ().solve(**case.loading()).is_converged
        True
        """
        with naming(self.file):
            _require_density(self.loads, self.loads.get("density"), "loads")
        return {
            **{kind: self.loads.get(kind, {}) for kind in PLACED},
            **{kind: self.loads.get(kind) for kind in ("gravity", "density")},
            "steps": self.settings.get("steps", 1),
            "settings": self.settings.get("newton"),
            "solver": self.settings.get("solver", "auto"),
        }

    def solve(self, organ: Organ, progress: Progress | None = None) -> State:
        """Static equilibrium of the organ or scene under the case's loads.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> case = beam.to_case("beam.toml", loads={"force": {"tip": (0, 0, -10.0)}})
        >>> organ = case.organ()
        >>> case.solve(organ).status
        'converged'
        """
        with naming(self.file):
            return organ.solve(**self.loading(), progress=progress)

    def _placed(self) -> Iterator[tuple[str, str]]:
        """Every place of the loads, and the key that names it."""
        for kind in PLACED:
            yield from ((place, f"{kind} in [loads]") for place in self.loads.get(kind, {}))


@dataclass(frozen=True)
class Case(Solvable):
    """A case file as read and checked; lengths and places are not resolved yet.

    >>> import viscera as vs
    >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
    >>> case = beam.to_case("beam.toml", loads={"force": {"tip": (0, 0, -10.0)}})
    >>> case.material["law"], case.loads
    ('NeoHookean', {'force': {'tip': [0, 0, -10.0]}})
    """

    mesh: str
    material: Mapping[str, Any]
    fixed: Any = None
    supports: Mapping[str, Any] = field(default_factory=dict)
    units: str | float | None = None
    element: str | None = None
    loads: Mapping[str, Any] = field(default_factory=dict)
    scan: Mapping[str, Any] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    reduction: Mapping[str, Any] = field(default_factory=dict)
    folder: Path = Path()
    file: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        """Raise `VisceraError` naming the first key that a case does not have."""
        words = {name: getattr(self, NAMES.get(name, name)) for name in schema.CASE.keys}
        schema.CASE({name: word for name, word in words.items() if word is not None}, "a case")
        if self.reduction:
            self._require_start()

    def _require_start(self) -> None:
        """Raise `VisceraError` unless [reduce] says which state is touched, and the case has its loads."""
        start = self.reduction.get("start")
        if start is None and self.scan:
            raise VisceraError(
                'a case with a [scan] must say what is touched: start = "scan", "loads" or "rest" in [reduce]'
            )
        if start == "scan" and not _acts(self.scan):
            raise VisceraError('start = "scan" in [reduce] needs the loads of the scan in a table [scan]')
        if start == "loads" and not _acts(self.loads):
            raise VisceraError(
                'start = "loads" in [reduce] needs loads in a table [loads]; give them, or say start = "rest"'
            )

    def organ(self) -> Organ:
        """The organ: mesh, law and supports; each place of the case becomes a named set of its mesh.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> case = beam.to_case("beam.toml", loads={"force": {"tip": (0, 0, -10.0)}})
        >>> case.organ()
        Organ(525 points, 1920 cells, NeoHookean, P1, 25 fixed nodes)
        """
        with naming(self.file):
            return self._organ(self._mesh())

    def _mesh(self) -> Mesh:
        with naming("mesh"):
            return load_mesh(self.mesh, self.units, self.folder)

    def _organ(self, plain: Mesh, others: Iterable[tuple[str, str]] = ()) -> Organ:
        """The organ on its mesh, whose sets are also the places that others than the case name, each with its key."""
        sets = dict[str, Any]()
        for place, key in (*self._placed(), *others):
            with naming(key):
                sets[place] = plain.nodes(place)
        named_mesh = plain.with_sets(**sets)
        supports = [ElasticSupport(place, **words) for place, words in self.supports.items()]
        held: dict[str, Any] = {"fixed": self.fixed, "supports": supports}
        return Organ(named_mesh, material(self.material, plain), element=self.element, **held)

    def _placed(self) -> Iterator[tuple[str, str]]:
        """Every place in words that the case names, and its key."""
        yield from super()._placed()
        yield from ((place, f"[supports.{place}]") for place in self.supports)
        for kind in PLACED:
            yield from ((place, f"{kind} in [scan]") for place in self.scan.get(kind, {}))
        held: dict[str, Any] = {"fixed": self.fixed, "touchable in [reduce]": self.reduction.get("touchable")}
        for key, place in held.items():
            yield from ((each, key) for each in words_of(place) or [place] if isinstance(each, str))

    @property
    def files(self) -> list[Path]:
        """The files that the case reads: that of its mesh.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> [path.name for path in beam.to_case("beam.toml").files]
        ['beam_mesh.vtu']
        """
        return [] if self.mesh.startswith("organ:") else [self.folder / self.mesh]

    def solve(self, organ: Organ, progress: Progress | None = None) -> State:
        """Static equilibrium of the organ under the case's loads, free of load before.

        Raises `VisceraError` for a case with a [scan], whose loads are to be removed first; see `predict`.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> case = beam.to_case("beam.toml", loads={"force": {"tip": (0, 0, -10.0)}})
        >>> case.solve(case.organ()).status
        'converged'
        """
        if self.scan:
            with naming(self.file):
                raise VisceraError(
                    "the mesh is loaded, says [scan], and `solve` takes it as free of load; "
                    "use case.predict(case.unloaded(case.organ()))"
                )
        return super().solve(organ, progress)

    def unloaded(self, organ: Organ, progress: Progress | None = None) -> Unloaded:
        """The organ free of the loads of its [scan]; if that has no density, the density of [loads] is taken.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> case = beam.to_case("beam.toml", scan={"gravity": (0, 0, -1.0), "density": 100.0})
        >>> case.unloaded(case.organ()).is_converged
        True
        """
        loads = {"density": self.loads.get("density"), **self.scan}
        with naming(self.file):
            _require_density(loads, loads["density"], "scan")
            return organ.unloaded(**loads, progress=progress)

    def predict(self, rest: Unloaded, progress: Progress | None = None) -> State:
        """Equilibrium of an organ from `unloaded` under the case's loads; displacements count from the scan.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> hanging = {"gravity": (0, 0, -1.0), "density": 100.0}
        >>> case = beam.to_case("beam.toml", scan=hanging, loads=hanging)
        >>> state = case.predict(case.unloaded(case.organ()))
        >>> bool(state.max_displacement < 1e-6)  # the posture of the scan again
        True
        """
        with naming(self.file):
            return rest.from_scan(rest.organ.solve(**self.loading(), start=rest.state, progress=progress))

    def require_unloaded(self, verb: str, remedy: str = "solve the [scan] first, with `viscera solve`") -> None:
        """Raise `VisceraError` with the remedy if the case has a [scan], which only `viscera solve` can remove.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> case = beam.to_case("beam.toml", scan={"gravity": (0, 0, -1.0), "density": 100.0})
        >>> case.require_unloaded("compare")
        Traceback (most recent call last):
        viscera.errors.VisceraError: `viscera compare` takes the mesh as free of load; ...
        """
        if self.scan:
            raise VisceraError(f"`viscera {verb}` takes the mesh as free of load; {remedy}")

    def reactions(self, organ: Organ, state: State) -> dict[str, list[float]]:
        """Total force (3,) [N] at each place that holds or moves the organ, by its name in the case.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> case = beam.to_case("beam.toml", loads={"force": {"tip": (0, 0, -10.0)}})
        >>> organ = case.organ()
        >>> reactions = case.reactions(organ, case.solve(organ))
        >>> {place: round(force[2], 3) for place, force in reactions.items()}
        {'clamp': 10.0}
        """
        moved = {place: state.reaction(place).tolist() for place in self.loads.get("displacement", {})}
        found = {
            place: state.support_force(own).tolist() for place, own in zip(self.supports, organ.supports, strict=True)
        }
        if self.fixed is not None:
            place = self.fixed if isinstance(self.fixed, str) else "fixed"
            found[place] = state.reaction(organ.fixed).tolist()
        return {**found, **moved}

    def reduce(self, organ: Organ, progress: Progress | None = None, checkpoint: Checkpoint | None = None) -> Touch:
        """The reduced model of the organ by the case's [reduce] table, about the equilibrium that `start` names.

        >>> import viscera as vs
        >>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
        >>> case = beam.to_case("beam.toml", reduction={"touchable": "tip", "depth": "2%", "order": 2})
        >>> case.reduce(case.organ())
        Touch(525 points, order 2, depth 0.0207846 m)
        """
        with naming(self.file):
            options = self._reduction(organ)
            organ, state = self._touched(organ, options.pop("start", None), progress)
            return organ.reduce(**options, start=state, checkpoint=checkpoint, progress=progress)

    def _reduction(self, organ: Organ) -> dict[str, Any]:
        """What [reduce] says; what is wrong there for the organ is refused before loads are solved."""
        self._require_start()
        options = dict(self.reduction)
        if "vary" in options:
            with naming("[reduce.vary]"):
                options["vary"] = vary = of_words(options["vary"])
                if vary.part is not None:
                    organ.mesh.cells_in(vary.part)
        with naming("[reduce]"):
            organ._sizes(*(options.get(name) for name in ("radius", "depth", "vary")))
        organ._require_held(AT_REST)
        return options

    def _touched(self, organ: Organ, start: Any, progress: Progress | None) -> tuple[Organ, State | None]:
        """The organ free of load, and the equilibrium that its touches start from; None at rest."""
        scanned = None
        if self.scan:
            rest = self.unloaded(organ, progress)
            if not rest.is_converged:
                raise VisceraError(f"the loads of the [scan] cannot be removed: {rest.message}")
            organ, scanned = rest.organ, rest.state
        if start == "loads":
            return organ, organ.solve(**self.loading(), start=scanned, progress=progress)
        return organ, scanned if start == "scan" else None


def read_case(path: str | os.PathLike[str]) -> Case:
    """Read a CASE.toml of one organ; raises `VisceraError` with the file and the key that is wrong or missing."""
    return read_words(path, case_of)


def read_words(path: str | os.PathLike[str], made: Callable[[Mapping[str, Any], Path, str], Made]) -> Made:
    """What is `made` of the words of a TOML file, of its folder and of its name; errors name the file.

    Of a symbolic link, the folder is that of the file itself, unless a file that the case names is not there.
    """
    source = path_of(path, "the case file")
    if source.is_dir() or not source.exists():
        raise VisceraError(f"{source}: {'is a folder, not a case file' if source.is_dir() else 'no such case file'}")
    words = toml.read(source)
    with naming(str(source)):
        read = made(words, followed(source).parent, str(source))
        if source.is_symlink() and not all(map(os.path.exists, read.files)):  # a folder of links into a store
            return made(words, source.parent, str(source))
        return read


def case_of(words: Mapping[str, Any], folder: Path = Path(), file: str = "") -> Case:
    """A case from the words of its file; raises `VisceraError` naming the key that is wrong or missing."""
    if "organs" in words:
        raise VisceraError(
            "a scene of several organs, and this takes one organ; `viscera solve`, `viscera view` and viscera.case "
            "take scenes"
        )
    for table in OF_SCENES:
        if table in words:
            raise VisceraError(
                f"[[{table}]] belong to a scene, and this is a case of one organ: move its mesh, units, fixed, "
                "supports, element and [material] into [organs.NAME] and [organs.NAME.material], and put NAME/ before "
                "the places in [loads]; in Python one organ takes tools by organ.solve(contact=[...])"
            )
    schema.CASE(words, "a case")  # unknown keys, which a `Case` has no place for
    return Case(**{NAMES.get(name, name): word for name, word in words.items()}, folder=folder, file=file)


def _require_density(loads: Mapping[str, Any], density: Any, table: str) -> None:
    if loads.get("gravity") is not None and density is None:
        raise VisceraError(f"gravity in [{table}] needs the key density [kg/m^3] there")


def _acts(loads: Mapping[str, Any]) -> bool:
    """Whether there is a load among these words, and not a density alone."""
    return any(len(loads.get(kind, ())) > 0 for kind in (*PLACED, "gravity"))


def load_mesh(name: str, units: str | float | None, folder: Path = Path()) -> Mesh:
    """A mesh file in the given units, or a built-in organ as `organ:liver`."""
    if name.startswith("organ:"):
        organ = name.removeprefix("organ:")
        if organ not in BUILT_IN:
            raise VisceraError(f"unknown built-in organ {brief(organ)}; {did_you_mean(organ, BUILT_IN)}")
        if units is not None and metres_per_unit(units) != 1.0:
            raise VisceraError(
                f'{name}: a built-in organ is in metres, and the units are {brief(units)}: leave them out, or say "m"'
            )
        return BUILT_IN[organ]()
    if units is None:
        file = path_of(folder / name, "the mesh file")
        if not file.exists():
            raise VisceraError(f"{file}: no such file; name a mesh file, or a built-in organ as 'organ:liver'")
        raise VisceraError(f"{name}: a mesh file needs its units, such as 'mm' or 'm'")
    return read(folder / name, units=units)
