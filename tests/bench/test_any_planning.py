"""The problems of arms that do not ship, and the figures about them on a few."""

from __future__ import annotations

import dataclasses

import msgspec
import numpy as np
import pytest

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.schemas.planning import PlanCode, Refusal
from gemelo.services.planner.collision.clearance import CLEARANCE
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.core import Planner
from gemelo.tools.bench.any_arm.drawn_problems import ProblemDrawer, problems
from gemelo.tools.bench.any_arm.families import FAMILIES, FEWEST, MOST, settings
from gemelo.tools.bench.any_arm.generated_arms import ArmSketch, SketchSolid, generated_arm, seven_joints, six_joints
from gemelo.tools.bench.planner import any_planning, near_planning, refusing
from gemelo.tools.bench.planner.any_planning import AnyTrial, has_contact, planned, trial

PLAIN = ("six", "seven")  # without meshes, for which spheres are fitted for a quarter of a minute
FEW = 2


@pytest.fixture(scope="module")
def planner() -> Planner:
    return Planner(generated_arm("seven"))


@pytest.fixture(scope="module")
def some(planner: Planner) -> list[AnyTrial]:
    return [trial(planner, problem) for family in ("box", "cage") for problem in problems_of(planner, family)]


def problems_of(planner: Planner, family: str):
    return problems(planner.arm, planner.kinematics, family, FEW)


@pytest.mark.parametrize("name", PLAIN)
def test_the_arms_are_mostly_free_of_themselves(name: str):
    arm = generated_arm(name)
    world = World(arm, Kinematics(arm))
    lower, upper = np.array([(joint.lower, joint.upper) for joint in arm.joints]).T
    rows = np.random.default_rng(0).uniform(lower, upper, (60, len(lower)))
    assert world.distance(arm.named_states["home"]) > CLEARANCE
    assert sum(world.distance(row) > CLEARANCE for row in rows) > 25


def test_seven_has_40_to_60_spheres_and_six_17_solids_that_are_worth_as_many():
    """A solid is worth as many spheres as stand side by side in its box, each as wide as its thinnest side."""
    seven, six = solids_of(seven_joints()), solids_of(six_joints())
    assert 40 <= len(seven) <= 60
    assert all(len(solid.size) == 1 for solid in seven)
    assert len(six) == 17
    assert 40 <= sum(np.prod(sides(solid)) / min(sides(solid)) ** 3 for solid in six) <= 60


def solids_of(sketch: ArmSketch) -> list[SketchSolid]:
    return [*sketch.base, *(solid for link in sketch.links for solid in link.solids)]


def sides(solid: SketchSolid) -> tuple[float, ...]:
    match solid.size:
        case (radius,):
            return (2.0 * radius,) * 3
        case radius, length:
            return 2.0 * radius, 2.0 * radius, length
    return solid.size


@pytest.mark.parametrize(("name", "table"), [("six", (0.0892, 0.425, 0.392, 0.109, 0.095, 0.182)), ("seven", ())])
def test_the_tool_is_where_the_published_table_has_it(name: str, table: tuple[float, ...]):
    arm = generated_arm(name)
    tool = Kinematics(arm).tool((0.0,) * len(arm.joints)).position
    if name == "six":
        d1, a2, a3, d4, d5, d6 = table
        assert tool == pytest.approx([-(a2 + a3), -(d4 + d6), d1 - d5], abs=1e-3)
    else:
        assert tool == pytest.approx([0.088, 0.0, 0.333 + 0.316 + 0.384 - 0.2104], abs=1e-9)


def test_meshes_are_made_by_code_and_read_as_any_others():
    arm = generated_arm("six_mesh")
    assert [path.name for path in sorted(arm.folder.glob("*.stl"))] == ["link_2.stl", "link_3.stl"]
    assert arm.urdf_path.read_text().count("<mesh") == 2
    assert arm.joint_names == generated_arm("six").joint_names


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("name", PLAIN)
def test_both_ends_are_within_limits_and_free_and_drawn_the_same_again(name: str, family: str):
    arm = generated_arm(name)
    kinematics = Kinematics(arm)
    drawn = problems(arm, kinematics, family, FEW)
    assert [each.is_pose for each in drawn] == [True, False]
    for problem in drawn:
        world = World(arm, kinematics, problem.setting.scene)
        for configuration in (problem.start, problem.goal):
            assert all(joint.is_within(value) for joint, value in zip(arm.joints, configuration, strict=True))
            assert world.distance(configuration) > CLEARANCE
    again = ProblemDrawer(arm, Kinematics(arm)).problem(family, drawn[-1].seed)
    assert (again.start, again.goal, again.setting.scene) == (
        drawn[-1].start,
        drawn[-1].goal,
        drawn[-1].setting.scene,
    )


@pytest.mark.parametrize("family", FAMILIES)
def test_goals_near_things_are_near_and_others_touch(planner: Planner, family: str):
    drawer = ProblemDrawer(planner.arm, planner.kinematics)
    for seed in range(FEW):
        near, touching = drawer.near(family, seed), drawer.in_contact(family, seed)
        world = World(planner.arm, planner.kinematics, near.setting.scene)
        assert near.goal == drawer.near(family, seed).goal
        assert near.clearance is not None
        assert near.clearance < world.distance(near.goal) < CLEARANCE
        assert world.distance(touching.goal) <= 0.0


def test_goals_near_things_are_reached_and_what_cannot_be_is_refused(monkeypatch: pytest.MonkeyPatch):
    for module in (near_planning, refusing):
        monkeypatch.setattr(module, "ARMS", ("seven",))
        monkeypatch.setattr(module, "FAMILIES", ("box", "three shelves"))
    reached, refused = near_planning.plan_near_success(FEW), refusing.refusal_ms(FEW)
    assert (reached.median, reached.met) == (100.0, True)
    assert {"goal in contact, p50", "goal too near, p50", "out of reach, p50"} <= set(refused.reference)


def test_cages_have_5_to_40_solids():
    counts = [len(next(settings("cage", seed)).scene.objects) - 1 for seed in range(60)]
    assert FEWEST <= min(counts) < 15 < 30 < max(counts) <= MOST


def test_a_trial_is_a_whole_plan_without_contact(some: list[AnyTrial]):
    for each in some:
        assert each.is_solved
        assert not each.has_contact
        assert each.worked > 0.0
        assert each.best <= each.length
        assert set(each.others) == {"OMPL", "roboplan"}


def test_a_contact_is_seen(planner: Planner):
    problem = problems_of(planner, "cage")[1]
    response, *_ = planned(planner, problem)
    assert not has_contact(planner, problem, response.trajectory)
    middle = response.trajectory.points[len(response.trajectory.points) // 2]
    at = Kinematics(planner.arm).tool(middle.positions).position.tolist()
    [thing, *others] = problem.setting.scene.objects[1:]
    moved = msgspec.structs.replace(thing, pose=msgspec.structs.replace(thing.pose, translation=tuple(at)))
    scene = msgspec.structs.replace(problem.setting.scene, objects=(moved, *others))
    there = dataclasses.replace(problem, setting=dataclasses.replace(problem.setting, scene=scene))
    assert has_contact(planner, there, response.trajectory)


def test_the_figures_count_what_is_not_solved(monkeypatch: pytest.MonkeyPatch, some: list[AnyTrial]):
    monkeypatch.setattr(any_planning, "every_trial", lambda count: {"seven box": some})
    assert any_planning.plan_any_success(FEW).met
    figure = any_planning.plan_any_ms(FEW)
    assert figure.median is not None
    assert figure.p99 is not None
    assert 0.0 < figure.median <= figure.p99
    assert figure.reference["of roboplan's, p50"] > 0.0
    response = msgspec.structs.replace(some[0].response, code=PlanCode.TIMED_OUT, refusal=Refusal(message="too late"))
    failed = dataclasses.replace(some[0], response=response)
    monkeypatch.setattr(any_planning, "every_trial", lambda count: {"seven box": [failed, *some[1:]]})
    figure = any_planning.plan_any_success(FEW)
    assert (figure.met, figure.median) == (False, 75.0)
    assert "seven box 0" in figure.note
