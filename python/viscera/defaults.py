"""The defaults of elements, the reduction and its check: the API, case files and the command line all read them."""

ELEMENT = "P1"
"""The element of compressible tissue."""

LOCKING_POISSON = 0.45
"""Poisson's ratio above which linear tetrahedra lock."""

LOCKING_FREE_ELEMENT = "P1 mean volume"
"""The element of nearly incompressible tissue (docs/elements.md)."""

RADIUS_FRACTION = 0.10
"""Radius of the contact patch, in units of the organ's bounding-box diagonal."""

DEPTH_FRACTION = 0.10
"""Largest contact displacement the model is built for, in units of the bounding-box diagonal."""

ORDER = 4
"""Total order of the series in the contact displacement: 34 terms."""

TOLERANCE = 2e-3
"""Relative error of the compressed field at full depth, at the worst position, root mean square over directions."""

MEMORY = 2e9
"""What the positions that a reduction has in progress may take [bytes]."""

GALERKIN_ORDER = 3
"""Order of the series fields that several touches are solved in: 19 modes for each contact."""

GALERKIN_TOLERANCE = 0.01
"""Error of the forces of the sampled cells in training, relative to those of all."""

CHECK_DEPTH_FRACTIONS = (0.05, 0.10)
"""Depths at which a model is checked, in units of the bounding-box diagonal."""

ALLOWED_ERROR = {0.05: 0.01, 0.10: 0.05}
"""Relative error a trusted answer may have up to a depth fraction; the last entry holds beyond it."""
