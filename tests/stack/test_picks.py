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
from gemelo.schemas.topics import camera_truth
from gemelo.tools.bench.vision.picks import FLOOR, picks
from gemelo.tools.cli.common.errors import ExitCode
from tests.stack import gemelo as command

BIN = (0.1, 0.3)  # [m] the place in rm1's sample cell


@pytest.fixture(scope="module")
def stack(cell_stack):
    return cell_stack


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

        assert arm.wait_for(is_there, 60.0)
        assert "red_block" not in arm.scene.objects
        arm.start(named="left")
        with pytest.raises(gemelo.Refused) as refused:
            arm.detect("cup")
        assert refused.value.check == "moving"
        arm.stop()


def stop_a_program_that_picks():
    """It ends within a second, wherever it is; the arm stands, and nothing is left in the scene."""
    picks_cup = Program("take", (Pick(thing="cup", place="bin"), Go(state="left")))
    with gemelo.connect() as arm:
        check = check_program(arm, picks_cup, {}, {})
        assert check.ok
        assert "planned when the thing is seen" in check.legs[0].note
        unknown = check_program(arm, Program("take", (Pick(thing="cap", place="bin"),)), {}, {})
        assert "no [[thing]]" in str(unknown.refusals[0])
        run = ProgramRun(arm, picks_cup, {}, {})
        run.start()
        assert arm.wait_for(lambda: max(map(abs, arm.velocities.values())) > 0.05, 60.0)
        run.stop()
        assert run.wait(60.0).status is RunStatus.STOPPED
        stood = arm.joints
        assert not arm.wait_for(lambda: max(map(abs, arm.velocities.values())) > 1e-3, 1.0)
        assert arm.joints == stood
        assert "cup" not in arm.scene.objects


@pytest.mark.alone  # a stack whose cameras and detector want a core for themselves
@pytest.mark.parametrize("robot", ["rm1", "parol6"])
def test_things_at_random_places_among_obstacles_are_picked_or_refused_with_a_reason(robot):
    trials = picks(robot, 1, 1)
    for trial in trials:
        assert (trial.off is not None and trial.off < FLOOR[robot] + 0.5e-3) or len(trial.reason) > 20, trial
        assert not trial.reason.startswith("aborted"), trial
    assert sum(trial.off is not None for trial in trials) >= 1, trials
