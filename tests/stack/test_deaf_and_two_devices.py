"""A device that speaks and does not hear, and a second one of its name, as a person at the command line finds them."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import gemelo
from gemelo.firmware.platform.host.flash import Flash, NetworkCredentials
from gemelo.libraries.runtime.process.unwritten import UnwrittenFiles
from gemelo.tools.stack.stack import Stack
from tests.mqtt.packet_proxy import PacketProxy
from tests.stack.gemelo import COMMAND
from tests.stack.person import Operator
from tests.stacks.shared import NEEDED, found_by_scripts

PUBLISH = 3  # of an MQTT packet's first four bits
ENDS = 20.0  # [s] of a command on a loaded machine; by the gateway's clock it is 2 s
NOTICED = 10.0  # [s] on a loaded machine
SPEAKS, TWO = "speaks and does not hear", 'two devices call themselves "rm1"'


class DevicesWay:
    """A proxy between a device and its broker; while `is_deaf`, nothing that is published reaches the device."""

    def __init__(self, broker: int) -> None:
        """`broker` is its port."""
        self.is_deaf = False
        self._proxy = PacketProxy(broker, to_client=lambda packet: not (self.is_deaf and packet[0] >> 4 == PUBLISH))
        self.port, self.close = self._proxy.port, self._proxy.close


class Site:
    """A stack whose device has been provisioned with the way."""

    def __init__(self, stack: Stack, way: DevicesWay) -> None:
        self.stack, self.way = stack, way

    def typed(self, *words: str, ends: float = ENDS) -> tuple[int, str]:
        """The exit code of a command and all that it has printed; it ends within `ends` [s]."""
        done = subprocess.run(
            [*COMMAND, *words],
            cwd=self.stack.root, env=self.stack.environment, capture_output=True, text=True, timeout=ends, check=False,
        )  # fmt: skip
        return done.returncode, done.stdout + done.stderr

    def looks(self) -> dict[str, str]:
        """What a person finds who looks."""
        commands = (("state",), ("device", "status"), ("doctor",))
        return {" ".join(words): self.typed(*words)[1] for words in commands}

    def moves_again(self) -> None:
        self.stack.wait_ready(120.0)
        operator = Operator(self.stack)
        try:
            outcome, _ = operator.move_again()
        finally:
            operator.close()
        assert outcome.result.executed_steps == outcome.result.commanded_steps


@pytest.fixture(scope="module")
def site() -> Iterator[Site]:
    stack = Stack(processes=NEEDED)
    way = DevicesWay(int(stack.deployment["GEMELO_MQTT_PORT"]))
    stack.run.mkdir(parents=True)
    flash = Flash(stack.run / "virtual_esp32_flash.json", "rm1", UnwrittenFiles(print))
    flash.keep_credentials(NetworkCredentials(mqtt_uri=f"mqtt://127.0.0.1:{way.port}"))
    try:
        with stack:
            yield Site(stack, way)
    finally:
        way.close()


def test_what_is_sent_to_a_device_that_does_not_hear_ends_and_a_person_is_told_why_and_since_when(site: Site) -> None:
    site.moves_again()
    site.way.is_deaf = True
    began = time.monotonic()
    try:
        for words in (("move", "--named", "ready"), ("move", "--named", "home"), ("stop",)):
            code, said = site.typed(*words)
            assert code != 0, said
            assert SPEAKS in said, said
            assert "Traceback" not in said
        with found_by_scripts(site.stack), gemelo.connect(timeout=60.0) as arm:
            asked = time.monotonic()
            with pytest.raises((gemelo.Refused, gemelo.Aborted), match=SPEAKS):
                arm.move(named="ready")
            assert time.monotonic() - asked < ENDS
        for command, shown in site.looks().items():
            assert SPEAKS in shown, command
            assert "a loose TX wire" in shown, command
            assert "offline" not in shown.lower(), command
            assert "(for " in shown, command
        assert time.monotonic() - began > 3.0
        assert "measured " in site.looks()["device status"]
    finally:
        site.way.is_deaf = False
    site.moves_again()
    assert "measured" not in site.typed("device", "status")[1]


def test_a_forgotten_second_device_is_named_and_nothing_moves_until_it_is_gone(site: Site, tmp_path: Path) -> None:
    site.moves_again()
    environment = {**site.stack.environment, "GEMELO_PATHS_RUN": str(tmp_path / "run")}
    second = subprocess.Popen(
        [sys.executable, "-m", "gemelo.services.virtual_esp32.main"], cwd=site.stack.root, env=environment,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        operator = Operator(site.stack)
        assert operator.wait_for(lambda: not site.stack.is_ready("stepper_gateway"), NOTICED)
        operator.close()
        for words in (("move", "--named", "ready"), ("home",)):
            code, said = site.typed(*words)
            assert code != 0, said
            assert TWO in said, said
        for command, shown in site.looks().items():
            assert TWO in shown, command
            assert f"process {second.pid} on " in shown, command
            assert str(tmp_path / "run") in shown, command
            assert shown.count("virtual") >= 2, command
    finally:
        second.terminate()
        second.wait(20.0)
    site.moves_again()
