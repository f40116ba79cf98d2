"""Stops, holds and goals in quick turns on a simulated arm."""

from __future__ import annotations

from collections.abc import Iterator
from random import Random

import pytest

import gemelo
from gemelo.schemas.reasons import because
from gemelo.tools.chaos.flutters import LONG, fluttering_holds, fluttering_stops, goal_and_stop, long_goal, unended
from tests.chaos.simulated_site import SimulatedSite


@pytest.fixture
def site() -> Iterator[SimulatedSite]:
    with gemelo.simulate("rm1") as arm:
        yield SimulatedSite(arm)


def test_a_move_through_many_holds_and_resumes_arrives(site: SimulatedSite) -> None:
    motion = site.arm.start(named="left")
    said = fluttering_holds(site, Random(1))
    assert said.endswith("holds and resumes in quick turns")
    assert motion.wait(60.0).status.name == "SUCCEEDED"
    assert site.found == []


def test_every_move_that_is_stopped_soon_ends(site: SimulatedSite) -> None:
    fluttering_stops(site, Random(2))
    assert site.found == []
    assert site.stands_within(3.0)


def test_a_motion_that_a_stop_does_not_end_is_seen(site: SimulatedSite) -> None:
    motion = site.arm.start(named="left", speed=0.02)
    (found,) = unended(motion)
    assert found == because("chaos.stop.unended", time=10.0)
    site.arm.stop()
    assert unended(motion) == []


def test_a_goal_and_a_stop_in_one_breath_leave_an_arm_that_stands(site: SimulatedSite) -> None:
    goal_and_stop(site, Random(3))
    assert site.found == []
    assert site.stands_within(1.0)


def test_the_goal_of_a_breath_would_move_for_longer_than_a_stop_takes(site: SimulatedSite) -> None:
    assert long_goal(site, Random(1)).trajectory.points[-1].time_from_start > LONG
    moving = site.arm.start(named="left", speed=0.1)
    site.pause(1.0)
    assert not site.stands_within(0.5)
    moving.cancel()
