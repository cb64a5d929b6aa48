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
from viscera import law as laws
from viscera import organs
from viscera._core import __version__
from viscera.answer import Answer
from viscera.bond import Bond
from viscera.case import Case
from viscera.cluster import sweep
from viscera.comparison import compare
from viscera.contact import Contact, Tool
from viscera.contact_pair import ContactPair
from viscera.deformed import Deformed, Moved, PointValues
from viscera.dynamics import BackwardEuler, Newmark, Prony
from viscera.elastic_support import ElasticSupport
from viscera.errors import NotConverged, VisceraError
from viscera.fibres import helical_fibres
from viscera.fitting import Fit, MaterialTest, SpecimenTest, fit
from viscera.forceps import Forceps
from viscera.frame import Frame
from viscera.hand import Hand
from viscera.image_fibres import image_fibres
from viscera.instrument import Instrument
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
from viscera.meshing import mesh_surface
from viscera.navigation import Unloaded
from viscera.organ import Organ
from viscera.probe import Felt, Probes, RigidProbe
from viscera.registration import Registered
from viscera.scan import Scan, scan
from viscera.scene import Scene
from viscera.scene_case import SceneCase
from viscera.scene_case import read_any as case
from viscera.series import write_series
from viscera.shapes import Box, Capsule, HalfSpace, Shape, Sphere
from viscera.solver import ConjugateGradients
from viscera.spring import Spring
from viscera.state import State
from viscera.stepper import Stepper
from viscera.stress import principal
from viscera.touch import Touch, load
from viscera.vary import Vary

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
