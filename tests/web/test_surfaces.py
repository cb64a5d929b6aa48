"""The page on small surfaces, and for those who scroll, pinch, listen, or need contrast."""

from __future__ import annotations

import base64
import itertools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import viscera as vs
from viscera.viewer import Server, export

if TYPE_CHECKING:
    from tests.web.conftest import Viewer

    Look = Callable[..., Viewer]
    Offer = Callable[[Path], str]

expect = pytest.importorskip("playwright.sync_api").expect

TOP = (0.3, 0.05, 0.1)
SIZES = [(1400, 900), (1100, 720), (820, 560), (760, 560), (390, 780), (780, 390)]
# The box around the organ at rest, and what a box of the page is.
ORGAN = """() => {
    const { rest } = viscera.evaluator;
    const points = [];
    for (let n = 0; n < rest.length; n += 3) points.push(viscera.project([...rest.slice(n, n + 3)]));
    const [x, y] = ["x", "y"].map((axis) => points.map((point) => point[axis]));
    return [Math.min(...x), Math.min(...y), Math.max(...x), Math.max(...y)];
}"""
BOX = """(found) => {
    const { left, top, right, bottom } = found.getBoundingClientRect();
    return [left, top, right, bottom];
}"""
# Whether a press on the middle of a control meets it.
REACHED = """(control) => {
    const { left, top, width, height } = control.getBoundingClientRect();
    return control.contains(control.getRootNode().elementFromPoint(left + width / 2, top + height / 2));
}"""
# Contrast of every text that is shown, by WCAG 2.2; of the colours of the view's ground the worst counts.
CONTRASTS = """() => {
    const root = document.querySelector("div[style]").shadowRoot.querySelector(".view");
    const parse = (colour) => colour.match(/[\\d.]+/g).map(Number);
    const light = (rgb) => {
        const [r, g, b] = rgb.map((x) => (x / 255 <= 0.04045 ? x / 3294.6 : ((x / 255 + 0.055) / 1.055) ** 2.4));
        return 0.2126 * r + 0.7152 * g + 0.0722 * b;
    };
    const contrast = (a, b) => {
        const [low, high] = [light(a), light(b)].sort((x, y) => x - y);
        return (high + 0.05) / (low + 0.05);
    };
    const grounds = (node) => {
        for (let at = node; at && at !== root; at = at.parentElement) {
            const [r, g, b, alpha = 1] = parse(getComputedStyle(at).backgroundColor);
            if (alpha === 1) return [[r, g, b]];
            if (alpha > 0) throw new Error(`half transparent: ${at.className}`);
        }
        return getComputedStyle(root).backgroundImage.match(/rgb\\([^)]*\\)/g).map(parse);
    };
    const found = {};
    const walk = document.createTreeWalker(root, NodeFilter.SHOW_TEXT);
    for (let text = walk.nextNode(); text; text = walk.nextNode()) {
        const words = text.textContent.trim();
        const parent = text.parentElement;
        const isSeen = parent.checkVisibility({ visibilityProperty: true }) && !parent.closest("option, .unseen");
        if (!words || !isSeen) continue;
        const ink = parse(getComputedStyle(parent).color);
        found[words] = Math.min(...grounds(parent).map((ground) => contrast(ink, ground)), found[words] ?? Infinity);
    }
    // The curve's labels are painted.
    const panel = getComputedStyle(root.querySelector(".readings"));
    const probe = root.appendChild(document.createElement("i"));
    probe.style.color = "var(--muted)";
    found["(curve)"] = contrast(parse(getComputedStyle(probe).color), parse(panel.backgroundColor));
    probe.remove();
    return found;
}"""
# Every element with a name of its own and words of its own.
NAMES = """() => {
    const root = document.querySelector("div[style]").shadowRoot;
    return [...root.querySelectorAll("button, select, input, label")].map((control) => [
        control.getAttribute("aria-label"),
        control.tagName === "SELECT" ? "" : (control.textContent ?? ""),
    ]);
}"""
# Every sentence that the page's live region takes from now on.
HEARD = """() => {
  const heard = [];
  const region = document.querySelector("div[style]").shadowRoot.querySelector("[role=status]");
  new MutationObserver(() => heard.push(region.textContent)).observe(region, { childList: true, characterData: true });
  return heard;
}"""
PUSHES = "([place, pushes]) => pushes.forEach((push) => window.viscera.touch(place, push))"
LIVE = """() => {
    const root = document.querySelector("div[style]").shadowRoot;
    return [...root.querySelectorAll("[aria-live], [role=status], [role=alert], [role=log], output")].length;
}"""
DISTANCE = "() => viscera.stage.camera.position.length()"
NOTEBOOK = """<!doctype html><title>notebook</title><p>a cell</p><div id="cell"></div>
<div style="height: 3000px">more cells</div><script type="module">
import widget from "./viewer.js";
const bytes = Uint8Array.from(atob("%s"), (c) => c.charCodeAt(0));
const model = { get: (name) => ({ model: new DataView(bytes.buffer), height: 420 })[name] };
await widget.render({ model, el: document.getElementById("cell") });
window.viscera = { stage: true };
</script>"""


@pytest.fixture(autouse=True)
def letting_go(viewer: Viewer) -> Iterator[None]:
    viewer.call("rest")
    viewer.call("setColouring", "tissue")
    yield
    assert viewer.complaints == []


def resize(viewer: Viewer, size: tuple[int, int]) -> None:
    """Give the page another size, and wait until it has taken it."""
    width, height = size
    viewer.page.set_viewport_size({"width": width, "height": height})
    viewer.page.wait_for_function("(width) => viscera.stage.canvas.clientWidth === width", arg=width)
    draw(viewer)


def draw(viewer: Viewer) -> None:
    """Let some frames pass: in the first one sees its new size, in the next it is fitted to it."""
    viewer.page.evaluate("async () => { for (let k = 0; k < 4; k++) await new Promise(requestAnimationFrame) }")


# Texts of the readings that leave their panel, or come closer to another one of the same line than four pixels, and two
# numbers than twelve: with less, "9.2 mm 82.2 N/m" reads as one.
CROWDED = """(panel) => {
    const all = [...panel.querySelectorAll("dt, dd, th, td, .force, .unit")];
    const texts = all.filter((found) => found.checkVisibility());
    const boxes = texts.map((found) => {
        const range = document.createRange();
        range.selectNodeContents(found);
        return [found, range.getBoundingClientRect()];
    });
    const edge = panel.getBoundingClientRect();
    const out = boxes.filter(([found, box]) => box.right > edge.right || found.scrollWidth > found.clientWidth + 1);
    const apart = (one, other) => (one.tagName === "DD" && other.tagName === "DD" ? 12 : 4);
    const isClose = (a, b, gap) => a.left < b.right + gap && b.left < a.right + gap;
    const close = boxes.flatMap(([one, a], k) => boxes.slice(k + 1).filter(([other, b]) =>
        a.top < b.bottom - 1 && b.top < a.bottom - 1 && isClose(a, b, apart(one, other)),
    ).map(([other]) => `${one.textContent} | ${other.textContent}`));
    return [...out.map(([found]) => found.textContent), ...close];
}"""


def overlap(a: list[float], b: list[float]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
def test_panels_leave_the_organ_free(viewer: Viewer, size: tuple[int, int]) -> None:
    resize(viewer, size)
    viewer.call("setColouring", "displacement")
    draw(viewer)
    panels = [panel.evaluate(BOX) for panel in viewer.page.locator(".panel:visible").all()]
    organ = viewer.page.evaluate(ORGAN)
    assert len(panels) == 3  # readings, legend, tools
    assert [panel for panel in panels if overlap(organ, panel)] == []
    assert not any(overlap(a, b) for a, b in itertools.combinations(panels, 2))
    assert not overlap([-np.inf, -np.inf, 0, np.inf], organ)
    assert organ[3] <= size[1]
    assert organ[2] - organ[0] > 0.2 * size[0]  # and it is not made tiny for that
    for control in viewer.page.locator(".tools button").all():
        assert control.evaluate(REACHED)


@pytest.mark.parametrize("size", [(1280, 800), (760, 560), (360, 740)], ids=lambda size: f"{size[0]}x{size[1]}")
def test_readings_keep_their_distance(viewer: Viewer, size: tuple[int, int]) -> None:
    """Of a soft organ, whose numbers are the longest, with a shape that is known less well than the force."""
    resize(viewer, size)
    viewer.page.evaluate(
        """([order]) => {
            const stiffness = [82.2, 0, 0, 0, 82.2, 0, 0, 0, 82.2];
            const errors = { error: 0.00042, shapeError: 0.0123 };
            viscera.display.readings.show({ force: 12.34, depth: 0.0192, stiffness, ...errors, isDoubtful: false });
            const reading = { force: 12.3456, volume: -0.1234, off: 0.1234, forceOff: 0.1234 };
            for (let p = 1; p <= order; p++) viscera.display.readings.showOrder(p, reading);
        }""",
        [4],
    )
    readings = viewer.page.locator(".readings")
    words = readings.inner_text()
    assert all(number in words for number in ("19.2 mm", "82.2 N/m", "0.042 %", "1.2 %"))
    assert readings.evaluate(CROWDED) == []


def test_a_force_does_not_hide_the_scale_bar(viewer: Viewer) -> None:
    """Seen so that the arrow's end is where the scale bar stands, at the lower left."""
    for size in ((1280, 800), (360, 740)):
        resize(viewer, size)
        viewer.call("reset")
        viewer.call("touch", TOP, (0.02, 0.0, 0.004))
        viewer.page.evaluate(
            """() => {
                const { arrow, label, gauge } = viscera.display;
                arrow.endsInScene = () => [0, 1].map((k) => viscera.stage.camera.position.clone().set(0, 0, 0));
                const { left, bottom } = gauge.root.getBoundingClientRect();
                viscera.stage.onCanvas = () => ({ x: left + 30, y: bottom - 10 });
                viscera.display.label.follow(1, "sound");
            }"""
        )
        boxes = [viewer.page.locator(name).evaluate(BOX) for name in (".force-label", ".gauge")]
        viewer.page.evaluate("() => { delete viscera.display.arrow.endsInScene; delete viscera.stage.onCanvas; }")
        assert not overlap(*boxes)


@pytest.mark.parametrize("size", [(1100, 720), (760, 560), (390, 780)], ids=lambda size: f"{size[0]}x{size[1]}")
def test_the_warning_leaves_the_title_free(viewer: Viewer, touch: vs.Touch, size: tuple[int, int]) -> None:
    resize(viewer, size)
    viewer.call("touch", TOP, (0.0, 0.0, -1.2 * touch.depth))
    warning = viewer.page.locator(".warning.is-shown").evaluate(BOX)
    for words in ("h1", "header p", ".readings"):
        assert not overlap(warning, viewer.page.locator(words).evaluate(BOX))


def test_the_curve_is_drawn_anew_in_another_size(viewer: Viewer) -> None:
    resize(viewer, (1100, 720))
    viewer.call("touch", TOP, (0.0, 0.0, -0.01))
    resize(viewer, (390, 780))
    viewer.page.wait_for_function(
        """() => {
            const canvas = document.querySelector("div[style]").shadowRoot.querySelector(".curve");
            return canvas.width === Math.round(canvas.clientWidth * devicePixelRatio)
                && canvas.height === Math.round(canvas.clientHeight * devicePixelRatio);
        }"""
    )


def test_the_orders_unfold_on_a_telephone(viewer: Viewer) -> None:
    resize(viewer, (390, 780))
    orders = viewer.page.locator(".orders")
    assert not orders.is_visible()
    fold = viewer.page.get_by_role("button", name="Orders")
    fold.click()
    assert orders.is_visible()
    assert fold.get_attribute("aria-expanded") == "true"
    fold.click()
    resize(viewer, (1100, 720))
    assert orders.is_visible()


def test_ticks_say_their_numbers(viewer: Viewer) -> None:
    rng = np.random.default_rng(5)
    largest = [125.0, 12.5, 0.3, 1250.0, 1e-3, *(10 ** rng.uniform(-3, 5, 200))]
    scales = viewer.page.evaluate(
        """async (all) => {
            const { scale } = await import("./viewer.js");
            return all.flatMap((largest) => [2, 3, 4, 7].map((steps) => [largest, steps, scale(largest, steps)]));
        }""",
        largest,
    )
    for high, steps, ticks in scales:
        values = np.array([tick["value"] for tick in ticks])
        assert [float(tick["text"]) for tick in ticks] == pytest.approx(values, rel=1e-12)
        assert values[0] == 0
        assert 2 <= len(ticks) <= steps + 1
        assert values[-2] < high * (1 + 1e-6)
        assert values[-1] >= high * (1 - 1e-6)
        step = values[1]
        assert float(f"{step:.2g}") == pytest.approx(step)
        assert str(f"{step:.1e}")[:3] in {"1.0", "2.0", "2.5", "5.0"}


def test_a_legend_has_round_ticks_and_says_where_it_ends(viewer: Viewer, touch: vs.Touch) -> None:
    viewer.call("setColouring", "displacement")
    viewer.call("touch", TOP, (0.0, 0.0, -0.5 * touch.depth))
    ticks = viewer.page.locator(".legend:visible .legend-ticks span")
    assert ticks.all_inner_texts() == ["0", "5", "10", "15", "20", "25"]
    bar, [first, *_, last] = viewer.page.locator(".legend:visible .legend-bar").evaluate(BOX), ticks.all()
    for tick, end in ((first, bar[0]), (last, bar[2])):
        left, _, right, _ = tick.evaluate(BOX)
        assert 0.5 * (left + right) == pytest.approx(end, abs=1)
    assert viewer.page.locator(".legend.is-beyond").count() == 0
    viewer.call("touch", TOP, (0.0, 0.0, -1.25 * touch.depth))
    largest = np.linalg.norm(np.reshape(viewer.state["field"], (-1, 3)), axis=1).max()
    assert largest > 0.025
    assert viewer.page.locator(".legend.is-beyond .legend-beyond").inner_text() == f"up to {1000 * largest:.1f}"


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_words_stand_out_from_their_ground(viewer: Viewer, touch: vs.Touch, scheme: str) -> None:
    viewer.page.emulate_media(color_scheme=scheme)
    viewer.call("setColouring", "displacement")
    viewer.call("touch", TOP, (0.0, 0.0, -1.2 * touch.depth))
    expect(viewer.page.get_by_text("made for").first).to_be_visible()
    contrasts = viewer.page.evaluate(CONTRASTS)
    assert any("made for" in words for words in contrasts)
    assert {"Keep", "depth", "Bar", "1"} <= contrasts.keys()
    assert {words: found for words, found in contrasts.items() if found < 4.5} == {}
    viewer.page.emulate_media(color_scheme="light")


def test_what_is_written_on_a_control_is_its_name(viewer: Viewer) -> None:
    viewer.call("toggleModes")
    for name, words in viewer.page.evaluate(NAMES):
        seen = " ".join(words.split())
        if name is not None and any(character.isalpha() for character in seen):
            assert seen.lower() in name.lower()
    for name in ("Keep", "Reset", "Wireframe", "Displacement"):
        assert viewer.page.get_by_role("button", name=name, exact=True).count() == 1
    viewer.call("toggleModes")


def test_escape_closes_the_help_and_nothing_else(viewer: Viewer) -> None:
    viewer.call("touch", TOP, (0.0, 0.0, -0.01))
    viewer.call("focus")
    for opened in ("?", None):
        if opened:
            viewer.page.keyboard.press("?")
        else:
            viewer.page.get_by_role("button", name="keys and gestures").click()
        assert viewer.page.locator(".help").is_visible()
        viewer.page.keyboard.press("Escape")
        assert not viewer.page.locator(".help").is_visible()
        assert viewer.state["activity"] == "kept"


def test_one_sentence_is_said_once_something_rests(viewer: Viewer, touch: vs.Touch) -> None:
    assert viewer.page.evaluate(LIVE) == 1
    said = viewer.page.get_by_role("status")
    expect(said).to_have_text("")
    force = float(np.linalg.norm(touch(TOP, (0.0, 0.0, -0.01)).force))
    heard = viewer.page.evaluate_handle(HEARD)
    # In one go: on a machine however slow, nothing rests in between.
    viewer.page.evaluate(PUSHES, [TOP, [(0.0, 0.0, -2e-3 * k) for k in range(1, 6)]])
    expect(said).to_contain_text(f"{force:.2f} N at a depth of 10.0 mm.")
    sentences = heard.evaluate("heard => heard")
    assert sentences == [said.inner_text()]
    assert sentences[0].startswith(f"{force:.2f} N")


def test_a_pinch_from_the_organ_to_beside_it_zooms(look_at: Look, server: Server) -> None:
    viewer = look_at(server.url, viewport={"width": 390, "height": 780}, has_touch=True, is_mobile=True)
    x, y = viewer.place(TOP)
    cdp = viewer.page.context.new_cdp_session(viewer.page)

    def fingers(kind: str, *places: tuple[float, float]) -> None:
        points = [{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(places)]
        cdp.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    before = viewer.page.evaluate(DISTANCE)
    # On the organ, the second finger would be a second hand as soon as its case has loaded.
    beside = viewer.page.evaluate(ORGAN)[1] - 20
    fingers("touchStart", (x, y))
    assert viewer.state["activity"] == "held"
    fingers("touchStart", (x, y), (x, beside))
    for step in range(1, 6):
        fingers("touchMove", (x, y + 10 * step), (x, beside - 10 * step))
    assert viewer.state["activity"] in {"springing", "rest"}
    viewer.page.wait_for_function(f"() => viscera.stage.camera.position.length() < {0.9 * before}")
    fingers("touchEnd")
    viewer.wait_for("rest")
    # One finger takes hold again.
    x, y = viewer.place(TOP)
    fingers("touchStart", (x, y))
    assert viewer.state["activity"] == "held"
    fingers("touchEnd")
    assert viewer.complaints == []
    viewer.close()


def test_a_notebook_scrolls_past_a_widget_that_nobody_uses(look_at: Look, touch: vs.Touch, server: Server) -> None:
    pytest.importorskip("anywidget")
    widget = touch.view("Bar", height=420)
    page = NOTEBOOK % base64.b64encode(widget.model).decode()
    with Server({"index.html": page.encode(), "viewer.js": widget._esm.encode()}) as notebook:
        viewer = look_at(notebook.url, bypass_csp=True, viewport={"width": 760, "height": 600})
        tab = viewer.page

        def scrolled() -> float:
            return float(tab.evaluate("() => scrollY"))

        tab.mouse.move(200, 200)
        tab.mouse.wheel(0, 100)
        tab.wait_for_function("() => scrollY > 50")
        tab.evaluate("() => scrollTo(0, 0)")
        tab.wait_for_function("() => scrollY === 0")
        tab.mouse.move(100, 360)
        tab.mouse.down()
        tab.mouse.up()
        tab.mouse.wheel(0, 100)
        tab.wait_for_timeout(300)
        assert scrolled() == 0
        # Somebody works elsewhere: the widget is left alone again.
        tab.locator("p").first.click()
        tab.evaluate("() => document.activeElement.blur()")
        tab.mouse.move(200, 200)
        tab.mouse.wheel(0, 100)
        tab.wait_for_function("() => scrollY > 50")
        viewer.close()


def test_a_page_scrolls_past_a_frame_that_nobody_uses(
    browser: Any, file_server: Offer, touch: vs.Touch, server: Server, tmp_path: Path
) -> None:
    export(touch, tmp_path, "Bar")
    frame = '<iframe src="index.html" width="700" height="420"></iframe>'
    (tmp_path / "blog.html").write_text(f'<!doctype html><p>words</p>{frame}<div style="height: 3000px"></div>')
    tab = browser.new_page(viewport={"width": 760, "height": 600})
    tab.goto(file_server(tmp_path) + "blog.html")
    tab.frames[1].wait_for_function("() => window.viscera")
    tab.mouse.move(200, 200)
    tab.mouse.wheel(0, 100)
    tab.wait_for_function("() => scrollY > 50")
    tab.close()
