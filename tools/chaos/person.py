"""The person beside the arm: sends it somewhere, waits for the end, and does by hand what a refusal asks for."""

from __future__ import annotations

import math
import time
from contextlib import suppress
from random import Random

import gemelo
from gemelo import DeviceMode
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.device import DeviceEvent, DeviceState, ShaftPositions
from gemelo.schemas.joints import JointState
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.schemas.topics import DEVICE_EVENTS, DEVICE_SHAFT, DEVICE_STATE, JOINT_STATES

SHARES = (0.2, 0.8)  # of a joint's travel between which goals lie
SPEEDS = (0.3, 1.0)
LEADING = 0.3  # of a joint's velocity limit with which it is led out of something, and [s] that it goes on
STANDS = 0.3  # [s] without a step: the arm rests
TO_REST = 20.0  # [s]
KEPT = 4000  # newest states: 80 s


class Person:
    """Hears every state of joints and device from the beginning on."""

    def __init__(self, arm: gemelo.Arm) -> None:
        self.arm = arm
        self.states: list[DeviceState] = []  # since `forget`
        self.position: tuple[float, ...] = ()  # [rad] or [m], the newest
        self.stamps: list[int] = []  # [ns] of all, to hold against the recording
        self.late: list[int] = []  # [ns] when the device said that its machine gave it no time; of all
        self.hands: list[str] = []  # what was done by hand since `forget`
        self._shaft = arm.node.latest(DEVICE_SHAFT)
        arm.node.subscribe(JOINT_STATES, self._hear_joints)
        arm.node.subscribe(DEVICE_STATE, self._hear_device)
        arm.node.subscribe(DEVICE_EVENTS, self._hear_event)

    def _hear_joints(self, state: JointState) -> None:
        self.stamps.append(state.stamp)
        self.position = state.position

    def _hear_device(self, state: DeviceState) -> None:
        self.states.append(state)
        del self.states[:-KEPT]

    def _hear_event(self, event: DeviceEvent) -> None:
        if event.event == "late":
            self.late.append(event.stamp)

    def forget(self) -> None:
        """Begins a new episode."""
        self.states, self.hands = self.states[-1:], []

    def pause(self, seconds: float) -> None:
        """Lets time [s] pass."""
        self.arm.wait_for(lambda: False, seconds)

    def start(self, random: Random) -> gemelo.Motion:
        """A move to a random place where the arm can be; raises `gemelo.Error` where none of some is accepted."""
        error: gemelo.Error | None = None
        for _ in range(10):
            goal = random_goal(self.arm.description, random)
            try:
                return self.arm.start(joints=goal, speed=random.uniform(*SPEEDS))
            except gemelo.Refused as refused:
                error = refused
                self._lead_out(refused)
        assert error is not None
        raise error

    def _lead_out(self, refused: gemelo.Refused) -> None:
        """Jogs an arm that stands in something to the nearest place where it is free, as the refusal says."""
        here = self.arm.joints
        ways = {name: there - here[name] for name, there in refused.nearest_free.items()}
        for name, way in ways.items():
            speed = math.copysign(LEADING * self.arm.description.joint(name).velocity, way)
            if abs(way) > 0.0:
                self.arm.jog(joints={name: speed}, duration=min(way / speed + LEADING, TO_REST))

    def await_rest(self) -> bool:
        """Waits until the arm rests; False if it has not within 20 s, or nothing is heard."""
        end = time.monotonic() + TO_REST
        while time.monotonic() < end:
            count = len(self.stamps)
            before = self.position
            self.pause(STANDS)
            if len(self.stamps) > count and self.position == before:
                return True
        return False

    def shaft(self) -> tuple[float, ...]:
        """[rad] or [m] by joint of the true shafts, heard after this call; raises `gemelo.Lost` if nothing is."""
        asked = time.time_ns()
        newest = lambda: self._shaft.message is not None and self._shaft.message.stamp > asked  # noqa: E731
        seen: ShaftPositions | None = self._shaft.message if self.arm.wait_for(newest, 3.0) else None
        if seen is None:
            raise gemelo.Lost(because("chaos.no_shafts"))
        positions = dict(zip(seen.name, seen.position, strict=True))
        return tuple(positions[name] for name in self.arm.joint_names)

    def make_ready(self, seconds: float, reference: bool) -> Reason | None:
        """Does what the device's mode asks for until it is idle; why it is not after `seconds` [s], None where it is.

        `reference`: the shafts may not be where the counters say, so the arm is referenced in any case.
        """
        end = time.monotonic() + seconds
        why: Reason | None = because("chaos.untried")
        while time.monotonic() < end:
            try:
                why = self._next_step(reference)
            except gemelo.Error as error:
                why = error.message
            if why is None:
                return None
            reference = reference and "reference" not in self.hands
            self.pause(0.1)
        return why

    def _next_step(self, reference: bool) -> Reason | None:
        device = self.arm.device
        mode, configuration = device.mode, device.configuration
        if not configuration.accepted:
            if configuration.device_crc32 == configuration.crc32:
                text = configuration.reason  # it has the configuration
                return configuration.why or (plain(text) if text else because("chaos.out_of_reach"))
            return self._do("configure", lambda: device.configure())
        if mode in (DeviceMode.FAULT, DeviceMode.ESTOP):
            return self._do("reset", device.reset)
        if mode in (DeviceMode.HOLD, DeviceMode.RUN):
            return self._do("stop", self.arm.stop)
        if not device.state.armed:
            return self._do("arm", device.arm)
        if mode is DeviceMode.UNREFERENCED or reference:
            return self._do("reference", self._reference)
        return None if mode is DeviceMode.IDLE else because("chaos.mode", mode=mode.name)

    def _reference(self) -> None:
        """A person looks where the arm stands: a virtual one says where its shafts are."""
        joints = self.arm.description.joints
        self.arm.reference({joint.name: joint.clamp(at) for joint, at in zip(joints, self.shaft(), strict=True)})

    def _do(self, word: str, act: object) -> Reason:
        assert callable(act)
        act()
        if word not in self.hands:
            self.hands.append(word)
        return because("chaos.just_done", hand=word)


def random_goal(arm: ArmDescription, random: Random) -> dict[str, float]:
    """[rad] or [m] by joint, in the middle of each one's travel."""
    return {joint.name: joint.lower + random.uniform(*SHARES) * (joint.upper - joint.lower) for joint in arm.joints}


def quietly_cancel(motion: gemelo.Motion) -> None:
    """Ends a motion of which nothing more is to be known."""
    with suppress(gemelo.Error):
        motion.cancel()
