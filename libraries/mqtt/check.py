"""One attempt to join a broker, and why it fails."""

from __future__ import annotations

import contextlib
import queue
import secrets

from paho.mqtt import client as paho

from gemelo.libraries.mqtt.access import BrokerAccess
from gemelo.libraries.mqtt.client import OLD_BROKER, MqttClient, code_of, is_failure
from gemelo.libraries.mqtt.failures import failure, refusal, silence
from gemelo.schemas.reasons import Reason, because

PATIENCE = 3.0  # [s] for an answer to CONNECT


def problem(access: BrokerAccess) -> Reason | None:
    """Why the broker does not let us in; None if it does."""
    answers: queue.SimpleQueue[Reason | None] = queue.SimpleQueue()
    client = MqttClient(access, f"gemelo-check-{secrets.token_hex(6)}")

    def on_connect(_client: paho.Client, _data: object, _flags: object, reason: object, _props: object) -> None:
        is_no = is_failure(reason) and code_of(reason) != OLD_BROKER
        answers.put(refusal(code_of(reason), str(reason), access) if is_no else None)

    def on_disconnect(*_: object) -> None:
        answers.put(failure(client.failure, access) if client.failure else silence(access))

    client.on_connect, client.on_disconnect = on_connect, on_disconnect
    try:
        client.connect(access.host, access.port)
    except OSError as error:
        return failure(error, access)
    client.loop_start()
    try:
        return answers.get(timeout=PATIENCE)
    except queue.Empty:
        return because("broker.no_answer", broker=access.place, time=PATIENCE)
    finally:
        with contextlib.suppress(OSError, ValueError):
            client.disconnect()
        client.loop_stop()
