"""The gateway's core and the firmware's core in one virtual time, joined by a wire that may delay, lose and reorder.

Everything runs faster than real time, and repeats exactly for the same seed.
"""

from __future__ import annotations

import heapq
import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

from gemelo.firmware.bindings.device import CoreDevice
from gemelo.firmware.platform.host.board import DeviceClock
from gemelo.libraries.arm.device.device_config import device_config, reference_steps
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.libraries.arm.model.jaws import gripper_unit
from gemelo.libraries.runtime.deployment import project_root
from gemelo.schemas.device_config import DeviceConfig
from gemelo.schemas.message import Message, Vector
from gemelo.schemas.robot import Motor
from gemelo.tools.virtual_arm.gateway_driver import GatewayDriver, GatewayParameters, Kind, LinkInput, Moment, StepInput

UNIX = 1_700_000_000_000_000_000  # [ns] at the start of virtual time
GATEWAY_ZERO = 1000.0  # [s] of the gateway's monotonic clock at the start
BOOTED = 5_000_000  # [us] of the device's clock at the start
BOOT_ID = 77
PERIOD = 20_000  # [us] of the gateway's loop
NEVER = 1 << 62  # [us]
# A broker keeps status, event and configuration until they are delivered. Heartbeats are spared because two lost ones
# hold the device, as they should: tests of that cut the wire instead.
SPARED = ("status", "event", "hb", "config", "config/ack")


@cache
def rm1() -> ArmDescription:
    """The arm of `urdf/rm1`."""
    return load_arm(project_root() / "urdf/rm1")


@dataclass
class VirtualWire:
    """The treatment of frames in both directions."""

    delay: float = 0.001  # [s]
    jitter: float = 0.0  # [s] more, uniformly distributed: reorders
    loss: float = 0.0  # probability
    duplicates: float = 0.0  # probability
    is_cut: bool = False
    is_ordered: bool = False  # as over TCP: no frame overtakes another
    spared: tuple[str, ...] = SPARED  # kinds without jitter, loss and duplicates


def tcp_wire() -> VirtualWire:
    """A network that delays every frame by 1 to 8 ms, in order."""
    return VirtualWire(delay=0.001, jitter=0.007, is_ordered=True, spared=())


class VirtualArm(GatewayDriver):
    """A gateway, a device and their wire; `run` lets virtual time pass.

    `step_us` [us] is the largest step of time: `path` and the condition of `run` are sampled at its end. The gateway's
    loop beats `phase_us` [us] after the device's reports. Without `motors` no motor ever loses a step.
    """

    def __init__(
        self,
        wire: VirtualWire | None = None,
        seed: int = 1,
        start: Vector | None = None,
        referenced: bool = True,
        parameters: GatewayParameters | None = None,
        arm: ArmDescription | None = None,
        config: DeviceConfig | None = None,
        *,
        motors: Sequence[Motor] = (),
        clock: DeviceClock | None = None,
        on_message: Callable[[Message], None] | None = None,
        step_us: int = 1000,
        phase_us: int = 0,
    ) -> None:
        super().__init__(on_message)
        self.arm = arm or rm1()
        self.wire = wire or VirtualWire()
        self.rng = random.Random(seed)
        self.now_us = 0
        steps = reference_steps(self.arm)
        if start is not None:
            steps = tuple(round(j.steps.to_steps(p)) for j, p in zip(self.arm.joints, start, strict=True))
        self.config = config or device_config(self.arm)  # with which the device starts
        self.device = CoreDevice(
            self.config, BOOT_ID, BOOTED, _fitting(steps, self.config), referenced, motors=motors,
            gripper=self.arm.gripper, gripper_unit=gripper_unit(self.arm),
        )  # fmt: skip
        self.device_is_on = self.gateway_is_on = True
        self.device_is_frozen = False  # what arrives waits
        self.loop_is_on = True  # of the gateway: no heartbeat without it; what arrives is still handled
        self.sent: list[tuple[float, str, bytes]] = []  # [s], kind and payload of the gateway's frames
        self.path: list[tuple[float, ...]] = []  # [steps] of the device's path, at the end of every step of time
        self.lost: set[str] = set()  # kinds that never arrive
        self.heartbeat_us = 0  # [us] when the device received its last heartbeat
        self._clock = clock
        self._device_zero = -BOOTED  # [us] of virtual time at which the device's clock was 0
        self._step_us, self._next_beat = step_us, PERIOD + phase_us
        self._flying: list[tuple[int, int, bool, str, bytes]] = []  # heap: due, order, to the device?, kind, payload
        self._waiting: list[tuple[int, int, bool, str, bytes]] = []  # frames for a frozen device
        self._order = 0
        self._latest = {True: 0, False: 0}  # [us] due time of the last frame to the device, and back
        self.new_gateway(parameters)

    def new_gateway(self, parameters: GatewayParameters | None = None) -> None:
        """The gateway's process starts, perhaps again."""
        self.start_core(self.arm, self.rng.randrange(1, 2**31), parameters)
        self.handle(LinkInput(True, ""))
        self.device.report_status()

    @property
    def moment(self) -> Moment:
        return Moment(UNIX + self.now_us * 1000, GATEWAY_ZERO + self.now_us * 1e-6)

    @property
    def now(self) -> float:
        """Virtual time [s] since the start."""
        return self.now_us * 1e-6

    @property
    def position(self) -> Vector:
        """Executed joint positions [rad] or [m]."""
        return tuple(j.steps.to_position(s) for j, s in zip(self.arm.joints, self.device.steps, strict=True))

    def run(self, seconds: float, until: Callable[[], bool] | None = None) -> bool:
        """Runs for `seconds` [s] of virtual time, or until `until()`; False if that did not come."""
        end = self.now_us + round(seconds * 1e6)
        while self.now_us < end:
            if until is not None and until():
                return True
            self._step(self.now_us + self._step_us)
        return until is None or until()

    def ready(self) -> VirtualArm:
        """Runs until the gateway accepts goals and the drivers have been on for as long as they need."""
        assert self.run(3.0, lambda: not self.reason_not_ready), self.reason_not_ready
        self.run(max(0.0, self.config.enable_lead_ms * 1e-3 - self.now))
        return self

    def link(self, up: bool) -> None:
        """The gateway loses or regains its connection to the broker."""
        self.wire.is_cut = not up
        self.drop()
        self.handle(LinkInput(up, "" if up else "the broker is gone"))
        if up:
            self.device.report_status()

    def reboot(self, boot_id: int, referenced: bool = True) -> None:
        """The device loses power and starts again where it stands, with its clock at 0."""
        self._device_zero = self.now_us
        self.device = CoreDevice(
            self.config, boot_id, 0, self.device.steps, referenced,
            gripper=self.arm.gripper, gripper_unit=gripper_unit(self.arm),
        )  # fmt: skip

    def unconfigure(self) -> None:
        """Another device takes its place, at its very first start."""
        self._device_zero = self.now_us
        self.device = CoreDevice(None, 79)

    def freeze(self, seconds: float) -> None:
        """The device stands still as a whole for `seconds` [s], and wakes up to what has arrived meanwhile."""
        self.device_is_frozen = True
        self.run(seconds)
        self.device_is_frozen = False
        for frame in self._waiting:
            heapq.heappush(self._flying, frame)
        self._waiting.clear()
        self.device.stand_still(self._device_us - 2000)
        self.device.advance(self._device_us)

    def drop(self, *kinds: str) -> list[bytes]:
        """Removes the frames of these kinds, of all kinds if none is named, from the wire; returns their payloads."""
        self._flying += self._waiting
        self._waiting.clear()
        dropped = sorted(frame for frame in self._flying if not kinds or frame[3] in kinds)
        self._flying = [frame for frame in self._flying if kinds and frame[3] not in kinds]
        heapq.heapify(self._flying)
        return [payload for *_, payload in dropped]

    def send(self, kind: Kind, payload: bytes) -> None:
        self.sent.append((self.now, kind, payload))
        self._launch(True, kind, payload)

    def _step(self, end: int) -> None:
        """Lets time pass until `end` [us]; arrivals and beats of the gateway happen at their own times."""
        while self.now_us < end:
            arrival = self._flying[0][0] if self._flying else NEVER
            self.now_us = min(end, self._next_beat, max(arrival, self.now_us))
            if self._device_runs:
                self._advance_device()
            self._deliver()
            if self.now_us == self._next_beat:
                self._next_beat += PERIOD
                if self.gateway_is_on and self.loop_is_on:
                    self.handle(StepInput(self.absences))
        if self._device_runs:
            self.path.append(self.device.commanded_steps)

    @property
    def _device_runs(self) -> bool:
        return self.device_is_on and not self.device_is_frozen

    @property
    def _device_us(self) -> int:
        return self._clock.at(self.now) if self._clock else self.now_us - self._device_zero

    def _advance_device(self) -> None:
        self.device.advance(self._device_us)
        for frame in self.device.take():
            self._launch(False, frame.kind, frame.payload)

    def _launch(self, to_device: bool, kind: str, payload: bytes) -> None:
        if self.wire.is_cut or kind in self.lost:
            return
        is_spared = kind in self.wire.spared
        copies = 1
        if not is_spared:
            copies = (self.rng.random() >= self.wire.loss) + (self.rng.random() < self.wire.duplicates)
        for _ in range(copies):
            late = self.wire.delay + (0.0 if is_spared else self.rng.random() * self.wire.jitter)
            due = self.now_us + round(late * 1e6)
            if self.wire.is_ordered:
                due = self._latest[to_device] = max(due, self._latest[to_device])
            self._order += 1
            heapq.heappush(self._flying, (due, self._order, to_device, kind, payload))

    def _deliver(self) -> None:
        while self._flying and self._flying[0][0] <= self.now_us:
            frame = heapq.heappop(self._flying)
            _, _, to_device, kind, payload = frame
            if to_device and self.device_is_frozen:
                self._waiting.append(frame)
            elif to_device and self.device_is_on:
                self._to_device(kind, payload)
            elif not to_device and self.gateway_is_on:
                self.receive(Kind(kind), payload)

    def _to_device(self, kind: str, payload: bytes) -> None:
        if kind == Kind.CONFIG:
            self.device.receive_config(payload)
            return
        if kind == Kind.HB:
            self.heartbeat_us = self.now_us
        self.device.receive(payload)


def _fitting(steps: tuple[int, ...], config: DeviceConfig) -> tuple[int, ...]:
    """One start position for each joint of a device that may have other joints."""
    return tuple(steps[index] if index < len(steps) else 0 for index in range(len(config.joints)))
