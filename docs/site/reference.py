"""The Python reference: every public name, in the order in which one meets them."""

from __future__ import annotations

import inspect

import viscera

GROUPS = {
    "Meshes": ("Mesh", "read", "mesh", "organs", "helical_fibres"),
    "Scans": ("Scan", "scan", "mesh_surface", "image_fibres"),
    "Laws": (
        "laws",
        "NeoHookean",
        "StableNeoHookean",
        "MooneyRivlin",
        "Yeoh",
        "Ogden",
        "ArrudaBoyce",
        "VerondaWestmann",
        "Fung",
        "HolzapfelGasserOgden",
        "SaintVenantKirchhoff",
        "Corotated",
        "Linear",
        "StrainEnergy",
        "fit",
        "MaterialTest",
        "SpecimenTest",
        "Fit",
    ),
    "Organs and equilibrium": (
        "Organ",
        "State",
        "ConjugateGradients",
        "compare",
        "Unloaded",
        "Registered",
        "case",
        "Case",
    ),
    "Stress, strain and results": ("Deformed", "Moved", "PointValues", "principal", "write_series"),
    "Supports and scenes": ("ElasticSupport", "Spring", "Scene", "Bond", "ContactPair", "SceneCase"),
    "Contact": ("Tool", "Sphere", "Capsule", "Box", "HalfSpace", "Shape", "Contact", "Instrument", "Forceps"),
    "Reduced models": ("Touch", "Answer", "RigidProbe", "Probes", "Felt", "load", "Vary", "sweep"),
    "Real time": ("Stepper", "Frame", "Hand", "BackwardEuler", "Newmark", "Prony"),
    "Errors": ("VisceraError", "NotConverged"),
}
MODULES = {"laws": "viscera.law", "organs": "viscera.organs"}
HIDDEN = {"__version__"}


def python_pages() -> dict[str, str]:
    """A page a group, and their table of contents; a public name that no group has is an error."""
    missing = set(viscera.__all__) - HIDDEN - {name for names in GROUPS.values() for name in names}
    if missing:
        raise SystemExit(f"docs/site/reference.py: put {', '.join(sorted(missing))} into a group")
    pages = {f"python/{slug(group)}.md": page(group, names) for group, names in GROUPS.items()}
    entries = "\n".join(slug(group) for group in GROUPS)
    pages["python/index.md"] = (
        "# Python\n\n`import viscera as vs`. All quantities are in SI units unless a name says otherwise.\n\n"
        f"```{{toctree}}\n:maxdepth: 2\n\n{entries}\n```\n"
    )
    return pages


def page(group: str, names: tuple[str, ...]) -> str:
    """One group: a heading and what autodoc makes of each name."""
    directives = "\n\n".join(directive(name) for name in names)
    return f"# {group}\n\n```{{eval-rst}}\n.. py:currentmodule:: viscera\n\n{directives}\n```\n"


def directive(name: str) -> str:
    if name in MODULES:
        return "\n".join(f".. autofunction:: {MODULES[name]}.{verb}" for verb in verbs(MODULES[name]))
    thing = getattr(viscera, name)
    if inspect.isclass(thing):
        return f".. autoclass:: viscera.{name}\n   :members:\n   :inherited-members: Exception, object"
    return f".. autofunction:: viscera.{name}"


def verbs(module: str) -> list[str]:
    """The public functions that a module defines."""
    members = inspect.getmembers(inspect.getmodule(__import__(module, fromlist=["_"])), inspect.isfunction)
    return [name for name, function in members if not name.startswith("_") and function.__module__.startswith(module)]


def slug(group: str) -> str:
    return group.lower().replace(",", "").replace(" ", "-")
