"""Size of a wheel and of its largest parts; fails if the wheel is larger than `LIMIT`.

    python scripts/wheel_size.py WHEEL.whl

`make wheel` keeps it in benchmarks/results/wheel.txt.
"""

from __future__ import annotations

import sys
from pathlib import Path
from zipfile import ZipFile

LIMIT = 12.0
"""[MB]; with the library of graphics processors, which only released wheels hold, `GPU` more."""
GPU = 8.0
SHOWN = 5


def main(path: Path) -> None:
    """Print the size of the wheel and of its largest files, compressed and unpacked [MB]."""
    size = path.stat().st_size / 1e6
    with ZipFile(path) as wheel:
        parts = sorted(wheel.infolist(), key=lambda part: -part.compress_size)
    limit = LIMIT + (GPU if any("viscera_gpu" in part.filename for part in parts) else 0.0)
    print(f"{path.name}: {size:.1f} MB, at most {limit:.0f} MB; {len(parts)} files")
    print(f"{'largest files':48} {'in the wheel [MB]':>18} {'unpacked [MB]':>14}")
    for part in parts[:SHOWN]:
        print(f"{part.filename:48} {part.compress_size / 1e6:18.2f} {part.file_size / 1e6:14.2f}")
    if size > limit:
        sys.exit(f"the wheel is larger than {limit:.0f} MB; find out what has grown, or raise the limit here")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
