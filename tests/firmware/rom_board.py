"""A new board on a pseudo-terminal: the boot loader in the ROM of an ESP32-C3, as esptool's serial protocol has it
(Espressif's documentation, "Serial Protocol"), and after a restart the firmware that was written.

The flash is real bytes; the firmware that "starts" is the one behind `firmware_port`, whose bytes are passed on.
"""

from __future__ import annotations

import errno
import hashlib
import os
import select
import struct
import threading
import time
import tty
import zlib
from pathlib import Path

END, ESC = b"\xc0", b"\xdb"
SYNC, MEM_END, READ_REG, MD5, SECURITY = 0x08, 0x06, 0x0A, 0x13, 0x14
DEFL_BEGIN, DEFL_DATA, ERASE_REGION = 0x10, 0x11, 0xD1
CHIP_C3, CHIP_S3 = 5, 9
FLASH = 4 << 20
FLASH_ID = 0x164020  # 4 MB
SPI_W0 = 0x60002058  # the register in which the flash's answer stands
WORKS = 4  # [bytes] of status behind an answer of the ROM


class RomBoard:
    """Its port is `port`; `flash` is what was written."""

    def __init__(self, firmware_port: Path, chip: int = CHIP_C3) -> None:
        self.flash = bytearray(b"\xff" * FLASH)
        self.is_written = self.is_worn = self.is_deaf = False
        self.chip = chip
        self._firmware_port = firmware_port
        self._is_stub, self._packed, self._at = False, b"", 0
        self._master, slave = os.openpty()
        tty.setraw(slave)
        self.port = os.ttyname(slave)
        os.close(slave)  # so that nobody has it open: that is seen when a program closes it
        self._is_over = False
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def close(self) -> None:
        """Ends its thread."""
        self._is_over = True
        self._thread.join(60.0)
        os.close(self._master)

    def _run(self) -> None:
        left, was_open, firmware = b"", False, -1
        while not self._is_over:
            watched = [self._master] + ([firmware] if firmware >= 0 else [])
            ready, _, _ = select.select(watched, [], [], 0.05)
            if firmware in ready:
                os.write(self._master, os.read(firmware, 4096))
            if self._master not in ready:
                continue
            try:
                data = os.read(self._master, 4096)
            except OSError as error:
                if error.errno != errno.EIO:  # that nobody has it open
                    raise
                if was_open and self.is_written and firmware < 0:  # esptool is through: the restart
                    firmware = os.open(self._firmware_port, os.O_RDWR | os.O_NOCTTY)
                left, was_open = b"", False
                time.sleep(0.01)
                continue
            was_open = True
            if firmware >= 0:
                os.write(firmware, data)
                continue
            *packets, left = (left + data).split(END)
            for packet in packets:
                self._obey(packet.replace(ESC + b"\xdc", END).replace(ESC + b"\xdd", ESC))
        if firmware >= 0:
            os.close(firmware)

    def _obey(self, packet: bytes) -> None:
        if len(packet) < 8 or packet[0] != 0 or self.is_deaf:
            return
        _, command, size, _ = struct.unpack_from("<BBHI", packet)
        data = packet[8 : 8 + size]
        value, more = 0, b""
        if command == READ_REG:
            value = FLASH_ID if struct.unpack("<I", data)[0] == SPI_W0 else 0
        elif command == SYNC:
            value = 0 if self._is_stub else 0x20120707  # by it esptool tells them apart
        elif command == SECURITY:
            more = struct.pack("<IBBBBBBBBII", 0, *[0] * 8, self.chip, 0)
        elif command == DEFL_BEGIN:
            _, _, _, self._at = struct.unpack_from("<IIII", data)
            self._packed = b""
        elif command == DEFL_DATA:
            self._packed += data[16:]
            self._write()
        elif command == MD5:
            at, count = struct.unpack_from("<II", data)
            digest = hashlib.md5(self.flash[at : at + count]).hexdigest().encode()
            more = bytes.fromhex(digest.decode()) if self._is_stub else digest
        for _ in range(8 if command == SYNC else 1):
            self._answer(command, value, more)
        if command == MEM_END and struct.unpack_from("<II", data)[1] != 0:
            self._is_stub = True
            self._send(b"OHAI")

    def _write(self) -> None:
        content = zlib.decompressobj().decompress(self._packed)
        self.flash[self._at : self._at + len(content)] = content
        if self.is_worn and content:
            self.flash[self._at] ^= 0x01
        self.is_written = True

    def _answer(self, command: int, value: int, more: bytes) -> None:
        status = bytes(2 if self._is_stub else WORKS)
        self._send(struct.pack("<BBHI", 1, command, len(more) + len(status), value) + more + status)

    def _send(self, packet: bytes) -> None:
        os.write(self._master, END + packet.replace(ESC, ESC + b"\xdd").replace(END, ESC + b"\xdc") + END)
