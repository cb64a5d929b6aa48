//! Viscera's numerical core: from a tetrahedral mesh and a strain energy to a reduced model
//! that answers a touch in microseconds. Numerics only: no files, no Python, no printing.
