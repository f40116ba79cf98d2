"""A plan that is made now and executed later, by the command line on a stack: the gateway judges if it still holds."""

from __future__ import annotations

import json

import pytest

from services.cli.errors import ExitCode
from tests.stack.gemelo import gemelo


@pytest.fixture
def plan(stack, operator, tmp_path):
    """From `home` to `ready`, in a file; the arm is at `home`."""
    gemelo(stack, "move", "--named", "home")
    path = tmp_path / "plan.json"
    path.write_text(gemelo(stack, "move", "--named", "ready", "--plan-only", "--json"))
    return path


def test_the_plan_of_a_file_is_executed_to_its_end(stack, plan):
    end = json.loads(plan.read_text())["response"]["trajectory"]["points"][-1]["positions"]
    report = json.loads(gemelo(stack, "move", "--execute", str(plan), "--json"))
    assert report["succeeded"]
    assert max(map(abs, report["final_error_steps"].values())) <= 0.5
    assert list(report["stopped_at"].values()) == pytest.approx(end, abs=0.01)
    refused = gemelo(stack, "move", "--execute", str(plan), code=ExitCode.FAILED)
    assert "refused by stepper_gateway" in refused
    assert "_joint" in refused


def test_a_plan_made_in_another_scene_is_refused(stack, plan):
    gemelo(stack, "scene", "add", "post", "--box", "40mm", "40mm", "160mm", "--at", "290mm", "270mm", "80mm")
    try:
        assert "plan again" in gemelo(stack, "move", "--execute", str(plan), code=ExitCode.FAILED)
    finally:
        gemelo(stack, "scene", "clear")


def test_a_plan_beyond_a_limit_is_refused_with_the_joint(stack, plan):
    saved = json.loads(plan.read_text())
    saved["response"]["trajectory"]["points"][-1]["positions"][0] = 9.0
    plan.write_text(json.dumps(saved))
    assert "brazo_joint" in gemelo(stack, "move", "--execute", str(plan), code=ExitCode.FAILED)
