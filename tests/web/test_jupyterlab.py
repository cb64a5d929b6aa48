"""The widget in a real JupyterLab with a real kernel, and what nbconvert makes of a notebook that shows it."""

from __future__ import annotations

import contextlib
import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import viscera as vs
from viscera.viewer import Server

nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")
nbconvert = pytest.importorskip("nbconvert")
playwright = pytest.importorskip("playwright.sync_api")
pytest.importorskip("jupyterlab")
pytest.importorskip("anywidget")

TOP = (0.3, 0.05, 0.1)
PUSH = (0.0, 1e-3, -8e-3)
# How often a cell is asked to run, and how long each time but the last is waited for its number.
TRIES, TRY_MS = 4, 45_000
CELLS = [
    'import viscera as vs\nwidget = vs.load("bar.viscera").view("Bar", height=420)\nwidget',
    f"widget.touch({TOP}, {PUSH})",
    'print("told", widget.point, widget.displacement, widget.force)',
]
SETTINGS = [
    "--no-browser",
    "--allow-root",
    "--IdentityProvider.token=",
    "--ServerApp.port=0",
    "--ServerApp.ip=127.0.0.1",
    "--LabApp.check_for_updates_class=jupyterlab.NeverCheckForUpdate",
]
# It would ask by a dialog whether news may be fetched.
PAGE = {"disabledExtensions": {"@jupyterlab/apputils-extension:announcements": True}}


@pytest.fixture
def folder(touch: vs.Touch, tmp_path: Path) -> Path:
    """A notebook that has not been run, and its model."""
    touch.save(tmp_path / "bar.viscera")
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    cells = [nbformat.v4.new_code_cell(code) for code in CELLS]
    notebook = nbformat.v4.new_notebook(cells=cells, metadata={"kernelspec": kernel})
    nbformat.write(notebook, tmp_path / "bar.ipynb")
    return tmp_path


@pytest.fixture
def lab(folder: Path, server: Server) -> Iterator[str]:
    """JupyterLab in that folder, with settings of its own; its address."""
    home = folder / "home"
    (home / "labconfig").mkdir(parents=True)
    (home / "labconfig" / "page_config.json").write_text(json.dumps(PAGE))
    homes = dict.fromkeys(("JUPYTER_CONFIG_DIR", "JUPYTER_RUNTIME_DIR", "IPYTHONDIR"), str(home))
    command = [sys.executable, "-m", "jupyterlab", *SETTINGS, f"--ServerApp.root_dir={folder}"]
    log = folder / "lab.log"
    with log.open("w") as said:
        running = subprocess.Popen(command, stderr=said, env={**os.environ, **homes}, cwd=folder)
    try:
        while not (found := re.search(r"http://127\.0\.0\.1:\d+/lab\b", log.read_text())):
            assert running.poll() is None, log.read_text()
            time.sleep(0.1)
        yield found.group()
    finally:
        running.terminate()
        running.wait(timeout=30)


class Lab:
    """The notebook in a tab of the browser."""

    def __init__(self, browser: Any, address: str) -> None:
        self.tab = browser.new_context(viewport={"width": 1100, "height": 900}).new_page()
        self.tab.set_default_timeout(180_000)
        self.tab.goto(f"{address}/tree/bar.ipynb?reset")
        self.cells = self.tab.locator(".jp-Notebook .jp-Cell")
        self.force = self.tab.locator(".view .force")
        self.cells.nth(2).wait_for()
        # A cell that is run before its kernel is there is not run at all.
        self.tab.locator(".jp-Notebook-ExecutionIndicator[data-status=idle]").wait_for()

    def run(self, cell: int) -> None:
        """Run a cell and wait until it has its number."""
        # Asked for anew each time: JupyterLab may put another prompt in the place of the first.
        number = self.cells.nth(cell).locator(".jp-InputPrompt", has_text=re.compile(r"\[\d+\]"))
        for _ in range(TRIES - 1):
            self.press_run(cell)
            with contextlib.suppress(playwright.TimeoutError):
                number.wait_for(timeout=TRY_MS)
                return
        self.press_run(cell)
        number.wait_for()

    def press_run(self, cell: int) -> None:
        """Have a cell run. JupyterLab loses it, without a word, while it draws its page anew or changes kernels."""
        self.cells.nth(cell).locator(".cm-content").click()
        self.tab.keyboard.press("Shift+Enter")

    def wait_for_force(self, condition: str, *values: str) -> None:
        """Wait until the force on the page is as a condition on `shown` and `values` says."""
        script = f"([at, values]) => {{ const shown = at.textContent; return {condition}; }}"
        self.tab.wait_for_function(script, arg=[self.force.element_handle(), list(values)])


def test_a_touch_goes_both_ways_in_jupyterlab(browser: Any, lab: str, folder: Path, touch: vs.Touch) -> None:
    notebook = Lab(browser, lab)
    tab = notebook.tab
    # The organ is there, and follows Python.
    notebook.run(0)
    notebook.force.wait_for()
    notebook.run(1)
    expected = f"{np.linalg.norm(touch(TOP, PUSH).force):.2f}"
    notebook.wait_for_force("shown === values[0]", expected)
    assert tab.locator("img[data-viscera]").is_hidden()
    assert tab.locator(".view").bounding_box()["height"] == 420
    # A hand, and Python knows.
    tab.locator(".view canvas.stage").focus()
    tab.keyboard.press("Escape")
    tab.keyboard.press("Enter")
    notebook.wait_for_force("!values.includes(shown)", expected, "0.00")
    notebook.run(2)
    said = notebook.cells.nth(2).locator(".jp-OutputArea-output").inner_text()
    point, push, force = (np.array(json.loads(text)) for text in re.findall(r"\[.*?\]", said))
    assert np.linalg.norm(push) > 0
    assert force == pytest.approx(touch(point, push).force, rel=1e-5, abs=1e-6)
    # Saved, it keeps the picture.
    tab.keyboard.press("Control+s")
    tab.wait_for_function("() => !document.querySelector('.jp-mod-dirty')")
    assert has_picture(nbformat.read(folder / "bar.ipynb", as_version=4))
    tab.context.close()


def test_a_notebook_run_without_a_browser_keeps_the_picture(folder: Path) -> None:
    notebook = nbformat.read(folder / "bar.ipynb", as_version=4)
    nbclient.NotebookClient(notebook, timeout=60, resources={"metadata": {"path": str(folder)}}).execute()
    assert has_picture(notebook)
    page, _ = nbconvert.HTMLExporter().from_notebook_node(notebook)
    [picture] = [found for found in re.findall(r"<img [^>]*>", page) if "data-viscera=" in found]
    assert 'src="data:image/png;base64,' in picture
    assert 'alt="The organ' in picture
    # A live view hides the picture by a style that names it; the page has none.
    assert not re.search(r"<style[^>]*>[^<]*img\[data-viscera", page)


def has_picture(notebook: Any) -> bool:
    """Whether the first cell's outputs hold the widget's picture."""
    shown = [output.get("data", {}).get("text/html", "") for output in notebook.cells[0].outputs]
    return any("data-viscera=" in html and "data:image/png;base64," in html for html in shown)
