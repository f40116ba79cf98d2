"""The clocks of other hosts are measured, and what their stamps mean here is known within the bound that is said."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.clock_offset import DRIFT, ClockOffset, best, measured
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.node_clock import NodeClock, ask_about
from gemelo.schemas.deployment import Deployment, PathsSection
from gemelo.schemas.system import NodeInfo
from tests.runtime.support import hear, spinning, until

SECOND = 1_000_000_000
HOUR = 3600.0
delays = st.floats(0.0, 2.0)  # [s]
apart = st.floats(-HOUR, HOUR)  # [s]


@given(offset=apart, there=delays, back=delays)
def test_the_true_offset_is_within_the_bound_however_different_both_ways_were(offset, there, back):
    asked = 1_700_000_000 * SECOND
    told = asked + round((offset + there) * SECOND)
    found = measured(asked, told, there + back)
    assert abs(found.offset - offset) <= found.bound + 1e-6
    assert found.bound == pytest.approx((there + back) / 2.0)


@given(offset=apart, ways=st.lists(st.tuples(delays, delays), min_size=1, max_size=8), seconds=st.floats(0.0, 60.0))
def test_a_stamp_is_moved_to_within_the_bound_of_the_best_question_also_after_a_drift(offset, ways, seconds):
    asked = 1_700_000_000 * SECOND
    found = best(measured(asked, asked + round((offset + there) * SECOND), there + back) for there, back in ways)
    assert found is not None
    assert found.bound == pytest.approx(min(there + back for there, back in ways) / 2.0)
    for drift in (-DRIFT, 0.0, DRIFT):
        now = asked + round(seconds * SECOND)
        stamp = now + round((offset + drift * seconds) * SECOND)  # the other's clock at this very moment
        known = found.later(seconds)
        # Where both may agree a stamp stays as it is, which is wrong by the offset: by no more than bound and error.
        assert abs(known.to_own(stamp) - now) <= (2.0 * known.bound + 1e-6) * SECOND


@given(bound=st.floats(0.0, 1.0), share=st.floats(-1.0, 1.0), stamp=st.integers(0, 2**62))
def test_clocks_that_may_agree_leave_a_stamp_to_the_nanosecond(bound, share, stamp):
    assert ClockOffset(bound * share, bound).to_own(stamp) == stamp


@dataclass
class Skewed:
    """A node's own clock: ahead of the one that all have here, and fast."""

    ahead: float  # [s]
    drift: float = 0.0  # [s/s]

    def on(self, node: Node) -> Node:
        own, began = node.now, node.monotonic()
        node.now = lambda: own() + round((self.ahead + self.drift * (node.monotonic() - began)) * SECOND)  # type: ignore[method-assign]
        return node


@pytest.fixture
def deployment(tmp_path) -> Deployment:
    return Deployment(paths=PathsSection(run=str(tmp_path / "run"), out=str(tmp_path / "out")))


@pytest.mark.parametrize(("ahead", "drift"), [(5.0, 1e-4), (-5.0, -1e-4), (86_400.0, 0.0)])
def test_a_node_knows_the_clock_of_another_that_is_seconds_apart_and_drifts(deployment, ahead, drift):
    network = MemoryNetwork()
    with ExitStack() as open_nodes:
        near = open_nodes.enter_context(Node("detector", deployment, robot="rm1", bus=MemoryBus(network)))
        far = Skewed(ahead, drift).on(
            open_nodes.enter_context(Node("camera", deployment, robot="rm1", bus=MemoryBus(network)))
        )
        open_nodes.enter_context(spinning(far))
        clock = NodeClock(near, "camera")
        assert clock.to_own(1) is None  # nobody has been asked
        assert hear(near, lambda: clock.offset() is not None)
        offset = clock.offset()
        stamp, now = far.now(), near.now()
        assert abs(offset.offset - ahead) <= offset.bound + 0.01
        own = clock.to_own(stamp)
        assert own is not None
        assert abs(own - now) <= (offset.bound + 0.01) * SECOND
        info, asked = ask_about(near, "camera", 2.0)
        assert asked is not None
        assert abs(asked.offset - ahead) <= asked.bound + 0.01
        assert info.node == "camera"


def test_one_clock_on_one_host_leaves_every_stamp_as_it_is(deployment):
    network = MemoryNetwork()
    with (
        Node("detector", deployment, robot="rm1", bus=MemoryBus(network)) as near,
        Node("camera", deployment, robot="rm1", bus=MemoryBus(network)) as far,
        spinning(far),
    ):
        clock = NodeClock(near, "camera")
        assert hear(near, lambda: clock.offset() is not None)
        assert clock.to_own(123_456_789) == 123_456_789


def test_a_clock_that_is_set_and_a_node_on_another_host_are_known_at_the_next_answer(deployment):
    with Node("detector", deployment, robot="rm1", bus=MemoryBus(MemoryNetwork())) as node:
        clock = NodeClock(node, "camera")
        for started, ahead in ((1, 0.0), (1, 5.0), (2, -3.0)):  # set; then started anew elsewhere
            asked = node.now()
            told = asked + round((ahead + 0.0005) * SECOND)
            clock.hear(NodeInfo(node="camera", started=started, clock=told), asked, 0.001)
            found = clock.offset()
            assert found is not None
            assert abs(found.offset - ahead) <= found.bound
        clock.hear(NodeInfo(node="camera", started=2), node.now(), 0.001)  # one that does not tell its time
        assert clock.offset() is not None


def test_a_node_tells_why_it_is_not_ready(deployment):
    network = MemoryNetwork()
    with (
        Node("logger", deployment, robot="rm1", bus=MemoryBus(network)) as far,
        Node("cli-1", deployment, robot="rm1", bus=MemoryBus(network)) as near,
        spinning(far),
    ):
        assert (far.info().ready, far.info().problem) == (False, "")
        far.set_ready(False, "the disk is full")
        assert ask_about(near, "logger", 2.0)[0].problem == "the disk is full"
        far.set_ready(True)
        assert until(lambda: ask_about(near, "logger", 2.0)[0].ready)
        assert ask_about(near, "logger", 2.0)[0].problem == ""
