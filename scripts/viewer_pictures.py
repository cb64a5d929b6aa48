"""Photographs the viewer for docs/viewer.md: a liver pushed in, wide and on a telephone in the dark, and held by two
probes, two arteries, and a scene of two beams.

python scripts/viewer_pictures.py out/liver.viscera
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from browser import launch
from playwright.sync_api import sync_playwright

import viscera as vs
from viscera.cases.case import read_case
from viscera.viewer import serve, serve_live

ROOT = Path(__file__).resolve().parent.parent
PICTURES = ROOT / "docs" / "pictures"
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
    shoot(page, name)


def photograph_probes(browser: Any, url: str, name: str) -> None:
    """A probe in each of two hands, at both sides of the middle."""
    page = browser.new_context(**WIDE).new_page()
    page.goto(url)
    page.wait_for_selector(".view canvas.stage")
    page.evaluate(
        """() => {
            const { stage, pointer, middle, depth } = viscera;
            viscera.toggleProbe();
            [-1, 1].forEach((side, hand) => {
                const aim = middle.map((x, i) => x + 0.16 * side * stage.diagonal * stage.right[i]);
                viscera.grab(pointer.near(aim), hand);
                viscera.move(viscera.contact(hand).normal.map((n) => -0.35 * depth * n), hand);
            });
        }"""
    )
    shoot(page, name)


def photograph_pair(browser: Any, url: str, name: str) -> None:
    """The case's law and the linear one, bent by the same hand."""
    page = browser.new_context(**WIDE).new_page()
    page.goto(url)
    page.wait_for_selector(".view canvas.stage")
    page.get_by_text("Compare two laws").click()
    page.evaluate("() => { viscera.touchMiddle(); viscera.nudge(-0.8, 0.1, 0.4); }")
    page.wait_for_function(
        "() => { const { held, specimens } = viscera.state(); "
        "return held && specimens.every(({ residual, force }) => residual < 1e-8 && Math.hypot(...force) > 0) }"
    )
    shoot(page, name)


def photograph_scene(browser: Any, url: str, name: str) -> None:
    """The upper beam pushed down onto the lower one."""
    page = browser.new_context(**WIDE).new_page()
    page.goto(url)
    page.wait_for_selector(".view canvas.stage")
    page.wait_for_function("() => viscera.state().specimens[0].residual < 1e-8")  # under their own weight
    page.evaluate("() => viscera.touch([0.55, 0.1, 0.41], [0, 0, -0.06])")
    page.wait_for_function(
        "() => { const [{ residual, force }] = viscera.state().specimens; "
        "return residual < 1e-8 && Math.hypot(...force) > 0 }"
    )
    shoot(page, name)


def shoot(page: Any, name: str) -> None:
    """Keep what is seen once it rests and is drawn sharp."""
    page.wait_for_timeout(3000)
    page.screenshot(path=PICTURES / name)
    page.context.close()


def main(model: str) -> None:
    """All pictures of one model."""
    PICTURES.mkdir(exist_ok=True)
    with serve(vs.load(model), Path(model).stem.capitalize(), is_hybrid=False) as server, sync_playwright() as driver:
        browser = launch(driver)
        photograph(browser, server.url, "viewer.png", WIDE, "tissue", 26)
        photograph(browser, server.url, "viewer-telephone.png", TELEPHONE, "displacement", 12)
        photograph_probes(browser, server.url, "viewer-probes.png")
        with serve_live(read_case(ROOT / "examples" / "artery.toml"), "Artery") as live:
            photograph_pair(browser, live.url, "viewer-pair.png")
        with serve_live(vs.case(ROOT / "examples" / "scene.toml"), "Two beams") as live:
            photograph_scene(browser, live.url, "viewer-scene.png")
        browser.close()


if __name__ == "__main__":
    main(sys.argv[1])
