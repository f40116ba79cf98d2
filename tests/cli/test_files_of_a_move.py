"""The count of our Python files that the process of one `gemelo move` loads, which its reader opens."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

from gemelo.libraries.runtime.node import Node
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import PlanRequest
from gemelo.schemas.topics import PLAN
from gemelo.services.planner.core import Planner
from tests.cli.conftest import PretendGateway
from tests.runtime.support import spinning

pytestmark = pytest.mark.full  # real processes

ROOT = Path(__file__).parents[2]
MOVE = """
import json, sys
from gemelo.tools.cli.main import run

assert run(["move", "--named", "left"]) == 0
print(json.dumps([each.__file__ for each in list(sys.modules.values()) if getattr(each, "__file__", None)]))
"""
# Chosen: of 114 and 12 when this was written, where 100 is wanted; the thirteenth came with the language of sentences.
MOST, MOST_OF_THE_COMMAND_LINE = 116, 13


def has_code(file: Path) -> bool:
    """False for a file that is empty but for its docstring."""
    return any(not isinstance(node, ast.Expr | ast.ImportFrom) for node in ast.parse(file.read_text()).body)


def loaded_by_a_move(router, arm) -> list[str]:
    """Our files with code, relative to the project, of a process that has moved an arm on a real router."""
    core, home = Planner(arm), JointState(name=arm.joint_names, position=(0.0,) * len(arm.joints))
    core.plan(PlanRequest(), home)  # the first one loads libraries, which may take longer than a caller waits
    with (
        Node("planner", router.deployment, robot="rm1") as planner,
        Node("stepper_gateway", router.deployment, robot="rm1") as gateway,
    ):
        planner.serve(PLAN, lambda request: core.plan(request, home))
        made = PretendGateway(gateway, arm)
        with spinning(planner, rate=10.0), spinning(gateway, made.step):
            moved = subprocess.run(
                [sys.executable, "-c", MOVE], cwd=ROOT, env=router.environ, capture_output=True, text=True, timeout=60,
                check=False,
            )  # fmt: skip
    assert moved.returncode == 0, moved.stderr
    files = {Path(file).resolve() for file in json.loads(moved.stdout.splitlines()[-1])}
    rooms = [ROOT / room for room in ("gemelo", "libraries", "schemas", "services", "tools", "firmware")]
    ours = [file for file in files if any(file.is_relative_to(room) for room in rooms)]
    return sorted(str(file.relative_to(ROOT)) for file in ours if has_code(file))


def test_a_move_is_so_many_files(router, arm):
    files = loaded_by_a_move(router, arm)
    assert "tools/cli/motion/move.py" in files
    assert len(files) <= MOST, "\n".join(files)
    assert len([file for file in files if file.startswith("tools/")]) <= MOST_OF_THE_COMMAND_LINE
    assert [file for file in files if file.startswith(("services/", "firmware/"))] == []
