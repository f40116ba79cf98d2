"""A refusal as data, as a script has it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest

import gemelo
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import (
    CircularMotion,
    FreeMotion,
    JogStatus,
    JointGoal,
    LinearMotion,
    NamedGoal,
    PlanRequest,
    PoseGoal,
    WaypointGoal,
)
from gemelo.schemas.reasons import Reason, Value, remedy, say
from gemelo.schemas.scene import BoxShape, SceneAdd, SceneObject, SphereShape


def test_a_plan_from_elsewhere_is_refused_with_the_joint_and_both_places():
    with gemelo.simulate("rm1") as arm:
        plan = arm.plan(named="left")
        arm.move(named="ready")
        with pytest.raises(gemelo.Refused) as refused:
            arm.execute(plan)
    reason = refused.value.reason
    assert isinstance(reason, Reason)
    assert reason.code == "goal.start.elsewhere"
    assert reason.values["joint"] in arm.joint_names
    start, present = reason.values["start"], reason.values["present"]
    assert isinstance(start, float)
    assert isinstance(present, float)
    assert reason.values["distance"] == pytest.approx(abs(start - present))
    assert reason.remedies == (remedy("plan_from_here"),)
    assert str(refused.value) == f"refused by stepper_gateway: {reason}"
    assert say(reason, "es").startswith(f"{reason.values['joint']}: el plan empieza en ")


ROOM = SceneObject(name="room", shape=BoxShape(size=(3.0, 3.0, 3.0)))
BALL = SceneObject(name="ball", shape=SphereShape(radius=-1.0))
Cause = Callable[[gemelo.Arm], object]


def asks(**request: Any) -> Cause:
    """A plan by the planner's own message, which `gemelo` does not look at."""
    return lambda arm: arm.plan(PlanRequest(**request))


def moved(arm: gemelo.Arm) -> object:
    """A plan from a start whose first joint moves."""
    names, here = arm.joint_names, tuple(arm.joints.values())
    moving = JointState(name=names, position=here, velocity=(0.5, *(0.0 for _ in names[1:])))
    return arm.plan(PlanRequest(goal=NamedGoal(name="ready"), start=moving))


def beside(arm: gemelo.Arm, z: float, motion: LinearMotion | CircularMotion) -> object:
    """The tool `z` [m] higher."""
    x, y, height = arm.pose().position
    return arm.plan(PlanRequest(goal=PoseGoal(position=(x, y, height + z)), motion=motion))


def in_a_room(cause: Cause) -> Cause:
    """Everything is within a box."""

    def run(arm: gemelo.Arm) -> None:
        with arm.scene.restored():
            arm.scene.edit(SceneAdd(object=ROOM))
            cause(arm)

    return run


READY = {"goal": NamedGoal(name="ready")}
FAR = PoseGoal(position=(2.0, 0.0, 0.1))
ARC_AHEAD = CircularMotion(interim=(0.3, 0.1, 0.1), center=(0.2, 0.1, 0.1))
IN_ROOM = {"second": "room", "second_kind": "box"}
OF_BOTH: list[tuple[Cause, list[str], dict[str, Value], list[str]]] = [
    (asks(goal=NamedGoal(name="redy")), ["plan.unknown.state"], {"name": "redy", "where": "robot.srdf"}, ["use_name"]),
    (asks(goal=JointGoal(name=("nose",), position=(0.0,))), ["plan.unknown.joint"], {"name": "nose"}, ["use_one_of"]),
    (asks(goal=PoseGoal(position=(0.2, 0.1, 0.1), frame="nose")), ["plan.unknown.frame"], {"name": "nose"},
     ["use_one_of"]),
    (asks(**READY, motion=FreeMotion(planner_id="RTT")), ["plan.unknown.planner"], {"name": "RTT"}, ["use_one_of"]),
    (asks(**READY, motion=FreeMotion(attempts=0)), ["plan.attempts"], {"value": 0, "most": 1000}, ["default_attempts"]),
    (asks(**READY, velocity_scaling=0.0), ["plan.scaling"], {"which": "velocity_scaling", "value": 0.0},
     ["scaling_within"]),
    (asks(**READY, velocity_scaling=1e-9), ["plan.verification", "plan.timing.too_long"], {"most": 86400.0},
     ["larger_scaling", "farther_goal", "report"]),
    (asks(**READY, clearance=0.2), ["plan.clearance.range"], {"value": 0.2, "least": 0.0005, "most": 0.05},
     ["ask_clearance", "own_clearance"]),
    (asks(**READY, allowed_time=0.0), ["plan.allowed_time"], {"value": 0.0, "most": 120.0}, ["default_time"]),
    (asks(goal=PoseGoal(position=(0.2, 0.1))), ["plan.numbers"], {"name": "position", "needed": 3, "count": 2},
     ["point_in_metres"]),
    (asks(goal=WaypointGoal()), ["plan.waypoints.none"], {}, ["give_one"]),
    (moved, ["plan.start.moving"], {"velocity": 0.5, "unit": "rad"}, ["wait_or_cancel"]),
    (lambda arm: beside(arm, 0.05, LinearMotion(speed=-1.0)), ["plan.tool.limit"], {"name": "speed", "value": -1.0},
     ["leave_default"]),
    (lambda arm: beside(arm, 0.05, CircularMotion()), ["plan.arc.neither"], {}, ["one_of_them"]),
    (lambda arm: beside(arm, 0.05, ARC_AHEAD), ["plan.arc.both"], {}, ["one_of_them"]),
    (lambda arm: arm.scene.remove("nothing"), ["scene.object.unknown"], {"object": "nothing"}, ["none_known"]),
    (lambda arm: arm.scene.edit(SceneAdd(object=BALL)), ["scene.shape.size"],
     {"object": "ball", "size": "radius", "kind": "sphere", "value": -1.0}, ["more_than_nothing"]),
    (in_a_room(lambda arm: arm.scene.detach("room")), ["scene.object.not_attached"], {"object": "room"}, []),
    (in_a_room(asks(**READY)), ["plan.collision.start", "plan.pair.touch"], IN_ROOM,
     ["remove_object", "allow_pair", "free_by_hand"]),
    (in_a_room(lambda arm: arm.check(arm.joints)), ["plan.collision.there", "plan.pair.inside"],
     {**IN_ROOM, "limit": 0.004}, ["other_configuration"]),
]  # fmt: skip
OF_RM1: list[tuple[Cause, list[str], dict[str, Value], list[str]]] = [
    (asks(goal=JointGoal(name=("brazo_joint",), position=(9.0,))), ["plan.limit.position"],
     {"joint": "brazo_joint", "value": 9.0, "limit": 2.95, "side": "upper", "unit": "rad"}, ["nearest_value"]),
    (asks(goal=FAR), ["plan.reach"], {"tool": "efector_link", "x": 2.0, "y": 0.0, "z": 0.1}, ["nearest_point"]),
    (lambda arm: arm.ik(position=FAR.position), ["plan.reach"], {"x": 2.0, "distance": pytest.approx(1.594, abs=1e-3)},
     ["nearest_point"]),
    (asks(goal=PoseGoal(position=(0.25, 0.15, 0.1), orientation=(0.0, 0.0, 0.0, 1.0))),
     ["plan.orientation.impossible", "plan.turns.no_tilt"], {"robot": "rm1", "missing": pytest.approx(math.pi)},
     ["position_alone", "position_and_yaw"]),
    (asks(goal=JointGoal(name=("antebrazo_joint",), position=(2.9,))), ["plan.collision.goal", "plan.pair.inside"],
     {"first": "base_link", "second": "efector_link", "first_kind": "link", "limit": 0.004}, ["farthest_on_line"]),
    (lambda arm: beside(arm, 0.6, LinearMotion(least_fraction=0.9)),
     ["plan.tool.too_little", "plan.tool.stopped", "plan.tool.at_limit"],
     {"joint": "efector_joint", "limit": 0.2, "unit": "m", "least": 0.9, "whole": pytest.approx(0.6)},
     ["via_another", "end_before", "allow_less"]),
    (in_a_room(lambda arm: arm.ik(position=(0.25, 0.15, 0.1))), ["ik.collision.every", "plan.pair.inside"],
     {"second": "room", "second_kind": "object"}, ["other_pose", "touching_too"]),
]  # fmt: skip
OF_PAROL6: list[tuple[Cause, list[str], dict[str, Value], list[str]]] = [
    (asks(goal=FAR), ["plan.reach.held", "plan.held"], {"tool": "tool_link", "joint": "joint_2", "side": "upper"},
     ["nearest_point"]),
    (asks(goal=PoseGoal(position=(0.25, 0.15, 0.1), orientation=(0.0, 0.0, 0.0, 1.0))),
     ["plan.orientation.held", "plan.held"], {"joint": "joint_5", "unit": "rad"}, ["nearest_orientation"]),
    (lambda arm: beside(arm, 0.6, LinearMotion(least_fraction=0.9)),
     ["plan.tool.too_little", "plan.tool.stopped", "plan.tool.singular"], {"least": 0.9},
     ["keep_away", "go_freely", "allow_less"]),
]  # fmt: skip


@pytest.mark.parametrize(("name", "rows"), [("rm1", OF_BOTH + OF_RM1), ("parol6", OF_BOTH + OF_PAROL6)])
def test_the_planner_says_why_with_a_code_its_values_and_what_would_do(
    name: str, rows: list[tuple[Cause, list[str], dict[str, Value], list[str]]], subtests: pytest.Subtests
):
    with gemelo.simulate(name) as arm:
        for cause, codes, values, remedies in rows:
            with subtests.test(codes[0]):
                with pytest.raises(gemelo.Refused) as refused:
                    cause(arm)
                reason = refused.value.reason
                chain = [reason]
                while len(chain) < len(codes):
                    chain.append(chain[-1].causes[0])
                assert [each.code for each in chain] == codes
                found = {key: value for each in chain for key, value in each.values.items()}
                assert {key: found.get(key) for key in values} == values
                assert [each.code for each in reason.remedies] == remedies
                assert say(reason, "es") != say(reason) == str(reason)


def test_a_jog_says_which_limit_slows_it_and_which_goal_keeps_it_from_beginning():
    statuses: list[JogStatus] = []
    with gemelo.simulate("rm1") as arm:
        arm.jog(joints={"brazo_joint": 1.5}, duration=3.0, on_progress=statuses.append)
        limit = arm.description.joint("brazo_joint").upper
        slowed = {each.why.code: each.why.values for status in statuses for each in status.limits if each.why}
        assert slowed["jog.limit.turning"] == {"joint": "brazo_joint", "limit": limit}
        motion = arm.start(arm.plan(named="home", speed=0.1))
        with pytest.raises(gemelo.Refused) as refused:
            arm.jog(joints={"brazo_joint": 0.1}, duration=2.0)
        motion.cancel()
    reason = refused.value.reason
    assert isinstance(reason, Reason)
    assert reason.code == "jog.goal_active"
    assert reason.remedies == (remedy("cancel_first"),)
