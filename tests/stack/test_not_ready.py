"""A stack that does not become ready says of each process why, and what it printed last."""

from __future__ import annotations

import re
import signal
import socket

import pytest

from gemelo.tools.stack.stack import Stack, StackError, free_ports
from tests.runtime.support import until


def test_a_stack_that_does_not_start_says_of_each_process_why(tmp_path):
    """The broker's port is taken, and nobody tells the state publisher where the joints are."""
    (port,) = free_ports(1)
    stack = Stack(
        out=tmp_path,
        processes=("router", "broker", "state_publisher"),
        environment={"GEMELO_MQTT_PORT": str(port)},
        ready_timeout=15.0,
    )
    with socket.create_server(("127.0.0.1", port)), pytest.raises(StackError) as raised:
        stack.__enter__()
    broker, publisher = raised.value.unready
    assert broker.name == "broker"
    assert re.search(r"started anew \d+ times, last exit code 1\)", broker.reason)
    assert f"port {port} on 127.0.0.1 is taken" in broker.lines[-1]
    assert publisher.name == "state_publisher"
    assert publisher.reason.startswith("no fresh joint_states; see that the stepper_gateway runs (process ")
    for each in (broker, publisher):
        assert str(each) in str(raised.value)


def test_a_frozen_process_is_called_frozen_and_one_that_is_ready_is_not_named(tmp_path):
    with Stack(out=tmp_path, processes=("router", "broker")) as stack:
        assert stack.why_not_ready() == ()
        pid = stack.kill("broker", signal.SIGSTOP)
        try:
            assert until(stack.why_not_ready, 60.0)
            (broker,) = stack.why_not_ready()
            assert broker.name == "broker"
            assert broker.reason == f"it is frozen (SIGSTOP): kill -CONT {pid} lets it go on"
            assert any("listens on" in line for line in broker.lines)
        finally:
            stack.kill("broker", signal.SIGCONT)
