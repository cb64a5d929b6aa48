"""Viscera: organs you can touch.

Hyperelastic soft tissue on tetrahedral meshes, reduced off-line to a model that answers a touch in microseconds.
SI units throughout: metres, newtons, pascals, joules.

>>> import viscera as vs
>>> beam = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.3), fixed="clamp")
>>> touch = beam.reduce(radius=0.1, depth=0.05, order=2)
"""

from viscera import startup  # noqa: F401 - before whatever takes its time

# isort: split
from viscera import compiled  # noqa: F401 - before whatever needs it

# isort: split
from viscera import threads  # noqa: F401 - before the core starts any

# isort: split
from viscera import law as laws
from viscera import organs
from viscera._core import __version__
from viscera.boundary.bond import Bond
from viscera.boundary.elastic_support import ElasticSupport
from viscera.boundary.spring import Spring
from viscera.cases.case import Case
from viscera.cases.scene_case import SceneCase
from viscera.cases.scene_case import read_any as case
from viscera.cluster import sweep
from viscera.comparison import compare
from viscera.contact.forceps import Forceps
from viscera.contact.instrument import Instrument
from viscera.contact.pair import ContactPair
from viscera.contact.shapes import Box, Capsule, HalfSpace, Shape, Sphere
from viscera.contact.tool import Contact, Tool
from viscera.deformed import Deformed, Moved
from viscera.errors import NotConverged, VisceraError
from viscera.fibres import helical_fibres
from viscera.fitting import Fit, MaterialTest, SpecimenTest, fit
from viscera.law import (
    ArrudaBoyce,
    Corotated,
    Fung,
    HolzapfelGasserOgden,
    Linear,
    MooneyRivlin,
    NeoHookean,
    Ogden,
    SaintVenantKirchhoff,
    StableNeoHookean,
    StrainEnergy,
    VerondaWestmann,
    Yeoh,
)
from viscera.mesh import Mesh, mesh, read
from viscera.navigation import Unloaded
from viscera.organ import Organ
from viscera.pointvalues import PointValues
from viscera.reduced.answer import Answer
from viscera.reduced.probe import Felt, Probes, RigidProbe
from viscera.reduced.touch import Touch, load
from viscera.reduced.vary import Vary
from viscera.registration import Registered
from viscera.scans.image_fibres import image_fibres
from viscera.scans.meshing import mesh_surface
from viscera.scans.scan import Scan, scan
from viscera.scene import Scene
from viscera.series import write_series
from viscera.solver import ConjugateGradients
from viscera.state import State
from viscera.stepping.dynamics import BackwardEuler, Newmark, Prony
from viscera.stepping.frame import Frame
from viscera.stepping.hand import Hand
from viscera.stepping.stepper import Stepper
from viscera.stress import principal

__all__ = [
    "Answer",
    "ArrudaBoyce",
    "BackwardEuler",
    "Bond",
    "Box",
    "Capsule",
    "Case",
    "ConjugateGradients",
    "Contact",
    "ContactPair",
    "Corotated",
    "Deformed",
    "ElasticSupport",
    "Felt",
    "Fit",
    "Forceps",
    "Frame",
    "Fung",
    "HalfSpace",
    "Hand",
    "HolzapfelGasserOgden",
    "Instrument",
    "Linear",
    "MaterialTest",
    "Mesh",
    "MooneyRivlin",
    "Moved",
    "NeoHookean",
    "Newmark",
    "NotConverged",
    "Ogden",
    "Organ",
    "PointValues",
    "Probes",
    "Prony",
    "Registered",
    "RigidProbe",
    "SaintVenantKirchhoff",
    "Scan",
    "Scene",
    "SceneCase",
    "Shape",
    "SpecimenTest",
    "Sphere",
    "Spring",
    "StableNeoHookean",
    "State",
    "Stepper",
    "StrainEnergy",
    "Tool",
    "Touch",
    "Unloaded",
    "Vary",
    "VerondaWestmann",
    "VisceraError",
    "Yeoh",
    "__version__",
    "case",
    "compare",
    "fit",
    "helical_fibres",
    "image_fibres",
    "laws",
    "load",
    "mesh",
    "mesh_surface",
    "organs",
    "principal",
    "read",
    "scan",
    "sweep",
    "write_series",
]
