"""`gemelo device doctor`: listens to what a board says on its serial line, and tells likely cause and remedy."""

from __future__ import annotations

import re
import time
from typing import NamedTuple

from gemelo.libraries.runtime.serial_frames import JsonFrame, PacketDecoder, packet, parse_json_frame, sync_frame
from gemelo.schemas.reasons import Reason, because
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


class MeasuredArrivals(NamedTuple):
    """What came at one rate."""

    baud: int
    data: bytes
    status: BoardStatus | None  # of gemelo's firmware


class BoardDiagnosis(NamedTuple):
    """The likely cause, and what to do."""

    cause: Reason
    remedy: Reason
    is_well: bool = False

    @property
    def reason(self) -> Reason:
        """Both in one sentence."""
        return because("board.found", self.cause, self.remedy)


# What the boot loaders of the ESP32, S3 and C3 print, most telling first.
SIGNS = (
    (rb"invalid header: 0xffffffff|flash read err, 1000|No bootable app", "board.empty", "board.empty.mend"),
    (rb"Detected size\(\d+k\) smaller than the size in the binary|spi flash probe failed|exceeds flash chip size",
     "board.small", "board.small.mend"),
    (rb"waiting for download|DOWNLOAD\(|DOWNLOAD_BOOT", "board.waits", "board.waits.mend"),
    (rb"partition table|invalid magic number|Checksum failed|Image hash failed", "board.damaged", "board.damaged.mend"),
    (rb"[Bb]rownout", "board.brownout", "board.brownout.mend"),
    (rb"Guru Meditation|abort\(\) was called|panic", "board.panic", "board.panic.mend"),
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
        listening = because("board.listening", port=str(options.serial), baud=baud, time=LISTENING)
        print(sentence(listening), flush=True)
        with open_line(options.serial, baud) as line:
            heard.append(listen(line, baud, LISTENING))
        if heard[-1].status is not None:
            break
    for line_of_text in lines_of(heard):
        print(f"  {sentence(because('board.line', text=line_of_text))}")
    if (status := heard[-1].status) is not None and (left := memory_left(status)) is not None:
        print(f"  {sentence(because('board.memory', left))}")
    finding = diagnose(heard)
    if finding.is_well:
        print(sentence(finding.reason))
        return ExitCode.OK
    raise CommandError(finding.reason)


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
                return BoardDiagnosis(because("board.runs"), low)
            return BoardDiagnosis(because("board.runs"), because("board.runs.next"), True)
    everything = b"\n".join(each.data for each in heard)
    for pattern, cause, remedy in SIGNS:
        if re.search(pattern, everything):
            return BoardDiagnosis(because(cause), because(remedy))
    starts = max(len(START.findall(each.data)) for each in heard)
    if starts >= LOOP:
        return BoardDiagnosis(because("board.loops", count=starts, time=LISTENING), because("board.loops.mend"))
    return _by_amount(heard, starts)


def _by_amount(heard: list[MeasuredArrivals], starts: int) -> BoardDiagnosis:
    spoken = [each for each in heard if len(each.data) >= SPOKEN]
    if not spoken:
        return BoardDiagnosis(because("board.silent"), because("board.silent.mend"))
    if starts:
        return BoardDiagnosis(because("board.only_boots"), because("board.only_boots.mend"))
    if any(_share_of_text(each.data) >= READABLE for each in spoken):
        return BoardDiagnosis(because("board.other"), because("board.other.mend"))
    rates = ", ".join(str(each.baud) for each in heard)
    return BoardDiagnosis(because("board.no_text", rates=rates), because("board.no_text.mend"))


def lines_of(heard: list[MeasuredArrivals], most: int = 6) -> list[str]:
    """The last readable lines, without control characters."""
    readable = [each.data for each in heard if each.data and _share_of_text(each.data) >= READABLE]
    text = b"\n".join(readable).decode("ascii", "replace")
    lines = ("".join(filter(str.isprintable, line)).strip() for line in text.splitlines())
    return [line[:120] for line in lines if line][-most:]


def _share_of_text(data: bytes) -> float:
    return sum(byte in b"\t\r\n" or 32 <= byte < 127 for byte in data) / max(1, len(data))
