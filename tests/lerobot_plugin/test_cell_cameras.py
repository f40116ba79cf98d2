"""The cameras of a cell, and LeRobot's own beside them, as the robot of the plug-in has them."""

from __future__ import annotations

import pytest

import gemelo
from gemelo.libraries.lerobot.values import WrongValue
from tests.lerobot_plugin.conftest import CELL
from tests.simulated import found_by_connect

PERIOD = 1.0 / 30.0  # [s] of LeRobot's loop
SIZE = {"fps": 30, "width": 64, "height": 48}


@pytest.fixture(scope="module")
def with_cell():
    with gemelo.simulate("rm1", cell=CELL) as arm, found_by_connect(arm):
        yield arm


@pytest.fixture
def make(make, monkeypatch):
    """A robot of the arm with its cell."""
    monkeypatch.setenv("GEMELO_CELL", str(CELL))
    return make


def test_features_have_the_cameras_of_the_cell_file_and_the_own_ones_without_a_connection(make):
    from lerobot.cameras import GreyConfig

    robot = make(cameras={"front": GreyConfig(**SIZE)})
    assert robot.observation_features["overhead"] == (480, 640, 3)
    assert robot.observation_features["front"] == (48, 64, 3)
    assert len(robot.cameras) == 2  # `lerobot-record` counts them
    assert not {"overhead", "front"} & set(robot.action_features)
    assert "overhead" not in make(cell_cameras=[]).observation_features


def test_an_observation_has_the_newest_image_of_each_in_its_shape_and_as_rgb(make, with_cell):
    from lerobot.cameras import GreyConfig

    robot = make(cameras={"front": GreyConfig(**SIZE)})
    robot.connect()
    found = robot.get_observation()
    assert list(found) == list(robot.observation_features)
    image = found["overhead"]
    assert (image.shape, image.dtype.name) == ((480, 640, 3), "uint8")
    assert found["front"].shape == (48, 64, 3)
    red = image[..., 0].astype(int) - image[..., 2]
    blue = -red
    assert red.max() > 80  # red_block and blue_block of the cell
    assert blue.max() > 80
    robot.disconnect()
    assert not any(camera.is_connected for camera in robot.cameras.values())


def test_an_image_is_decoded_once_and_awaited_by_who_wants_a_new_one(make, with_cell):
    robot = make()
    robot.connect()
    camera = robot.cameras["overhead"]
    first = camera.read_latest()
    assert camera.read_latest() is first
    assert camera.async_read(timeout_ms=1000.0) is not first


def test_an_image_that_is_too_old_ends_the_loop_with_its_camera_and_both_ages(make, with_cell):
    robot = make()
    robot.connect()
    camera = robot.cameras["overhead"]
    camera.read_latest()
    with_cell.sim.sleep(0.45)
    with pytest.raises(TimeoutError, match=r'camera "overhead" of the cell: .* s old, 0\.0 s are allowed'):
        camera.read_latest(max_age_ms=0.0)


def test_a_camera_of_which_no_image_comes_is_named_with_a_remedy(make, plugin, with_cell, monkeypatch):
    robot = make(timeout=0.3)
    robot.cameras["overhead"].name = "elsewhere"
    with pytest.raises(TimeoutError, match=r'"elsewhere" of the cell: no image within 0\.3 s: `gemelo camera list`'):
        robot.connect()
    assert not with_cell.control.held


def test_names_that_cannot_be_are_refused_at_once(make):
    from lerobot.cameras import GreyConfig

    with pytest.raises(WrongValue) as caught:
        make(cell_cameras=["front"])
    assert caught.value.reason.code == "lerobot.camera.unknown"
    assert caught.value.reason.values["names"] == ("overhead",)
    with pytest.raises(WrongValue) as caught:
        make(cameras={"overhead": GreyConfig(**SIZE)})
    assert caught.value.reason.code == "lerobot.camera.twice"


def test_an_own_camera_without_a_size_is_refused_by_lerobot_itself(make):
    from lerobot.cameras import GreyConfig

    with pytest.raises(ValueError, match="width"):
        make(cameras={"front": GreyConfig(fps=30)})
