"""`gemelo device provision`: gives a board its networks over its serial line, without the stack."""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol, TypeVar

import msgspec

from gemelo.libraries.runtime.serial_frames import (
    JsonFrame,
    PacketDecoder,
    disarm_frame,
    json_frame,
    packet,
    parse_json_frame,
    sync_frame,
)
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.tools.cli.common.errors import CommandError, ExitCode, usage
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.terminal import confirm
from gemelo.tools.cli.hosts.credentials import (
    MQTT_DEVICE_PASSWORD,
    MQTT_PASSWORD,
    WIFI_PASSWORD,
    CredentialsChange,
    certificate,
    password,
    private_key,
    require_sound,
    update_key,
)
from gemelo.tools.cli.parser import Options, Parser, positive_integer

T = TypeVar("T", bound=msgspec.Struct)

BAUD = 921_600
PATIENCE = 15.0  # [s] for a board to start and answer
AGAIN = 2.0  # [s] between two tries
TO_RESTART = 8.0  # [s] for the first message after it
PASSWORDS = """Passwords are no arguments, because every user of a machine sees those: they are asked for, or taken from
$GEMELO_WIFI_PASSWORD and $GEMELO_MQTT_DEVICE_PASSWORD (else $GEMELO_MQTT_PASSWORD), or read as lines of standard
input, in this order."""


def add_options(parser: Parser) -> None:
    """Adds port, names, networks and --factory-reset."""
    parser.add_argument("--serial", required=True, metavar="PORT", help="as /dev/ttyUSB0")
    parser.add_argument("--baud", type=positive_integer, default=BAUD, metavar="BAUD", help="921600 if not said")
    add_network_options(parser)
    parser.add_argument("--factory-reset", action="store_true", help="forget everything, configuration included")
    parser.add_argument("-y", "--yes", action="store_true", help="do not ask before a factory reset")
    parser.epilog = f"{PASSWORDS}\n\n{parser.epilog}"


def add_network_options(parser: Parser) -> None:
    """Adds what a board can be told over its line: its name, networks, certificates and rate."""
    parser.add_argument("--device", metavar="NAME", help="its name: that of [device] in robot.toml")
    parser.add_argument("--wifi-ssid", metavar="NAME", help="the network; its password is asked for")
    parser.add_argument("--mqtt-uri", metavar="URI", help="as mqtt://host:1883, or mqtts://host:8883")
    parser.add_argument("--mqtt-user", metavar="NAME", help="at the broker; its password is asked for")
    parser.add_argument("--mqtt-ca", type=Path, metavar="FILE", help="the certificate that mqtts trusts, PEM")
    parser.add_argument("--mqtt-cert", type=Path, metavar="FILE", help="its own certificate for mqtts, PEM")
    parser.add_argument("--mqtt-key", type=Path, metavar="FILE", help="the key of that certificate, PEM, mode 600")
    parser.add_argument(
        "--update-key", type=Path, metavar="FILE", help="the public key of `gemelo device update --make-key`"
    )
    parser.add_argument(
        "--serial-baud",
        type=positive_integer,
        metavar="BAUD",
        help="of its serial line from now on, as 115200 for a driver of <SEQ,...>; then also [serial] baud",
    )


def run(options: Options) -> ExitCode:
    """Provisions the board, or resets it to its factory state after asking."""
    given = (
        options.device, options.wifi_ssid, options.mqtt_uri, options.mqtt_user, options.mqtt_ca, options.mqtt_cert,
        options.mqtt_key, options.update_key, options.serial_baud,
    )  # fmt: skip

    if options.factory_reset:
        if any(each is not None for each in given):
            raise usage(because("provision.reset_alone"))
        confirm(because("provision.ask_reset", port=str(options.serial)), options.yes)
        return provision(options.serial, options.baud, CredentialsChange(factory_reset=True))
    return provision(options.serial, options.baud, credentials_of(options, options.device))


def credentials_of(options: Options, device: str | None) -> CredentialsChange:
    """What the options say, and the passwords that they want; raises `CommandError`."""
    wifi, mqtt = options.wifi_ssid, options.mqtt_user
    credentials = CredentialsChange(
        device=device,
        wifi_ssid=wifi,
        mqtt_uri=options.mqtt_uri,
        mqtt_user=mqtt,
        mqtt_ca=certificate(options.mqtt_ca),
        mqtt_certificate=certificate(options.mqtt_cert, "--mqtt-cert"),
        mqtt_key=private_key(options.mqtt_key),
        update_key=update_key(options.update_key),
        serial_baud=None if options.serial_baud is None else str(options.serial_baud),
        wifi_password=None if wifi is None else password("wifi", WIFI_PASSWORD, os.environ),
        mqtt_password=None if mqtt is None else password("mqtt", MQTT_PASSWORD, os.environ, MQTT_DEVICE_PASSWORD),
    )
    return require_sound(credentials)


class BoardLine(Protocol):
    """A serial line; `read` waits a moment at most."""

    def write(self, data: bytes, /) -> int | None: ...
    def read(self, size: int = 1, /) -> bytes: ...


class ProvisionAnswer(msgspec.Struct, frozen=True):
    """The JSON of `provision/ack`."""

    accepted: bool
    reason: str = ""


class BoardStatus(msgspec.Struct, frozen=True):
    """The fields of the JSON of `status` that are printed; memory in bytes."""

    device: str = ""
    firmware: str = ""
    heap_free: int = 0
    heap_least: int = 0
    stack_least: int = 0
    stack_task: str = ""


class ConfigAnswer(msgspec.Struct, frozen=True):
    """The JSON of `config/ack`."""

    crc32: int
    accepted: bool
    part: str = ""
    reason: str = ""


def provision(port: str, baud: int, credentials: CredentialsChange) -> ExitCode:
    """Sends the credentials and prints the answer; raises `CommandError` if the board refuses or is silent."""
    with open_line(port, baud) as line:
        exchange = BoardExchange(line)
        answer = exchange.send(credentials.text())
        if not answer.accepted:
            raise CommandError(refusal(answer.reason))
        done = because("provision.forgotten") if credentials.factory_reset else because(
            "provision.taken", what=credentials.summary()
        )  # fmt: skip
        print(sentence(done), flush=True)
        who = exchange.status()
    if who is None:
        print(sentence(because("provision.silent_since", time=TO_RESTART)))
    elif who.device:
        print(sentence(because("provision.back", device=who.device, firmware=who.firmware)))
    else:
        print(sentence(because("provision.back.unnamed", firmware=who.firmware)))
    return ExitCode.OK


class BoardExchange:
    """The exchange of frames with one board."""

    def __init__(self, line: BoardLine) -> None:
        self._line = line
        self._packets = PacketDecoder()
        self._came: deque[bytes] = deque()  # frames behind an answer
        self.newest_status: BoardStatus | None = None  # of this exchange

    def send(self, text: bytes, patience: float = PATIENCE) -> ProvisionAnswer:
        """Sends `text` until the board answers: opening the port may have restarted it.

        Raises `CommandError` without an answer in `patience` [s].
        """
        ack = self._exchange(packet(json_frame(JsonFrame.PROVISION, text)), JsonFrame.PROVISION_ACK, patience, AGAIN)
        if ack is None:
            raise CommandError(because("provision.no_answer", time=patience))
        return decoded(ack, ProvisionAnswer)

    def configure(self, text: bytes, patience: float = PATIENCE) -> None:
        """Disarms the board and sends it the configuration.

        Raises `CommandError` where it refuses, or says nothing for `patience` [s].
        """
        self._line.write(packet(disarm_frame(time.time_ns() & 0xFFFF_FFFF)))
        question = packet(json_frame(JsonFrame.CONFIG, text))
        ack = self._exchange(question, JsonFrame.CONFIG_ACK, patience, AGAIN)
        if ack is None:
            raise CommandError(because("provision.configuration.unanswered", time=patience))
        answer = decoded(ack, ConfigAnswer)
        if not answer.accepted:
            why = plain(answer.reason)
            why = because("provision.part", why, part=answer.part) if answer.part else why
            raise CommandError(because("provision.configuration.refused", why))

    def status(self, patience: float = TO_RESTART) -> BoardStatus | None:
        """The board's status after its restart; None if it says nothing for `patience` [s]."""
        status = self._exchange(packet(sync_frame(0)), JsonFrame.STATUS, patience, 1.0)
        return None if status is None else decoded(status, BoardStatus)

    def _exchange(self, question: bytes, answer: JsonFrame, patience: float, again: float) -> bytes | None:
        deadline, next_try = time.monotonic() + patience, 0.0
        while (now := time.monotonic()) < deadline:
            if now >= next_try:
                self._line.write(question)
                next_try = now + again
            self._came.extend(self._packets.feed(self._line.read(4096)))
            while self._came:
                found = parse_json_frame(self._came.popleft())
                if found is None:
                    continue
                if found.kind is JsonFrame.STATUS:
                    self.newest_status = decoded(found.text, BoardStatus)
                if found.kind is answer:
                    return found.text
        return None


def refusal(reason: str) -> Reason:
    """What the device answers, in its own words."""
    return because("provision.refused", reason=reason) if reason else because("provision.refused.unexplained")


def decoded(text: bytes, kind: type[T]) -> T:
    """The JSON of a frame; raises `CommandError` where it is none of that kind."""
    try:
        return msgspec.json.decode(text, type=kind)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise CommandError(because("provision.bad_answer", kind=kind.__name__, error=str(error))) from error


@contextmanager
def open_line(port: str, baud: int) -> Iterator[BoardLine]:
    """Yields the port at `baud` [bit/s]; raises `CommandError` if it cannot be opened or fails.

    Its control lines stay low: many boards reset by them.
    """
    import serial  # slow to load, for a line alone

    try:
        line = serial.Serial(None, baud, timeout=0.05, write_timeout=2.0, exclusive=True)
        line.dtr = line.rts = False
        line.port = port
        line.open()
    except (serial.SerialException, ValueError, OSError) as error:
        raise CommandError(because("provision.port.unopened", port=port, error=str(error))) from error
    try:
        yield line
    except (serial.SerialException, OSError) as error:
        raise CommandError(because("provision.port.failed", port=port, error=str(error))) from error
    finally:
        line.close()
