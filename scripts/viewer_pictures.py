"""Photographs the viewer for docs/viewer.md: a liver pushed in, on a wide screen and on a telephone in the dark.

python scripts/viewer_pictures.py out/liver.viscera
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright

import viscera as vs
from viscera.viewer import serve

PICTURES = Path(__file__).resolve().parent.parent / "docs" / "pictures"
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
WIDE = {"viewport": {"width": 1280, "height": 800}, "color_scheme": "light"}
TELEPHONE = {"viewport": {"width": 390, "height": 780}, "color_scheme": "dark", "device_scale_factor": 2}


def photograph(browser: Any, url: str, name: str, settings: dict[str, Any], colouring: str, drag: int) -> None:
    """Drag the organ where it faces the viewer by so many pixels, and keep what is seen."""
    page = browser.new_context(**settings).new_page()
    page.goto(url)
    page.wait_for_selector(".view canvas.stage")
    at = page.evaluate("() => window.viscera.project(window.viscera.middle)")
    page.evaluate("(colouring) => window.viscera.setColouring(colouring)", colouring)
    page.mouse.move(at["x"], at["y"])
    page.mouse.down()
    page.mouse.move(at["x"], at["y"] + drag, steps=5)
    page.wait_for_timeout(500)
    page.screenshot(path=PICTURES / name)
    page.context.close()


def main(model: str) -> None:
    """All pictures of one model."""
    PICTURES.mkdir(exist_ok=True)
    program = shutil.which("chromium") or shutil.which("google-chrome")
    with serve(vs.load(model), Path(model).stem.capitalize()) as server, sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=program, args=FLAGS)
        photograph(browser, server.url, "viewer.png", WIDE, "tissue", 38)
        photograph(browser, server.url, "viewer-telephone.png", TELEPHONE, "displacement", 24)
        browser.close()


if __name__ == "__main__":
    main(sys.argv[1])
