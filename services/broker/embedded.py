"""amqtt in this process: enough for a simulated arm, with nothing to install."""

from __future__ import annotations

import asyncio
import logging
import signal
from collections.abc import Callable

from amqtt.broker import Broker

from schemas.deployment import MqttSection

BEAT = 1.0  # [s]


def serve(section: MqttSection, beat: Callable[[], None]) -> int:
    """Runs until SIGTERM or SIGINT, calling `beat` once a second while it serves; the exit code."""
    for chatty in ("amqtt", "transitions", "asyncio"):
        logging.getLogger(chatty).setLevel(logging.ERROR)
    asyncio.run(_serve(section, beat))
    return 0


async def _serve(section: MqttSection, beat: Callable[[], None]) -> None:
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, stop.set)
    # asyncio sets TCP_NODELAY on every connection it accepts, without which a command waits 40 ms.
    broker = Broker(_settings(section))
    await broker.start()
    try:
        while not stop.is_set():
            beat()
            await _wait(stop, BEAT)
    finally:
        await broker.shutdown()


async def _wait(stop: asyncio.Event, seconds: float) -> None:
    try:
        await asyncio.wait_for(stop.wait(), seconds)
    except TimeoutError:
        return


def _settings(section: MqttSection) -> dict[str, object]:
    host, port = section.listening
    return {
        "listeners": {"default": {"type": "tcp", "bind": f"{host}:{port}"}},
        "plugins": {"amqtt.plugins.authentication.AnonymousAuthPlugin": {"allow_anonymous": True}},
    }
