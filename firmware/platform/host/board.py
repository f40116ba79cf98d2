"""A virtual board: what it keeps over a restart, and the device that wakes up from it."""

from __future__ import annotations

import json
import logging
from collections.abc import Sequence
from pathlib import Path

import msgspec

from gemelo.firmware.bindings.device import ConfigError, CoreDevice, joint_count
from gemelo.firmware.bindings.parsers import ProvisionRefused, asks_for_factory_reset
from gemelo.firmware.platform.host.firmware_slots import Booted, FirmwareSlots
from gemelo.firmware.platform.host.flash import Flash, NetworkCredentials
from gemelo.firmware.platform.host.memory import BootState, PositionStore, StoredPosition
from gemelo.libraries.arm.device.device_config import device_config, reference_steps
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.arm.model.jaws import gripper_unit
from gemelo.libraries.runtime.clock import SYSTEM, Clock
from gemelo.libraries.runtime.process.unwritten import UnwrittenFiles, remedy_of
from gemelo.schemas.device_config import config_text
from gemelo.schemas.robot import Motor


class DeviceClock:
    """Device time [us], continuous, of real time [s]; exact until somebody lets it drift."""

    def __init__(self, real: float, device_us: int = 0) -> None:
        self._real, self._device_us, self._ppm = real, float(device_us), 0.0

    def at(self, real: float) -> int:
        """Device time [us] at the real time [s]; never below zero."""
        return max(0, int(self._exact(real)))

    def drift(self, real: float, ppm: float) -> None:
        """From the real time [s] on the clock is fast by `ppm`, in millionths."""
        self._device_us, self._real, self._ppm = self._exact(real), real, ppm

    def restart(self, real: float) -> None:
        """Count from zero again at the real time [s]; the quartz is the same."""
        self._real, self._device_us = real, 0.0

    def _exact(self, real: float) -> float:
        return self._device_us + (real - self._real) * (1e6 + self._ppm)


log = logging.getLogger("virtual_esp32")


class Board:
    """One board of an arm's; its files lie in `folder`.

    It leaves the factory with the configuration that robot.toml asks for, and the arm in its reference pose. The motors
    are robot.toml's, or those of `motors`, one for each joint.
    """

    def __init__(
        self,
        arm: ArmDescription,
        folder: Path,
        name: str,
        unwritten: UnwrittenFiles,
        motors: Sequence[Motor] = (),
        clock: Clock = SYSTEM,
    ) -> None:
        """`unwritten` gets what the disk refuses; the board runs on without."""
        self._clock = clock
        self._factory = config_text(device_config(arm))
        self._reference = reference_steps(arm)
        self._gripper = arm.gripper
        self._gripper_unit = gripper_unit(arm)
        self._motors = tuple(motors) or tuple(joint.drive.motor for joint in arm.joints)
        self.name = arm.device.name
        self._flash = Flash(folder / f"{name}_flash.json", self.name, unwritten)
        self._memory = PositionStore(folder / f"{name}.json", self.name, unwritten)
        self.firmware = FirmwareSlots(folder, name, lambda: self.credentials.update_key, unwritten)
        self._shaft: tuple[int, ...] = ()  # [steps] where the arm truly is; empty: as the memory has it
        self._crc32 = 0  # of the configuration that the flash has
        self.is_on_trial = False  # the firmware that runs, until it has said status to somebody

    @property
    def credentials(self) -> NetworkCredentials:
        return self._flash.credentials

    @property
    def device_name(self) -> str:
        """Part of every topic."""
        return self._flash.credentials.device or self.name

    def boot(self, reset_cause: str = "") -> CoreDevice:
        """The device after a reset; `reset_cause` says why, unless its memory knows better."""
        kept = self._flash.configuration
        text = self._factory if kept is None else kept.encode()
        booted = self.firmware.boot()
        self.is_on_trial = booted.is_on_trial
        cause = "update_rolled_back" if booted.is_rolled_back else reset_cause
        try:
            return self._boot(text, cause, booted)
        except ConfigError as error:
            log.warning("%s; the board starts without a configuration", error)
            return self._boot(b"", cause, booted)

    def remember(self, device: CoreDevice) -> None:
        """Keep what a restart must find; to be called often, writes seldom.

        A firmware on trial is not asked: it may say anything.
        """
        self.firmware.remember()
        if self.is_on_trial:
            return
        present = device.lasting
        crc32 = present.config_crc32
        if crc32 != self._crc32 and self._flash.keep_configuration(device.kept_config.decode()):
            self._crc32 = crc32
        if not present.steps:
            return
        self._shaft = present.shaft
        self._memory.keep(
            StoredPosition(
                device=self.name,
                steps=present.steps,
                moving=not present.still,
                referenced=present.referenced,
                shaft=self._shaft,
            )
        )

    def provision(self, said: dict[str, str]) -> None:
        """Keep these fields of the credentials, and the others as they were; they count from the next boot on.

        Raises OSError.
        """
        self._flash.keep_credentials(msgspec.structs.replace(self._flash.credentials, **said))

    def factory_reset(self) -> None:
        """Forget configuration, credentials and position; the arm stays where it is. Raises OSError."""
        self._flash.forget()
        nowhere = (0,) * len(self._reference)
        self._memory.keep(
            StoredPosition(
                device=self.name, steps=nowhere, moving=False, referenced=False, shaft=self._shaft or nowhere
            )
        )

    def _boot(self, text: bytes, reset_cause: str, booted: Booted) -> CoreDevice:
        boot_state = self._memory.wake(self._reference)
        self._shaft = self._shaft or boot_state.shaft
        count = joint_count(text)
        is_known = count == len(boot_state.steps)
        device = CoreDevice(
            text or None,
            boot_id=self._clock.bits(32) or 1,
            steps=boot_state.steps if is_known else (0,) * count,
            referenced=boot_state.referenced and is_known,
            reset_cause=_cause(boot_state, reset_cause),
            motors=self._motors,
            shaft=self._shaft,
            gripper=self._gripper,
            gripper_unit=self._gripper_unit,
            library=booted.library,
            slot=booted.slot,
        )
        device.attach_firmware_slot(self.firmware)
        self._crc32 = device.config_crc32
        return device


def _cause(boot_state: BootState, reset_cause: str) -> str:
    return reset_cause if reset_cause and boot_state.reset_cause == "power_on" else boot_state.reset_cause


def provision(board: Board, device: CoreDevice, text: bytes) -> str:
    """Do what `text` asks for; why the device now starts anew. Raises ProvisionRefused."""
    is_reset = asks_for_factory_reset(text)
    if not device.still:
        raise ProvisionRefused("the device moves: stop it first")
    try:
        if is_reset:
            board.factory_reset()
            return "factory_reset"
        said = msgspec.json.decode(text, type=dict[str, str | bool])
        said.pop("factory_reset", None)
        board.provision({key: str(value) for key, value in said.items()})
        return "provisioned"
    except OSError as error:
        raise ProvisionRefused(f"its flash cannot be written ({error.strerror}): {remedy_of(error)}") from error


def provision_answer(refusal: str = "") -> bytes:
    """The JSON of `provision/ack`."""
    return json.dumps({"accepted": not refusal, "reason": refusal}).encode()
