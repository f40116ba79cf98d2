"""Things of a cell that are seen, taken and put down by both arms, as a person does it; and what is refused."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys

import pytest

import gemelo
from gemelo.programs import Go, Pick, Program, ProgramRun, RunStatus, check_program
from schemas.cell import MeasuredCamera, Mount
from schemas.topics import camera_truth
from services.arm.cell.camera_file import CAMERA_FILE, write_measured
from services.arm.cell.camera_model import exact_info
from services.arm.cell.cell_file import load_cell
from services.arm.model.description import load_arm
from services.bench.vision.picks import FLOOR, PROCESSES, picks
from services.cli.errors import ExitCode
from services.runtime.deployment import project_root
from services.stack.stack import Stack
from tests.stack import gemelo as command

BIN, RED = (0.1, 0.3), (0.3, -0.12)  # [m] of rm1's sample cell: the place, and where the red block stands
ASTRAY = 0.04  # [m]
MORE = """
[[place]]
name = "far"
kind = "pose"
position = [0.9, 0.1, 0.06]

[[thing]]  # which is nowhere
name = "ghost"
kind = "tag"
id = 7
size = 0.028

[[thing]]  # whose grasp is beside it
name = "beside"
kind = "tag"
id = 8
size = 0.028
box = [0.03, 0.03, 0.04]
grasp_offset = [0.0, -0.06, -0.012]
position = [0.24, 0.02, 0.04]
"""


@pytest.fixture(scope="module")
def stack(tmp_path_factory):
    environment = {"GEMELO_CELL": "urdf/rm1/cell.toml"}
    with Stack(out=tmp_path_factory.mktemp("out"), processes=PROCESSES, environment=environment) as running:
        running.wait_ready(30.0)
        yield running


def test_a_person_detects_and_picks_what_the_sample_cell_has(stack, monkeypatch):
    for name, value in stack.deployment.items():
        monkeypatch.setenv(name, value)
    command.gemelo(stack, "reference")
    command.gemelo(stack, "move", "--named", "ready")
    seen = {each["name"]: each for each in json.loads(command.gemelo(stack, "detect", "--json"))}
    assert {"cup", "red_block", "blue_block", "tray"} <= set(seen)
    assert math.dist(seen["cup"]["pose"]["position"], (0.26, 0.16, 0.04)) < 1e-3
    command.gemelo(stack, "detect", "red_block", "--scene")
    assert "red_block" in command.gemelo(stack, "scene", "list")
    check = subprocess.run(
        [stack.root / ".venv/bin/gemelo", "camera", "check"], cwd=stack.root, env=stack.environment, input="\n\n",
        capture_output=True, text=True, timeout=120.0, check=True,
    )  # fmt: skip
    assert re.search(r"cup: \+0\.0 \+0\.0 mm, step floor \+-[0-2]\.\d\d mm", check.stdout), check.stdout
    assert "no more than camera, mount and arm are good for together" in check.stdout
    assert "cup" not in command.gemelo(stack, "scene", "list")
    stop_a_program_that_picks()
    done = subprocess.run(
        [sys.executable, "examples/16_sort_by_colour.py"], cwd=stack.root, env=stack.environment, capture_output=True,
        text=True, timeout=120.0, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert re.fullmatch(r"blue_block is at tray: .*\nred_block is at bin: .*\n", done.stdout)
    assert "no [[thing]]" in command.gemelo(stack, "pick", "cap", "--to", "bin", code=ExitCode.FAILED)
    with gemelo.connect() as arm:
        truth = arm.node.latest(camera_truth("overhead"))

        def is_there() -> bool:
            items = () if truth.message is None else truth.message.items
            places = [item.base_from_thing.translation for item in items if item.name == "red_block"]
            return any(math.dist(place[:2], BIN) < FLOOR["rm1"] + 0.5e-3 for place in places)

        assert arm.wait_for(is_there, 3.0)
        assert "red_block" not in arm.scene.objects
        arm.start(named="left")
        with pytest.raises(gemelo.Refused) as refused:
            arm.detect("cup")
        assert refused.value.check == "moving"
        arm.stop()


def test_a_thing_that_cannot_be_carried_on_is_said_to_be_between_the_jaws(stack, monkeypatch):
    """What stands in the bin is below the jaws, and in the way of the cup that they carry."""
    for name, value in stack.deployment.items():
        monkeypatch.setenv(name, value)
    with gemelo.connect() as arm:
        arm.move(named="ready")
        arm.scene.add_box("full", (0.04, 0.04, 0.07), at=(*BIN, 0.035))
        with pytest.raises(gemelo.Aborted, match=r"cup was picked and is still between the jaws: .*full"):
            arm.pick("cup", to="bin")
        assert arm.scene.objects["cup"].attached
        arm.scene.remove("full")
        arm.grip("open")
        arm.scene.remove("cup")


def stop_a_program_that_picks():
    """It ends within a second, wherever it is; the arm stands, and nothing is left in the scene."""
    picks_cup = Program("take", (Pick(thing="cup", place="bin"), Go(state="left")))
    with gemelo.connect() as arm:
        check = check_program(arm, picks_cup, {}, {})
        assert check.ok
        assert "planned when the thing is seen" in check.legs[0].note
        unknown = check_program(arm, Program("take", (Pick(thing="cap", place="bin"),)), {}, {})
        assert "no [[thing]]" in unknown.refusals[0]
        run = ProgramRun(arm, picks_cup, {}, {})
        run.start()
        assert arm.wait_for(lambda: max(map(abs, arm.velocities.values())) > 0.05, 20.0)
        run.stop()
        assert run.wait(3.0).status is RunStatus.STOPPED
        stood = arm.joints
        assert not arm.wait_for(lambda: max(map(abs, arm.velocities.values())) > 1e-3, 1.0)
        assert arm.joints == stood
        assert "cup" not in arm.scene.objects


@pytest.fixture
def astray(tmp_path):
    """rm1's cell without its fixed tags, with a camera that stands 40 mm beside where camera.toml has it."""
    rm1 = project_root() / "urdf/rm1"
    path = tmp_path / "cell.toml"
    text = (rm1 / "cell.toml").read_text()
    path.write_text(re.sub(r"\[\[tag\]\].*?(?=\[\[thing)", "", text, flags=re.DOTALL) + MORE)
    arm = load_arm(rm1)
    (record,) = load_cell(path, arm).cameras
    info = exact_info(record, arm.base_frame)
    x, y, z = info.parent_from_camera.translation
    mount = Mount(parent=info.parent, position=(x, y + ASTRAY, z), rotation=info.parent_from_camera.rotation)
    write_measured(path.with_name(CAMERA_FILE), [MeasuredCamera(name=record.name, mount=mount)])
    with Stack(processes=PROCESSES, environment={"GEMELO_CELL": str(path)}) as running:
        running.wait_ready(30.0)
        yield running


def test_what_cannot_be_picked_is_refused_or_aborted_with_its_reason(astray, monkeypatch):
    """Above all what stays where it was: rm1's jaws measure nothing, and can only say what is believed of them."""
    for name, value in astray.deployment.items():
        monkeypatch.setenv(name, value)
    with gemelo.connect() as arm:
        arm.device.arm()
        arm.reference()
        arm.move(named="folded")
        assert arm.detect("red_block")[0].pose.position[1] == pytest.approx(RED[1] + ASTRAY, abs=2e-3)
        with pytest.raises(
            gemelo.Aborted, match=r"red_block was not picked: it still stands at .*: is the camera where"
        ):
            arm.pick("red_block", to="bin")
        assert "red_block" not in arm.scene.objects
        truth = arm.node.latest(camera_truth("overhead"))
        asked = arm.node.now()
        assert arm.wait_for(lambda: truth.message is not None and truth.message.stamp > asked, 3.0)
        (red,) = [item for item in truth.message.items if item.name == "red_block"]
        assert red.base_from_thing.translation[:2] == pytest.approx(RED)


@pytest.mark.parametrize("robot", ["rm1", "parol6"])
def test_things_at_random_places_among_obstacles_are_picked_or_refused_with_a_reason(robot):
    trials = picks(robot, 1, 1)
    for trial in trials:
        assert (trial.off is not None and trial.off < FLOOR[robot] + 0.5e-3) or len(trial.reason) > 20, trial
        assert not trial.reason.startswith("aborted"), trial
    assert sum(trial.off is not None for trial in trials) >= 1, trials
