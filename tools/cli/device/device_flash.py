"""`gemelo device flash`: a shop's board becomes one of gemelo's: firmware, name and networks, configuration, a look."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from gemelo.libraries.arm.device.device_config import device_config
from gemelo.schemas.device_config import config_text
from gemelo.schemas.reasons import because
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.session import load_robot
from gemelo.tools.cli.common.terminal import confirm
from gemelo.tools.cli.device import flash_tool
from gemelo.tools.cli.device.flash_parts import FirmwareBuild, build_for, read_builds
from gemelo.tools.cli.device.provision import (
    BAUD,
    PASSWORDS,
    BoardExchange,
    BoardLine,
    add_network_options,
    credentials_of,
    open_line,
)
from gemelo.tools.cli.parser import Options, Parser, positive_integer

if TYPE_CHECKING:
    from gemelo.libraries.arm.model.description import ArmDescription
    from gemelo.tools.cli.hosts.credentials import CredentialsChange

TO_COME_BACK = 10.0  # [s] chosen: for a chip's own USB to be a port again after the restart
STATUS_PERIOD = 12.0  # [s] standard: firmware/PROTOCOL.md, every 10 s; and some more
AGAIN = 0.5  # [s] between two attempts to open it


def add_options(parser: Parser) -> None:
    """Adds the image, the port, and what `gemelo device provision` takes."""
    parser.add_argument(
        "--image", required=True, type=Path, metavar="PATH",
        help="a release's .zip or manifest.json, or the folder of a build, as firmware/.pio/build/esp32",
    )  # fmt: skip
    parser.add_argument("--port", "--serial", dest="serial", required=True, metavar="PORT", help="as /dev/ttyUSB0")
    parser.add_argument(
        "--usb", action="store_true", help="of a release: that for a board with the chip's own USB only"
    )
    parser.add_argument(
        "--flash-baud", type=positive_integer, default=flash_tool.BAUD, metavar="BAUD",
        help=f"while the flash is written [{flash_tool.BAUD}]",
    )  # fmt: skip
    add_network_options(parser)
    parser.add_argument("-y", "--yes", action="store_true", help="do not ask before the board's firmware is replaced")
    parser.epilog = (
        "esptool (pipx install esptool) writes and compares every part; the board keeps the networks that it has, and "
        "gets its name and the configuration of robot.toml. A firmware that it runs already is updated without the "
        f"cable by `gemelo device update`.\n\n{PASSWORDS}\n\n{parser.epilog}"
    )


def run(options: Options) -> ExitCode:
    """Reads and checks everything before the board is touched; then writes, provisions, configures and looks."""
    builds = read_builds(options.image, options.usb)
    arm = load_robot().description
    credentials = credentials_of(options, options.device or arm.device.name)
    config = config_text(device_config(arm))
    flash_tool.find_esptool()
    port = options.serial
    build = builds[0] if len(builds) == 1 else build_for(builds, flash_tool.chip_of(port))
    what = {"project": build.header.project, "version": build.header.version, "chip": build.chip}
    print(sentence(because("flash.image", path=str(options.image), **what)), flush=True)
    confirm(because("flash.ask", port=port), options.yes)
    flash(build, port, options.flash_baud)
    settle(port, options.serial_baud or BAUD, arm, credentials, config)
    print(sentence(because("flash.next")))
    return ExitCode.OK


def flash(build: FirmwareBuild, port: str, baud: int) -> None:
    """Step 1: the flash."""
    size = sum(len(part.content) for part in build.parts)
    print(sentence(because("flash.step.write", parts=len(build.parts), size=size, port=port, baud=baud)), flush=True)
    flash_tool.write(build, port, baud, lambda line: print(f"     {line}", flush=True))


def settle(port: str, baud: int, arm: ArmDescription, credentials: CredentialsChange, config: bytes) -> None:
    """Steps 2 and 3: name and networks, then the configuration; raises `CommandError` where the board refuses."""
    print(sentence(because("flash.step.networks", what=credentials.summary())), flush=True)
    with opened_again(port, BAUD) as line:
        answer = BoardExchange(line).send(credentials.text())
        if not answer.accepted:
            raise CommandError(because("flash.refused", error=answer.reason or "-"))
    print(sentence(because("flash.step.configuration", robot=arm.name, size=len(config))), flush=True)
    with opened_again(port, baud) as line:
        exchange = BoardExchange(line)
        exchange.configure(config)
        who = exchange.newest_status or exchange.status(STATUS_PERIOD)
    if who is None:
        raise CommandError(because("flash.silent_since", port=port))
    print(sentence(because("flash.ready", device=who.device, firmware=who.firmware)))


@contextmanager
def opened_again(port: str, baud: int) -> Iterator[BoardLine]:
    """Yields the port once it is there: one that is the chip's own USB goes and comes back with a restart."""
    end = time.monotonic() + TO_COME_BACK
    with ExitStack() as opened:
        while True:
            try:
                line = opened.enter_context(open_line(port, baud))
                break
            except CommandError:
                if time.monotonic() > end:
                    raise
                time.sleep(AGAIN)
        yield line
