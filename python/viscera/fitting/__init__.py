"""From a testing machine to a law: measured curves, families of laws, and the fit with its accuracy."""

from viscera.fitting.fit import Fit, fit
from viscera.fitting.materialtest import MaterialTest
from viscera.fitting.specimen import SpecimenTest

__all__ = ["Fit", "MaterialTest", "SpecimenTest", "fit"]
