"""A recording as a LeRobotDataset: its times are those of the arm, and what it holds makes the arm do it again."""

from __future__ import annotations

import io
import json
import math
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from PIL import Image

import gemelo
from gemelo.api.simulation import SimulatedArm
from gemelo.libraries.recordings.channels import Entry
from gemelo.libraries.recordings.mcap_file import McapFile
from gemelo.libraries.recordings.subscriptions import Subscriptions
from gemelo.schemas.topics import DESCRIPTION
from gemelo.services.logger.images import record_cameras
from gemelo.services.state_publisher.main import describe
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run

ROOT = Path(__file__).parents[2]
CELL = ROOT / "urdf/rm1/cell.toml"
PERIOD = 1.0 / 30.0  # [s]
BRAZO = "brazo_joint"
SPEED = 0.3  # [rad/s] of the streamed episode
PAUSE = 2.0  # [s]


class Recorder:
    """What the logger would have written."""

    def __init__(self, arm: SimulatedArm, path: Path) -> None:
        self._node, self._file = arm.sim.node("recorder"), McapFile(path, {"gemelo": {"robot": arm.name}})
        self._take(DESCRIPTION, describe(arm.description))
        Subscriptions(self._node, self._take)
        record_cameras(self._node, ["overhead"], lambda: 30.0, self._take)
        self._node.begin(rate=1.0)

    def _take(self, topic, message) -> None:
        self._file.write([Entry(topic, message, self._node.now())])

    def close(self) -> None:
        self._node.close()
        self._file.close()


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A streamed episode of 30 targets, a pause, then two moves and a grip close behind one another."""
    path = tmp_path_factory.mktemp("recording") / "demonstrations.mcap"
    with gemelo.simulate("rm1", cell=CELL) as arm:
        recorder = Recorder(arm, path)
        arm.sim.sleep(0.5)
        for step in range(30):
            arm.stream({BRAZO: SPEED * PERIOD * step})
            arm.sim.sleep(PERIOD)
        arm.sim.sleep(PAUSE)
        with arm.sim.connect("person") as person:
            person.move(joints={BRAZO: 0.6})
            person.grip(0.02)
            person.move(joints={BRAZO: 0.2})
        arm.sim.sleep(0.5)
        recorder.close()
    return path


@pytest.fixture(scope="module")
def dataset(recording, tmp_path_factory):
    folder = tmp_path_factory.mktemp("dataset") / "cups"
    assert run(["bag", "export", str(recording), "--lerobot", str(folder), "--task", "cup to bin"]) == ExitCode.OK
    return folder


def info(folder):
    return json.loads((folder / "meta/info.json").read_text())


def rows(folder, column):
    """All frames of one column, as an array."""
    return np.asarray(pq.read_table(folder / "data")[column].to_pylist())


def of_episode(folder, number, column):
    return rows(folder, column)[rows(folder, "episode_index") == number]


def test_an_episode_ends_at_a_pause_and_the_counters_run_through(dataset):
    about = info(dataset)
    assert about["total_episodes"] == 2
    assert about["total_frames"] == len(rows(dataset, "index"))
    assert list(rows(dataset, "index")) == list(range(about["total_frames"]))
    episodes = pq.read_table(dataset / "meta/episodes").to_pylist()
    assert [each["dataset_from_index"] for each in episodes] == [0, episodes[0]["length"]]
    assert [each["dataset_to_index"] for each in episodes][-1] == about["total_frames"]
    assert [each["tasks"] for each in episodes] == [["cup to bin"]] * 2
    for number, each in enumerate(episodes):
        assert list(of_episode(dataset, number, "frame_index")) == list(range(each["length"]))


def test_every_frame_has_the_features_of_the_plug_in_in_its_units(dataset):
    features = info(dataset)["features"]
    names = ["brazo_joint.pos", "antebrazo_joint.pos", "efector_joint.pos", "gripper.pos"]
    for name in ("observation.state", "action"):
        assert features[name] == {"dtype": "float32", "shape": [4], "names": names}
        assert rows(dataset, name).shape == (info(dataset)["total_frames"], 4)
    assert features["observation.images.overhead"]["shape"] == [480, 640, 3]


def test_times_are_true_a_streamed_speed_is_what_was_streamed(dataset):
    """However often the loop of a recorder would have run."""
    action, time = of_episode(dataset, 0, "action")[:, 0], of_episode(dataset, 0, "timestamp")
    speed = np.polyfit(time[2:29], action[2:29], 1)[0]
    assert math.radians(speed) == pytest.approx(SPEED, rel=0.02)
    state = of_episode(dataset, 0, "observation.state")[:, 0]
    lag = (action[10:25] - state[10:25]).mean() / speed
    assert 0.03 < lag < 0.09  # the arm follows 40 ms later, and a target is up to 33 ms old


def test_of_a_planned_path_the_action_leads_the_state_by_what_the_arm_follows_later(dataset):
    """A policy that repeats the state would never move."""
    action, state = of_episode(dataset, 1, "action")[:, 0], of_episode(dataset, 1, "observation.state")[:, 0]
    speed = np.gradient(state, PERIOD)
    fast = np.abs(speed) > 20.0
    assert fast.sum() > 10
    assert ((action - state)[fast] / speed[fast]) == pytest.approx(0.04, abs=0.012)
    assert action[-1] == pytest.approx(math.degrees(0.2), abs=0.1)


def test_the_gripper_is_there_with_its_target_before_it_arrives(dataset):
    state, action = of_episode(dataset, 1, "observation.state")[:, 3], of_episode(dataset, 1, "action")[:, 3]
    assert state[-1] == pytest.approx(40.0, abs=1.0)
    assert np.flatnonzero(np.abs(action - 40.0) < 1.0)[0] <= np.flatnonzero(np.abs(state - 40.0) < 1.0)[0]


def test_images_are_those_that_were_recorded_the_newest_at_each_frame(dataset):
    pictures = [each["bytes"] for each in pq.read_table(dataset / "data")["observation.images.overhead"].to_pylist()]
    assert Image.open(io.BytesIO(pictures[0])).size == (640, 480)
    different = len(set(pictures))
    assert 0.1 * len(pictures) < different < 0.3 * len(pictures)  # 5 images a second in 30 frames


def test_what_scales_a_policy_is_that_of_the_frames(dataset):
    found = json.loads((dataset / "meta/stats.json").read_text())
    states = rows(dataset, "observation.state")
    assert found["observation.state"]["mean"] == pytest.approx(list(states.mean(axis=0)), rel=1e-4, abs=1e-4)
    assert found["observation.state"]["std"] == pytest.approx(list(states.std(axis=0)), rel=1e-3, abs=1e-3)
    assert found["action"]["max"] == pytest.approx(list(rows(dataset, "action").max(axis=0)), rel=1e-6)
    image = found["observation.images.overhead"]
    assert np.shape(image["mean"]) == (3, 1, 1)
    assert 0.0 < np.min(image["mean"]) < np.max(image["max"]) <= 1.0


def test_the_card_says_the_units(dataset):
    card = (dataset / "README.md").read_text()
    assert "degrees" in card
    assert "`timestamp` is true time" in card


def test_the_command_says_what_it_wrote_and_that_images_repeat(recording, tmp_path, capsys):
    words = ["bag", "export", str(recording), "--lerobot", str(tmp_path / "cups"), "--task", "cup to bin"]
    assert run(words) == ExitCode.OK
    said = capsys.readouterr().out
    assert "2 episodes" in said
    assert "image_rate 30" in said
    assert run(["--lang", "es", *words]) != ExitCode.OK  # the folder is there
    assert "cups" in capsys.readouterr().err


def test_each_goal_can_be_an_episode_and_a_longer_pause_can_join_all(recording, tmp_path):
    words = ["bag", "export", str(recording), "--task", "cup to bin", "--lerobot"]
    assert run([*words, str(tmp_path / "goals"), "--each-goal"]) == ExitCode.OK
    assert info(tmp_path / "goals")["total_episodes"] == 2
    assert run([*words, str(tmp_path / "all"), "--gap", "5", "--fps", "10"]) == ExitCode.OK
    about = info(tmp_path / "all")
    assert (about["total_episodes"], about["fps"]) == (1, 10)
    assert rows(tmp_path / "all", "timestamp")[-1] > 3.0


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ((), "--task"),
        (("--task", "a", "--fps", "0"), "--fps is 0"),
        (("--task", "a", "--gap", "1000000s"), "--gap is"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_is_written(recording, tmp_path, capsys, more, said):
    assert run(["bag", "export", str(recording), "--lerobot", str(tmp_path / "a"), *more]) == ExitCode.USAGE
    assert said in capsys.readouterr().err
    assert not (tmp_path / "a").exists()


def test_a_recording_of_a_resting_arm_has_no_demonstration(tmp_path, capsys):
    path = tmp_path / "rest.mcap"
    with gemelo.simulate("rm1") as arm:
        recorder = Recorder(arm, path)
        arm.sim.sleep(1.0)
        recorder.close()
    assert run(["bag", "export", str(path), "--lerobot", str(tmp_path / "a"), "--task", "a"]) != ExitCode.OK
    assert "nothing has moved the arm" in capsys.readouterr().err
    assert not (tmp_path / "a").exists()


def test_replayed_the_arm_arrives_to_the_step_where_it_was(dataset):
    """As `lerobot-replay` does it: the actions of an episode, one in each period."""
    actions = of_episode(dataset, 1, "action")
    recorded = of_episode(dataset, 1, "observation.state")
    with gemelo.simulate("rm1") as arm:
        arm.move(joints={BRAZO: math.radians(actions[0, 0])})
        for action in [*actions, *[actions[-1]] * 30]:
            arm.stream({BRAZO: math.radians(action[0])})
            arm.sim.sleep(PERIOD)
        steps = arm.description.joint(BRAZO).steps.steps_per_turn
        off = abs(arm.joints[BRAZO] - math.radians(recorded[-1, 0])) / (2.0 * math.pi) * float(steps)
    assert off < 1.5
