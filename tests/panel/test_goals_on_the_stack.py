"""The page of a whole stack by its own words: a goal, a plan, a jog, the device and the scene."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Iterator
from math import cos, degrees, radians, sin

import numpy as np
import pytest

import gemelo
from gemelo.schemas.scene import CylinderShape, SphereShape
from gemelo.services.panel.view.world import configuration_at
from gemelo.services.panel.words.en import ENGLISH
from gemelo.tools.bench.bare_browser import bare_browser
from gemelo.tools.stack.stack import Stack
from tests.panel.person import until
from tests.panel.served import Served, passed, rests
from tests.stacks.shared import found_by_scripts

ARM, FOREARM, LIFT = "brazo_joint", "antebrazo_joint", "efector_joint"
POST = {"size": (0.08, 0.08, 0.2), "at": (0.36, 0.25, 0.1)}  # [m] beside "home", 4 mm away from 0.42 rad on
BEHIND = {ARM: radians(35.0), FOREARM: 0.0, LIFT: 0.0}  # where the arm would be in it


@pytest.fixture(scope="module")
def twin(rm1_stack: Stack) -> Iterator[Stack]:
    with found_by_scripts(rm1_stack):
        yield rm1_stack


@pytest.fixture(autouse=True)
def fresh(served: Served, arm: gemelo.Arm) -> None:
    """The goal is where the arm is, nothing is told, and the page knows the scene."""
    served.operator.live.switch(False)
    served.operator.forget_problem()
    until(lambda: served.operator.arm.joints, lambda joints: joints == arm.joints)
    served.operator.follow_measured()
    until(lambda: served.operator.goal.goal, lambda goal: goal.problem is None and goal.joints == arm.joints)


def stands_free(arm: gemelo.Arm) -> None:
    """At rest, before the post and not in it."""
    rests(arm)
    arm.check(arm.joints)
    assert 0.3 < arm.joints[ARM] < 0.43


def test_what_a_dragged_goal_would_touch_is_named_with_how_deep_and_drawn_red_and_the_nearest_that_can_is_free(
    served: Served, arm: gemelo.Arm
) -> None:
    goal, move = served.operator.goal, served.page.move
    inside = arm.fk(BEHIND)
    arm.scene.add_box("post", **POST)
    until(lambda: [item.name for item in served.operator.bus.scene.objects], lambda names: "post" in names)
    goal.set_pose(inside)  # as the gizmo does
    said = until(lambda: move.problem.content, lambda content: "post would touch: " in content)
    assert "<b>Something is in the way</b>" in said
    assert " mm of one inside the other" in said
    assert "joints=" not in said
    problem = goal.goal.problem
    assert problem is not None
    named = {f"{each.first} · {each.second}" for each in problem.contacts}
    assert any("post" in name for name in named)
    obstacles = served.world.obstacles
    until(lambda: set(served.labels.values()), lambda texts: texts == named)
    assert "post" in obstacles.red
    assert served.world.bad_goal.is_visible
    served.press("plan")
    until(lambda: served.page.problem.content, lambda content: "post would touch: " in content)
    until(lambda: move.problem.content, lambda content: content == "")  # once is enough
    served.browser.press_exactly(ENGLISH["take_nearest"], 0)
    until(lambda: goal.goal, lambda now: now.problem is None and now.version > 0)
    arm.check(goal.goal.joints)
    until(lambda: (obstacles.red, served.labels), lambda now: not any(now))
    assert not served.world.bad_goal.is_visible
    until(lambda: move.problem.content, lambda content: content == "")


def test_a_goal_is_checked_anew_when_anybody_changes_what_stands_around(served: Served, arm: gemelo.Arm) -> None:
    goal = served.operator.goal
    served.operator.set_goal(BEHIND)
    until(lambda: goal.goal, lambda now: now.joints == BEHIND and now.problem is None)
    arm.scene.add_box("late_post", **POST)  # over another connection than the page's
    said = until(lambda: served.page.move.problem.content, lambda content: "late_post would touch: " in content)
    assert "<b>Something is in the way</b>" in said
    until(lambda: served.world.bad_goal.is_visible, bool)
    arm.scene.remove("late_post")
    until(lambda: goal.goal.problem, lambda problem: problem is None)
    until(lambda: served.page.move.problem.content, lambda content: content == "")
    assert goal.goal.joints == BEHIND


def test_a_pose_out_of_reach_stays_wanted_when_the_scene_changes(served: Served, arm: gemelo.Arm) -> None:
    goal = served.operator.goal
    far = gemelo.Pose((0.9, 0.3, 0.1), (0.0, 0.0, 0.0, 1.0))
    goal.set_pose(far)
    told = until(lambda: goal.goal, lambda now: now.wanted == far)
    answered = goal.solved
    arm.scene.add_box("bystander", size=(0.02, 0.02, 0.02), at=(-0.4, -0.4, 0.01))
    until(lambda: goal.solved, lambda solved: solved > answered)
    assert (goal.goal.wanted, goal.goal.joints) == (far, told.joints)
    assert goal.goal.problem is not None
    assert goal.goal.problem.is_same(told.problem)
    arm.scene.remove("bystander")


def test_a_drag_that_only_another_configuration_can_follow_says_so_and_a_far_goal_does_not(
    served: Served, arm: gemelo.Arm
) -> None:
    goal, move = served.operator.goal, served.page.move
    near_the_end = {ARM: radians(168.0), FOREARM: radians(40.0), LIFT: 0.1}
    served.operator.set_goal(near_the_end)
    until(lambda: goal.goal, lambda now: now.pose.position == pytest.approx(arm.fk(near_the_end).position, abs=1e-6))
    x, y, z = goal.goal.pose.position
    turn = radians(8.0)  # beyond the limit of the first joint, 169 degrees, with the elbow on this side
    goal.set_pose(gemelo.Pose((x * cos(turn) - y * sin(turn), x * sin(turn) + y * cos(turn), z), (0.0, 0.0, 0.0, 1.0)))
    until(lambda: goal.goal.joints[FOREARM], lambda at: at < 0.0)
    assert FOREARM in goal.goal.jumped
    until(lambda: move.problem.content, lambda content: "Only another configuration reaches there: " in content)
    goal.set_pose(arm.fk(arm.states["right"]))  # as a click far away, or typed numbers
    far = arm.fk(arm.states["right"]).position
    until(lambda: goal.goal, lambda now: now.pose.position == pytest.approx(far, abs=1e-4) and now.jumped == ())
    until(lambda: move.problem.content, lambda content: content == "")


def test_a_line_the_speed_and_the_planner_are_those_that_are_chosen(served: Served, arm: gemelo.Arm) -> None:
    motions = served.operator.motions
    far = arm.states["left"]

    def planned() -> gemelo.Plan:
        before = motions.plan
        served.press("plan")
        until(lambda: motions.plan, lambda plan: plan is not None and plan is not before)
        assert motions.plan is not None
        return motions.plan

    arm.scene.add_box("post", size=(0.04, 0.04, 0.16), at=(0.29, 0.27, 0.08))  # in the way
    served.operator.set_goal(far)
    usual = planned()
    served.choose("planner", "RRTConnect")
    until(lambda: served.operator.choice.planner, lambda planner: planner == "RRTConnect")
    assert planned().planner == "RRTConnect" != usual.planner
    served.choose("planner", ENGLISH["default"])
    until(lambda: served.operator.choice.planner, lambda planner: planner == "")
    served.browser.slide(ENGLISH["speed_share"], 50)
    until(lambda: served.operator.choice.speed, lambda speed: speed == 0.5)
    slow = planned()
    peaks = np.abs([point.velocities for point in slow.trajectory.points]).max(axis=0)
    limits = [arm.description.joint(name).velocity for name in slow.trajectory.joint_names]
    assert max(peaks / limits) == pytest.approx(0.5, abs=0.02)
    served.browser.slide(ENGLISH["speed_share"], 100)
    served.choose("path_kind", ENGLISH["line_motion"])
    until(lambda: served.operator.choice.line, bool)
    arm.move(named="ready")
    start, end = arm.pose(), arm.pose().offset(y=-0.05)
    served.operator.goal.set_pose(end)
    until(lambda: served.operator.goal.goal.pose.position, lambda at: at == pytest.approx(end.position, abs=1e-4))
    line = planned()
    served.choose("path_kind", ENGLISH["free_motion"])
    until(lambda: served.operator.choice.line, lambda is_line: not is_line)
    for share in (0.25, 0.5, 0.75):
        x, _, z = arm.fk(configuration_at(line, share * line.duration)).position
        assert (x, z) == pytest.approx((start.position[0], start.position[2]), abs=2e-3)


def test_an_execute_right_after_plan_goes_to_the_new_goal_and_not_along_the_plan_before(
    served: Served, arm: gemelo.Arm
) -> None:
    arm.move(named="ready")
    served.operator.set_goal(arm.states["left"])
    served.press("plan")
    before = until(lambda: served.operator.motions.plan, lambda plan: plan is not None)
    goal = degrees(arm.states["ready"][ARM]) - 8.0
    served.browser.slide(f"{ARM} [°]", goal)
    with passed(arm, ARM) as seen:
        served.press("plan")
        served.press("execute")  # in the same breath: the plan is not made yet
        until(lambda: degrees(arm.joints[ARM]), lambda at: abs(at - goal) < 0.1)
    assert served.operator.motions.plan is not before
    assert served.operator.newest_problem is None
    assert max(seen) <= max(seen[0], arm.joints[ARM]) + 1e-3  # "left" is the other way


def test_an_execute_right_after_plan_and_execute_goes_nowhere_else(served: Served, arm: gemelo.Arm) -> None:
    arm.move(named="ready")
    served.operator.set_goal(arm.states["left"])
    served.press("plan")
    until(lambda: served.operator.motions.plan, lambda plan: plan is not None)
    goal = degrees(arm.states["ready"][ARM]) - 8.0
    served.browser.slide(f"{ARM} [°]", goal)
    with passed(arm, ARM) as seen:
        served.press("plan_and_execute")
        served.press("execute")
        until(lambda: degrees(arm.joints[ARM]), lambda at: abs(at - goal) < 0.1)
        until(lambda: served.operator.motions.is_moving, lambda is_moving: not is_moving)
    assert served.operator.newest_problem is None
    assert max(seen) <= max(seen[0], arm.joints[ARM]) + 1e-3  # "left" is the other way


def test_a_stop_starts_nothing_also_where_the_goal_is_found_long_after_it(
    served: Served, arm: gemelo.Arm, monkeypatch: pytest.MonkeyPatch
) -> None:
    motions, found = served.operator.motions, threading.Event()
    monkeypatch.setattr(served.operator.goal, "wait", lambda: found.wait(10.0))
    at = arm.joints
    served.browser.slide(f"{ARM} [°]", degrees(at[ARM]) + 8.0)
    with passed(arm, ARM) as seen:
        served.press("plan_and_execute")
        until(lambda: motions.is_planning, bool)
        served.press("stop")
        until(lambda: motions.has_just_stopped, bool)
        until(lambda: motions.has_just_stopped, lambda has_just_stopped: not has_just_stopped)
        found.set()
        until(lambda: motions.is_planning, lambda is_planning: not is_planning)
        assert motions.plan is not None
        heard = len(seen)
        until(lambda: len(seen), lambda count: count > heard + 10)
    assert max(seen) - min(seen) < 1e-3
    assert arm.joints == at


def test_a_stop_between_plan_and_execute_starts_nothing(served: Served, arm: gemelo.Arm) -> None:
    at, before = arm.joints, served.operator.motions.plan
    served.browser.slide(f"{ARM} [°]", degrees(at[ARM]) + 8.0)
    with passed(arm, ARM) as seen:
        served.press("plan")
        served.press("execute")
        served.press("stop")
        until(lambda: served.operator.motions.plan, lambda plan: plan is not None and plan is not before)
        until(lambda: served.operator.motions.is_planning, lambda is_planning: not is_planning)
        heard = len(seen)
        until(lambda: len(seen), lambda count: count > heard + 10)
    assert max(seen) - min(seen) < 1e-3
    assert arm.joints == at


def test_the_ghost_stands_where_its_time_is_set_to(served: Served, arm: gemelo.Arm) -> None:
    motions, world = served.operator.motions, served.world
    served.operator.set_goal(arm.states["left"])
    served.press("plan")
    plan = until(lambda: motions.plan, lambda plan: plan is not None)
    served.choose("play", False)
    for share in (50.0, 100.0, 0.0):
        served.browser.slide(ENGLISH["scrub"], share)
        wanted = configuration_at(plan, share / 100.0 * plan.duration)
        until(lambda: shown_by_the_ghost(served), lambda shown, at=wanted: shown == pytest.approx(at, abs=1e-3))
        assert world.ghost.is_visible
    served.choose("play", True)
    before = shown_by_the_ghost(served)
    until(lambda: shown_by_the_ghost(served), lambda shown: shown != before)
    assert not any(arm.velocities.values())


def shown_by_the_ghost(served: Served) -> dict[str, float]:
    return {each.joint.name: each.shown or 0.0 for each in served.world.ghost.joints if each.joint.name in BEHIND}


def test_a_jog_goes_along_the_tool_s_axes_by_steps_and_says_what_slows_it(served: Served, arm: gemelo.Arm) -> None:
    served.choose("along_axes", ENGLISH["tool_axes"])
    served.choose("jog_mode", "10 mm / 10°")
    tab = served.page.jog
    until(lambda: (tab.frame_name, tab.step), lambda now: now == (arm.tool_frame, 10.0))
    served.browser.press("z -")  # the tool's z axis points down
    until(lambda: arm.joints[LIFT], lambda at: at == pytest.approx(0.01, abs=5e-4))
    rests(arm)
    served.browser.press(f"{ARM} -")
    until(lambda: degrees(arm.joints[ARM]), lambda at: at == pytest.approx(-10.0, abs=0.1))
    rests(arm)
    served.choose("along_axes", ENGLISH["base_axes"])
    served.choose("jog_mode", ENGLISH["continuous"])
    until(lambda: (tab.frame_name, tab.step), lambda now: now == ("", 0.0))
    served.holds("z +", lambda: arm.joints[LIFT] > 0.03)
    rests(arm)
    arm.move(joints={ARM: 0.0, LIFT: 0.0})
    arm.scene.add_box("post", **POST)
    served.holds(f"{ARM} +", lambda: "collision of antebrazo_link and post (" in tab.status.content)
    assert "% of the speed is left" in tab.status.content
    served.holds(f"{ARM} +", lambda: "<b>0 % of the speed is left</b>" in tab.status.content)
    stands_free(arm)
    until(lambda: tab.status.content, lambda content: content == "")


def test_live_sliders_stop_before_a_box_and_say_that_it_is_watched(served: Served, arm: gemelo.Arm) -> None:
    arm.scene.add_box("post", **POST)
    move = served.page.move
    served.choose("live", True)
    until(lambda: move.watched.content, lambda content: ENGLISH["live_hint"] in content)
    with passed(arm, ARM) as seen:
        until(lambda: len(seen), lambda number: number > 10)
    assert np.ptp(seen) == 0.0  # it does not jump when it is switched on
    served.browser.slide(f"{ARM} [°]", degrees(BEHIND[ARM]))
    until(lambda: move.watched.content, lambda content: "collision of antebrazo_link and post (" in content)
    until(lambda: move.watched.content, lambda content: "<b>0 % of the speed is left</b>" in content)
    stands_free(arm)
    served.press("stop")
    until(lambda: served.operator.live.is_on, lambda on: not on)
    until(lambda: (move.live.value, move.watched.content), lambda now: now == (False, ""))
    stands_free(arm)


def test_outputs_and_mishaps_are_the_device_s_and_what_cannot_be_done_is_grey_with_its_reason(
    served: Served, arm: gemelo.Arm
) -> None:
    device = served.page.device
    for on in (True, False):
        served.browser.choose(f"{ENGLISH['output']} avanzar", on)
        until(lambda: "avanzar" in arm.device.state.outputs, lambda is_on, wanted=on: is_on is wanted)
    arm.output("avanzar", True)  # by somebody else
    until(lambda: device.outputs["avanzar"].handle.value, bool)
    arm.output("avanzar", False)
    until(lambda: grey(served), lambda names: names == {"arm", "reset", "hold", "resume"})
    until(lambda: reasons(served).get("arm", ""), lambda why: "Switch the drivers on: they are on already" in why)
    served.press("estop_press")
    until(lambda: grey(served), lambda names: {"move", "jog", "home", "reference"} <= names and "reset" not in names)
    until(lambda: reasons(served).get("move", ""), lambda why: "the device is in ESTOP: reset it first" in why)
    until(lambda: device.facts.content, lambda content: ENGLISH["mode_estop"] in content)
    served.press("estop_release")
    until(lambda: arm.device.state.inputs, lambda inputs: "estop" not in inputs)
    served.press("reset")
    until(lambda: grey(served), lambda names: "arm" not in names)
    served.press("arm")
    until(lambda: grey(served), lambda names: "arm" in names and "disarm" not in names)
    until(lambda: reasons(served).get("move", ""), lambda why: "not referenced: " in why)


def grey(served: Served) -> set[str]:
    """What cannot be done now: of which all buttons are greyed."""
    gated = served.page.kit.gated
    return {name for name in {name for _, name in gated} if all(each.disabled for each, of in gated if of == name)}


def reasons(served: Served) -> dict[str, str]:
    """Each line of a place for reasons, by the first of its actions."""
    places = served.page.kit.reason_places
    return {name: place.content for place, titles in places for name in titles if place.content}


def test_the_state_is_told_in_rows_of_its_own(served: Served, arm: gemelo.Arm) -> None:
    arm.move(joints={ARM: 0.5, LIFT: 0.05})
    state, device = served.page.state, served.page.device
    steps = dict(zip(arm.device.state.name, arm.device.state.steps, strict=True))
    wanted = arm.description.joint(ARM).steps.to_steps(0.5)
    expected = {f">{steps[ARM]}<", "28.6", f">{wanted:.1f}<"}  # what was commanded comes over a topic of its own
    rows = until(lambda: state.joints.content, lambda content: all(each in content for each in expected))
    for word in ("measured", "steps_off", "commanded", "executed"):
        assert ENGLISH[word] in rows
    tool, (x, y, z) = state.tool.content, arm.pose().position
    until(lambda: state.tool.content, lambda content: f"{1e3 * x:.1f}, {1e3 * y:.1f}, {1e3 * z:.1f} mm" in content)
    for sensor in arm.description.sensors:
        assert f">{sensor.name}<" in tool
    until(lambda: state.log.content, lambda content: "stepper_gateway: motion finished: at brazo_joint" in content)
    until(lambda: device.facts.content, lambda content: ENGLISH["link"] in content and " ms<" in content)


def test_spheres_and_cylinders_are_added_and_resized(served: Served, arm: gemelo.Arm) -> None:
    tab, scene = served.page.scene, arm.scene
    for kind in ("sphere", "cylinder"):
        served.choose("shape", ENGLISH[kind])
        tab.name.value, tab.size.value, tab.at.value = f"my {kind}", (40.0, 40.0, 60.0), (0.0, 350.0, 100.0)
        until(lambda: tab.shape.value, lambda shape, wanted=kind: shape == ENGLISH[wanted])
        served.press("add")
        until(lambda: tuple(scene.objects), lambda names, name=f"my {kind}": name in names)
        until(lambda: tab.chosen.value, lambda chosen, name=f"my {kind}": chosen == name)
        until(lambda name=f"my {kind}": name in tab.facts.content and tab.gizmo, bool)  # the fields are the new one's
    assert scene.objects["my sphere"].shape == SphereShape(radius=0.02)
    assert scene.objects["my cylinder"].shape == CylinderShape(radius=0.02, length=0.06)
    until(lambda: tuple(tab.size.value), lambda size: size == pytest.approx((40.0, 40.0, 60.0)))
    tab.size.value = (30.0, 30.0, 20.0)
    served.press("apply")
    until(lambda: scene.objects["my cylinder"].shape, lambda shape: shape == CylinderShape(radius=0.015, length=0.02))
    assert scene.objects["my cylinder"].pose.translation == pytest.approx((0.0, 0.35, 0.1))


def test_for_a_browser_that_does_not_keep_up_only_the_newest_of_each_joint_is_kept(
    served: Served, arm: gemelo.Arm
) -> None:
    reads = threading.Event()
    buffer = served.panel.server._websock_server._broadcast_buffer  # viser tells nobody what it keeps

    def kept() -> Counter[str]:
        """Of what is drawn of the measured arm, the messages that wait for browsers, by node and kind."""
        waiting = tuple(buffer.message_from_id.values())
        moved = [each for each in waiting if type(each).__name__ in ("SetOrientationMessage", "SetPositionMessage")]
        return Counter(f"{each.name} {type(each).__name__}" for each in moved if each.name.startswith("/measured"))

    with bare_browser(served.address, lambda said, at: reads.wait(60.0) or None):
        until(lambda: len(served.panel.pages()), lambda number: number == 2)
        try:
            for name in ("left", "home"):
                arm.move(named=name)
            rests(arm)
            assert len(kept()) >= len(arm.joint_names)
            assert set(kept().values()) == {1}
        finally:
            reads.set()
