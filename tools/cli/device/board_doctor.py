"""`gemelo device doctor`: listens to what a board says on its serial line, and tells likely cause and remedy."""

from __future__ import annotations

import re
import time
from typing import NamedTuple

from gemelo.libraries.runtime.serial_frames import JsonFrame, PacketDecoder, packet, parse_json_frame, sync_frame
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.device.board_memory import memory_left, memory_low
from gemelo.tools.cli.device.provision import BAUD, BoardLine, BoardStatus, decoded, open_line
from gemelo.tools.cli.parser import Options, Parser, positive_integer

BOOT_BAUD = 115_200  # of the chip's own boot loader, which is in ROM
LISTENING = 3.0  # [s] at each rate
ASK_AGAIN = 0.5  # [s]
READABLE = 0.85  # share of text among bytes that were read at the right rate
SPOKEN = 16  # [bytes] that are worth a judgement
LOOP = 3  # starts within LISTENING
MANUAL = "firmware/README.md"


class MeasuredArrivals(NamedTuple):
    """What came at one rate."""

    baud: int
    data: bytes
    status: BoardStatus | None  # of gemelo's firmware


class BoardDiagnosis(NamedTuple):
    """The likely cause, and what to do."""

    cause: str
    remedy: str
    is_well: bool = False


# What the boot loaders of the ESP32, S3 and C3 print, most telling first.
SIGNS = (
    (rb"invalid header: 0xffffffff|flash read err, 1000|No bootable app", "there is no firmware in its flash",
     f"flash it: {MANUAL}, Build and flash"),
    (rb"Detected size\(\d+k\) smaller than the size in the binary|spi flash probe failed|exceeds flash chip size",
     "its flash is smaller than the firmware was built for",
     "build it as firmware/platformio.ini has it, for 4 MB, and flash bootloader and firmware"),
    (rb"waiting for download|DOWNLOAD\(|DOWNLOAD_BOOT", "it waits to be flashed: BOOT was held low while it started",
     "release BOOT and press EN; if it stays so, something pulls the BOOT pin low: unplug what is wired to it"),
    (rb"partition table|invalid magic number|Checksum failed|Image hash failed", "its flash holds damaged firmware",
     f"erase it (`esptool erase-flash`), then flash all three files: {MANUAL}, Build and flash"),
    (rb"[Bb]rownout", "its 3.3 V break down while it starts",
     "a better 5 V supply and a shorter cable, 470 uF at 5V; nothing else on its 3.3 V"),
    (rb"Guru Meditation|abort\(\) was called|panic", "its firmware stops with an error", "report it with these lines"),
)  # fmt: skip
START = re.compile(rb"rst:0x[0-9a-f]+ \(|ESP-ROM:")


def add_options(parser: Parser) -> None:
    """Adds the port and the rate that the firmware is expected at."""
    parser.add_argument("--serial", required=True, metavar="PORT", help="as /dev/ttyUSB0")
    parser.add_argument("--baud", type=positive_integer, default=BAUD, metavar="BAUD", help="921600 if not said")


def run(options: Options) -> ExitCode:
    """Listens at the firmware's rate, then at the boot loader's; prints what was heard, the cause and the remedy."""
    heard = []
    for baud in dict.fromkeys((options.baud, BOOT_BAUD)):
        print(f"listening to {options.serial} at {baud} baud for {LISTENING:g} s ...", flush=True)
        with open_line(options.serial, baud) as line:
            heard.append(listen(line, baud, LISTENING))
        if heard[-1].status is not None:
            break
    for line_of_text in lines_of(heard):
        print(f"  it says: {line_of_text}")
    if (status := heard[-1].status) is not None and (left := memory_left(status)) is not None:
        print(f"  memory: {sentence(left)}")
    finding = diagnose(heard)
    if finding.is_well:
        print(f"{finding.cause}: {finding.remedy}")
        return ExitCode.OK
    raise CommandError(f"{finding.cause}: {finding.remedy}")


def listen(line: BoardLine, baud: int, seconds: float) -> MeasuredArrivals:
    """Everything that comes in `seconds` [s], or until gemelo's firmware answers; it is asked meanwhile."""
    packets, data = PacketDecoder(), bytearray()
    deadline, ask = time.monotonic() + seconds, 0.0
    while (now := time.monotonic()) < deadline:
        if now >= ask:
            line.write(packet(sync_frame(0)))
            ask = now + ASK_AGAIN
        piece = line.read(4096)
        data += piece
        for frame in packets.feed(piece):
            found = parse_json_frame(frame)
            if found is not None and found.kind is JsonFrame.STATUS:
                return MeasuredArrivals(baud, bytes(data), decoded(found.text, BoardStatus))
    return MeasuredArrivals(baud, bytes(data), None)


def diagnose(heard: list[MeasuredArrivals]) -> BoardDiagnosis:
    """The likely cause of what was heard at each rate, and the remedy."""
    for each in heard:
        if each.status is not None:
            if (low := memory_low(each.status)) is not None:
                return BoardDiagnosis("gemelo's firmware runs and answers", sentence(low))
            return BoardDiagnosis(
                "gemelo's firmware runs and answers", "`gemelo device provision` tells it its networks", True
            )
    everything = b"\n".join(each.data for each in heard)
    for pattern, cause, remedy in SIGNS:
        if re.search(pattern, everything):
            return BoardDiagnosis(cause, remedy)
    starts = max(len(START.findall(each.data)) for each in heard)
    if starts >= LOOP:
        return BoardDiagnosis(
            f"it starts again and again, {starts} times in {LISTENING:g} s",
            "disconnect all but USB and look again; then its supply, then flash it anew",
        )
    return _by_amount(heard, starts)


def _by_amount(heard: list[MeasuredArrivals], starts: int) -> BoardDiagnosis:
    spoken = [each for each in heard if len(each.data) >= SPOKEN]
    if not spoken:
        return BoardDiagnosis(
            "it says nothing",
            "press EN while this listens; then: is this its port, is the cable one for data, is it the socket marked "
            "UART, and is EN held low by something wired to it?",
        )
    if starts:
        return BoardDiagnosis("its boot loader runs, gemelo's firmware does not answer", f"flash it anew: {MANUAL}")
    if any(_share_of_text(each.data) >= READABLE for each in spoken):
        return BoardDiagnosis("another firmware speaks there", f"flash gemelo's: {MANUAL}, Build and flash")
    rates = ", ".join(str(each.baud) for each in heard)
    return BoardDiagnosis(f"what it says is no text at {rates} baud", "another --baud, or a bad cable or ground")


def lines_of(heard: list[MeasuredArrivals], most: int = 6) -> list[str]:
    """The last readable lines, without control characters."""
    readable = [each.data for each in heard if each.data and _share_of_text(each.data) >= READABLE]
    text = b"\n".join(readable).decode("ascii", "replace")
    lines = ("".join(filter(str.isprintable, line)).strip() for line in text.splitlines())
    return [line[:120] for line in lines if line][-most:]


def _share_of_text(data: bytes) -> float:
    return sum(byte in b"\t\r\n" or 32 <= byte < 127 for byte in data) / max(1, len(data))
