"""A gateway's host that is cut off from the logger's: what it says meanwhile is kept there, and comes afterwards."""

from __future__ import annotations

from contextlib import closing

from msgspec.structs import replace

from gemelo.libraries.recordings.subscriptions import Subscriptions
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.device import GatewayInputs
from gemelo.schemas.joints import JointState
from gemelo.schemas.system import LogRecord
from gemelo.schemas.topics import GATEWAY, GATEWAY_INPUTS, JOINT_STATES, LOG
from gemelo.tools.chaos.slow_link import SlowLink
from tests.runtime.support import RouterProcess, free_port, hear, until

MINUTE = range(2, 122)  # two batches of what the gateway was given a second
BACK = 10.0  # [s]


def test_the_minute_of_a_gateway_that_is_cut_off_comes_when_its_link_is_back(tmp_path) -> None:
    router, port = RouterProcess(tmp_path), free_port()
    far = replace(router.deployment, router=replace(router.deployment.router, port=port))
    inputs: list[int] = []
    logs: list[int] = []
    states: list[int] = []
    kept = {GATEWAY_INPUTS.key: inputs, LOG.key: logs, JOINT_STATES.key: states}
    try:
        with closing(SlowLink(port, router.port)) as link, Node(GATEWAY, far, robot="rm1") as gateway, \
                Node("logger", router.deployment, robot="rm1") as logger:  # fmt: skip
            Subscriptions(logger, lambda topic, message: kept[topic.key].append(message.stamp), kept.__contains__)

            def say(stamp: int) -> None:
                gateway.publisher(GATEWAY_INPUTS).put(GatewayInputs(stamp=stamp))
                gateway.publisher(LOG).put(LogRecord(stamp=stamp))
                gateway.publisher(JOINT_STATES).put(JointState(stamp=stamp))

            assert hear(logger, lambda: say(1) or all(kept.values()))
            link.cut()
            assert until(lambda: not gateway.is_connected)
            for stamp in MINUTE:
                say(stamp)
            link.heal()
            assert hear(logger, lambda: inputs[-1] == logs[-1] == MINUTE[-1], BACK), (inputs[-3:], logs[-3:])
            assert inputs[-len(MINUTE) :] == logs[-len(MINUTE) :] == list(MINUTE)
            assert set(states) == {1}  # they are in what the gateway was given: `gemelo replay FILE stepper_gateway`
    finally:
        router.kill()
