"""The browser without a window that the pictures are taken with."""

from __future__ import annotations

import shutil
from typing import Any

BROWSERS = ("chromium", "chromium-headless-shell", "chromium-browser", "google-chrome")
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]


def launch(driver: Any) -> Any:
    """Start the first that is installed; `make test-web` installs one."""
    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    if program is None:
        raise SystemExit("no Chromium here; install the package chromium")
    return driver.chromium.launch(executable_path=program, args=FLAGS)
