"""Goals that are sent again: a gateway as it should be shows nothing, and one that carried them out would be seen."""

from __future__ import annotations

from collections.abc import Iterator
from random import Random

import pytest

import gemelo
from gemelo.schemas.actions import GoalRequest
from gemelo.tools.chaos.replays import (
    by_the_same_client,
    disturbed,
    replayed_after_a_stop,
    replayed_during_another_move,
    replayed_later,
)
from gemelo.tools.chaos.site import ChaosSite
from tests.chaos.simulated_site import SimulatedSite


@pytest.fixture
def site() -> Iterator[SimulatedSite]:
    with gemelo.simulate("rm1") as arm:
        site = SimulatedSite(arm)
        site.motion = arm.start(named="left")
        arm.sim.sleep(0.5)
        yield site


def by_none_other(site: ChaosSite, request: GoalRequest) -> str:
    """A gateway that moves the arm for a goal that it has seen before."""
    site.person.start(Random(1))
    return "accepted"


@pytest.fixture
def with_one_client(monkeypatch: pytest.MonkeyPatch) -> None:
    """A simulated site has no stranger on the bus."""
    monkeypatch.setattr("gemelo.tools.chaos.replays.by_another_client", by_the_same_client)


def test_a_goal_that_is_sent_again_after_its_end_moves_nothing(site: SimulatedSite) -> None:
    assert replayed_later(by_the_same_client)(site, Random(1)).startswith("the goal again after its end: ")
    assert site.found == []
    assert site.motion.status.name == "SUCCEEDED"


@pytest.mark.usefixtures("with_one_client")
def test_a_goal_that_is_sent_again_after_a_stop_moves_nothing(site: SimulatedSite) -> None:
    replayed_after_a_stop(site, Random(1))
    assert site.found == []
    assert site.motion.status.name == "ABORTED"  # by the stop


@pytest.mark.usefixtures("with_one_client")
def test_a_goal_that_is_sent_again_during_another_move_leaves_that_alone(site: SimulatedSite) -> None:
    replayed_during_another_move(site, Random(1))
    assert site.found == []


def test_an_arm_that_moves_for_a_goal_of_before_is_seen(site: SimulatedSite) -> None:
    replayed_later(by_none_other)(site, Random(1))
    assert site.found
    assert (site.found[0].code, site.found[0].values["answer"]) == ("chaos.replay.moved", "accepted")


def test_a_move_that_ends_elsewhere_or_not_as_it_should_is_seen(site: SimulatedSite) -> None:
    site.arm.stop()
    (found,) = disturbed(site, site.motion)
    assert found.code == "chaos.replay.ended"
    assert str(found).startswith("a goal of before that was sent again has ended a move: ")


def test_a_motion_is_recorded_as_the_gateway_was_sent_it(site: SimulatedSite) -> None:
    request = site.recorded_goal()
    assert request.goal_id == site.motion.goal_id
    assert request.epoch != 0
