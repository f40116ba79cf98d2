"""Two gateways on one device: never are chunks of both played, and a STOP of either always works."""

from __future__ import annotations

from collections.abc import Callable

from hypothesis import Phase, given
from hypothesis import strategies as st

from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import DeviceMode, StopKind
from gemelo.services.stepper_gateway.links.frames import Ack, Code, decode
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.tools.virtual_arm.gateway_driver import GatewayDriver, LinkInput, Moment, StepInput
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm
from tests.profiles import examples
from tests.stepper_gateway.harness import move

HOME, READY = (0.0, 0.0, 0.0), (0.6, -1.2, 0.08)
NOTICED = 1.5  # [s] of both, after which each knows of the other: three questions for the clock
OTHER_CLOCK = 0.0137  # [s] of the second's host, so that no two questions are of one microsecond
STOPPED = 2.0  # [s] from a STOP to rest


class SecondGateway(GatewayDriver):
    """Another core on the wire of `first`."""

    def __init__(self, first: Twins) -> None:
        super().__init__()
        self._first = first

    @property
    def moment(self) -> Moment:
        first = self._first.moment
        return first._replace(monotonic=first.monotonic + OTHER_CLOCK)

    def send(self, kind: Kind, payload: bytes) -> None:
        self._first.send(kind, payload)

    def run(self, seconds: float, until: Callable[[], bool] | None = None) -> bool:
        return self._first.run(seconds, until)


class Twins(VirtualArm):
    """A gateway and its device, and a second gateway once `join` was called; `frozen` ones stand still.

    What a frozen one would receive waits, as its process's inbox and sockets keep it.
    """

    def __init__(self) -> None:
        self.second: SecondGateway | None = None
        self.frozen: set[int] = set()
        self._inboxes: dict[int, list[tuple[Kind, bytes]]] = {1: [], 2: []}
        self.taken: list[tuple[float, int]] = []  # [s], stream of chunks that the device has accepted
        super().__init__(step_us=5000)

    def join(self) -> SecondGateway:
        """The second gateway's process starts."""
        self.second = SecondGateway(self)
        self.second.start_core(self.arm, 2_000_000_000)
        self.second.handle(LinkInput(True, ""))
        self.device.report_status()
        return self.second

    def freeze_first(self, seconds: float) -> None:
        """The first gateway's process is stopped for `seconds` [s], and goes on with what has arrived."""
        self.frozen.add(1)
        self.loop_is_on = False
        self.run(seconds)
        self.frozen.discard(1)
        self.loop_is_on = True

    def receive(self, kind: Kind, payload: bytes, retained: bool = False) -> None:
        if kind is Kind.TRAJ_ACK:
            ack = decode(payload)
            assert isinstance(ack, Ack)
            self.taken += [(self.now, ack.stream)] if ack.code == Code.OK else []
        self._inboxes[1].append((kind, payload))
        if 1 not in self.frozen:
            for each in self._inboxes[1]:
                super().receive(*each)
            self._inboxes[1].clear()
        if self.second is not None:
            self.second.receive(kind, payload)

    def _deliver(self) -> None:
        super()._deliver()
        if self.second is not None and self.now_us == self._next_beat:
            self.second.handle(StepInput())


def accepted(driver: GatewayDriver, goal_id: str, arm: VirtualArm) -> bool:
    """Asks for a motion from where the arm stands to the other end of it."""
    target = HOME if max(map(abs, arm.position)) > 0.3 else READY
    return driver.goal(move(arm.position, target), goal_id).accepted


@given(st.floats(0.0, 2.5), st.lists(st.tuples(st.booleans(), st.floats(0.0, 1.0)), max_size=6), st.booleans())
@examples(quick=6, full=60, phases=(Phase.explicit, Phase.generate))
def test_of_two_gateways_never_are_chunks_of_both_played_and_a_stop_of_either_works(
    joins: float, goals: list[tuple[bool, float]], first_stops: bool
) -> None:
    arm = Twins()
    arm.ready()
    assert accepted(arm, "g", arm)
    arm.run(joins)
    second = arm.join()
    joined = arm.now
    arm.run(0.3)  # ten questions of the second, which the first sees answered
    for number, (is_first, pause) in enumerate(goals):
        accepted(arm if is_first else second, f"g{number}", arm)
        arm.run(pause)
    stopper = arm if first_stops else second
    stopper.ask(StopKind.STOP, 99)
    assert arm.run(0.5, lambda: 99 in stopper.answers)
    assert arm.run(STOPPED, lambda: not arm.device.moving)
    after = {stream >= 2_000_000_000 for at, stream in arm.taken if at > joined + 0.3}
    assert after <= {True}, "chunks of the first, which knows of the second"
    assert not [at for at, _ in arm.taken if at > joined + 0.3 + NOTICED], "each knows of the other"


def test_each_says_so_and_the_one_that_stays_goes_on() -> None:
    arm = Twins()
    arm.ready()
    second = arm.join()
    assert arm.run(NOTICED, lambda: "another gateway" in arm.reason_not_ready)
    assert arm.run(NOTICED, lambda: "another gateway" in second.reason_not_ready)
    arm.loop_is_on = False  # the first has ended
    assert arm.run(3.0, lambda: not second.reason_not_ready)
    assert accepted(second, "g", arm)
    assert second.finish("g")[0] is GoalStatusCode.SUCCEEDED


@given(st.floats(1.0, 6.0), st.floats(0.0, 2.0))
@examples(quick=15, full=100, phases=(Phase.explicit, Phase.generate))
def test_a_gateway_that_thaws_beside_another_moves_nothing(frozen: float, later: float) -> None:
    arm = Twins()
    arm.ready()
    assert accepted(arm, "g", arm)
    arm.run(0.6)
    arm.freeze_first(1.0)
    second = arm.join()
    arm.freeze_first(frozen)
    thawed = arm.now
    arm.run(later)
    accepted(arm, "late", arm)
    arm.run(1.0)
    arm.run(STOPPED, lambda: arm.device.mode is DeviceMode.IDLE)
    assert not [at for at, stream in arm.taken if at > thawed and stream < 2_000_000_000]
    second.ask(StopKind.STOP, 99)
    assert arm.run(0.5, lambda: 99 in second.answers)
    assert second.answers[99].accepted
