"""A replay notices what has changed: one digit of an input, one constant of a core; and names where."""

from __future__ import annotations

import pytest

from gemelo.services.planner import core as planner_core
from gemelo.services.state_publisher import core as publisher_core
from gemelo.tools.replay.main import replay, text_of
from tests.replay.conftest import RECORDINGS, Messages


def test_one_digit_of_a_joint_state_is_found_in_the_frames(changed):
    moved = 400

    def alter(state, number):
        if number == moved:
            state["position"][1] += 1e-9

    found = replay(changed("state_publisher", Messages("joint_states", alter)), "state_publisher").difference
    assert found is not None
    assert found.topic == "frames"
    assert found.path.startswith("transforms[1].transform.rotation[")
    assert 0.0 < found.at < 60.0
    assert float(found.recorded) == pytest.approx(float(found.replayed), abs=1e-8)
    assert found.recorded != found.replayed


def test_one_character_of_a_recorded_output_is_found(changed):
    def alter(frames, number):
        if number == 7:
            frames["transforms"][0]["child"] = "another"

    found = replay(changed("state_publisher", Messages("frames", alter)), "state_publisher").difference
    assert (found.topic, found.sequence, found.path) == ("frames", 7, "transforms[0].child")
    assert found.recorded == "another"


def test_a_core_that_says_nothing_is_found(monkeypatch):
    monkeypatch.setattr(publisher_core.StatePublisher, "on_joint_state", lambda *_: publisher_core.FramesUpdate())
    found = replay(RECORDINGS / "state_publisher.mcap", "state_publisher").difference
    assert (found.topic, found.path, found.replayed) == ("frames", "", "(nothing)")


def test_another_constant_of_the_planner_is_found(monkeypatch):
    monkeypatch.setattr(planner_core, "PATH_POINTS", 9)
    found = replay(RECORDINGS / "planner.mcap", "planner").difference
    assert found.topic == "planned_path"
    assert found.path.startswith("points[")


def test_a_slower_arm_is_found_in_the_first_plan(monkeypatch):
    limits = planner_core.joint_limits
    monkeypatch.setattr(planner_core, "joint_limits", lambda arm, velocity, rest: limits(arm, 0.999 * velocity, rest))
    replayed = replay(RECORDINGS / "planner.mcap", "planner")
    assert replayed.difference.topic == "@request/plan"
    assert replayed.difference.path.startswith("trajectory.points[")
    assert "DIFFERENT: @request/plan, message" in text_of(replayed)


def test_another_start_of_a_plan_is_found(changed):
    def alter(inputs, number):
        if number == 0:
            inputs["present"]["position"][0] += 1e-6

    found = replay(changed("planner", Messages("plan/inputs", alter)), "planner").difference
    assert (found.topic, found.sequence) == ("@request/plan", 0)


def test_a_plan_that_took_most_of_its_time_is_set_aside_and_said(changed):
    """Its search may have ended by the clock: even where it differs now, nobody can say that the planner did it."""

    def alter(inputs, number):
        inputs["elapsed"] += 120.0 * (number == 0)

    replayed = replay(changed("planner", Messages("plan/inputs", alter)), "planner")
    assert replayed.difference is None
    (why,) = replayed.aside
    assert "the clock may have ended a search" in why
