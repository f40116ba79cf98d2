"""An export of a CAD program, imported by one command, moves at once in the stack that the import's last line starts:
nobody wrote anything."""

from __future__ import annotations

import shlex

from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.motion import FollowJointTrajectoryGoal
from gemelo.schemas.planning import NamedGoal, PlanCode, PlanRequest
from gemelo.schemas.topics import PLAN
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run
from gemelo.tools.stack.stack import Stack
from tests.robot_import.exports import solidworks
from tests.stack.gemelo import gemelo
from tests.stack.person import Operator


def test_an_imported_export_makes_its_first_move_on_a_generated_device(tmp_path, capsys):
    export = solidworks(tmp_path / "download")
    assert run(["import", str(export.source), "--yes", "--output", str(tmp_path / "my arms")]) is ExitCode.OK
    last = capsys.readouterr().out.splitlines()[-1]
    robot = shlex.split(last)[0].removeprefix("GEMELO_ROBOT=")
    typed = ("sh", "-c", f"exec env {last}")
    environment = {"GEMELO_ROBOT": robot}  # of those who look on
    with Stack(out=tmp_path / "out", panel=True, command=typed, environment=environment) as stack:
        person = Operator(stack)
        try:
            for name in ("ready", "home"):
                plan = person.node.call(PLAN, PlanRequest(goal=NamedGoal(name=name)), timeout=60.0)
                assert plan.code is PlanCode.SUCCESS, plan.refusal
                outcome = person.follow.send(FollowJointTrajectoryGoal(trajectory=plan.trajectory)).wait(
                    plan.duration + 10.0
                )
                assert outcome.status is GoalStatusCode.SUCCEEDED, outcome
            assert "virtual" in gemelo(stack, "device", "status")
        finally:
            person.close()
