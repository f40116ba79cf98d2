"""The real thing once, for each arm: processes under process-compose, a move, a stop, a page, and what was recorded."""

from __future__ import annotations

import signal
from collections import Counter
from math import degrees
from pathlib import Path

import pytest

import gemelo
from gemelo.libraries.recordings.reader import MAGIC, RecordingReader
from gemelo.schemas.topics import DEVICE_STATE, JOINT_STATES, STEP_ERRORS
from gemelo.tools.stack.stack import Stack
from tests.optional import lack, need
from tests.panel.person import Person, until
from tests.stacks.browser import SIZE
from tests.stacks.shared import BROKER, NEEDED, found_by_scripts

GOALS = {"rm1": ("brazo_joint", 25.0, 150.0), "parol6": ("joint_1", 20.0, 80.0)}  # [deg] to reach, and to stop before


@pytest.mark.parametrize("robot", GOALS)
def test_an_arm_moves_stops_is_led_by_its_page_and_all_of_it_is_recorded(
    robot: str, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    processes, environment = (*NEEDED, "logger", "panel"), {"GEMELO_ROBOT": f"urdf/{robot}"}
    with Stack(broker=BROKER, out=tmp_path, processes=processes, environment=environment) as stack:
        with found_by_scripts(stack), gemelo.connect(timeout=60.0) as arm:
            if not all(arm.device.state.referenced):
                arm.reference()
            is_moved_and_stopped(arm)
            if not lack("chromium"):
                chromium = request.getfixturevalue("chromium")
                with Person(chromium, stack.deployment["GEMELO_PANEL_PORT"], "en-US", SIZE) as person:
                    is_led_by_its_page(person, arm)
                    person.require_no_errors()
        was_started_once = [state.restarts for state in stack.compose.processes() if state.name in processes]
        assert was_started_once == [0] * len(processes)
        stack.kill("logger", signal.SIGTERM)
        recording = min((stack.out / "recordings").glob("*.mcap"))
        until(lambda: recording.read_bytes()[-len(MAGIC) :], lambda end: end == MAGIC)
        is_recorded(recording, robot)
        assert [name for name in processes if "Traceback" in stack.logs(name)] == []
    need("chromium")  # all but the page has been shown


def is_moved_and_stopped(arm: gemelo.Arm) -> None:
    motion = arm.move(named="ready")
    for name, at in motion.stopped_at.items():
        half_a_step = 0.501 / arm.description.joint(name).steps.per_unit
        assert at == pytest.approx(arm.states["ready"][name], abs=half_a_step)
    stopped = arm.start(named="home", speed=0.3)
    until(lambda: stopped.progress, lambda progress: progress > 0.1)
    arm.stop()
    with pytest.raises(gemelo.Aborted, match="STOP"):
        stopped.wait()
    assert stopped.progress < 0.9
    arm.move(named="home")


def is_led_by_its_page(person: Person, arm: gemelo.Arm) -> None:
    joint, goal, beyond = GOALS[arm.name]
    person.types(f"{joint} [°]", goal)
    person.press("Plan")
    person.reads("Duration")
    assert degrees(arm.joints[joint]) == pytest.approx(0.0, abs=0.1), "it moves before Execute"
    person.press("Execute")
    until(lambda: degrees(arm.joints[joint]), lambda at: abs(at - goal) < 0.06)
    person.reads("Arrived")
    assert max(abs(error) for error in arm.step_errors.values()) <= 0.5 + 1e-9
    person.types("Speed [%]", 5)
    person.types(f"{joint} [°]", beyond)
    person.press("Plan and execute")
    until(lambda: degrees(arm.joints[joint]), lambda at: at > goal + 1.0)
    person.press("■ STOP (space bar)")
    person.reads("stopped by a device command (STOP)")
    assert degrees(arm.joints[joint]) < beyond - 5.0


def is_recorded(recording: Path, robot: str) -> None:
    reader = RecordingReader(recording)
    count = Counter(row.channel.topic for row in reader.rows())
    assert not reader.damage.is_any, reader.damage
    assert reader.read_metadata()["gemelo"]["robot"] == robot
    for topic in (JOINT_STATES, STEP_ERRORS, DEVICE_STATE):
        assert count[topic.key] > 100, (topic.key, count)
    assert count["@request/plan"] >= 2, count
