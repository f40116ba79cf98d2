"""Device frames that no device has said, with a valid CRC: another boot, jumped counters, far times, old ones again.

Each comes in front of the true frame that it was made from. What a forger says of modes, steps and refusals cannot be
told from the truth; everything else must neither end a move nor keep the next one from starting.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from typing import Any

import pytest
from msgspec.structs import replace

from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import DeviceMode, SpeedCommand
from gemelo.schemas.message import encode as encode_message
from gemelo.schemas.topics import JOINT_STATES
from gemelo.services.stepper_gateway.links.frames import SyncReply, decode, encode
from gemelo.services.stepper_gateway.links.link import FROM_DEVICE, Kind
from gemelo.tools.virtual_arm.gateway_driver import CancelInput
from gemelo.tools.virtual_arm.virtual_arm import BOOTED, GATEWAY_ZERO, VirtualArm
from tests.stepper_gateway.harness import move

HOME = (0.0, 0.0, 0.0)
READY = (0.6, -1.2, 0.08)
OTHER = (0.1, 0.1, 0.05)
CLOCK_ERROR = 2000.0  # [us] that the virtual wire's 1 ms and the rounding of its steps allow
Forge = Callable[[bytes], bytes]

WORDS = (0, 1, 2**31, 2**32 - 1)
TIMES = (0, 2**31, 2**62, 2**63 - 1, 2**63, 2**64 - 1)
NUMBERS = (0, -1, 2**31, -(2**62), 2**63 - 1, 2**64 - 1, 10**30, 1e308, -1e308)
AHEAD = (50_000, 400_000, 900_000, 2_000_000, 2**40)  # [us] beyond the true value

# Of each frame the fields that tell who speaks, when, and which place in a row.
FRAMES: dict[Kind, dict[str, Sequence[Any]]] = {
    Kind.STATE: {
        "boot_id": WORDS,
        "t_us": TIMES,
        "stream": WORDS,
        "next_seq": WORDS,
        "play_us": TIMES,
        "underruns": WORDS,
        "refused": WORDS,
        "bad_frames": WORDS,
    },
    Kind.SYNC_R: {"boot_id": WORDS, "t0": TIMES, "t1": TIMES, "t2": TIMES},
    Kind.TRAJ_ACK: {"boot_id": WORDS, "stream": WORDS, "seq": WORDS[2:], "next_seq": WORDS[2:], "t_us": TIMES},
    Kind.CMD_ACK: {"boot_id": WORDS, "cmd_id": WORDS, "t_us": TIMES},
}
TOLD: dict[Kind, tuple[tuple[str, ...], ...]] = {  # the fields that are moved together
    Kind.STATE: (("t_us",), ("play_us",)),
    Kind.SYNC_R: (("t1",), ("t2",), ("t1", "t2")),
    Kind.TRAJ_ACK: (("t_us",),),
    Kind.CMD_ACK: (("t_us",),),
}
TEXTS: dict[Kind, dict[str, Sequence[Any]]] = {
    Kind.STATUS: {
        "boot_id": NUMBERS,
        "joints": NUMBERS,
        "tick_hz": NUMBERS,
        "queue_capacity": NUMBERS,
        "config_crc32": NUMBERS,
        "online": (False,),
        "device": ("", "other", "x" * 60_000),
    },
    Kind.EVENT: {"t_us": NUMBERS, "stream": NUMBERS, "event": ("", "finished", "started", "stopped", "boot", "hold")},
    Kind.SENSORS: {"t_us": NUMBERS, "boot_id": NUMBERS, "temperature": NUMBERS, "nothing": NUMBERS},
    Kind.SHAFT: {"t_us": NUMBERS, "steps": [(number,) * 3 for number in NUMBERS], "shaft": [(0,), (2**62,) * 3]},
    Kind.CONFIG_ACK: {"crc32": NUMBERS, "accepted": (False, True), "part": ("joint",), "reason": ("forged",)},
}
SAMPLES: dict[Kind, dict[str, Any]] = {  # of what the virtual device says on occasion only
    Kind.EVENT: {"event": "started", "t_us": BOOTED, "boot_id": 77, "stream": 1, "detail": ""},
    Kind.SENSORS: {"t_us": BOOTED, "boot_id": 77},
    Kind.SHAFT: {"t_us": BOOTED, "steps": (0, 0, 0), "shaft": (0, 0, 0)},
    Kind.CONFIG_ACK: {"crc32": 0, "accepted": True, "part": "", "reason": ""},
}


class ForgedArm(VirtualArm):
    """A wire on which somebody else speaks for the device, just before it speaks itself."""

    def __init__(self) -> None:
        self.forges: dict[Kind, list[Forge]] = {kind: [] for kind in Kind}
        self.last: dict[Kind, bytes] = {}
        super().__init__(step_us=5000)

    def receive(self, kind: Kind, payload: bytes, retained: bool = False) -> None:
        self.last[kind] = payload
        forges, self.forges[kind] = self.forges[kind], []
        for forge in forges:
            super().receive(kind, forge(payload))
        super().receive(kind, payload, retained)

    def play(self, kind: Kind, forges: Sequence[Forge]) -> None:
        """Lets `forges` come before the next true frame; asks for what the device says on request only."""
        self.forges[kind] += forges
        if kind == Kind.CMD_ACK:
            self.answers.clear()
            self.ask(SpeedCommand())
        assert self.run(2.0, lambda: not self.forges[kind])

    @property
    def clock_error(self) -> float:
        """[us] by which the gateway's idea of the device's clock is wrong now."""
        now = self.moment.monotonic
        return abs(self.core.device.session.clock.device_time(now) - (now - GATEWAY_ZERO) * 1e6 - BOOTED)

    def assert_moves_on(self) -> None:
        """The goal under way succeeds, so does the next one at once, and all that was said can be sent."""
        status, result = self.finish(seconds=30.0)
        assert status == GoalStatusCode.SUCCEEDED, result.error_string
        self.assert_next_goal_succeeds()
        assert self.clock_error < CLOCK_ERROR
        for messages in self.published.values():
            for message in messages:
                encode_message(message)

    def assert_next_goal_succeeds(self) -> None:
        assert not self.reason_not_ready
        assert self.device.mode == DeviceMode.IDLE
        verdict = self.goal(move(self.messages(JOINT_STATES)[-1].position, OTHER), "next")
        assert verdict.accepted, verdict.reason
        status, result = self.finish("next", 20.0)
        assert status == GoalStatusCode.SUCCEEDED, result.error_string
        assert self.device.max_slot_error <= 128


def moving_rig() -> ForgedArm:
    rig = ForgedArm()
    rig.ready()
    assert rig.goal(move(HOME, READY, slower=2.0)).accepted
    rig.run(1.2)
    assert rig.device.moving
    return rig


def changed(field: str, value: Any) -> Forge:
    return lambda payload: encode(replace(decode(payload), **{field: value}))


def later(by: int, *fields: str) -> Forge:
    def forge(payload: bytes) -> bytes:
        frame = decode(payload)
        return encode(replace(frame, **{field: getattr(frame, field) + by for field in fields}))

    return forge


@pytest.mark.parametrize("kind", FRAMES)
def test_a_frame_with_a_jumped_field_ends_no_move(kind: Kind) -> None:
    rig = moving_rig()
    for field, values in FRAMES[kind].items():
        rig.play(kind, [changed(field, value) for value in values])
        assert not rig.finished, f"{field}: {rig.log[-1]}"
    assert rig.core.bad_frames > 0
    rig.assert_moves_on()


@pytest.mark.parametrize(("kind", "fields"), [(kind, fields) for kind, rows in TOLD.items() for fields in rows])
def test_a_frame_from_ahead_of_the_devices_time_ends_no_move(kind: Kind, fields: tuple[str, ...]) -> None:
    rig = moving_rig()
    for by in AHEAD:
        rig.play(kind, [later(by, *fields)])
    assert rig.core.bad_frames > 0
    rig.assert_moves_on()


@pytest.mark.parametrize("kind", TEXTS)
def test_a_text_with_a_jumped_field_ends_no_move(kind: Kind) -> None:
    rig = moving_rig()
    sample = SAMPLES.get(kind) or json.loads(rig.last[kind])
    for field, values in TEXTS[kind].items():
        for value in values:
            rig.receive(kind, json.dumps(sample | {field: value}).encode())
            rig.run(0.02)
            assert not rig.finished, f"{field} {value}: {rig.log[-1]}"
    assert rig.core.bad_frames > 0
    rig.assert_moves_on()


def test_frames_of_before_that_come_again_end_no_move() -> None:
    rig = moving_rig()
    rig.play(Kind.CMD_ACK, [])
    rig.run(0.1)
    old = {kind: rig.last.get(kind) or json.dumps(SAMPLES[kind]).encode() for kind in FROM_DEVICE}
    for _ in range(5):
        for kind, payload in old.items():
            rig.receive(kind, payload)
        rig.run(0.1)
    rig.assert_moves_on()


@pytest.mark.parametrize("offset", [-5_000_000, 700_000, 60_000_000])
def test_a_forged_answer_to_every_question_for_the_clock_moves_it_nowhere(offset: int) -> None:
    rig = moving_rig()

    def forge(payload: bytes) -> bytes:
        true = decode(payload)
        assert isinstance(true, SyncReply)
        middle = true.t1 + offset
        return encode(replace(true, t1=middle, t2=middle + 1900))

    for _ in range(6):
        rig.play(Kind.SYNC_R, [forge])
    rig.assert_moves_on()


@pytest.mark.parametrize("by", AHEAD[1:])
def test_a_stop_whose_answer_is_forged_from_ahead_still_ends_the_goal(by: int) -> None:
    rig = moving_rig()
    rig.forges[Kind.CMD_ACK].append(later(by, "t_us"))
    assert rig.handle(CancelInput("g")).why is None
    assert rig.finish(seconds=3.0)[0] == GoalStatusCode.CANCELED
    rig.assert_next_goal_succeeds()


def test_a_refused_configuration_that_was_never_refused_is_given_again() -> None:
    rig = ForgedArm()
    rig.ready()
    rig.unconfigure()
    rig.lost.add("config")
    rig.run(1.0)
    forged = {"crc32": rig.core.device.configuration.crc32, "accepted": False, "part": "joint", "reason": "forged"}
    rig.receive(Kind.CONFIG_ACK, json.dumps(forged).encode())
    rig.lost.clear()
    assert rig.run(30.0, lambda: rig.device.mode == DeviceMode.UNREFERENCED)
    assert rig.run(1.0, lambda: rig.core.device.configuration.is_in_force)
