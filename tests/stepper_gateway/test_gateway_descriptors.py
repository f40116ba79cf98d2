"""Links of a process that has no descriptor left: each says so, goes on trying, and connects when there are some."""

from __future__ import annotations

import os
import pty
from contextlib import closing

import pytest

from gemelo.firmware.bindings.library import load_library
from gemelo.libraries.mqtt.access import gateway_access
from gemelo.schemas.deployment import MqttSection
from gemelo.services.stepper_gateway.links.foreign.ra_link import RaLink
from gemelo.services.stepper_gateway.links.mqtt import MqttLink
from gemelo.services.stepper_gateway.links.serial import SerialLink
from gemelo.tools.virtual_arm.virtual_arm import rm1
from tests.descriptors import few_descriptors
from tests.runtime.support import until
from tests.stepper_gateway.processes import Processes

NONE_LEFT = "no descriptor"


@pytest.fixture
def access(tmp_path):
    processes = Processes("mosquitto", tmp_path)
    try:
        processes.start_broker()
        yield gateway_access(MqttSection(port=processes.port))
    finally:
        processes.close()


@pytest.mark.parametrize("free", [0, 1], ids=["none for a connection", "none to wake its thread"])
@pytest.mark.parametrize("kind", [MqttLink, RaLink])
def test_a_link_to_a_broker_outlives_the_want_of_descriptors(access, kind, free):
    load_library()  # as it is in a gateway that has started
    device = "rm1" if kind is MqttLink else rm1()
    with few_descriptors(free):
        link = kind(access, device, lambda: None)
        seen = until(lambda: NONE_LEFT in str(link.reason), 60.0)
    with closing(link):
        assert seen, link.reason
        assert until(lambda: link.connected, 60.0), link.reason


def test_a_serial_link_outlives_the_want_of_descriptors():
    board, line = pty.openpty()
    try:
        port = os.ttyname(line)
        with few_descriptors():
            link = SerialLink(port, 921_600, lambda: None)
            seen = until(lambda: NONE_LEFT in str(link.reason), 60.0)
        with closing(link):
            assert seen, link.reason
            assert until(lambda: link.connected, 60.0), link.reason
    finally:
        os.close(board)
        os.close(line)
