"""The streams of targets that go wrong on a simulated arm."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from random import Random

import pytest

import gemelo
from gemelo.schemas.reasons import because
from gemelo.tools.chaos import streams
from gemelo.tools.chaos.site import ChaosSite
from gemelo.tools.chaos.streams import dying_stream, replayed_stream, stalling_stream
from tests.chaos.simulated_site import SimulatedSite


@pytest.fixture
def site() -> Iterator[SimulatedSite]:
    with gemelo.simulate("rm1") as arm:
        yield SimulatedSite(arm)


@pytest.mark.parametrize("begin", [dying_stream, stalling_stream, replayed_stream])
def test_an_arm_whose_stream_goes_wrong_moves_and_rests(
    site: SimulatedSite, begin: Callable[[ChaosSite, Random], str]
) -> None:
    before = site.seen.size
    begin(site, Random(4))
    assert site.steps_since(before) > 10
    assert site.found == []
    assert site.stands_within(0.5)


def test_an_arm_that_goes_on_without_a_target_is_seen(site: SimulatedSite, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(streams, "RESTS", 0.0)
    motion = site.arm.start(named="left", speed=0.05)
    site.pause(1.0)
    streams.expect_rest(site)
    assert site.found == [because("chaos.stream.moves", time=0.0)]
    motion.cancel()
