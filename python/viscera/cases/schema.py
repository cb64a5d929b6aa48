"""What a case file may hold: its tables, their keys, and what each value must be.

Cases are checked against it before anything else is done, and docs/case-file.md is written from it.
"""

from __future__ import annotations

from typing import Any

from viscera import defaults, reducible, statics, supported
from viscera.boundary import elastic_support
from viscera.cases.entries import Components, Key, Length, PerCell, Place, Places, Table, Text, Units
from viscera.cases.material_schema import Material
from viscera.errors import naming
from viscera.quantity import Choice, Flag, Number, Vector
from viscera.reduced import vary
from viscera.solver import NAMES as SOLVERS
from viscera.solver import NEWTON

STARTS = ("rest", "loads", "scan")
"""States that the touches of a reduced model may start from."""


class End:
    """One end of a range: of a length, or of another parameter; `Varied` knows of which, and whether it has words."""

    def __call__(self, value: Any, what: str) -> None:
        if not isinstance(value, str):
            Number()(value, what)

    def __str__(self) -> str:
        kinds = {**vary.ENDS, "radius": Length()}
        return "; ".join(f'for "{name}" {kind}' for name, kind in kinds.items())


class Varied:
    """The table of a range."""

    def __call__(self, words: Any, what: str) -> None:
        VARY(words, what)
        for end in ("low", "high"):
            vary.require_end(words["parameter"], words[end], f"{end} in [{VARY.name}]")
        with naming(f"[{VARY.name}]"):
            vary.of_words(words)

    def __str__(self) -> str:
        return str(VARY)


def _percent(fraction: float) -> str:
    return f'"{100 * fraction:g}%"'


DENSITY = Key(PerCell(Number("kg/m^3", above=0)), "density of the tissue")
GRAVITY = Key(Vector("m/s^2"), "acceleration; needs the density", "none")


def _loads(table: str) -> dict[str, Key]:
    return {
        "force": Key(Places(f"{table}.force", Vector("N")), "total force over the surface of the place", "none"),
        "traction": Key(Places(f"{table}.traction", Vector("Pa")), "dead load per area of the shape at rest", "none"),
        "pressure": Key(
            Places(f"{table}.pressure", Number("Pa")),
            "pressure on the deformed surface, against its outward normal",
            "none",
        ),
        "gravity": GRAVITY,
        "density": DENSITY,
    }


LOADS = Table(
    "loads",
    "Loads on the organ.",
    {
        "displacement": Key(Places("loads.displacement", Components()), "prescribed displacement", "none"),
        **_loads("loads"),
    },
)
SCAN = Table(
    "scan",
    "Loads under which the mesh was acquired. `viscera solve` removes them first, and counts displacements from the "
    "scan. If no density is given here, that of `[loads]` applies.",
    _loads("scan"),
)
SETTINGS = Table(
    "settings",
    "Settings of the solver; rarely needed.",
    {
        "steps": Key(statics.STEPS, "initial number of load steps; more are taken where needed", "1"),
        "solver": Key(Choice(SOLVERS), "solver of the linear systems", '"auto"'),
        "newton": Key(
            Table(
                "settings.newton",
                "Settings of Newton's method.",
                {name: Key(kind, means, default) for name, (kind, means, default) in NEWTON.items()},
            ),
            "settings of Newton's method",
        ),
    },
)
VARY = Table(
    "reduce.vary",
    "One model for a range of a parameter.",
    {
        "parameter": Key(Choice(vary.PARAMETERS), "parameter that varies", is_required=True),
        "part": Key(Place("cell"), "part in which it varies", "the whole organ"),
        "low": Key(End(), "lower end of the range", is_required=True),
        "high": Key(End(), "upper end of the range, above `low`", is_required=True),
        "nodes": Key(vary.NODES, "number of values that are solved", str(vary.Vary.nodes)),
    },
)
REDUCE = Table(
    "reduce",
    "The reduced model that `viscera reduce` makes.",
    {
        "touchable": Key(
            Place("node"),
            "part of the surface that may be touched",
            "the surface farther than the radius from fixed nodes",
        ),
        "radius": Key(Length(), "radius of the contact patch", _percent(defaults.RADIUS_FRACTION)),
        "depth": Key(Length(), "largest contact displacement", _percent(defaults.DEPTH_FRACTION)),
        "order": Key(reducible.ORDER, "order of the series", str(defaults.ORDER)),
        "tolerance": Key(
            statics.TOLERANCE, "relative compression error of the stored field", f"{defaults.TOLERANCE:g}"
        ),
        "pade": Key(Flag(), "sum the series in its Padé form", "true"),
        "memory": Key(reducible.MEMORY, "what positions in progress may take", f"{defaults.MEMORY:g}"),
        "solver": Key(
            reducible.SOLVER,
            "where the right-hand sides of the series are computed: the processor or the device",
            '"cholesky"',
        ),
        "start": Key(
            Choice(STARTS),
            'state that touches start from; `"loads"` and `"scan"` need loads in the table of that name',
            '"rest"; required if there is a `[scan]`',
        ),
        "vary": Key(Varied(), "range of a parameter that the model covers", "none"),
    },
)
SUPPORT = Table(
    "supports.PLACE",
    "Springs spread over the surface of a place, where PLACE stands for its name or condition in quotes.",
    {
        "stiffness": Key(elastic_support.STIFFNESS, "force per area and displacement across it", is_required=True),
        "tangential": Key(elastic_support.TANGENTIAL, "the same along the surface", "the `stiffness`"),
    },
)
CASE = Table(
    "",
    "One organ, with its loads, settings and reduction.",
    {
        "mesh": Key(
            Text(), 'path of a mesh file, from the folder of the case; or an organ: "organ:liver"', is_required=True
        ),
        "units": Key(Units(), "unit of the mesh file", "required, except for a built-in organ, which is in metres"),
        "fixed": Key(
            Place("node"),
            "fixed nodes",
            "none; then `supports`, displacements or bonds of a scene must hold the organ in a solve",
        ),
        "supports": Key(Places("supports", SUPPORT), "elastic supports", "none"),
        "element": Key(Choice(supported.ELEMENTS), "element of the mesh", "chosen for the material"),
        "material": Key(Material(), "law and parameters", is_required=True),
        "loads": Key(LOADS, "loads", "no load"),
        "scan": Key(SCAN, "loads under which the mesh was acquired", "the mesh is at rest"),
        "settings": Key(SETTINGS, "settings of the solver"),
        "reduce": Key(REDUCE, "reduced model"),
    },
)
