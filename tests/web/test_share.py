"""What is taken along from the page: a picture, a film, a link; how large the organ is; and the first hint."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

import viscera as vs
from viscera.viewer import Server

if TYPE_CHECKING:
    from tests.web.conftest import Viewer

TOP = (0.3, 0.05, 0.1)
PUSH = (0.001, 0.002, -0.015)


@pytest.fixture(autouse=True)
def letting_go(viewer: Viewer) -> Iterator[None]:
    viewer.call("rest")
    yield
    assert viewer.complaints == []


def test_a_link_carries_the_touch(viewer: Viewer, server: Server, look_at: Callable[..., Viewer]) -> None:
    viewer.call("touch", TOP, PUSH)
    viewer.call("setOrder", 2)
    viewer.call("setColouring", "displacement")
    viewer.page.evaluate("() => viscera.sight.choose('translucent')")
    viewer.page.get_by_label("save or share").click()
    viewer.page.get_by_role("button", name="Link").click()
    viewer.page.wait_for_function("() => location.hash.includes('touch=')")
    other = look_at(viewer.page.url)
    for name in ("point", "displacement", "force"):
        assert np.allclose(other.state[name], viewer.state[name], rtol=1e-4, atol=1e-6)
    assert [other.state[name] for name in ("order", "looking", "activity")] == [2, "translucent", "kept"]
    assert other.page.locator(".legend:visible").is_visible()
    assert other.complaints == []
    other.close()
    viewer.call("setOrder", 4)
    viewer.call("setColouring", "tissue")
    viewer.page.evaluate("() => viscera.sight.choose('solid')")


def test_a_link_carries_the_stiffness(viewer: Viewer, server: Server, look_at: Callable[..., Viewer]) -> None:
    viewer.call("touch", TOP, PUSH)
    viewer.call("setStiffness", 3)
    force, hash = viewer.state["force"], viewer.call("hash")
    viewer.call("setStiffness", 1)
    other = look_at(f"{server.url}#{hash}")
    assert np.allclose(other.state["force"], force, rtol=1e-4)
    assert "× 3.0" in other.page.locator("label.stiffness").inner_text()
    assert other.complaints == []
    other.close()


def test_a_second_link_opens_in_the_same_page(server: Server, look_at: Callable[..., Viewer]) -> None:
    other = look_at(f"{server.url}#touch=300,50,100;0,0,-15&order=2&stiffness=3")
    other.page.evaluate("() => (window.isTheSame = true)")
    other.page.goto(f"{server.url}#touch=250,50,100;0,0,-5&order=4&stiffness=1")
    other.page.wait_for_function("() => viscera.state().order === 4")
    assert other.page.evaluate("() => window.isTheSame")
    assert np.allclose(other.state["point"], (0.25, 0.05, 0.1))
    assert other.state["displacement"] == [0, 0, -0.005]
    assert other.state["stiffness_factor"] == 1
    assert other.complaints == []
    other.close()


def test_a_link_is_followed_without_the_probe(server: Server, look_at: Callable[..., Viewer]) -> None:
    """It carries a contact that sticks, and so do paths: nothing is drawn that slides."""
    other = look_at(server.url)
    pressed = other.page.get_by_role("button", name="Probe")
    other.call("toggleProbe")
    assert pressed.get_attribute("aria-pressed") == "true"
    other.page.goto(f"{server.url}#touch=300,50,100;0,0,-15")
    other.page.wait_for_function("() => viscera.state().activity === 'kept'")
    assert pressed.get_attribute("aria-pressed") == "false"
    assert other.state["probe"] is None
    other.call("rest")
    other.call("toggleProbe")
    other.call("togglePath")
    assert pressed.get_attribute("aria-pressed") == "false"
    assert other.complaints == []
    other.close()


def test_a_link_to_a_place_beside_the_organ_is_a_sentence(server: Server, look_at: Callable[..., Viewer]) -> None:
    other = look_at(f"{server.url}#touch=3000,50,100;0,0,-15&order=2")
    warning = other.page.locator(".warning.is-shown")
    assert "not on the touchable surface" in warning.inner_text()
    assert (other.state["activity"], other.state["point"], other.state["order"]) == ("rest", None, 2)
    other.call("touch", TOP, PUSH)
    assert warning.count() == 0
    # Whatever is held is let go.
    other.page.goto(f"{server.url}#touch=3000,50,100;0,0,-15")
    warning.wait_for()
    assert other.state["point"] is None
    assert other.complaints == []
    other.close()


def test_a_damaged_link_says_what_could_not_be_read(server: Server, look_at: Callable[..., Viewer]) -> None:
    other = look_at(f"{server.url}#touch=1,2;x&order=99&stiffness=-1&colour=mauve&look=up&from=0,0,0&constructor=1&a")
    warning = other.page.locator(".warning.is-shown")
    assert warning.inner_text() == (
        "This link could not be read where it says touch=1,2;x, order=99, stiffness=-1, colour=mauve, look=up, "
        "from=0,0,0, constructor=1, a. The organ is shown at rest."
    )
    assert other.state["activity"] == "rest"
    assert other.state["stiffness_factor"] == 1
    # What can be read is done, and a long part is told by its beginning.
    other.page.goto(f"{server.url}#touch=300,50,100;0,0,-15&order=2&colour={'z' * 50}")
    warning.get_by_text("colour=").wait_for()
    said = f"This link could not be read where it says colour={'z' * 33}…."
    assert warning.inner_text().endswith(said)
    assert (other.state["activity"], other.state["order"]) == ("kept", 2)
    # Whatever is held is let go where the next link's touch cannot be read.
    other.page.goto(f"{server.url}#touch=300,50,100;0,0,NaN")
    other.page.wait_for_function("() => viscera.state().activity === 'rest'")
    said = "This link could not be read where it says touch=300,50,100;0,0,NaN. The organ is shown at rest."
    assert warning.inner_text() == said
    other.page.goto(f"{server.url}#order=4")
    warning.wait_for(state="detached")
    assert other.complaints == []
    other.close()


def test_a_link_that_can_be_read_takes_back_what_was_said_of_another(
    server: Server, look_at: Callable[..., Viewer]
) -> None:
    """It says so of itself alone, whatever else it changes: here the view."""
    other = look_at(f"{server.url}#stiffness=-5")
    warning = other.page.locator(".warning.is-shown")
    said = "This link could not be read where it says {}."
    assert warning.inner_text() == said.format("stiffness=-5")
    other.page.goto(f"{server.url}#colour=mauve")
    warning.get_by_text("mauve").wait_for()
    assert warning.inner_text() == said.format("colour=mauve")
    other.page.goto(f"{server.url}#from=1,1,1")
    warning.wait_for(state="detached", timeout=5_000)
    assert other.complaints == []
    other.close()


def test_a_picture_is_saved(viewer: Viewer) -> None:
    viewer.call("touch", TOP, PUSH)
    viewer.page.locator("details.share").evaluate("(menu) => (menu.open = true)")
    with viewer.page.expect_download() as download:
        viewer.page.get_by_role("button", name="Picture").click()
    assert download.value.suggested_filename == "bar.png"
    assert Path(download.value.path()).read_bytes().startswith(b"\x89PNG")
    # The organ is on it: the middle is of another colour than the corner.
    colours = viewer.page.evaluate(
        """([x, y]) => {
            const drawn = viscera.share.drawn();
            const scale = drawn.width / viscera.stage.canvas.clientWidth;
            const all = drawn.getContext("2d").getImageData(0, 0, drawn.width, drawn.height).data;
            const at = (x, y) => {
                const pixel = Math.round(y * scale) * drawn.width + Math.round(x * scale);
                return [...all.slice(4 * pixel, 4 * pixel + 4)];
            };
            return [at(x, y), at(1, 1)];
        }""",
        viewer.place((0.2, 0.0, 0.05)),
    )
    assert np.abs(np.subtract(*colours)).max() > 30


def test_a_film_is_saved(viewer: Viewer) -> None:
    viewer.page.locator("details.share").evaluate("(menu) => (menu.open = true)")
    film = viewer.page.get_by_role("button", name="Film")
    film.click()
    viewer.call("togglePath")
    viewer.page.wait_for_function("() => viscera.share.frames > 3")
    with viewer.page.expect_download() as download:
        film.click()
    content = Path(download.value.path()).read_bytes()
    assert content.startswith(b"\x1a\x45\xdf\xa3")  # Matroska, of which WebM is a part
    assert film.get_attribute("aria-pressed") == "false"


# Keeps how wide and high the organ is drawn into a picture, and how many pixels it has.
RECORD = """() => {
    const draw = CanvasRenderingContext2D.prototype.drawImage;
    CanvasRenderingContext2D.prototype.drawImage = function (image, x, y, width, height) {
        window.drawn = { from: [image.width, image.height], at: [x, y], to: [width, height],
                         on: [this.canvas.width, this.canvas.height] };
        return draw.call(this, image, x, y, width, height);
    };
}"""


def test_a_film_keeps_the_proportions_where_the_window_is_turned(
    server: Server, look_at: Callable[..., Viewer]
) -> None:
    turned = look_at(server.url)
    turned.page.evaluate(RECORD)
    turned.page.evaluate("() => viscera.share.film()")
    turned.page.wait_for_function("() => viscera.share.frames > 0")
    size = turned.page.evaluate("() => window.drawn.on")
    turned.page.set_viewport_size({"width": 500, "height": 900})
    turned.page.wait_for_function("() => viscera.stage.canvas.clientWidth === 500 && window.drawn.from[0] < 500")
    drawn = turned.page.evaluate("() => window.drawn")
    assert drawn["on"] == size
    assert drawn["to"][0] / drawn["to"][1] == pytest.approx(drawn["from"][0] / drawn["from"][1], rel=1e-6)
    # It fits, in the middle.
    for i in range(2):
        assert drawn["to"][i] <= size[i] * (1 + 1e-6)
        assert 2 * drawn["at"][i] + drawn["to"][i] == pytest.approx(size[i], rel=1e-6)
    with turned.page.expect_download():
        turned.page.evaluate("() => viscera.share.film()")
    assert turned.complaints == []
    turned.close()


def test_a_picture_of_what_moves_on_a_slow_machine_has_all_pixels(
    server: Server, look_at: Callable[..., Viewer]
) -> None:
    slow = look_at(server.url)
    slow.page.evaluate(
        """() => {
            Object.defineProperty(viscera.stage.pace, "rate", { get: () => 5 });
            Object.defineProperty(viscera.stage.pace, "isAtRest", { get: () => false });
        }"""
    )
    full = slow.page.evaluate("() => Math.min(devicePixelRatio, 2)")
    slow.page.wait_for_function("(full) => viscera.stage.renderer.getPixelRatio() < full", arg=full)
    wanted = slow.page.evaluate("() => ['clientWidth', 'clientHeight'].map((side) => viscera.stage.canvas[side])")
    slow.page.evaluate(RECORD)
    slow.page.evaluate("() => void viscera.share.drawn()")
    drawn = slow.page.evaluate("() => window.drawn")
    assert drawn["from"] == drawn["on"] == pytest.approx([full * side for side in wanted], abs=1)
    # The next frames save pixels again.
    slow.page.wait_for_function("(full) => viscera.stage.renderer.getPixelRatio() < full", arg=full)
    assert slow.complaints == []
    slow.close()


def test_a_picture_of_a_load_path_says_its_force(viewer: Viewer) -> None:
    viewer.call("setOrder", 1)
    viewer.call("togglePath")
    viewer.page.wait_for_function("() => viscera.touching && Math.hypot(...viscera.touching.force) > 0.1")
    caption, worth = viewer.page.evaluate("() => [viscera.caption(), viscera.touching.worth(1)]")
    assert " N at a depth of " in caption
    assert caption.endswith(f", order 1{worth and f', {worth}'}.")
    viewer.call("setOrder", 4)


def test_the_scale_bar_is_as_long_as_it_says(viewer: Viewer) -> None:
    viewer.page.wait_for_function("() => viscera.display.gauge.bar.dataset.metres")
    metres, pixels, ends = viewer.page.evaluate(
        """() => {
            const { bar } = viscera.display.gauge;
            const { camera, centre } = viscera.stage;
            const metres = Number(bar.dataset.metres);
            const right = camera.matrixWorld.elements.slice(0, 3);
            const at = (side) => viscera.stage.project(camera.position.clone().fromArray(
                centre.map((x, i) => x + 0.5 * side * metres * right[i])));
            return [metres, parseFloat(bar.style.width), [at(-1), at(1)]];
        }"""
    )
    assert 0 < metres < 0.5
    assert pixels == pytest.approx(ends[1]["x"] - ends[0]["x"], rel=0.01)


def test_the_first_visit_has_a_hint(server: Server, look_at: Callable[..., Viewer]) -> None:
    viewer = look_at(server.url)
    hint = viewer.page.locator(".hint")
    hint.wait_for()
    x, y = viewer.place(TOP)
    viewer.page.mouse.move(x, y)
    viewer.page.mouse.down()
    viewer.page.mouse.up()
    hint.wait_for(state="hidden")
    viewer.page.reload()
    viewer.page.wait_for_function("() => window.viscera")
    assert viewer.page.locator(".hint").is_hidden()
    viewer.close()


def test_a_link_that_goes_too_deep_says_where_the_contact_slips(
    touch: vs.Touch, server: Server, look_at: Callable[..., Viewer]
) -> None:
    asked = 1000 * touch.depth * 4
    other = look_at(f"{server.url}#touch=300,50,100;0,0,-{asked:g}")
    warning = other.page.locator(".warning.is-shown")
    warning.wait_for()
    said = warning.inner_text()
    assert said.startswith("Not trusted: a depth of 32.5 mm exceeds the 25 mm that this model is made for")
    assert said.endswith(f"and the contact slips before the {asked:g} mm that were asked for.")
    deepest = [0.0, 0.0, -1.3 * touch.depth]
    other.call("touch", [0.3, 0.05, 0.1], deepest)
    assert "slips" not in warning.inner_text()
    other.close()
