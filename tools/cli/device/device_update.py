"""`gemelo device update`: a new firmware for a board, over MQTT or its serial line; and the key that signs it."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.credentials.private_files import AccessError, require_private
from gemelo.libraries.mqtt.access import gateway_access
from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.runtime.firmware_update import ImageHeader, NoImage, leave_for_older, read_header
from gemelo.libraries.runtime.signatures import SignatureError, make_key, sign
from gemelo.libraries.runtime.started import load_started
from gemelo.schemas.reasons import because
from gemelo.tools.cli.common.errors import CommandError, ExitCode, usage
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.terminal import LiveBlock
from gemelo.tools.cli.device.provision import BAUD, open_line
from gemelo.tools.cli.device.update_transfer import (
    SerialWire,
    Transfer,
    UpdateStatus,
    UpdateWire,
    await_status,
    mqtt_wire,
)
from gemelo.tools.cli.parser import Options, Parser, positive_integer

KEY = ".gemelo/update.key"
TO_ANSWER = 6.0  # [s] until a device that is there has said status
TRIAL = 30.0  # [s] that the new firmware has to say status; then the one before starts again
TO_START = 15.0  # [s] that a board takes for that


def add_options(parser: Parser) -> None:
    """Adds the file, the wire and the key."""
    parser.add_argument(
        "file", nargs="?", type=Path, metavar="FILE", help="the image, as .pio/build/esp32/firmware.bin"
    )
    parser.add_argument("--serial", metavar="PORT", help="over this line, as /dev/ttyUSB0 [over the deployment's MQTT]")
    parser.add_argument("--baud", type=positive_integer, default=BAUD, metavar="BAUD", help="921600 if not said")
    parser.add_argument("--device", metavar="NAME", help="its name at the broker [that of the deployment's robot]")
    parser.add_argument("--key", type=Path, metavar="FILE", help=f"the private key that signs [{KEY}]")
    parser.add_argument("--downgrade", action="store_true", help="send it though it is older than what the device runs")
    parser.add_argument("--make-key", action="store_true", help="make such a key instead, and its public one beside it")
    parser.epilog = (
        "The device checks the signature with the public key that `gemelo device provision --update-key` gave it over "
        "its cable, takes the image only while it is disarmed, and goes back to the firmware before unless the new one "
        f"says status within {TRIAL:g} s. A version older than what runs is refused without --downgrade. "
        f"A transfer that was cut off goes on where it ended.\n\n{parser.epilog}"
    )


def run(options: Options) -> ExitCode:
    """Makes a key, or updates a device."""
    key = options.key or project_root() / KEY
    try:
        if options.make_key:
            return make(key)
        if options.file is None:
            raise usage(because("update.which_file"))
        image, header = read_image(options.file)
        require_private(str(key))
        signature = sign(key, image)  # also that the key is good, before anything is asked of the device
    except SignatureError as error:
        raise CommandError(error) from error
    except AccessError as error:
        raise CommandError(because("update.key.unusable", error.reason)) from error
    image_is = because(
        "update.image",
        file=str(options.file), project=header.project, version=header.version, chip=header.chip, size=len(image),
    )  # fmt: skip
    print(sentence(image_is), flush=True)
    with wire_of(options) as wire:
        older = key if options.downgrade else None
        return update(wire, image, signature, older)


def make(key: Path) -> ExitCode:
    """Makes a pair and says what to do with it."""
    if key.suffix == ".pub":
        raise usage(because("update.key.ending", key=str(key)))
    public = key.with_suffix(".pub")
    make_key(key, public)
    print(sentence(because("update.key.private", key=str(key))))
    print(sentence(because("update.key.public", key=str(public))))
    return ExitCode.OK


def read_image(file: Path) -> tuple[bytes, ImageHeader]:
    """The image and what it says of itself; raises `CommandError`."""
    try:
        image = file.read_bytes()
        return image, read_header(image)
    except OSError as error:
        raise usage(because("update.file.unreadable", file=str(file), error=str(error.strerror))) from error
    except NoImage as error:
        raise usage(because("update.file.no_image", error.reason, file=str(file))) from error


@contextmanager
def wire_of(options: Options) -> Iterator[UpdateWire]:
    """Yields the wire that was asked for; raises `CommandError`."""
    if options.serial is not None:
        with open_line(options.serial, options.baud) as line:
            yield SerialWire(line)
        return
    deployment = load_started()
    device = options.device or load_arm(project_root() / deployment.robot).device.name
    try:
        access = gateway_access(deployment.mqtt)
    except AccessError as error:
        raise CommandError(error) from error
    with mqtt_wire(access, device) as wire:
        yield wire


def update(wire: UpdateWire, image: bytes, signature: bytes, older: Path | None = None) -> ExitCode:
    """Brings the image there and waits for what becomes of it; raises `CommandError` unless it runs in the end.

    `older`: the key that signs the leave for an image that is older than what runs.
    """
    before = await_status(wire, TO_ANSWER, lambda _: True)
    if before is None:
        raise CommandError(because("update.nobody", time=TO_ANSWER))
    if before.armed:
        raise CommandError(because("update.armed"))
    if older is not None:
        signature = sign(older, leave_for_older(hashlib.sha256(image).digest(), before.boot_id))
    block = LiveBlock()
    transfer = Transfer(wire, image, signature, lambda sent: block.draw(_progress(sent, len(image))))
    had = transfer.run(before.boot_id)
    block.say(sentence(because("update.there.rest", size=had) if had else because("update.there")))
    after = await_status(wire, TRIAL + TO_START, lambda status: status.boot_id != before.boot_id)
    return outcome(before, after)


def outcome(before: UpdateStatus, after: UpdateStatus | None) -> ExitCode:
    """Prints what runs now; raises `CommandError` if that is not the new firmware."""
    if after is None:
        raise CommandError(because("update.silent_since", time=TRIAL + TO_START, firmware=before.firmware))
    if after.slot == before.slot:
        raise CommandError(because("update.gone_back", time=TRIAL, firmware=after.firmware, slot=after.slot))
    runs = because(
        "update.runs", firmware=after.firmware, slot=after.slot, before=before.firmware, before_slot=before.slot
    )
    print(sentence(runs))
    return ExitCode.OK


def _progress(sent: int, size: int) -> str:
    return sentence(because("update.sent", percent=100 * sent // size))
