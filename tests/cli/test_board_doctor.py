"""A board's output as it starts, and the diagnosis of it; at a pseudo-terminal where a line is needed."""

from __future__ import annotations

import os
import threading
import tty

import msgspec
import pytest

from gemelo.libraries.runtime.serial_frames import JsonFrame, json_frame, packet
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.device import board_doctor
from gemelo.tools.cli.device.board_doctor import MeasuredArrivals, diagnose
from gemelo.tools.cli.device.provision import BoardStatus
from gemelo.tools.cli.main import run

ROM = b"ets Jul 29 2019 12:21:46\r\n\r\nrst:0x1 (POWERON_RESET),boot:0x13 (SPI_FAST_FLASH_BOOT)\r\n"
SAID = {
    "no firmware": (ROM + b"invalid header: 0xffffffff\r\n" * 9, "board.empty"),
    "an empty ESP32 of old": (ROM + b"flash read err, 1000\r\nets_main.c 371\r\n", "board.empty"),
    "small flash": (
        ROM + b"E (36) spi_flash: Detected size(4096k) smaller than the size in the binary image header(8192k).\r\n",
        "board.small",
    ),
    "held for flashing": (
        b"ESP-ROM:esp32s3-20210327\r\nrst:0x1 (POWERON),boot:0x0 (DOWNLOAD(USB/UART0))\r\nwaiting for download\r\n",
        "board.waits",
    ),
    "damaged": (ROM + b"E (71) esp_image: Checksum failed. Calculated 0x1 read 0x2\r\n", "board.damaged"),
    "weak supply": (ROM + b"Brownout detector was triggered\r\n", "board.brownout"),
    "crash": (ROM + b"Guru Meditation Error: Core 0 panic'ed (LoadProhibited).\r\n", "board.panic"),
    "boot loop": (ROM * 5, "board.loops"),
    "silent firmware": (ROM + b"load:0x3fff0030,len:4\r\n", "board.only_boots"),
    "another firmware": (b"connecting to wifi ...\r\n" * 3, "board.other"),
    "wrong rate": (bytes(range(128, 256)), "board.no_text"),
    "held in reset": (b"", "board.silent"),
    "noise of a plug": (b"\x00\xff", "board.silent"),
}


@pytest.mark.parametrize("name", SAID)
def test_the_cause_is_told_from_what_is_heard(name):
    data, code = SAID[name]
    at_wrong_rate = bytes(byte | 128 for byte in data)  # text is not read as text there
    finding = diagnose([MeasuredArrivals(921_600, at_wrong_rate[:400], None), MeasuredArrivals(115_200, data, None)])
    assert (finding.cause.code, finding.remedy.code) == (code, f"{code}.mend")
    assert not finding.is_well


def test_a_cause_has_the_values_that_were_measured():
    loop = diagnose([MeasuredArrivals(921_600, b"", None), MeasuredArrivals(115_200, ROM * 5, None)])
    assert loop.cause.values == {"count": 5, "time": 3.0}
    no_text = bytes(range(128, 256))
    noise = diagnose([MeasuredArrivals(921_600, no_text, None), MeasuredArrivals(115_200, no_text, None)])
    assert noise.cause.values == {"rates": "921600, 115200"}


def test_a_board_that_is_well_is_said_to_be():
    assert diagnose([MeasuredArrivals(921_600, b"", BoardStatus(device="rm1"))]).is_well


@pytest.mark.parametrize(
    ("heap", "stack", "said"),
    [
        (40_200, 812, ""),
        (9_000, 812, "the board's memory was down to 9000 bytes"),
        (40_200, 120, "the stack of the board's task wire was down to 120 bytes"),
    ],
)
def test_a_board_whose_memory_runs_out_is_not_well(heap, stack, said):
    status = BoardStatus(device="rm1", heap_free=71_000, heap_least=heap, stack_least=stack, stack_task="wire")
    finding = diagnose([MeasuredArrivals(921_600, b"", status)])
    assert finding.is_well == (said == "")
    assert said in str(finding.remedy)


@pytest.fixture
def port(request):
    """A line whose other end says `request.param` when it is asked for the first time."""
    master, slave = os.openpty()
    tty.setraw(slave)

    def answer():
        os.read(master, 1)
        os.write(master, request.param)

    board = threading.Thread(target=answer)
    board.start()
    yield os.ttyname(slave)
    board.join(60.0)
    os.close(slave)
    os.close(master)


MEMORY = {"heap_free": 71000, "heap_least": 40200, "stack_least": 812, "stack_task": "wire"}
STATUS = packet(json_frame(JsonFrame.STATUS, msgspec.json.encode({"online": True, "device": "rm1", **MEMORY})))


@pytest.mark.parametrize("port", [ROM + b"invalid header: 0xffffffff\r\n\x1b[31m"], indirect=True)
def test_a_port_is_listened_to_and_the_lines_are_shown(port, capsys, monkeypatch):
    monkeypatch.setattr(board_doctor, "LISTENING", 0.6)
    assert run(["device", "doctor", "--serial", port]) is ExitCode.FAILED
    said = capsys.readouterr()
    assert "it says: invalid header: 0xffffffff" in said.out
    assert "\x1b" not in said.out
    assert "there is no firmware in its flash: flash it" in said.err


@pytest.mark.parametrize("port", [STATUS], indirect=True)
def test_a_board_that_answers_is_well_at_once(port, capsys):
    assert run(["device", "doctor", "--serial", port]) is ExitCode.OK
    said = capsys.readouterr().out
    assert "gemelo's firmware runs and answers" in said
    assert "115200" not in said


def test_a_port_that_is_not_there_or_not_allowed_is_named(capsys, tmp_path):
    assert run(["device", "doctor", "--serial", str(tmp_path / "tty")]) is ExitCode.FAILED
    said = capsys.readouterr().err
    assert "cannot open" in said
    assert "group dialout" in said
