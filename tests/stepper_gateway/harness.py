"""The gateway's core and the real firmware core, joined by a wire that delays, loses, doubles and reorders.

Everything runs in virtual time, faster than real time, and repeats exactly for the same seed.
"""

from __future__ import annotations

import random
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import accumulate, pairwise
from pathlib import Path
from typing import Any

from firmware.bindings.device import Device
from schemas.actions import GoalStatusCode
from schemas.device import (
    ConfigureResponse,
    DeviceCommand,
    DeviceCommandKind,
    DeviceCommandRequest,
    DeviceCommandResponse,
    DeviceState,
    DeviceStopRequest,
    PressRequest,
    PressResponse,
    StopKind,
)
from schemas.device_config import DeviceConfig
from schemas.joints import JointTargets
from schemas.message import Vector
from schemas.motion import (
    FollowJointTrajectoryFeedback,
    FollowJointTrajectoryGoal,
    FollowJointTrajectoryResult,
    JointTrajectory,
    TrajectoryPoint,
)
from schemas.topics import Topic
from services.arm.description import Arm, load_arm
from services.arm.device_config import device_config, reference_steps
from services.stepper_gateway.core import GatewayCore
from services.stepper_gateway.device.command_arguments import KINDS
from services.stepper_gateway.goals.goal_executor import GoalVerdict
from services.stepper_gateway.links.link import Kind, Received
from services.stepper_gateway.moment import Moment
from services.stepper_gateway.motion.knots import Knot
from services.stepper_gateway.motion.limits import Limits
from services.stepper_gateway.motion.paths import profile
from services.stepper_gateway.outputs import (
    Answer,
    GoalExecuting,
    GoalFinished,
    GoalProgress,
    LogLine,
    Output,
    Publish,
    SendFrame,
)
from services.stepper_gateway.parameters import GatewayParameters

ROOT = Path(__file__).resolve().parents[2]
UNIX = 1_700_000_000_000_000_000  # [ns] at the start of virtual time
GATEWAY_ZERO = 1000.0  # [s] of the gateway's monotonic clock at the start
# A broker keeps status and event until they are delivered. Heartbeats are spared because two lost ones hold the
# device, as they should: tests of that cut the wire instead.
SAFE = ("status", "event", "hb", "config", "config/ack")


@cache
def rm1() -> Arm:
    return load_arm(ROOT / "urdf" / "rm1")


@dataclass
class Wire:
    """How both directions treat frames."""

    delay: float = 0.001  # [s]
    jitter: float = 0.0  # [s] more, uniformly: reorders
    loss: float = 0.0
    duplicates: float = 0.0
    is_cut: bool = False


class Rig:
    """A gateway, a device and their wire; `run` lets time pass."""

    def __init__(
        self,
        wire: Wire | None = None,
        seed: int = 1,
        start: Vector | None = None,
        referenced: bool = True,
        parameters: GatewayParameters | None = None,
        arm: Arm | None = None,
        config: DeviceConfig | None = None,
    ) -> None:
        self.arm = arm or rm1()
        self.wire = wire or Wire()
        self.rng = random.Random(seed)
        self.now_us = 0
        steps = reference_steps(self.arm)
        if start is not None:
            steps = tuple(round(j.steps.to_steps(p)) for j, p in zip(self.arm.joints, start, strict=True))
        self._device_zero = -5_000_000  # [us] of virtual time at which the device booted
        self.config = config or device_config(self.arm)  # what the device works with when it starts
        self.device = Device(self.config, 77, 5_000_000, _fitting(steps, self.config), referenced)
        self.device_is_on = self.gateway_is_on = True
        self.device_is_frozen = False  # what arrives waits
        self.published: dict[str, list[Any]] = defaultdict(list)
        self.finished: dict[str, tuple[GoalStatusCode, FollowJointTrajectoryResult]] = {}
        self.executing: list[str] = []
        self.feedback: list[FollowJointTrajectoryFeedback] = []
        self.answers: dict[int, DeviceCommandResponse] = {}
        self.configured: dict[int, ConfigureResponse] = {}
        self.pressed: dict[int, PressResponse] = {}
        self.log: list[str] = []
        self.sent: list[tuple[float, str, bytes]] = []
        self.path: list[tuple[float, ...]] = []  # [steps] of the device's path, every millisecond
        self.lost: set[str] = set()  # kinds that never arrive
        self._flying: list[tuple[int, int, bool, str, bytes]] = []  # due, order, to the device?, kind, payload
        self._order = 0
        self.new_gateway(parameters)

    def new_gateway(self, parameters: GatewayParameters | None = None) -> None:
        """The gateway's process starts, perhaps again."""
        self.core = GatewayCore(self.arm, self.rng.randrange(1, 2**31), parameters)
        self._do(self.core.on_link(True, "", self.moment))
        self.device.report_status()

    @property
    def moment(self) -> Moment:
        return Moment(UNIX + self.now_us * 1000, GATEWAY_ZERO + self.now_us * 1e-6)

    @property
    def now(self) -> float:
        """[s] since the start."""
        return self.now_us * 1e-6

    @property
    def position(self) -> Vector:
        """[rad] or [m] executed."""
        return tuple(j.steps.to_position(s) for j, s in zip(self.arm.joints, self.device.steps, strict=True))

    def run(self, seconds: float, until: Callable[[], bool] | None = None) -> bool:
        """Let time pass; true as soon as `until` holds."""
        end = self.now_us + round(seconds * 1e6)
        while self.now_us < end:
            if until is not None and until():
                return True
            self._millisecond()
        return until is None or until()

    def freeze(self, seconds: float) -> None:
        """The device stands still as a whole, and wakes up to what has arrived meanwhile."""
        self.device_is_frozen = True
        self.run(seconds)
        self.device_is_frozen = False
        now_us = self.now_us - self._device_zero
        self.device.stand_still(now_us - 2000)
        self.device.advance(now_us)

    def ready(self) -> Rig:
        """Run until the gateway may accept goals and the drivers have been on for as long as they need."""
        assert self.run(3.0, lambda: not self.core.not_ready(self.moment)), self.core.not_ready(self.moment)
        self.run(max(0.0, self.config.enable_lead_ms * 1e-3 - self.now))
        return self

    def goal(self, goal: FollowJointTrajectoryGoal | JointTrajectory, goal_id: str = "g") -> GoalVerdict:
        if isinstance(goal, JointTrajectory):
            goal = FollowJointTrajectoryGoal(trajectory=goal)
        verdict, outputs = self.core.on_goal(goal_id, goal, self.moment)
        self._do(outputs)
        return verdict

    def finish(self, goal_id: str = "g", seconds: float = 60.0) -> tuple[GoalStatusCode, FollowJointTrajectoryResult]:
        assert self.run(seconds, lambda: goal_id in self.finished), f"{goal_id} has not ended"
        return self.finished[goal_id]

    def cancel(self, goal_id: str = "g") -> str:
        reason, outputs = self.core.on_cancel(goal_id, self.moment)
        self._do(outputs)
        return reason

    def target(self, **positions: float) -> None:
        """Stream a target for the joints named."""
        targets = JointTargets(name=tuple(positions), position=tuple(positions.values()))
        self._do(self.core.on_targets(targets, self.moment))

    def command(self, kind: DeviceCommandKind, ticket: int = 1, **positions: float) -> None:
        self.ask(asked(kind, name=tuple(positions), position=tuple(positions.values())), ticket)

    def ask(self, wanted: DeviceCommand | StopKind, ticket: int = 1) -> None:
        """Ask for a command or a stop; its answer comes in `answers`."""
        if isinstance(wanted, StopKind):
            self._do(self.core.on_stop(DeviceStopRequest(kind=wanted), ticket, self.moment))
        else:
            self._do(self.core.on_command(DeviceCommandRequest(command=wanted), ticket, self.moment))

    def answer(self, wanted: DeviceCommand | StopKind, ticket: int = 1) -> DeviceCommandResponse:
        """The answer to a command or a stop, once the next states have come too."""
        self.ask(wanted, ticket)
        assert self.run(3.0, lambda: ticket in self.answers)
        self.run(0.1)
        return self.answers.pop(ticket)

    def configure(self) -> ConfigureResponse:
        """The answer to a request for the configuration."""
        self.ask_configuration(1)
        assert self.run(6.0, lambda: 1 in self.configured)
        self.run(0.1)
        return self.configured.pop(1)

    def ask_configuration(self, ticket: int) -> None:
        self._do(self.core.on_configure(ticket, self.moment))

    def press(self, request: PressRequest, ticket: int = 1) -> None:
        self._do(self.core.on_press(request, ticket, self.moment))

    @property
    def state(self) -> DeviceState:
        """What the gateway has last said of the device."""
        state: DeviceState = self.published["device/state"][-1]
        return state

    def receive(self, kind: Kind, payload: bytes, retained: bool = False) -> None:
        """Hand the gateway a payload as if it came over the wire."""
        received = Received(kind, payload, retained, round(self.moment.monotonic * 1e9))
        self._do(self.core.on_received(received, self.moment))

    def link(self, up: bool) -> None:
        """The gateway loses or regains its own connection to the broker."""
        self.wire.is_cut = not up
        self._flying.clear()
        self._do(self.core.on_link(up, "" if up else "the broker is gone", self.moment))
        if up:
            self.device.report_status()

    def reboot(self, boot_id: int, referenced: bool = True) -> None:
        """The device loses power and starts again where it stands, with a clock of its own."""
        self._device_zero = self.now_us
        self.device = Device(self.config, boot_id, 0, self.device.steps, referenced)

    def unconfigure(self) -> None:
        """Another device at its very first start."""
        self._device_zero = self.now_us
        self.device = Device(None, 79)

    def messages(self, topic: Topic[Any]) -> list[Any]:
        return self.published[topic.key]

    def events(self) -> list[str]:
        return [event.event for event in self.published["device/events"]]

    def _millisecond(self) -> None:
        self.now_us += 1000
        self._deliver()
        if self.device_is_on and not self.device_is_frozen:
            self.device.advance(self.now_us - self._device_zero)
            self.path.append(self.device.commanded_steps)
            for frame in self.device.take():
                self._launch(False, frame.kind, frame.payload)
        if self.gateway_is_on and self.now_us % 20_000 == 0:
            self._do(self.core.step(self.moment))

    def _launch(self, to_device: bool, kind: str, payload: bytes) -> None:
        if self.wire.is_cut or kind in self.lost:
            return
        is_safe = kind in SAFE
        copies = 1
        if not is_safe:
            copies = (self.rng.random() >= self.wire.loss) + (self.rng.random() < self.wire.duplicates)
        for _ in range(copies):
            late = self.wire.delay + (0.0 if is_safe else self.rng.random() * self.wire.jitter)
            self._order += 1
            self._flying.append((self.now_us + round(late * 1e6), self._order, to_device, kind, payload))

    def _deliver(self) -> None:
        if not self._flying:
            return
        due = sorted(item for item in self._flying if self._is_due(item))
        self._flying = [item for item in self._flying if not self._is_due(item)]
        for _, _, to_device, kind, payload in due:
            if to_device and self.device_is_on and kind == Kind.CONFIG:
                self.device.receive_config(payload)
            elif to_device and self.device_is_on:
                self.device.receive(payload)
            elif not to_device and self.gateway_is_on:
                self.receive(Kind(kind), payload)

    def _is_due(self, item: tuple[int, int, bool, str, bytes]) -> bool:
        return item[0] <= self.now_us and not (item[2] and self.device_is_frozen)

    def _do(self, outputs: list[Output]) -> None:
        for output in outputs:
            match output:
                case SendFrame(kind, payload):
                    self.sent.append((self.now, kind, payload))
                    self._launch(True, kind, payload)
                case Publish(topic, message):
                    self.published[topic.key].append(message)
                case GoalExecuting(goal_id):
                    self.executing.append(goal_id)
                case GoalProgress(_, feedback):
                    self.feedback.append(feedback)
                case GoalFinished(goal_id, status, result):
                    assert goal_id not in self.finished, f"{goal_id} ends twice"
                    self.finished[goal_id] = (status, result)
                case Answer(ticket, DeviceCommandResponse() as response):
                    self.answers[ticket] = response
                case Answer(ticket, ConfigureResponse() as response):
                    self.configured[ticket] = response
                case Answer(ticket, PressResponse() as response):
                    self.pressed[ticket] = response
                case LogLine(_, text):
                    self.log.append(text)


def asked(kind: DeviceCommandKind, **fields: Any) -> DeviceCommand | StopKind:
    """What a person asks for under the command's number on the wire, with those of `fields` that it has."""
    if kind in (DeviceCommandKind.STOP, DeviceCommandKind.HOLD, DeviceCommandKind.DISARM):
        return StopKind[kind.name]
    command = next(command for command, number in KINDS.items() if number == kind)
    return command(**{field: value for field, value in fields.items() if field in command.__struct_fields__})


def _fitting(steps: tuple[int, ...], config: DeviceConfig) -> tuple[int, ...]:
    """One start position for each joint of a device that may have other joints."""
    return tuple(steps[index] if index < len(steps) else 0 for index in range(len(config.joints)))


def move(start: Vector, end: Vector, period: float = 0.05, slower: float = 1.0) -> JointTrajectory:
    """A jerk-limited move from rest to rest in points of `period` seconds, as the planner makes them."""
    arm = rm1()
    path = profile(Knot.at_rest(start), Knot.at_rest(end), Limits.of(arm.joints))
    assert path is not None
    count = max(1, round(path.duration / period))
    times = [path.duration * i / count for i in range(count + 1)]
    knots = [path.at(t) for t in times]
    points = [
        TrajectoryPoint(
            positions=knot.position,
            velocities=tuple(v / slower for v in knot.velocity),
            accelerations=tuple(a / slower**2 for a in knot.acceleration),
            time_from_start=t * slower,
        )
        for t, knot in zip(times, knots, strict=True)
    ]
    last = TrajectoryPoint(
        positions=end, velocities=(0.0,) * 3, accelerations=(0.0,) * 3, time_from_start=times[-1] * slower
    )
    points = points[:-1] if path.duration > 0.0 else []
    return JointTrajectory(joint_names=arm.joint_names, points=(*points, last))


@dataclass(frozen=True)
class Peak:
    """The largest speed and acceleration of one joint, as shares of its limits."""

    velocity: float
    acceleration: float


WINDOW = 40  # [ms] over which rates are taken
KNOT_NOISE = 3.0 / 256.0  # [steps] by which rounding to the wire may bend a window


def peaks(rig: Rig, since: int = 0) -> list[Peak]:
    """Of the device's path from the millisecond `since` on; the wire's rounding is allowed for."""
    found = []
    seconds = WINDOW * 1e-3
    for column, joint in enumerate(rig.arm.joints):
        track = _without_starts([row[column] for row in rig.path[max(0, since - 1) :]])[min(since, 1) :]
        rates = [(track[i + WINDOW] - track[i]) / seconds for i in range(len(track) - WINDOW)]
        bends = [abs(rates[i + WINDOW] - rates[i]) / seconds for i in range(len(rates) - WINDOW)]
        noise = KNOT_NOISE / seconds
        speed = max(0.0, max(map(abs, rates), default=0.0) - noise)
        bend = max(0.0, max(bends, default=0.0) - noise / seconds)
        scale = joint.steps.per_unit
        found.append(Peak(speed / scale / joint.velocity, bend / scale / joint.acceleration))
    return found


def _without_starts(track: list[float]) -> list[float]:
    """A stream may begin up to a step beside where the path ended, at rest and without a pulse: no motion."""
    rises = [b - a for a, b in pairwise(track)]
    moved = [0.0 if before == 0.0 and 0.01 < abs(rise) <= 1.0 else rise for before, rise in pairwise([0.0, *rises])]
    return [track[0] + rise for rise in accumulate(moved, initial=0.0)]


def assert_within_limits(rig: Rig, since: int = 0) -> None:
    """The device's path kept every limit and every slot was executed to half a step."""
    for joint, peak in zip(rig.arm.joints, peaks(rig, since), strict=True):
        assert peak.velocity <= 1.005, f"{joint.name} {peak}"
        assert peak.acceleration <= 1.1, f"{joint.name} {peak}"
    assert rig.device.max_slot_error <= 128
