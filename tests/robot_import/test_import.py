"""Exports of different origin become robots that load, are well, and plan from `home` to `ready`."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from gemelo.libraries.arm.checks.check import Severity, check
from gemelo.libraries.arm.device.device_config import device_config
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import NamedGoal, PlanCode, PlanRequest
from gemelo.services.planner.core import Planner
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run
from tests.robot_import.exports import EXPORTS, Export, hobby


@dataclass(frozen=True)
class Imported:
    """An export, what the command said of it, and the arm."""

    export: Export
    said: str
    arm: ArmDescription


@pytest.fixture(scope="module", params=EXPORTS, ids=lambda build: build.__name__)
def imported(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Imported:
    build: Callable[[Path], Export] = request.param
    folder = tmp_path_factory.mktemp(build.__name__)
    export = build(folder / "download")
    with Said() as said:
        code = run(["import", str(export.source), "--yes", "--name", "arm", "--output", str(folder / "urdf")])
    assert code is ExitCode.OK, said.text
    return Imported(export, said.text, load_arm(folder / "urdf" / "arm"))


class Said:
    """What is printed while it is entered."""

    def __enter__(self) -> Said:
        import contextlib
        import io

        self._out = io.StringIO()
        self._redirected = contextlib.redirect_stdout(self._out)
        self._redirected.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        self._redirected.__exit__(None, None, None)

    @property
    def text(self) -> str:
        return self._out.getvalue()


def test_what_is_wrong_and_what_is_mended_is_said_with_its_line(imported: Imported):
    for words in imported.export.says:
        assert words in imported.said, imported.said
    for line in imported.said.splitlines():
        if line.startswith(("mended:", "warning:")) and ": meshes: " not in line:
            assert ", line " in line


def test_the_joints_have_their_order_and_names_that_commands_take(imported: Imported):
    assert imported.arm.joint_names == imported.export.joints
    assert not imported.arm.has_motors
    assert device_config(imported.arm).name == "arm"


def test_every_step_says_its_time_and_the_last_line_starts_the_twin(imported: Imported):
    assert imported.said.splitlines()[-1] == f"GEMELO_ROBOT={imported.arm.folder} make up"
    for step in ("reading the source and its meshes", "pairs of links that need no check", "gemelo check, with plans"):
        (line,) = (line for line in imported.said.splitlines() if re.match(rf"{step}.*: \d", line))
        assert line.endswith(" s")


def test_gemelo_check_finds_no_error(imported: Imported):
    assert [finding for finding in check(imported.arm.folder) if finding.severity is Severity.ERROR] == []


def test_every_link_that_is_drawn_has_collision_shapes_unless_only_others_had_some_and_no_mesh_is_among_them(
    imported: Imported,
):
    for link in imported.arm.model.links:
        is_untouched = f'link "{link.name}": can be seen but not touched' in imported.said
        assert (bool(link.visuals) and not is_untouched) == bool(link.collisions)
        assert all(shape.mesh is None for shape in link.collisions)
        for visual in link.visuals:
            assert visual.mesh is None or (imported.arm.folder / visual.mesh).is_file()


@pytest.mark.parametrize("imported", [hobby], indirect=True)
def test_links_of_one_hinge_are_excused_where_shapes_are_fitted(imported: Imported):
    assert imported.arm.collisions_are_disabled("base", "disc")


def test_a_plan_from_home_to_ready_and_back_succeeds(imported: Imported):
    arm, planner = imported.arm, Planner(imported.arm)
    for start, goal in (("home", "ready"), ("ready", "home")):
        standing = JointState(name=arm.joint_names, position=arm.named_states[start])
        response = planner.plan(PlanRequest(goal=NamedGoal(name=goal), start=standing, allowed_time=5.0), None)
        assert response.code is PlanCode.SUCCESS, response.message


def test_importing_it_again_writes_nothing_without_force(imported: Imported):
    folder = imported.arm.folder
    before = {file: file.stat().st_mtime_ns for file in folder.rglob("*")}
    words = ["import", str(imported.export.source), "--yes", "--name", "arm", "--output", str(folder.parent)]
    assert run(words) is ExitCode.FAILED
    assert {file: file.stat().st_mtime_ns for file in folder.rglob("*")} == before
