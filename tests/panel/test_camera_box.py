"""The cameras' part of the page, in a real server and without a browser: what a click changes, and what it says."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace

import pytest
import viser

from gemelo.schemas.camera import CameraImage
from gemelo.schemas.detections import Detection, Detections
from gemelo.services.panel.model.cameras import CameraPictures
from gemelo.services.panel.view.browser import CHANNEL, Click, read_browser
from gemelo.services.panel.view.camera_box import CameraBox
from gemelo.services.panel.view.kit import Kit
from gemelo.services.panel.words.words import Words


def square(name: str, x: float, y: float) -> Detection:
    return Detection(name=name, corners=((x - 20, y - 20), (x + 20, y - 20), (x + 20, y + 20), (x - 20, y + 20)))


@pytest.fixture(scope="module")
def server() -> Iterator[viser.ViserServer]:
    opened = viser.ViserServer("127.0.0.1", 0, verbose=False)
    yield opened
    opened.stop()


@pytest.fixture
def page(server: viser.ViserServer):
    """The box of two cameras that see a cup, a bolt and a tag, and all HTML of the page."""
    return opened(server, ("bin",))


def opened(server: viser.ViserServer, places: tuple[str, ...]):
    handlers = {}
    node = SimpleNamespace(subscribe=lambda topic, handler: handlers.update({topic.key: handler}))
    pictures = CameraPictures(SimpleNamespace(node=node), ("above", "side"), period=0.0)
    picks = SimpleNamespace(things=("cup", "bolt"), places=places, lines=(), look=print, pick=print)
    operator = SimpleNamespace(cameras=pictures, picks=picks, tell=print)
    server.gui.reset()
    kit = Kit(SimpleNamespace(gui=server.gui), operator, Words("en"))
    lines, line = [], kit.line
    kit.line = lambda content="": lines.append(line(content)) or lines[-1]
    box = CameraBox(kit)
    items = (square("cup", 100.0, 100.0), square("bolt", 300.0, 200.0), square("tag 7", 500.0, 400.0))
    for name in ("above", "side"):
        handlers[f"camera/{name}/detections"](Detections(camera=name, items=items))
        handlers[f"camera/{name}/image"](CameraImage(camera=name, width=640, height=480, data=b"0"))
    return SimpleNamespace(
        box=box, picks=box.picks, html=lambda: " ".join(each.content for each in lines), handlers=handlers,
        pictures=pictures,
    )  # fmt: skip


def clicks(page, x: float, y: float, camera: str = "above") -> None:
    page.box.point(Click(camera, x / 640.0, y / 480.0, 1))
    page.box.refresh()


def test_a_click_on_a_thing_chooses_it_and_its_outline_stands_out(page) -> None:
    page.box.refresh()
    assert page.picks.thing == "cup"
    before = page.html()
    clicks(page, 310.0, 190.0)
    assert page.picks.thing == "bolt"
    assert "bolt is chosen." in page.html()
    assert page.html() != before


@pytest.mark.parametrize(
    ("x", "y", "said"),
    [
        (500.0, 400.0, "tag 7 is no thing of the cell file, so it cannot be picked."),
        (100.0, 220.0, "Nothing is detected there; the nearest thing is cup, 100 pixels away."),
    ],
)
def test_a_click_beside_every_thing_changes_nothing_and_says_so_under_that_image(page, x, y, said) -> None:
    clicks(page, 310.0, 190.0, "side")
    clicks(page, x, y)
    assert page.picks.thing == "bolt"
    assert said in page.html()
    assert "bolt is chosen." not in page.html()


def test_where_nothing_is_detected_a_click_says_that(page) -> None:
    page.handlers["camera/above/detections"](Detections(camera="above"))
    clicks(page, 100.0, 100.0)
    assert "No thing of the cell file is detected in this image now." in page.html()


def test_an_image_is_not_sent_again_while_it_is_the_same(page, monkeypatch) -> None:
    page.box.refresh()
    sent = []
    monkeypatch.setattr("gemelo.services.panel.view.camera_box.image_html", lambda *each: sent.append(each) or "")
    page.box.refresh()
    assert not sent
    clicks(page, 310.0, 190.0)
    assert len(sent) == 2


def test_a_click_into_no_camera_or_where_nothing_can_be_picked_is_nothing(page, server) -> None:
    clicks(page, 310.0, 190.0, "behind")
    assert page.picks.thing == "cup"
    without = opened(server, ())
    clicks(without, 310.0, 190.0)
    assert "chosen" not in without.html()
    assert "click" not in without.html()


@pytest.mark.parametrize("clicked", ["null", '{"camera":"above","x":0.5,"y":0.25,"number":3}'])
def test_the_browser_tells_its_newest_click(clicked: str) -> None:
    told = read_browser(f'{CHANNEL} {{"sent":1,"clicked":{clicked}}}')
    assert told is not None
    assert told.clicked == (None if clicked == "null" else Click("above", 0.5, 0.25, 3))
