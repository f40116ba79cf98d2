"""The firmware's core in place of a board that speaks another dialect: it plays paths, keeps limits, holds and stops.

What it executes is what the board is then sent. What the board does with that is not known, and its reports say so.
Pure: it is given the time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import msgspec

from gemelo.firmware.bindings.device import CoreDevice
from gemelo.libraries.arm.device.device_config import device_config
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.device import DeviceCommandKind, DeviceMode
from gemelo.schemas.device_config import config_text
from gemelo.services.stepper_gateway.links.frames import (
    BadFrame,
    Code,
    CommandFrame,
    CommandReply,
    StateFrame,
    Sync,
    SyncReply,
    decode,
    encode,
)
from gemelo.services.stepper_gateway.links.link import Kind

STALL = 0.1  # [s] a later caller was stopped by the operating system, and catches nothing up; chosen: five knots
LAST_SLOTS = 2000  # [us] that run after a stall; chosen: two slots show that the device stood still
PROTOCOL = (1, 1)  # chosen: what has been sent to a board of another dialect is not replaced any more
OF_THE_BOARD = (Kind.SENSORS, Kind.SHAFT)  # the core has neither; where the board has sensors, it says so itself

Report = tuple[Kind, bytes]


class StandIn:
    """One core; `now` [s] is any clock that only goes forward, `new_boot` gives every start another boot id."""

    def __init__(
        self, arm: ArmDescription, name: str, steps: Sequence[int], new_boot: Callable[[], int], now: float
    ) -> None:
        """`name` stands for the firmware's version."""
        self._config, self._name = config_text(device_config(arm)), name
        self._new_boot = new_boot
        self._reports: list[Report] = []
        self.stalled = 0.0  # [s] altogether that this process was stopped: nothing was read then, nobody was silent
        self.start(steps, False, now)

    def start(self, steps: Sequence[int], referenced: bool, now: float) -> None:
        """Begin anew at `now` [s], as after a reset, at these steps; no path goes on."""
        self._zero = self._advanced = now
        self._is_stopping = False
        self._device = CoreDevice(self._config, self._new_boot(), steps=steps, referenced=referenced)
        self.report_status()

    @property
    def steps(self) -> tuple[int, ...]:
        """What the paths have commanded so far, absolute."""
        return self._device.steps

    @property
    def is_referenced(self) -> bool:
        """A person has said where the joints stand."""
        return self._device.referenced

    @property
    def is_moving(self) -> bool:
        return self._device.moving

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs that are to be on."""
        return self._device.outputs

    def device_us(self, now: float) -> int:
        """[us] since the start, as the reports have it."""
        return max(0, int((now - self._zero) * 1e6))

    def report_status(self) -> None:
        """Say again who it is."""
        self._device.report_status()

    def receive(self, kind: Kind, payload: bytes, now: float) -> None:
        """A frame of the gateway's at `now` [s]; `BadFrame` is left to the core, which counts it."""
        self.advance(now)
        if kind is Kind.CONFIG:
            return self._device.receive_config(payload)
        if kind is Kind.INJECT:
            return
        self._device.receive(payload if kind is not Kind.CMD else self._command(payload))

    def advance(self, now: float) -> None:
        """Let time pass until `now` [s] monotonic."""
        until = self.device_us(now)
        if now - self._advanced > STALL:
            self.stalled += now - self._advanced
            self._device.stand_still(max(0, until - LAST_SLOTS))
        self._device.advance(until)
        self._advanced = max(self._advanced, now)

    def answer_sync(self, sync: Sync, asked: float, sent: float, now: float) -> None:
        """Answer a question that came at `asked` [s], went over the board's own wire at `sent` and is answered `now`.

        The wire counts, the waiting for it does not: that is the time which the device took.
        """
        half = 0.5 * (now - sent)
        taken, answered = self.device_us(asked + half), self.device_us(sent + half)
        self._reports.append(
            (Kind.SYNC_R, encode(SyncReply(boot_id=self._device.boot_id, t0=sync.t0, t1=taken, t2=answered)))
        )

    def take(self, is_settled: bool) -> list[Report]:
        """What it has said; until the board is settled, what stands here is still under way there."""
        if is_settled and not self._device.moving:
            self._is_stopping = False
        said = self._reports + [(Kind(frame.kind), frame.payload) for frame in self._device.take()]
        self._reports = []
        return [self._as_the_board(kind, payload, is_settled) for kind, payload in said if kind not in OF_THE_BOARD]

    def discard(self) -> None:
        """Forget what it has said: the board is not there."""
        self._reports.clear()
        self._device.take()

    def _command(self, payload: bytes) -> bytes:
        """The command, or nothing where no board of another dialect can do it."""
        try:
            command = decode(payload)
        except BadFrame:
            return payload
        if not isinstance(command, CommandFrame):
            return payload
        if command.cmd == DeviceCommandKind.DISARM:
            self._refuse(command)
            return b""
        if command.cmd == DeviceCommandKind.STOP:
            self._is_stopping = True
        return payload

    def _refuse(self, command: CommandFrame) -> None:
        reply = CommandReply(
            boot_id=self._device.boot_id,
            cmd_id=command.cmd_id,
            cmd=command.cmd,
            code=Code.UNKNOWN_CMD,
            mode=self._device.mode,
            t_us=self._device.now_us,
        )
        self._reports.append((Kind.CMD_ACK, encode(reply)))

    def _as_the_board(self, kind: Kind, payload: bytes, is_settled: bool) -> Report:
        match kind:
            case Kind.STATUS:
                status = msgspec.json.decode(payload, type=dict[str, object])
                status |= {"firmware": self._name, "protocol": PROTOCOL, "open_loop": True, "virtual": False}
                return kind, msgspec.json.encode(status)
            case Kind.STATE:
                state = decode(payload)
                assert isinstance(state, StateFrame)
                return kind, encode(self._with_what_is_under_way(state, is_settled))
            case _:
                return kind, payload

    def _with_what_is_under_way(self, state: StateFrame, is_settled: bool) -> StateFrame:
        mode = state.mode
        if mode == DeviceMode.IDLE and not is_settled:
            mode = DeviceMode.HOLD if self._is_stopping else DeviceMode.RUN
        return msgspec.structs.replace(state, mode=mode)
