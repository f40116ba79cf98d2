"""mosquitto in place of this process (exec), so that a signal to this process ends mosquitto."""

from __future__ import annotations

import os
import select
import shutil
import signal
import socket
import ssl
import sys
from collections.abc import Callable
from pathlib import Path

from schemas.deployment import MqttSection
from services.mqtt import secure_folder

BEAT = 1.0  # [s]
PATIENCE = 1.5  # [s] for the handshake, and again for the answer: with BEAT less than the watchdog of its unit
# MQTT 3.1.1, 3.1: protocol, level 4, a session that leaves nothing, 5 s of keep-alive, no name, no user.
CONNECT = b"\x10\x0c\x00\x04MQTT\x04\x02\x00\x05\x00\x00"
CONNACK, DISCONNECT = b"\x20", b"\xe0\x00"
OPEN = "allow_anonymous true"
CONFIGURATION = "mosquitto.conf"


class NotInstalled(Exception):
    """There is no mosquitto on this machine; one sentence with the remedy."""


def find() -> str:
    """The path of mosquitto, also where Debian keeps it out of a user's PATH."""
    path = os.pathsep.join([os.environ.get("PATH", ""), "/usr/sbin", "/usr/local/sbin"])
    found = shutil.which("mosquitto", path=path)
    if found is None:
        raise NotInstalled(
            'the deployment says mqtt.broker = "mosquitto", but mosquitto is not installed: '
            "sudo apt-get install mosquitto, or GEMELO_MQTT_BROKER=amqtt"
        )
    return found


def serve(section: MqttSection, run: Path, beat: Callable[[], None], on_end: Callable[[], None]) -> int:
    """Becomes mosquitto; a child process calls `beat` once a second while it answers, and `on_end` when it has ended.

    Does not return in the process that becomes mosquitto.
    """
    program = find()
    conf = configuration_file(run, configuration(section))
    alive, held = os.pipe()
    if os.fork() == 0:
        os.close(held)
        _watch_broker(section, alive, beat, on_end)
        os._exit(0)
    os.close(alive)
    # Held open by mosquitto, never written: its end is seen by the companion whatever way it ends.
    os.set_inheritable(held, True)
    sys.stdout.flush()
    sys.stderr.flush()
    os.execv(program, [program, "-c", conf])


def configuration(section: MqttSection) -> str:
    """The text of mosquitto.conf: open, or with the lock that `gemelo broker secure` has made."""
    host, port = section.listening
    door = secure_folder.listener(Path(section.secure_folder)) if section.secure_folder else OPEN
    return secure_folder.mosquitto_conf(host, port, door)


def configuration_file(run: Path, text: str) -> str:
    """The path of a file with it in `run`; where that disk takes none, of one in memory that the program inherits."""
    try:
        run.mkdir(parents=True, exist_ok=True)
        (run / CONFIGURATION).write_text(text)
    except OSError:
        held = os.memfd_create(CONFIGURATION, 0)
        os.write(held, text.encode())
        return f"/proc/self/fd/{held}"
    return str(run / CONFIGURATION)


def _watch_broker(section: MqttSection, alive: int, beat: Callable[[], None], on_end: Callable[[], None]) -> None:
    for number in (signal.SIGTERM, signal.SIGINT):  # they are mosquitto's; this one ends with it
        signal.signal(number, signal.SIG_IGN)
    interval = 0.02
    while not select.select([alive], [], [], interval)[0]:
        if _answers(section):
            interval = BEAT
            beat()
    on_end()


def _answers(section: MqttSection) -> bool:
    """It says yes or no to a client: the kernel accepts connections also for one that stands still."""
    try:
        with socket.create_connection(section.listening, timeout=PATIENCE) as plain, _wrapped(section, plain) as link:
            link.sendall(CONNECT)
            answer = link.recv(4)
            link.sendall(DISCONNECT)
    except OSError:
        return False
    return answer.startswith(CONNACK)


def _wrapped(section: MqttSection, link: socket.socket) -> socket.socket:
    if not section.secure_folder:
        return link
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    # It is our own broker, at our own address; one whose certificate has ended still answers.
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    return context.wrap_socket(link)
