"""A planner more is one file and one row: it plans, and page, command line, documents and API have it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.additions import added, row_added, run_in

SEARCH = '''"""The search that tries one corner after another, drawn within the limits."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gemelo.services.planner.path.path import PathNotFound, Sought
from gemelo.services.planner.request.deadline import Deadline
from gemelo.services.planner.request.refusals import SearchFailure


def corners(sought: Sought, _planner_id: str, deadline: Deadline) -> NDArray[np.float64]:
    """Start, corner and goal (3, n) [rad] or [m]; raises `PathNotFound`."""
    limits = [(max(joint.lower, -math.pi), min(joint.upper, math.pi)) for joint in sought.arm.joints]
    lower, upper = np.array(limits).T
    random, is_free = np.random.default_rng(sought.seed), sought.validity.is_line_free
    while not deadline.has_passed():
        corner = random.uniform(lower, upper)
        if is_free(sought.start, corner) and is_free(corner, sought.goals[0]):
            return np.vstack((sought.start, corner, sought.goals[0]))
    raise PathNotFound(SearchFailure.TIMED_OUT)
'''
TEXT, TEXT_ES = "one corner, drawn until it is free", "una esquina, sorteada hasta que está libre"
ROW = f'    PlannerRow("OneCorner", "one_corner", "{TEXT}", "{TEXT_ES}"),'
PLANNING = """
import json, time
import gemelo
from gemelo.libraries.arm.model.description import load_arm
from gemelo.schemas.frames import Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import FreeMotion, JointGoal, PlanRequest
from gemelo.schemas.scene import BoxShape, PlanningScene, SceneObject
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.core import Planner
from pathlib import Path

planner = Planner(load_arm(Path("urdf/rm1")))
start, goal = (-0.6, 0.3, 0.05), (0.9, 0.3, 0.05)
between = planner.kinematics.tool((0.15, 0.3, 0.05)).position.tolist()
post = SceneObject(
    name="post", shape=BoxShape(size=(0.05, 0.05, 0.05)),
    pose=Transform(translation=tuple(between), rotation=(0.0, 0.0, 0.0, 1.0)),
)
planner.set_world(World(planner.arm, planner.kinematics, PlanningScene(version=1, objects=(post,)), ()))
names = planner.arm.joint_names
request = PlanRequest(
    start=JointState(name=names, position=start), goal=JointGoal(name=names, position=goal), allowed_time=20.0,
    motion=FreeMotion(planner_id="OneCorner", seed=1),
)
response = planner.plan(request, None, 0.0, time.monotonic)
print(json.dumps([response.code.name, response.planner_id, gemelo.planners.NAMES]))
"""
PAGE = """
import json, tempfile
from pathlib import Path
from tests.panel.memory_page import memory_page

if __name__ == "__main__":
    with memory_page("rm1", Path(tempfile.mkdtemp())) as page:
        page.draw(2)
        [shown] = page.panel.pages()
        planner = shown.move.planner
        print(json.dumps([list(planner.options), planner.hint]))
"""
DOCS = """
import json, runpy
pages = runpy.run_path("docs/make_planners.py")["pages"]()
print(json.dumps([text for text in pages.values()]))
"""


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """This one, with the planner `OneCorner`."""
    table = row_added("schemas/planners.py", after="PLANNERS = (", row=ROW)
    search = {"services/planner/path/searches/one_corner.py": SEARCH}
    return added(tmp_path_factory.mktemp("project"), {**search, **table})


def said(project: Path, script: str) -> list[object]:
    done = run_in(project, "-c", script)
    assert done.returncode == 0, done.stderr
    found: list[object] = json.loads(next(line for line in done.stdout.splitlines() if line.startswith("[")))
    return found


def test_it_plans_around_a_post_and_gemelo_names_it(project: Path) -> None:
    code, planner_id, names = said(project, PLANNING)
    assert (code, planner_id) == ("SUCCESS", "OneCorner")
    assert names == ["OneCorner", "native", "RRTConnect", "RRTstar", "BITstar", "PRM"]


def test_the_page_offers_it_and_says_what_it_can_do(project: Path) -> None:
    options, hint = said(project, PAGE)
    assert "OneCorner" in options
    assert f"OneCorner: {TEXT}" in hint


def test_the_command_line_offers_it(project: Path) -> None:
    done = run_in(project, "-m", "gemelo.tools.cli.main", "move", "--help")
    assert "OneCorner, native" in " ".join(done.stdout.split())


def test_the_documents_have_a_row_for_it_in_both_languages(project: Path) -> None:
    english, spanish = said(project, DOCS)
    assert f"| `OneCorner` | {TEXT} |" in english
    assert f"| `OneCorner` | {TEXT_ES} |" in spanish
