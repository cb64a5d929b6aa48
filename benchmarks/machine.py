"""The machine and the stamp of a run, for the benchmarks here; and for what is no Python program:

python benchmarks/machine.py [THREADS]
"""

import sys
from pathlib import Path

from viscera.bench.machine import describe, stamp

__all__ = ["ROOT", "describe", "stamp"]

ROOT = Path(__file__).resolve().parent.parent

if __name__ == "__main__":
    print(describe(int(sys.argv[1]) if sys.argv[1:] else None))
