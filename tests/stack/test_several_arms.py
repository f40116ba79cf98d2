"""`make up ARMS="rm1 parol6"`: both arms on one router and one broker, moved at once, each to the step."""

from __future__ import annotations

import re
import subprocess
import time
import urllib.request
from pathlib import Path

import pytest

import gemelo as api
from gemelo.libraries.recordings.foreign import METADATA
from gemelo.libraries.recordings.reader import RecordingReader
from gemelo.libraries.runtime.running import robots_on
from gemelo.libraries.runtime.started import deployment_of_arm
from gemelo.schemas.actions import GoalStatusCode
from gemelo.services.visualizer.program.rerun_program import rerun_binary
from gemelo.tools.stack.stack import Stack, free_ports
from tests.stack.gemelo import gemelo
from tests.stack.person import Operator, jumps

ARMS = ("rm1", "parol6")
OF_EACH = ("virtual_esp32", "stepper_gateway", "state_publisher", "planner", "logger", "visualizer", "panel")
WANTED = ("/rm1/world/measured/base_link/", "/rm1/joints/brazo_joint/position/executed",
          "/parol6/world/measured/base_link/", "/parol6/joints/joint_6/step_error")  # fmt: skip


class OneOf:
    """A stack as one of its arms has it."""

    def __init__(self, stack: Stack, name: str) -> None:
        file = deployment_of_arm(name, stack.environment)
        assert file is not None
        kept = {key: value for key, value in stack.environment.items() if key not in stack.deployment}
        self.environment = {**kept, "GEMELO_CONFIG": str(file)}


def two_free_ports() -> int:
    """The first of two that follow one another."""
    while True:
        first = free_ports(1)[0]
        try:
            urllib.request.urlopen(f"http://127.0.0.1:{first + 1}", timeout=0.5)
        except OSError:
            return first


@pytest.fixture(scope="module")
def stack(tmp_path_factory):
    names = ("router", "broker", "viewer", *(f"{arm}/{name}" for arm in ARMS for name in OF_EACH))
    page = {"GEMELO_PANEL_PORT": str(two_free_ports())}
    command = ("make", "up", f"ARMS={' '.join(ARMS)}")
    out = tmp_path_factory.mktemp("out")
    with Stack(
        command=command, processes=names, environment=page, out=out, viewer="web", ready_timeout=120.0
    ) as running:
        yield running


@pytest.fixture(scope="module")
def people(stack):
    made = [Operator(OneOf(stack, name)) for name in ARMS]
    yield made
    for each in made:
        each.close()


def test_both_arms_are_on_one_router(people):
    assert robots_on(people[0].node.deployment.router, "stepper_gateway") == tuple(sorted(ARMS))


def test_both_move_at_once_and_lose_no_step(people):
    plans = [each.plan(speed=0.5) for each in people]
    goals = [each.send(plan) for each, plan in zip(people, plans, strict=True)]
    end = time.monotonic() + 60.0
    while not all(each.is_moving() for each in people):
        assert time.monotonic() < end, "they did not move at one moment"
        for each in people:
            each.node.wait(0.01)
    for person, goal, plan in zip(people, goals, plans, strict=True):
        outcome = goal.wait(plan.duration + 20.0)
        assert outcome.status is GoalStatusCode.SUCCEEDED, outcome
        assert outcome.result.executed_steps == outcome.result.commanded_steps
        assert not jumps(person.arm, person.seen)


def test_a_script_finds_each_by_its_deployment_file(stack):
    files = [deployment_of_arm(name, stack.environment) for name in ARMS]
    with api.connect(deployment=files[0]) as first, api.connect("parol6", deployment=files[1]) as second:
        assert (first.name, second.name) == ARMS
        motions = [arm.start(named="left", speed=0.5) for arm in (first, second)]
        assert [motion.wait().status for motion in motions] == [GoalStatusCode.SUCCEEDED] * 2


def test_the_command_line_speaks_with_the_arm_that_is_named(stack):
    said = {name: gemelo(stack, "--robot", name, "state") for name in ARMS}
    assert "joint_6" in said["parol6"]
    assert "joint_6" not in said["rm1"]
    gemelo(stack, "--robot", "parol6", "move", "--named", "ready")
    assert "parol6" in gemelo(stack, "--robot", "parol6", "device", "status")


def test_the_end_of_the_start_says_where_each_page_is_and_they_are_there(stack):
    end = time.monotonic() + 30.0
    while "gemelo is up with 2 arms" not in stack.console():
        assert time.monotonic() < end, stack.console()
        time.sleep(0.1)
    first = int(stack.deployment["GEMELO_PANEL_PORT"])
    for port in (first, first + 1):
        assert f"http://127.0.0.1:{port}" in stack.console()
        with urllib.request.urlopen(f"http://127.0.0.1:{port}", timeout=60.0) as page:
            assert page.status == 200


def test_one_viewer_shows_both_arms_in_one_recording(stack):
    port, web = (stack.deployment[f"GEMELO_VIEWER_{key}"] for key in ("PORT", "WEB_PORT"))
    said = stack.console()
    assert len(re.findall(r"see \w+ +http", said)) == 1, said
    assert f"see them  http://127.0.0.1:{web}/" in said
    viewer = f"rerun+http://127.0.0.1:{port}/proxy"
    picked, end = Path(stack.out) / "seen.rrd", time.monotonic() + 30.0
    watching = subprocess.Popen([rerun_binary(), viewer, "--save", picked], stderr=subprocess.DEVNULL)
    try:
        while not all(wanted in printed(picked) for wanted in WANTED):
            assert time.monotonic() < end, printed(picked)[-2000:]
            time.sleep(0.5)
    finally:
        watching.kill()
        watching.wait()
    assert set(re.findall(r'Recording,\s+"gemelo",\s+"(.*)"', printed(picked))) == {"arms-live"}


def printed(recording: Path) -> str:
    """What is in a recording of Rerun's, as its program says it; a file that is being written ends anywhere."""
    command = [rerun_binary(), "rrd", "print", recording]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=60.0).stdout


def test_one_stop_for_all_and_the_recordings_are_apart(stack, people):
    for each in people:
        each.node.close()
    subprocess.run(("make", "down"), cwd=stack.root, env=_addressed(stack), check=True, timeout=60, capture_output=True)
    assert stack.server is not None
    stack.server.wait(30.0)
    for name in ARMS:
        (file,) = (Path(stack.out) / name / "recordings").glob("*.mcap")
        assert file.stem.endswith(f"_{name}")
        assert RecordingReader(file).read_metadata()[METADATA]["robot"] == name


def _addressed(stack: Stack) -> dict[str, str]:
    return {**stack.environment, "PC_SOCKET_PATH": str(stack.socket)}
