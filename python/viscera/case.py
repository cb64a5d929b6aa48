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

Unknown keys are errors that name the nearest known one.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from viscera import law, organs
from viscera.errors import VisceraError, did_you_mean
from viscera.fibres import helical_fibres
from viscera.mesh import Indices, Mesh, read
from viscera.navigation import Unloaded
from viscera.organ import Organ, Progress
from viscera.select import length, select, select_cells
from viscera.state import State
from viscera.touch import Touch
from viscera.vary import Vary

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

PARAMETERS = (
    *("young", "poisson", "mu", "lam", "c1", "c2", "kappa", "alpha"),
    *("c10", "c20", "c30", "c", "k1", "k2", "dispersion"),
)
KEYS: dict[str, Collection[str] | None] = {  # of each table; None where the keys are places
    "": ("mesh", "units", "fixed", "element", "material", "loads", "scan", "settings", "reduce"),
    "loads": ("displacement", "force", "traction", "pressure", "gravity", "density"),
    "loads.displacement": None,
    "loads.force": None,
    "loads.traction": None,
    "loads.pressure": None,
    "scan": ("force", "traction", "pressure", "gravity", "density"),
    "scan.force": None,
    "scan.traction": None,
    "scan.pressure": None,
    "settings": ("steps", "newton"),
    "reduce": ("touchable", "radius", "depth", "order", "tolerance", "pade", "start", "vary"),
    "reduce.vary": ("parameter", "part", "low", "high", "nodes"),
    "material": ("law", *PARAMETERS, "volumetric", "bear_compression", "fibres"),
    "material.fibres": ("angle", "axis", "through"),
}
STARTS = ("rest", "loads", "scan")  # of the touches of a reduced model
BUILT_IN: dict[str, Callable[[], Mesh]] = {"liver": organs.liver, "beam": organs.beam, "artery": organs.artery}


@dataclass(frozen=True)
class Case:
    """A case as read: the words of the file, checked for their names; lengths and places still to be resolved."""

    mesh: str
    fixed: Any
    material: Mapping[str, Any]
    units: str | float | None = None
    element: str | None = None
    loads: Mapping[str, Any] = field(default_factory=dict)
    scan: Mapping[str, Any] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    reduction: Mapping[str, Any] = field(default_factory=dict)
    folder: Path = Path()

    def organ(self) -> Organ:
        """The organ: mesh read, law made, supports resolved; each place of the case becomes a named set of its mesh."""
        plain = load_mesh(self.mesh, self.units, self.folder)
        places = [self.fixed]
        for kind in ("displacement", "force", "traction", "pressure"):
            places += [*self.loads.get(kind, {}), *self.scan.get(kind, {})]
        places += [self.reduction["touchable"]] if "touchable" in self.reduction else []
        named = {place: select(plain, place) for place in places if isinstance(place, str)}
        named_mesh = plain.with_sets(**named)
        return Organ(named_mesh, material(self.material, plain), fixed=self.fixed, element=self.element)

    def loading(self) -> dict[str, Any]:
        """Loads and settings as `Organ.solve` takes them."""
        moved = self.loads.get("displacement", {})
        return {
            "displacement": {place: _components(place, values) for place, values in moved.items()},
            "force": self.loads.get("force", {}),
            "traction": self.loads.get("traction", {}),
            "pressure": self.loads.get("pressure", {}),
            "gravity": self.loads.get("gravity"),
            "density": self.loads.get("density"),
            "steps": self.settings.get("steps", 1),
            "settings": self.settings.get("newton"),
        }

    def solve(self, organ: Organ, progress: Progress | None = None) -> State:
        """Static equilibrium of the organ under the case's loads."""
        return organ.solve(**self.loading(), progress=progress)

    def unloaded(self, organ: Organ, progress: Progress | None = None) -> Unloaded:
        """The organ without the loads of its [scan]; the density is that of the [loads] where it is given there."""
        density = self.loads.get("density")
        return organ.unloaded(**{"density": density, **self.scan}, progress=progress)

    def predict(self, rest: Unloaded, progress: Progress | None = None) -> State:
        """Equilibrium under the case's loads of an organ found by `unloaded`; displacements count from the scan."""
        return rest.from_scan(rest.organ.solve(**self.loading(), start=rest.state, progress=progress))

    def require_unloaded(self, verb: str) -> None:
        """Raise `VisceraError` where the case has a [scan], which only `viscera solve` takes off."""
        if self.scan:
            raise VisceraError(
                f"`viscera {verb}` takes the mesh as free of load; solve the [scan] first, with `viscera solve`"
            )

    def reactions(self, organ: Organ, state: State) -> dict[str, list[float]]:
        """Total force (3,) [N] at each place that holds or moves the organ, by the words of the case."""
        moved = {place: state.reaction(place).tolist() for place in self.loads.get("displacement", {})}
        return {self.fixed if isinstance(self.fixed, str) else "fixed": state.reaction(organ.fixed).tolist(), **moved}

    def reduce(self, organ: Organ, progress: Progress | None = None) -> Touch:
        """The reduced model of the organ with the case's [reduce] settings, about the equilibrium they start from."""
        options = dict(self.reduction)
        organ, state = self._touched(organ, options.pop("start", None), progress)
        for name in ("radius", "depth"):
            if name in options:
                options[name] = length(options[name], organ.mesh.diagonal, name)
        vary = _varied(organ.mesh, options.pop("vary")) if "vary" in options else None
        return organ.reduce(**options, start=state, vary=vary, progress=progress)

    def _touched(self, organ: Organ, start: Any, progress: Progress | None) -> tuple[Organ, State | None]:
        """The organ free of load, and the equilibrium that its touches start from; None at rest."""
        if start is None and self.scan:
            raise VisceraError('a [scan] leaves open what is touched: start = "scan", "loads" or "rest" in [reduce]')
        if start not in {None, *STARTS}:
            raise VisceraError(f"start in [reduce] is {start!r}; {did_you_mean(str(start), STARTS)}")
        if start == "scan" and not self.scan:
            raise VisceraError('start = "scan" in [reduce] needs the loads of the scan in a table [scan]')
        scanned = None
        if self.scan:
            rest = self.unloaded(organ, progress)
            if not rest.is_converged:
                raise VisceraError(f"the loads of the [scan] cannot be taken off: {rest.message}")
            organ, scanned = rest.organ, rest.state
        if start == "loads":
            return organ, organ.solve(**self.loading(), start=scanned, progress=progress)
        return organ, scanned if start == "scan" else None


def read_case(path: str | os.PathLike[str]) -> Case:
    """Read a CASE.toml; raises `VisceraError` naming the file and the key that is wrong or missing."""
    source = Path(path)
    try:
        words = tomllib.loads(source.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise VisceraError(f"{source}: no such case file") from None
    except ValueError as error:  # wrong TOML, or bytes that are not UTF-8
        raise VisceraError(f"{source}: not a TOML file ({error})") from error
    _require_known(source, words)
    for name in ("mesh", "fixed", "material"):
        if name not in words:
            raise VisceraError(f"{source}: the key {name!r} is missing")
    words["reduction"] = words.pop("reduce", {})
    return Case(**words, folder=source.parent)


def load_mesh(name: str, units: str | float | None, folder: Path = Path()) -> Mesh:
    """A mesh file in the given units, or a built-in organ as `organ:liver`."""
    if name.startswith("organ:"):
        organ = name.removeprefix("organ:")
        if organ not in BUILT_IN:
            raise VisceraError(f"unknown built-in organ {organ!r}; {did_you_mean(organ, BUILT_IN)}")
        return BUILT_IN[organ]()
    if units is None:
        raise VisceraError(f"{name}: a mesh file needs its units, such as 'mm' or 'm'")
    return read(folder / name, units=units)


def material(words: Mapping[str, Any], mesh: Mesh) -> law.Law:
    """The law that a [material] table describes, its tables naming what differs in a part of the mesh."""
    parameters = {name: value for name, value in words.items() if not _is_part(name, value)}
    if "law" not in parameters:
        raise VisceraError(f"the material names no law; {did_you_mean('', law.LAWS)}")
    kind = law.named(parameters.pop("law"))
    if isinstance(parameters.get("fibres"), Mapping):
        parameters["fibres"] = _called(helical_fibres, "fibres", mesh, **parameters["fibres"])
    for place, part in words.items():
        if not _is_part(place, part):
            continue
        cells = select_cells(mesh, place)
        for name, value in part.items():
            if name not in parameters:
                raise VisceraError(f"material: {place!r} gives {name!r}, which the rest of the organ has no value for")
            parameters[name] = _in_part(parameters[name], cells, value, mesh, f"{name!r} of {place!r}")
    made: law.Law = _called(kind, f"material {kind.__name__}", **parameters)
    return made


def _varied(mesh: Mesh, words: Mapping[str, Any]) -> Vary:
    """The range of a parameter that a [reduce.vary] table describes."""
    options = dict(words)
    missing = [name for name in ("parameter", "low", "high") if name not in options]
    if missing:
        raise VisceraError(f"[reduce.vary]: the key {missing[0]!r} is missing")
    name = options.pop("parameter")
    if name == "radius":
        options |= {end: length(options[end], mesh.diagonal, f"{end} radius") for end in ("low", "high")}
    if "part" in options:
        options["part"] = select_cells(mesh, options["part"])
    return Vary(name, **options)


def _is_part(name: str, value: Any) -> bool:
    """Whether an entry of [material] is a table about a part of the mesh."""
    return isinstance(value, Mapping) and name != "fibres"


def _in_part(whole: Any, cells: Indices, value: Any, mesh: Mesh, name: str) -> Any:
    """A parameter per cell: `value` in the given cells, what it was in the others; lists (of terms) entry by entry."""
    if isinstance(whole, list):
        if not isinstance(value, list) or len(value) != len(whole):
            raise VisceraError(f"material: {name} must be a list of {len(whole)} numbers, as elsewhere, got {value!r}")
        return [_in_part(*pair, mesh=mesh, name=name) for pair in zip(whole, [cells] * len(whole), value, strict=True)]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise VisceraError(f"material: {name} must be a number, got {value!r}")
    values = np.array(np.broadcast_to(np.asarray(whole, dtype=float), len(mesh.cells)))
    values[cells] = value
    return values


def _called(make: Callable[..., Any], what: str, *arguments: Any, **words: Any) -> Any:
    try:
        return make(*arguments, **words)
    except TypeError as error:
        raise VisceraError(f"{what}: {str(error).split('() ')[-1]}") from error


def _components(name: str, values: Any) -> list[float | None]:
    if not isinstance(values, list) or len(values) != 3:
        raise VisceraError(f"displacement of {name!r}: give three numbers [m], 'free' for a free one, got {values!r}")
    for value in values:
        if isinstance(value, str) and value != "free":
            raise VisceraError(f"displacement of {name!r}: {value!r} is neither a number [m] nor 'free'")
    return [None if value == "free" else value for value in values]


def _require_known(source: Path, words: Mapping[str, Any]) -> None:
    for table, keys in KEYS.items():
        inside: Any = words
        for name in table.split(".") if table else []:
            inside = inside.get(name, {})
        if table == "material.fibres" and isinstance(inside, list):
            continue
        if not isinstance(inside, Mapping):
            raise VisceraError(f"{source}: {table!r} is a table, written as [{table}], got {inside!r}")
        for key, value in inside.items():
            if table == "material" and _is_part(key, value):
                _require_parameters(source, key, value)
            elif keys is not None and key not in keys:
                where = f" in [{table}]" if table else ""
                raise VisceraError(f"{source}: unknown key {key!r}{where}; {did_you_mean(key, keys)}")


def _require_parameters(source: Path, place: str, part: Mapping[str, Any]) -> None:
    for name in part:
        if name not in PARAMETERS:
            raise VisceraError(
                f"{source}: unknown key {name!r} in [material.{place}]; {did_you_mean(name, PARAMETERS)}"
            )
