"""A plan of now is executed later, by the command line on a simulated arm: the gateway judges if it still holds."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

import gemelo
from gemelo.tools.cli.common.errors import ExitCode
from tests.simulated import TypedAt


@pytest.fixture
def typed() -> Iterator[TypedAt]:
    with gemelo.simulate("rm1", start="home") as arm:
        yield TypedAt(arm)


@pytest.fixture
def plan(typed: TypedAt, tmp_path: Path) -> Path:
    """From `home` to `ready`, in a file."""
    path = tmp_path / "plan.json"
    path.write_text(typed("move", "--named", "ready", "--plan-only", "--json"))
    return path


def test_the_plan_of_a_file_is_executed_to_its_end(typed: TypedAt, plan: Path) -> None:
    end = json.loads(plan.read_text())["response"]["trajectory"]["points"][-1]["positions"]
    report = json.loads(typed("move", "--execute", str(plan), "--json"))
    assert report["succeeded"]
    assert max(map(abs, report["final_error_steps"].values())) <= 0.5
    assert list(report["stopped_at"].values()) == pytest.approx(end, abs=0.01)
    refused = typed("move", "--execute", str(plan), code=ExitCode.FAILED)
    assert "refused by stepper_gateway" in refused
    assert "_joint" in refused


def test_a_plan_made_in_another_scene_is_refused(typed: TypedAt, plan: Path) -> None:
    typed("scene", "add", "post", "--box", "40mm", "40mm", "160mm", "--at", "290mm", "270mm", "80mm")
    assert "plan again" in typed("move", "--execute", str(plan), code=ExitCode.FAILED)


def test_a_plan_beyond_a_limit_is_refused_with_the_joint(typed: TypedAt, plan: Path) -> None:
    saved = json.loads(plan.read_text())
    saved["response"]["trajectory"]["points"][-1]["positions"][0] = 9.0
    plan.write_text(json.dumps(saved))
    assert "brazo_joint" in typed("move", "--execute", str(plan), code=ExitCode.FAILED)
