"""The page's messages, counted one by one: none while nothing changes, and few while the arm moves."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.api.device import Device
from gemelo.libraries.arm.model.description import load_arm
from gemelo.schemas.device import StopKind
from gemelo.schemas.frames import Transform
from gemelo.schemas.scene import BoxShape, PlanningScene, SceneObject
from gemelo.services.panel.main import TEXTS
from gemelo.services.panel.model.pace import EARLY, PERIOD, DrawPace
from gemelo.services.panel.view.arms import DrawnArm, load_model
from gemelo.services.panel.view.browser import CHANNEL, STOP_SIGN
from gemelo.services.panel.view.page import LATE, LATE_AGAIN
from gemelo.services.panel.view.world import ASPECT, FARTHEST
from gemelo.services.panel.words.en import ENGLISH
from tests.panel.memory_page import ROOT, MemoryPage, memory_page
from tests.profiles import examples
from tests.runtime.support import until

BUSY = 40  # presses, of which each keeps a thread: more than viser has


@pytest.fixture(params=["rm1", "parol6"])
def page(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[MemoryPage]:
    with memory_page(request.param, tmp_path) as page:
        settle(page)
        yield page


def settle(page: MemoryPage) -> None:
    """Until the browser has all, and its answers have been shown."""
    for _ in range(20):
        page.draw(5)
        if not page.sent():
            page.draw(5)
            if not page.sent():
                return
    raise AssertionError("the page goes on sending")


def test_nothing_is_sent_to_a_browser_while_nothing_changes(page: MemoryPage):
    page.draw(round(60.0 * TEXTS))
    assert page.sent() == {}


def test_a_picture_of_one_joint_that_moves_is_one_message_whatever_the_arm_carries(page: MemoryPage):
    arm = page.panel.operator.arm.description
    box = SceneObject(name="box", shape=BoxShape(size=(0.02, 0.02, 0.02)), frame=arm.tool_frame, attached=True,
                      pose=Transform(translation=(0.0, 0.0, 0.02), rotation=(0.0, 0.0, 0.0, 1.0)))  # fmt: skip
    page.gateway.show_scene(PlanningScene(objects=(box,)))
    assert until(lambda: len(page.panel.operator.bus.scene.objects) == 1)
    settle(page)
    page.gateway.joints |= {arm.joints[0].name: 0.101}
    page.now += PERIOD - 1.0 / TEXTS
    page.draw()
    said = page.sent()
    assert {name: number for name, number in said.items() if name.startswith("Set")} == {"SetOrientationMessage": 1}
    assert set(said) <= {"SetOrientationMessage", "GuiUpdateMessage"}


def test_a_browser_that_tells_its_frame_rate_later_has_the_lag_that_it_had(page: MemoryPage):
    [shown] = page.panel.pages()
    assert shown.browser is not None
    lag, sent = shown.lag, shown.browser.sent
    shown.hear(f'{CHANNEL} {{"sent": {sent}, "language": "en", "rate": 5.0}}')
    assert (shown.lag, shown.browser.rate) == (lag, 5.0)


def test_a_long_lag_is_measured_again_though_nothing_else_changes(page: MemoryPage):
    [shown] = page.panel.pages()
    shown.lag = 3.0
    page.draw()  # says so, with a new mark
    assert until(lambda: shown.lag < LATE)
    shown.lag = 0.7  # as of a browser that compiles its shaders, for the same mark
    page.draw(round(LATE_AGAIN * TEXTS) - 2)
    page.sent()
    assert shown.lag == 0.7
    page.draw(4)
    assert until(lambda: shown.lag < LATE)
    settle(page)
    page.draw(round(2.0 * LATE_AGAIN * TEXTS))
    assert page.sent() == {}


def test_the_lag_of_a_page_that_was_loading_is_not_shown_for_ever(page: MemoryPage, monkeypatch: pytest.MonkeyPatch):
    [shown] = page.panel.pages()
    monkeypatch.setattr(shown, "hear", lambda text: None)  # the browser tells nothing besides
    for lag, told in ((4.7, "4700 ms"), (0.03, "30 ms"), (0.04, "30 ms"), (0.2, "200 ms")):
        shown.lag = lag
        page.draw(2)
        assert told in shown.header.content


def test_in_a_narrow_picture_the_camera_stands_farther_away_on_the_same_line_and_in_a_wide_one_it_stays(
    page: MemoryPage,
):
    [shown] = page.panel.pages()
    world, camera = page.panel.world, shown.client.camera
    before = np.array(camera.position)
    world.step_back(shown.client, 1.5)
    assert np.array(camera.position) == pytest.approx(before)
    away = []
    for aspect in (1.0, 0.5, 0.1):
        world.step_back(shown.client, aspect)
        line = np.array(camera.position) - world.seen
        away.append(np.linalg.norm(line) / np.linalg.norm(world.eye - world.seen))
        assert np.cross(line, world.eye - world.seen) == pytest.approx(np.zeros(3), abs=1e-9)
    assert away == pytest.approx([ASPECT, 2 * ASPECT, FARTHEST])


def test_stop_goes_out_though_every_thread_is_busy_with_other_buttons(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    busy, over = [], threading.Event()

    def keep(device: Device) -> None:
        busy.append(device)
        assert over.wait(60.0)

    monkeypatch.setattr(Device, "reset", keep)
    with memory_page("rm1", tmp_path) as page:
        settle(page)
        try:
            for _ in range(BUSY):
                page.browser.press(ENGLISH["reset"])
            assert until(lambda: len(busy) >= 32)
            page.browser.press(STOP_SIGN)
            assert until(lambda: bool(page.gateway.stops))
            assert page.gateway.stops[0].kind is StopKind.STOP
            assert len(busy) < BUSY  # the others still wait for a thread
        finally:
            over.set()


@pytest.mark.parametrize("robot", ["rm1", "parol6"])
@examples(quick=5, full=20)
@given(data=st.data())
def test_the_drawn_arm_stands_as_the_urdf_says(robot: str, drawn_arms: dict[str, DrawnArm], data: st.DataObject):
    arm, drawn = load_arm(ROOT / "urdf" / robot), drawn_arms[robot]
    model = load_model(arm.urdf_path)
    joints = {
        joint.name: data.draw(st.floats(max(joint.lower, -3.0), min(joint.upper, 3.0))) for joint in arm.joints
    }  # fmt: skip
    drawn.show(joints)
    model.update_cfg(np.array([joints.get(name, 0.0) for name in model.actuated_joint_names]))
    for joint in arm.model.joints:
        node = drawn.nodes[joint.child]
        wanted = model.get_transform(joint.child, joint.parent)
        w, x, y, z = node.wxyz
        assert rotation(w, x, y, z) == pytest.approx(wanted[:3, :3], abs=1e-4)
        assert node.position == pytest.approx(wanted[:3, 3], abs=1e-4)
    tool = model.get_transform(arm.tool_frame)
    assert drawn.pose(arm.tool_frame)[0] == pytest.approx(tool[:3, 3], abs=1e-4)


@pytest.fixture(scope="module")
def drawn_arms(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, DrawnArm]]:
    with memory_page("rm1", tmp_path_factory.mktemp("page")) as page:
        arms = {name: load_arm(ROOT / "urdf" / name) for name in ("rm1", "parol6")}
        yield {name: DrawnArm(page.panel.server, arm, f"/test_{name}") for name, arm in arms.items()}


def rotation(w: float, x: float, y: float, z: float) -> np.ndarray:
    """(3, 3) of a unit quaternion."""
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def test_of_an_arm_that_moves_every_second_state_is_drawn_as_it_comes_and_the_last_one_too():
    pace, drawn = DrawPace(), []
    for step in range(500):
        now, position = 0.02 * step + 0.004 * (step % 3), (float(min(step, 250)),)
        if pace.is_due(position, now):
            drawn.append(position)
            pace.drawn(position, now)
    assert 120 <= len(drawn) <= 130
    assert drawn[0] == (0.0,)
    assert drawn[-1] == (250.0,)


@given(st.lists(st.tuples(st.floats(0.0, 0.1), st.integers(0, 3)), max_size=100))
def test_pictures_are_never_closer_than_they_may_be_and_never_of_what_is_drawn_already(heard: list[tuple[float, int]]):
    pace, now, before, shown = DrawPace(), 0.0, float("-inf"), None
    for wait, position in heard:
        now += wait
        if pace.is_due((float(position),), now):
            assert now - before >= PERIOD - EARLY
            assert position != shown
            pace.drawn((float(position),), now)
            before, shown = now, position
