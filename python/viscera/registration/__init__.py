"""An organ fitted to what is seen of it during an intervention: part of its surface, landmarks, points.

docs/navigation.md says how to use it, and how well it does.

measured.py    files of what was measured
observed.py    what was measured, checked
rigid.py       rigid motions; where the organ is, before anything deforms
forces.py      forces on the boundary and in the volume, and the equilibrium responses of the organ to them
causes.py      one thing that may have happened, and what is believed over all of them
fit.py         the most probable motion and forces, by Gauss-Newton with closest points renewed
normals.py     on which face of the organ a point of the cloud lies
rivals.py      other poses in which the organ fits as well
residuals.py   what is left between points and organ, and whether that is a good fit
registered.py  what comes out
"""

from viscera.registration.fit import register
from viscera.registration.observed import observed
from viscera.registration.registered import Registered
from viscera.registration.rigid import rigid_of

__all__ = ["Registered", "observed", "register", "rigid_of"]
