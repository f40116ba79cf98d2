"""A disk that is full or read-only in the middle of a move, and a gateway without a descriptor: the arm goes on."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress

import pytest

from gemelo.libraries.runtime.errors import NoAnswer, ServerLost
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import DeviceStopRequest
from gemelo.schemas.topics import DEVICE_STOP
from gemelo.tools.chaos.descriptors import give_descriptors, take_descriptors
from gemelo.tools.chaos.small_disk import SmallDisk
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.stack.stack import Stack
from tests.optional import need_mounts
from tests.stack.gemelo import gemelo
from tests.stack.person import Operator, jumps

SPEED = 0.3  # slow enough that all of a fault falls into the move
OF_THE_ARM = ("router", "broker", "virtual_esp32", "stepper_gateway")
PROCESSES = (*OF_THE_ARM, "planner", "state_publisher", "logger", "panel")
OUT_SIZE = 128 << 20  # [bytes] for the recordings and black boxes of all tests
FAULTS = ("full", "read-only")


class Site:
    """A stack whose run folder and recordings have a disk of their own each."""

    def __init__(self, stack: Stack, run: SmallDisk, out: SmallDisk) -> None:
        self.stack, self._run, self._out = stack, run, out

    @contextmanager
    def fault(self, name: str) -> Iterator[None]:
        """Lasts until the end of the block."""
        with ExitStack() as healing:
            if name == "full":
                for disk in (self._run, self._out):
                    healing.callback(disk.free)
                    disk.fill()
            else:
                healing.callback(self._run.make_writable)
                self._run.make_read_only()
            yield


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Iterator[Site]:
    need_mounts()
    folder = tmp_path_factory.mktemp("disks")
    stack = Stack(broker="embedded", panel=True, out=folder / "out", processes=PROCESSES)
    with SmallDisk(stack.run) as run, SmallDisk(folder / "out", OUT_SIZE) as out, stack:
        yield Site(stack, run, out)


@pytest.fixture
def stack(site: Site) -> Stack:
    return site.stack


def begin(operator: Operator):
    """A move that is under way, and its plan."""
    plan = operator.plan(SPEED)
    handle = operator.send(plan)
    assert operator.wait_for(lambda: handle.feedback is not None and handle.feedback.elapsed > 0.1, 60.0)
    return handle, plan


def require_success(outcome) -> None:
    assert outcome.status is GoalStatusCode.SUCCEEDED, outcome
    assert outcome.result.executed_steps == outcome.result.commanded_steps


def doctor(stack: Stack) -> str:
    return gemelo(stack, "doctor", code=ExitCode.FAILED)


@pytest.mark.parametrize("fault", FAULTS)
def test_a_move_goes_on_to_the_step_and_a_stop_works_and_nobody_is_started_anew(site, stack, operator, fault):
    before = stack.pids()
    ready = [name for name in PROCESSES if name != "logger" or fault == "read-only"]  # it has nowhere to record else
    handle, plan = begin(operator)
    with site.fault(fault):
        require_success(handle.wait(plan.duration + 10.0))
        assert operator.wait_for(lambda: all(map(stack.is_ready, ready)), 60.0), stack.why_not_ready()
        assert "folder run" in doctor(stack)
        handle, plan = begin(operator)
        gemelo(stack, "stop")
        assert handle.wait(60.0).status is not GoalStatusCode.SUCCEEDED
        assert stack.pids() == before
    stack.wait_ready(120.0)
    assert stack.pids() == before
    assert not jumps(operator.arm, operator.seen)
    outcome, _ = operator.move_again()
    require_success(outcome)
    assert all((stack.run / f"{name}.ready").exists() for name in PROCESSES)


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("name", OF_THE_ARM)
def test_what_moves_and_stops_the_arm_also_starts_while_the_disk_refuses(site, stack, operator, fault, name):
    with site.fault(fault):
        before = stack.kill(name, signal.SIGTERM)
        assert operator.wait_for(lambda: stack.pid(name) not in (0, before), 60.0)
        stack.wait_ready(120.0, OF_THE_ARM)
        outcome, _ = operator.move_again()
        require_success(outcome)
        assert "folder run" in doctor(stack)
    stack.wait_ready(120.0)


def test_a_gateway_without_a_descriptor_outlives_its_broker_and_comes_back_with_the_first_one(stack, operator):
    gateway = stack.pid("stepper_gateway")
    take_descriptors(gateway)
    try:
        stack.kill("broker")
        assert operator.wait_for(lambda: not stack.is_ready("stepper_gateway"), 60.0)
        stack.wait_ready(120.0, ["broker"])
        operator.wait_for(lambda: False, 3.0)  # some attempts
        assert stack.pid("stepper_gateway") == gateway
    finally:
        give_descriptors(gateway)
    stack.wait_ready(120.0)
    assert stack.pid("stepper_gateway") == gateway
    outcome, _ = operator.move_again()
    require_success(outcome)


@contextmanager
def without_descriptors(stack: Stack) -> Iterator[None]:
    """No process of the stack gets a file or connection until the end of the block."""
    pids = [stack.pid(name) for name in PROCESSES]
    try:
        for pid in pids:
            take_descriptors(pid)
        yield
    finally:
        for pid in pids:
            give_descriptors(pid)


def test_a_move_goes_on_to_the_step_and_a_stop_works_where_no_process_has_a_descriptor(stack, operator):
    before = stack.pids()
    handle, plan = begin(operator)
    with without_descriptors(stack):
        require_success(handle.wait(plan.duration + 10.0))
        handle, plan = begin(operator)
        assert operator.node.call(DEVICE_STOP, DeviceStopRequest(), timeout=5.0).accepted
        assert handle.wait(60.0).status is not GoalStatusCode.SUCCEEDED
    stack.wait_ready(120.0)
    assert stack.pids() == before
    assert not jumps(operator.arm, operator.seen)
    outcome, _ = operator.move_again()
    require_success(outcome)


@pytest.mark.parametrize("name", ["broker", "router"])
def test_a_link_that_breaks_in_a_move_of_a_stack_without_descriptors_comes_back_with_the_first_ones(
    stack, operator, name
):
    others = {each: pid for each, pid in stack.pids().items() if each != name}
    handle, _ = begin(operator)
    with without_descriptors(stack):
        stack.kill(name)
        operator.wait_for(lambda: False, 3.0)  # some attempts
        alive = {each: pid for each, pid in stack.pids().items() if each != name}
        assert alive == others
    stack.wait_ready(120.0)
    with suppress(NoAnswer, ServerLost):
        ended = handle.wait(30.0)
        if ended.status is GoalStatusCode.SUCCEEDED:
            require_success(ended)
    assert not jumps(operator.arm, operator.seen)
    outcome, _ = operator.move_again()
    require_success(outcome)
