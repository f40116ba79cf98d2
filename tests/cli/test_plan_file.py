"""`gemelo move --plan-only --json > plan.json`, then `gemelo move --execute plan.json`."""

from __future__ import annotations

import io
import json
from contextlib import contextmanager
from pathlib import Path

import msgspec
import pytest

import gemelo
from gemelo.schemas.planning import PlanResponse
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.common.session import load_robot, reported
from gemelo.tools.cli.main import run
from gemelo.tools.cli.motion import move


@pytest.fixture
def stack(connected, gateway, planner, monkeypatch):
    """The commands reach a planner and a gateway."""

    @contextmanager
    def connect_arm(robot=None):
        with reported(load_robot()):
            yield connected

    monkeypatch.setattr(move, "connect_arm", connect_arm)
    return gateway


@pytest.fixture
def plan(stack, tmp_path: Path, capsys) -> Path:
    """The file that a person has written by redirecting the output."""
    assert run(["move", "--joints", "brazo_joint=30deg", "--plan-only", "--json"]) is ExitCode.OK
    path = tmp_path / "plan.json"
    path.write_text(capsys.readouterr().out)
    return path


def test_plan_only_as_json_has_the_trajectory_and_moves_nothing(stack, plan):
    saved = json.loads(plan.read_text())
    assert saved["robot"] == "rm1"
    assert saved["duration_s"] == saved["response"]["duration"] > 0.0
    assert saved["planned_s"] == saved["response"]["planning_time"]
    points = saved["response"]["trajectory"]["points"]
    assert points[-1]["positions"][0] == pytest.approx(0.5235987755982988, abs=1e-9)
    assert points[-1]["time_from_start"] == saved["duration_s"]
    assert stack.goals == []


def test_the_executed_goal_is_exactly_the_plan_of_the_file(stack, plan, capsys):
    assert run(["move", "--execute", str(plan)]) is ExitCode.OK
    assert "took 0.40 s, final error" in capsys.readouterr().out
    saved = msgspec.convert(json.loads(plan.read_text())["response"], PlanResponse)
    [goal] = stack.goals
    assert goal.trajectory == saved.trajectory
    assert (goal.scene_version, goal.scene_epoch) == (saved.scene_version, saved.scene_epoch)


def test_a_plan_comes_from_a_pipe_too(stack, plan, capsys, monkeypatch):
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(plan.read_bytes())))
    assert run(["move", "--execute", "-", "--json"]) is ExitCode.OK
    assert json.loads(capsys.readouterr().out)["succeeded"] is True
    assert len(stack.goals) == 1


def test_a_gateway_that_refuses_the_plan_is_quoted(stack, plan, capsys):
    stack.refusal = "the arm stands elsewhere"
    assert run(["move", "--execute", str(plan)]) is ExitCode.FAILED
    assert "refused by stepper_gateway: the arm stands elsewhere" in capsys.readouterr().err


def changed(text: str, **fields: object) -> str:
    """The file with other top-level fields, or with other fields of its trajectory."""
    saved = json.loads(text)
    for name, value in fields.items():
        where = saved if name in saved else saved["response"] if name in saved["response"] else None
        (where or saved["response"]["trajectory"])[name] = value
    return json.dumps(saved)


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda text: text[: len(text) // 2], "holds no plan: "),
        (lambda text: "", "holds no plan: "),
        (lambda text: "[1, 2]", "holds no plan: "),
        (lambda text: '{"robot": "rm1", "status": "SUCCEEDED"}', "missing required field `response`"),
        (lambda text: text.replace('"positions":[', '"positions":[NaN,', 1), "holds no plan: "),
        (lambda text: text.replace('"positions":[', '"positions":[1e999,', 1), "holds no plan: "),
        (lambda text: text.replace('"positions":[', '"positions":["far",', 1), "holds no plan: "),
        (lambda text: text.replace('"positions":[', '"positions":[0.0,', 1), "point 0 has 4 positions for 3 joints"),
        (lambda text: changed(text, robot="parol6"), "is a plan for parol6, and this robot is rm1"),
        (lambda text: changed(text, points=[]), "holds a plan without a trajectory"),
        (lambda text: changed(text, refusal={"message": "2 m is out of reach"}), "holds a refusal, no plan: 2 m is"),
        (lambda text: changed(text, joint_names=["J1", "J2", "J3"]), "moves J1, J2, J3, and rm1 has brazo_joint"),
    ],
)
def test_a_file_that_is_no_plan_for_this_arm_is_refused_by_name(stack, plan, capsys, spoil, reason):
    plan.write_text(spoil(plan.read_text()))
    assert run(["move", "--execute", str(plan)]) in (ExitCode.USAGE, ExitCode.FAILED)
    error = capsys.readouterr().err
    assert str(plan) in error
    assert reason in error
    assert stack.goals == []


@pytest.mark.parametrize("name", ["nowhere.json", "."])
def test_a_file_that_cannot_be_read_is_named(name, capsys):
    assert run(["move", "--execute", name]) is ExitCode.USAGE
    assert f"{name} cannot be read: " in capsys.readouterr().err


@pytest.mark.parametrize(
    ("option", "named"),
    [("--speed 50%", "--speed"), ("--speed 0%", "--speed"), ("--plan-only", "--plan-only"), ("--seed 0", "--seed"),
     ("--line", "--line"), ("--via 0 0 0", "--via"), ("--frame base_link", "--frame"), ("--time 3", "--time")],
)  # fmt: skip
def test_an_option_of_a_goal_does_not_go_with_a_plan_of_before(option, named, capsys):
    assert run(["move", "--execute", "plan.json", *option.split()]) is ExitCode.USAGE
    assert f"{named} does not go with --execute" in capsys.readouterr().err


def test_a_plan_and_a_goal_exclude_one_another(capsys):
    with pytest.raises(SystemExit):
        run(["move", "--execute", "plan.json", "--named", "ready"])
    assert "not allowed with argument --execute" in capsys.readouterr().err


def test_the_python_api_reads_and_writes_the_same_file(stack, plan, tmp_path):
    loaded = gemelo.Plan.load(str(plan))
    saved = msgspec.convert(json.loads(plan.read_text())["response"], PlanResponse)
    assert loaded.response == saved
    loaded.save(str(tmp_path / "again.json"))
    assert run(["move", "--execute", str(tmp_path / "again.json")]) is ExitCode.OK
    assert stack.goals[-1].trajectory == saved.trajectory
