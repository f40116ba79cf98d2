"""Every process has a clock of its own, seconds apart and drifting: all that moves the arm goes as with one clock."""

from __future__ import annotations

import json
import math
import re

import pytest

import gemelo as api
from gemelo.libraries.recordings.mcap_file import CLOCKS
from gemelo.libraries.recordings.reader import RecordingReader
from gemelo.schemas.topics import camera_truth
from gemelo.tools.bench.vision.picks import FLOOR, PROCESSES
from gemelo.tools.chaos.clocks import shifted
from gemelo.tools.stack.stack import Stack
from tests.stack.gemelo import gemelo

AHEAD = {
    "gemelo-stepper-gateway": (5.0, 2e-4),
    "gemelo-planner": (-5.0, -2e-4),
    "gemelo-camera": (-10.0, 1e-4),
    "gemelo-detector": (10.0, -1e-4),
    "gemelo-state-publisher": (2.5, 0.0),
    "gemelo-logger": (-2.5, 1e-4),
}  # [s] ahead, and [s/s] fast
NODE = {name.removeprefix("gemelo-").replace("-", "_"): ahead for name, (ahead, _) in AHEAD.items()}
BIN = (0.1, 0.3)  # [m] of rm1's sample cell


@pytest.fixture(scope="module")
def stack(tmp_path_factory):
    clocks = shifted(tmp_path_factory.mktemp("clock"), AHEAD)
    environment = {"GEMELO_CELL": "urdf/rm1/cell.toml", **clocks}
    processes = (*PROCESSES, "logger")
    with Stack(out=tmp_path_factory.mktemp("out"), processes=processes, environment=environment) as running:
        yield running


@pytest.fixture(autouse=True)
def here(stack, monkeypatch):
    for name, value in stack.deployment.items():
        monkeypatch.setenv(name, value)


def test_the_clocks_are_measured_and_shown(stack):
    lines = {line.split()[0]: line for line in gemelo(stack, "node", "list").splitlines()}
    for name, ahead in NODE.items():
        said = re.search(r"([+-][\d.]+) ±([\d.]+) ms$", lines[name])
        assert said is not None, lines[name]
        assert abs(float(said[1]) / 1e3 - ahead) < 0.2, lines[name]  # they drift
    found = {each["subject"]: each for each in json.loads(gemelo(stack, "doctor", "--json"))}
    assert found["clocks"]["verdict"] == "warning"
    for name in NODE:
        assert name in found["clocks"]["found"]


def test_a_thing_is_seen_after_the_arm_has_come_to_rest_and_carried_to_its_place(stack):
    gemelo(stack, "reference")
    gemelo(stack, "move", "--named", "ready")
    seen = {each["name"]: each for each in json.loads(gemelo(stack, "detect", "--json"))}
    assert math.dist(seen["cup"]["pose"]["position"], (0.26, 0.16, 0.04)) < 1e-3
    gemelo(stack, "pick", "red_block", "--to", "bin")
    with api.connect() as arm:
        truth = arm.node.latest(camera_truth("overhead"))

        def is_there() -> bool:
            items = () if truth.message is None else truth.message.items
            places = [item.base_from_thing.translation for item in items if item.name == "red_block"]
            return any(math.dist(place[:2], BIN) < FLOOR["rm1"] + 0.5e-3 for place in places)

        assert arm.wait_for(is_there, 60.0)


def test_moves_jogs_and_stops_are_as_ever_and_a_script_sees_what_was_measured_after_its_move(stack):
    with api.connect() as arm:
        for state in ("left", "ready"):
            arm.move(named=state)
            wanted = arm.description.named_states[state]
            for joint, place in zip(arm.description.joints, wanted, strict=True):
                assert abs(arm.joints[joint.name] - place) <= 1.0 / joint.steps.per_unit  # a step
        before = arm.joints["brazo_joint"]
        gemelo(stack, "jog", "--joint", "brazo_joint=10deg/s", "--for", "1")
        assert math.degrees(arm.joints["brazo_joint"] - before) == pytest.approx(10.0, abs=4.0)
        motion = arm.start(named="left")
        arm.stop()
        with pytest.raises(api.Aborted):
            motion.wait(10.0)


def test_the_recording_says_whose_clock_each_stamp_is_of(stack):
    stack.stop()
    (file,) = (stack.out / "recordings").glob("*.mcap")
    reader = RecordingReader(file)
    for _ in reader.rows():
        pass
    clocks = {name: json.loads(text) for name, text in reader.metadata[CLOCKS].items()}
    own = NODE["logger"]
    for name, ahead in NODE.items():
        if name == "logger":  # whose own clock is what the others are held against
            continue
        assert abs(clocks[name]["offset"] - (ahead - own)) <= clocks[name]["bound"] + 0.2, (name, clocks[name])
        assert clocks[name]["host"]
