"""A gateway whose process was stopped: silent until it knows that no other has its place, then it goes on or ends.

Its loop really stands still here, as after SIGSTOP; the bus is in memory.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.runtime.bus.identity import identify
from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.bus.name_holder import AGAIN, STOPPED
from gemelo.libraries.runtime.errors import NodeNameTaken
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.schemas.deployment import Deployment, PathsSection
from gemelo.schemas.device import DeviceStopRequest, StopKind
from gemelo.schemas.topics import DEVICE_STOP
from gemelo.services.stepper_gateway.core import GatewayCore
from gemelo.services.stepper_gateway.inputs import BeganInput
from gemelo.services.stepper_gateway.ledger.ledger_file import LedgerFile
from gemelo.services.stepper_gateway.links.link import Kind, Received
from gemelo.services.stepper_gateway.parameters import GatewayParameters
from gemelo.services.stepper_gateway.shell import Shell
from tests.runtime.support import ROOT, spinning, until

STAND = 1.5 * STOPPED  # [s]
REGULAR = (Kind.HB, Kind.SYNC)


class RecordingLink:
    """Connected to nobody; keeps what is sent, and when."""

    connected, reason = True, ""

    def __init__(self) -> None:
        self.sent: list[tuple[float, Kind]] = []  # [s] monotonic

    def send(self, kind: Kind, _payload: bytes, urgent: bool = False) -> bool:
        self.sent.append((time.monotonic(), kind))
        return True

    def take(self, _most: int) -> list[Received]:
        return []

    def close(self) -> None:
        pass

    def since(self, when: float) -> list[Kind]:
        """What has been sent since `when` [s] monotonic."""
        return [kind for at, kind in self.sent if at >= when]


class Rig:
    """A gateway on a bus, whose loop can be made to stand still."""

    def __init__(self, folder: Path) -> None:
        self.network, self.link = MemoryNetwork(), RecordingLink()
        self.deployment = Deployment(
            robot="urdf/rm1", paths=PathsSection(out=str(folder / "out"), run=str(folder / "run"))
        )
        self.node = self.joined("stepper_gateway")
        parameters = self.node.parameters(GatewayParameters)
        self.ledger = LedgerFile(folder, "rm1", self.node.unwritten)
        core = GatewayCore(load_arm(ROOT / "urdf/rm1"), 1, parameters.value)
        self.shell = Shell(self.node, core, BeganInput(1, parameters.value), parameters, self.ledger)
        self.shell.use(self.link)

    def joined(self, name: str) -> Node:
        return Node(name, self.deployment, robot="rm1", bus=MemoryBus(self.network), stop=ShutdownRequest())

    def stand_still(self, meanwhile: Callable[[], object]) -> float:
        """The loop stands still for STAND; `meanwhile` happens at its end. [s] monotonic of that."""
        ended: list[float] = []
        done = threading.Event()

        def stand() -> None:
            time.sleep(STAND)  # the stop itself
            meanwhile()
            ended.append(time.monotonic())
            done.set()

        self.node.post(stand)
        assert done.wait(STAND + 10.0)
        return ended[0]

    def close(self) -> None:
        self.node.close()
        self.ledger.close()


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    with closing(Rig(tmp_path)) as rig:
        yield rig


def test_a_gateway_that_was_stopped_sends_nothing_until_it_is_certain_and_then_goes_on(rig: Rig) -> None:
    with spinning(rig.node, rig.shell.step):
        assert until(lambda: bool(rig.link.sent))
        thawed = rig.stand_still(lambda: None)
        assert until(lambda: bool(rig.link.since(thawed)))
        assert min(at for at, _ in rig.link.sent if at >= thawed) - thawed >= 0.9 * AGAIN


def test_a_stop_of_a_person_is_sent_also_meanwhile(rig: Rig) -> None:
    with closing(rig.joined("cli-1")) as person, spinning(rig.node, rig.shell.step), spinning(person):
        assert until(lambda: bool(rig.link.sent))
        thawed = rig.stand_still(lambda: None)
        person.ask(DEVICE_STOP, DeviceStopRequest(kind=StopKind.STOP), 3.0, lambda: None)
        assert until(lambda: bool(rig.link.since(thawed)))
        assert rig.link.since(thawed)[0] is Kind.CMD


def test_a_gateway_whose_place_was_taken_meanwhile_never_sends_again_and_ends(rig: Rig) -> None:
    bus = MemoryBus(rig.network)
    newer = replace(identify("stepper_gateway"), pid=4711, host="desk")
    thawed: list[float] = []

    def run() -> None:
        thawed.append(rig.stand_still(lambda: bus.declare_alive(newer.key)))

    other = threading.Thread(target=run, daemon=True)
    other.start()
    with pytest.raises(NodeNameTaken, match="has started since this one"):
        rig.node.spin(rig.shell.step)
    other.join(60.0)
    assert rig.link.since(thawed[0]) == []
