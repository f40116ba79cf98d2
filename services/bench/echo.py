"""A bare MQTT echo in processes of its own: what the broker alone makes of a chunk and its acknowledgement.

`python -m services.bench.echo` asks: QoS 1 there as chunks are sent, QoS 0 back as they are acknowledged, TCP_NODELAY
on both sides; prints the round trips [ms] as JSON.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import socket
import struct
import sys
import threading
import time
from typing import Any

from paho.mqtt.client import Client, MQTTMessage
from paho.mqtt.enums import CallbackAPIVersion

THERE, BACK = "gemelo-bench/there", "gemelo-bench/back"
PATIENCE = 5.0  # [s]
_COUNT = struct.Struct("<I")


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--port", type=int, required=True)
    parser.add_argument("--bytes-there", type=int, required=True)
    parser.add_argument("--bytes-back", type=int, required=True)
    parser.add_argument("--rate", type=float, required=True, help="[Hz]")
    parser.add_argument("--count", type=int, required=True)
    options = parser.parse_args()
    ready = multiprocessing.Event()
    echo = multiprocessing.Process(target=serve, args=(options.port, options.bytes_back, ready), daemon=True)
    echo.start()
    if not ready.wait(PATIENCE):
        sys.exit("the echo did not connect")
    print(json.dumps(ask(options.port, options.bytes_there, options.rate, options.count)))
    echo.terminate()
    echo.join()


def send_at_once(client: Client, userdata: object, opened: Any) -> None:
    """Without this Nagle and delayed acknowledgements cost 40 ms."""
    opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)


def connected(port: int, subscribe_to: str, name: str) -> Client:
    """A client with TCP_NODELAY that has subscribed."""
    client = Client(CallbackAPIVersion.VERSION2, client_id=f"bench-{name}-{time.time_ns()}")
    subscribed = threading.Event()
    client.on_socket_open = send_at_once
    client.on_connect = lambda c, userdata, flags, code, properties: c.subscribe(subscribe_to, qos=1)
    client.on_subscribe = lambda c, userdata, message, codes, properties: subscribed.set()
    client.connect("127.0.0.1", port)
    client.loop_start()
    if not subscribed.wait(PATIENCE):
        sys.exit("no subscription")
    return client


def serve(port: int, size: int, ready: threading.Event) -> None:
    """Answers for ever."""
    filler = bytes(size - _COUNT.size)
    client = connected(port, THERE, "echo")

    def on_message(client: Client, userdata: object, message: MQTTMessage) -> None:
        client.publish(BACK, bytes(message.payload[: _COUNT.size]) + filler, qos=0)

    client.on_message = on_message
    ready.set()
    threading.Event().wait()


def ask(port: int, size: int, rate: float, count: int) -> list[float]:
    """[ms] of every round trip that came back."""
    sent: dict[int, float] = {}
    took: list[float] = []

    def on_message(client: Client, userdata: object, message: MQTTMessage) -> None:
        number = _COUNT.unpack(message.payload[: _COUNT.size])[0]
        took.append((time.perf_counter() - sent[number]) * 1e3)

    client = connected(port, BACK, "ask")
    client.on_message = on_message
    filler = bytes(size - _COUNT.size)
    began = time.perf_counter()
    for number in range(count):
        time.sleep(max(0.0, began + number / rate - time.perf_counter()))
        sent[number] = time.perf_counter()
        client.publish(THERE, _COUNT.pack(number) + filler, qos=1)
    time.sleep(0.5)
    client.disconnect()
    client.loop_stop()
    return took


if __name__ == "__main__":
    main()
