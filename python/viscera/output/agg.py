"""Import this before anything of matplotlib: it sees that MPLBACKEND does not keep matplotlib from being imported."""

from viscera.output.backend import require

require()
