"""Frames of built-in organs stepped in a browser's page and on this machine, for a hand that wanders.

Medians over 100 frames of what a frame says it took. `drawn` is how many frames a second the page could draw
meanwhile: its worker steps as fast as it can. What a page steps by itself (`PAGE_UNKNOWNS` of viscera/viewer/live.py)
is chosen by it.

Then the time of the script for one move of the pointer over a reduced model: what every order answers, the curve, the
shape of the organ and the readings. Drawing is left out: that is the graphics processor's.

    python benchmarks/page.py > benchmarks/results/page.txt
"""

import json
import shutil
from statistics import median

import numpy as np
from machine import describe

import viscera as vs
from viscera import _core
from viscera.cases.case import Case
from viscera.viewer import Server, page, serve
from viscera.viewer.live import LiveCase, live_case

FRAMES, MILLISECONDS = 100, 7
MOVES = """([point, depth, moves]) => {
    const times = [];
    viscera.touch(point, [0, 0, 0]);
    for (let k = 0; k < moves; k++) {
        const began = performance.now();
        viscera.move([0.3 * depth * Math.sin(0.1 * k), 0, -depth * Math.abs(Math.sin(0.03 * k))]);
        times.push(performance.now() - began);
    }
    return times.sort((a, b) => a - b);
}"""
ORGANS = {"artery": "top", "beam": "clamp", "liver": "hilum"}
STEPS = """async ([requests, milliseconds]) => {
    const worker = new Worker("stepper.js", { type: "module" });
    const answer = () => new Promise((resolve) => (worker.onmessage = ({ data }) => resolve(data)));
    let [drawn, isDone] = [0, false];
    const draw = () => { drawn += 1; if (!isDone) requestAnimationFrame(draw); };
    worker.postMessage([await (await fetch("organ.case")).arrayBuffer(), null]);
    await answer();
    draw();
    const [times, began] = [[], performance.now()];
    for (const request of requests) {
        worker.postMessage(request);
        times.push(new Float32Array(await answer())[milliseconds]);
    }
    isDone = true;
    return [times, 1000 * drawn / (performance.now() - began)];
}"""


def requests(live: LiveCase) -> list[str]:
    """A grasp of the surface where it is farthest from what is fixed, and a hand that wanders from there."""
    about = json.loads(_core.Live(live.data).describe())
    rest = np.reshape(about["rest"], (-1, 3))
    far = rest[np.argmax(np.linalg.norm(rest - rest.mean(axis=0), axis=1))]
    ways = [0.02 * about["diagonal"] * np.array([np.sin(0.1 * k), 1 - np.cos(0.1 * k), 0]) for k in range(FRAMES)]
    return [json.dumps({"grab": far.tolist()}), *(json.dumps({"move": way.tolist()}) for way in ways)]


def main() -> None:
    """The table."""
    print(describe())
    program = shutil.which("chromium") or shutil.which("google-chrome")
    if program is None:
        print("no Chromium here: frames in a page are left out")
        return
    from playwright.sync_api import sync_playwright

    print("organ    unknowns  here [ms]  in the page [ms]  ratio  drawn [1/s]")
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=program, args=["--no-sandbox"])
        for name, fixed in ORGANS.items():
            material = {"law": "NeoHookean", "young": 1e5, "poisson": 0.45}
            live = live_case(Case(mesh=f"organ:{name}", fixed=fixed, material=material), name)
            asked = requests(live)
            stepped = _core.Live(live.data)
            here = median([np.frombuffer(stepped.answer(text), "<f4")[MILLISECONDS] for text in asked])
            with Server({**page.stepping_files(), "page.js": b"", page.CASE: live.data}) as server:
                tab = browser.new_page()
                tab.goto(server.url)
                times, drawn = tab.evaluate(STEPS, [asked, MILLISECONDS])
                tab.close()
            there = median(times)
            print(f"{name:8s} {live.unknowns:8d}  {here:9.2f}  {there:16.2f}  {there / here:5.1f}  {drawn:11.0f}")
        organ = vs.Organ(vs.organs.beam(), vs.NeoHookean(young=1e5, poisson=0.45), fixed="clamp")
        touch = organ.reduce("top")
        with serve(touch, "Beam") as server:
            tab = browser.new_page()
            tab.goto(server.url)
            tab.wait_for_function("() => window.viscera")
            middle = touch.locate("(50%, 50%, 100%)").tolist()
            times = tab.evaluate(MOVES, [middle, touch.depth, 5 * FRAMES])
        low, high = times[len(times) // 10], times[19 * len(times) // 20]
        print(
            f"\nscript for one move of the pointer, beam of {len(touch.surface_nodes)} surface nodes, "
            f"order {touch.order}: median {median(times):.2f} ms, 10th percentile {low:.2f} ms, 95th {high:.2f} ms"
        )
        browser.close()


if __name__ == "__main__":
    main()
