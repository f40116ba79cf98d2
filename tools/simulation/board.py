"""The virtual ESP32 in virtual time: the same board, on a wire in memory."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path

import msgspec

from gemelo.firmware.platform.host.board import Board
from gemelo.firmware.platform.host.memory import StoredPosition
from gemelo.firmware.platform.host.virtual_esp32 import VirtualEsp32
from gemelo.firmware.platform.host.wires import Wires
from gemelo.libraries.arm.device.device_config import reference_steps
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.runtime.process.readiness import Readiness
from gemelo.libraries.runtime.process.unwritten import UnwrittenFiles
from gemelo.schemas.robot import Motor
from gemelo.tools.simulation.memory_wire import MemoryWire
from gemelo.tools.simulation.virtual_clock import VirtualClock

NAME = "virtual_esp32"
PERIOD = 0.02  # [s] between two turns of a board to which nothing comes: as often its state is due
PHASE = 0.0011  # [s] of a turn after its state is due: a slot of the firmware, and what begins it

log = logging.getLogger(NAME)
log.addHandler(logging.NullHandler())  # what it has to say comes as events


class SimulatedBoard:
    """A board that a virtual clock runs, as it does a loop."""

    def __init__(
        self, arm: ArmDescription, folder: Path, clock: VirtualClock, wire: MemoryWire, motors: Sequence[Motor]
    ) -> None:
        self._clock, self._wire = clock, wire
        self._due = self._beat = (
            clock.monotonic() + PHASE
        )  # [s] monotonic, of the next turn and the next without a frame
        unwritten = UnwrittenFiles(log.warning)
        board, readiness = Board(arm, folder, NAME, unwritten, motors, clock), Readiness(folder, NAME, unwritten)
        self._esp32 = VirtualEsp32(board, Wires(wire, None), inbox=wire.inbox, readiness=readiness, clock=clock)
        self._esp32.begin()
        clock.drive(self)

    def due(self) -> float:
        return self._due

    def turn(self) -> None:
        now = self._clock.monotonic()
        while self._beat <= now:
            self._beat += PERIOD
        self._due = self._beat
        self._esp32.turn(self._wire.take())

    def on_task(self, wake: object) -> None:
        """Frames for the board are its tasks."""
        self._wire.attach(self._arrived)
        self._wake = wake

    def _arrived(self) -> None:
        self._due = self._clock.monotonic()
        if callable(self._wake):
            self._wake()

    def close(self) -> None:
        self._clock.release(self)


def keep_position(folder: Path, arm: ArmDescription, positions: Mapping[str, float] | None, referenced: bool) -> None:
    """The memory of a board that was switched off at `positions` [rad] or [m] by joint, the others at their reference.

    `referenced`: the board knows where its joints stand.
    """
    steps = list(reference_steps(arm))
    for index, joint in enumerate(arm.joints):
        if positions is not None and joint.name in positions:
            steps[index] = round(joint.steps.to_steps(positions[joint.name]))
    kept = StoredPosition(
        device=arm.device.name, steps=tuple(steps), moving=False, referenced=referenced, shaft=tuple(steps)
    )
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{NAME}.json").write_bytes(msgspec.json.encode(kept))
