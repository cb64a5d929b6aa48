"""Films a touch of the viewer for the README: pressed in, drawn aside, let go, on no background.

    python scripts/moving_picture.py out/liver.viscera      # writes docs/pictures/touch.webp

The page's panels are hidden and its ground is transparent, so that one file serves light and dark pages.
"""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import Any

import numpy as np
from browser import launch
from PIL import Image
from playwright.sync_api import Page, sync_playwright

import viscera as vs
from viscera.viewer import serve

TARGET = Path(__file__).resolve().parent.parent / "docs" / "pictures" / "touch.webp"
SETTINGS: dict[str, Any] = {"viewport": {"width": 1000, "height": 760}, "color_scheme": "light"}
FRAMES, MILLISECONDS = 30, 80
MARGIN = 8
"""Around the organ, in pixels."""
LARGEST = 1.5e6
"""Of the file, in bytes."""
BARE = """
const root = [...document.querySelectorAll("*")].find((each) => each.shadowRoot).shadowRoot;
const style = document.createElement("style");
style.textContent = `.view { background: none !important } .plan > :not(.clearing) { display: none !important }
  .clearing { grid-area: 1 / 1 / -1 / -1; margin: 2% 14% 10% }`;
root.append(style);
document.documentElement.style.background = document.body.style.background = "none";
window.viscera.reset();
"""


def pushes(touch: vs.Touch) -> list[tuple[np.ndarray, np.ndarray]]:
    """Contact point and displacement [m] of each frame: in, aside in a circle, out; trusted all the way."""
    triangles = touch.mesh.points[touch.touchable_triangles]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    inward = -normals.sum(axis=0) / np.linalg.norm(normals.sum(axis=0))
    aside = np.cross(inward, (0.0, 0.0, 1.0))
    point = touch.locate(np.average(triangles.mean(axis=1), axis=0, weights=np.linalg.norm(normals, axis=1)))
    turn = 2 * np.pi * np.arange(FRAMES) / FRAMES
    loop = np.outer(0.45 * (1 - np.cos(turn)), inward) + np.outer(0.45 * np.sin(turn) * (1 - np.cos(turn)), aside)
    loop /= np.linalg.norm(loop, axis=1).max()
    for share in np.arange(1.0, 0.2, -0.05):
        path = share * touch.depth * loop
        if all(touch(point, push).is_shape_trusted for push in path):
            print(f"{1e3 * np.linalg.norm(path, axis=1).max():.0f} mm at most")
            return [(point, push) for push in path]
    sys.exit("no deep touch at the middle is trusted all the way")


def film(page: Page, touch: vs.Touch) -> list[Image.Image]:
    """One picture for each push."""
    page.wait_for_selector(".view canvas.stage")
    page.evaluate(BARE)
    frames = []
    for point, push in pushes(touch):
        page.evaluate("([point, push]) => window.viscera.touch(point, push)", [point.tolist(), push.tolist()])
        page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        frames.append(Image.open(io.BytesIO(page.screenshot(omit_background=True))).convert("RGBA"))
    return frames


def main(model: str) -> None:
    """Film, crop to what is not empty in any frame, write."""
    touch = vs.load(model)
    with serve(touch, "Liver", is_hybrid=False) as server, sync_playwright() as driver:
        browser = launch(driver)
        page = browser.new_context(**SETTINGS).new_page()
        page.goto(server.url)
        frames = film(page, touch)
        browser.close()
    boxes = np.array([frame.getbbox() for frame in frames])
    left, top, *_ = (boxes.min(axis=0) - MARGIN).tolist()
    *_, right, bottom = (boxes.max(axis=0) + MARGIN).tolist()
    first, *rest = [frame.crop((left, top, right, bottom)) for frame in frames]
    first.save(TARGET, save_all=True, append_images=rest, duration=MILLISECONDS, loop=0, quality=70)
    size = TARGET.stat().st_size
    print(f"{TARGET.name}: {len(frames)} frames of {first.width} x {first.height}, {size / 1e6:.2f} MB")
    if size > LARGEST:
        sys.exit(f"more than {LARGEST / 1e6} MB")


if __name__ == "__main__":
    main(sys.argv[1])
