"""The two slots for firmware in a virtual board's flash, as files, and its boot loader with the rules of ESP-IDF's.

The code of an image is the shared library of a core; slot 0 holds the one that this was installed with until another is
written there. A new image is started once; unless it is confirmed before the next reset, the one before is started
again.
"""

from __future__ import annotations

import hashlib
import logging
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

import msgspec

from gemelo.firmware.bindings.firmware_slot import SlotRefused
from gemelo.firmware.bindings.library import LIBRARY, LibraryMissing, load_library
from gemelo.libraries.runtime.firmware_update import HEADER, NoImage, leave_for_older, read_header
from gemelo.libraries.runtime.process.unwritten import Attempts, UnwrittenFiles
from gemelo.libraries.runtime.signatures import SignatureError, is_signed

log = logging.getLogger("virtual_esp32")

SLOT_SIZE = 0x1E0000  # [bytes] as in platform/esp32/partitions.csv
ELF = b"\x7fELF"
UNUSABLE = (NoImage, OSError, LibraryMissing)  # why a slot's firmware is not started


class ImageState(StrEnum):
    """Of the image that is to be booted; the names are ESP-IDF's."""

    NEW = "new"
    PENDING = "pending_verify"
    VALID = "valid"


class BootRecord(msgspec.Struct, frozen=True, kw_only=True):
    """The file of the boot loader."""

    slot: int = 0
    state: ImageState = ImageState.VALID


class Booted(NamedTuple):
    """The firmware that was started."""

    slot: str
    library: Path
    is_on_trial: bool
    is_rolled_back: bool


class FirmwareSlots:
    """The slots of one board; `key` gives the public key (PEM) that was provisioned, empty for none."""

    def __init__(self, folder: Path, name: str, key: Callable[[], str], unwritten: UnwrittenFiles) -> None:
        self._folder, self._name, self._key = folder, name, key
        self._images = tuple(folder / f"{name}_ota_{slot}.bin" for slot in (0, 1))
        self._file = folder / f"{name}_ota.json"
        self._record = self._written = _read(self._file)
        self._attempts = Attempts(f"which firmware starts next, in {self._file},", unwritten)
        self._writing: Path | None = None
        self.is_ready = False  # to restart into a new image

    def boot(self) -> Booted:
        """Starts what the boot loader starts after a reset."""
        self.is_ready, is_rolled_back = False, False
        if self._record.state is ImageState.PENDING:
            is_rolled_back = True
            self.roll_back()
        is_on_trial = self._record.state is ImageState.NEW
        if is_on_trial:
            self._keep(BootRecord(slot=self._record.slot, state=ImageState.PENDING))
        try:
            library = self._library(self._record.slot)
        except UNUSABLE as error:
            if not is_on_trial:
                return self._other_slot(error)
            log.error("the new firmware does not start: %s", error)
            return self.boot()._replace(is_rolled_back=True)
        return Booted(f"ota_{self._record.slot}", library, is_on_trial, is_rolled_back)

    def _other_slot(self, error: Exception) -> Booted:
        """Starts the firmware of the other slot, as this one's cannot be; raises LibraryMissing where neither can."""
        slot = self._record.slot
        try:
            library = self._library(1 - slot)
        except UNUSABLE as others:
            raise LibraryMissing(
                f"no firmware can be started: {self._images[slot]}: {error}; the other slot: {others}. Remove "
                f"{self._folder / self._name}_ota* to start with the one that is installed here, or run `make setup`"
            ) from error
        log.error(
            "the firmware in %s cannot be started (%s): the other slot's is; `gemelo device update` writes a new one",
            self._images[slot], error,
        )  # fmt: skip
        self._keep(BootRecord(slot=1 - slot))
        return Booted(f"ota_{1 - slot}", library, False, True)

    def confirm(self) -> None:
        """The firmware that runs is good: it stays."""
        self._keep(BootRecord(slot=self._record.slot))
        log.info("the new firmware has said status, and stays")

    def roll_back(self) -> None:
        """The firmware before is started next."""
        self._keep(BootRecord(slot=1 - self._record.slot))
        log.warning("the new firmware has not said status: back to the one before")

    def verify(self, digest: bytes, signature: bytes) -> None:
        """Raises SlotRefused for a signature that is not by the provisioned key."""
        key = self._key()
        if not key:
            raise SlotRefused("it has no key for updates: provision --update-key over its cable")
        try:
            is_good = is_signed(key, digest, signature)
        except SignatureError as error:
            raise SlotRefused(str(error)) from error
        if not is_good:
            raise SlotRefused("its signature is not by the key that this device was provisioned with")

    def permits_older(self, digest: bytes, boot_id: int, signature: bytes) -> bool:
        """True if the key's owner lets this boot go back to the image with this SHA-256."""
        key = self._key()
        leave = hashlib.sha256(leave_for_older(digest, boot_id)).digest()
        with suppress(SignatureError):
            return bool(key) and is_signed(key, leave, signature)
        return False

    def begin(self, size: int) -> None:
        """Opens the slot that does not run; raises SlotRefused."""
        if self._record.state is ImageState.PENDING:
            raise SlotRefused("the firmware that runs is on trial itself: wait for its status")
        if size > SLOT_SIZE:
            raise SlotRefused(f"it has {size} bytes, the slot {SLOT_SIZE}")
        self._writing = self._images[1 - self._record.slot].with_suffix(".part")
        with _refused():
            self._writing.write_bytes(b"")

    def write(self, data: bytes) -> None:
        """Appends; raises SlotRefused."""
        assert self._writing is not None
        with _refused(), self._writing.open("ab") as file:
            file.write(data)

    def finish(self, digest: bytes) -> None:
        """Has it started next; raises SlotRefused."""
        assert self._writing is not None
        part, self._writing = self._writing, None
        with _refused():
            image = part.read_bytes()
        if hashlib.sha256(image).digest() != digest:
            raise SlotRefused("its checksum is not that of what was signed: it was damaged on its way")
        try:
            _code(image)
        except NoImage as error:
            raise SlotRefused(f"it is damaged: {error}") from error
        other = 1 - self._record.slot
        with _refused():
            os.replace(part, self._images[other])
            self._write(BootRecord(slot=other, state=ImageState.NEW))
        self.is_ready = True

    def abort(self) -> None:
        """Forgets what was written."""
        if self._writing is not None:
            with suppress(OSError):
                self._writing.unlink()
        self._writing = None

    def _library(self, slot: int) -> Path:
        """The code of the slot as a file of its own, by a name that no other code ever has: a process loads it once."""
        if slot == 0 and not self._images[0].exists():
            library = LIBRARY
        else:
            code = _code(self._images[slot].read_bytes())
            library = self._folder / f"{self._name}_{hashlib.sha256(code).hexdigest()[:16]}.so"
            for old in self._folder.glob(f"{self._name}_*.so"):
                if old != library:
                    with suppress(OSError):
                        old.unlink()
            if not _holds(library, code):
                library = _written(library, code)
        load_library(library)
        return library

    def remember(self) -> None:
        """Tries again what the disk has refused."""
        if self._record != self._written:
            self._attempts.write(lambda: self._write(self._record))

    def _keep(self, record: BootRecord) -> None:
        """It counts at once, and for the next start as soon as the disk takes it."""
        self._record = record
        self.remember()

    def _write(self, record: BootRecord) -> None:
        """Raises OSError."""
        beside = self._file.with_suffix(".tmp")
        beside.write_bytes(msgspec.json.encode(record) + b"\n")
        os.replace(beside, self._file)
        self._record = self._written = record


@contextmanager
def _refused() -> Iterator[None]:
    """SlotRefused in place of OSError."""
    try:
        yield
    except OSError as error:
        raise SlotRefused(f"the flash memory cannot be written: {error.strerror}") from error


def _holds(file: Path, code: bytes) -> bool:
    """True if the file is this code and nothing else: one that was cut off would end whoever loads it."""
    try:
        return file.read_bytes() == code
    except OSError:
        return False


def _written(library: Path, code: bytes) -> Path:
    """A file with that code: `library`, or one in memory where the disk refuses it; raises OSError."""
    beside = library.with_suffix(".tmp")
    try:
        beside.write_bytes(code)
        os.replace(beside, library)
    except OSError:
        with suppress(OSError):
            beside.unlink(missing_ok=True)
        descriptor = os.memfd_create(library.name)  # stays open: it is the file's only name
        with open(descriptor, "wb", closefd=False) as file:
            file.write(code)
        return Path(f"/proc/{os.getpid()}/fd/{descriptor}")
    return library


def _code(image: bytes) -> bytes:
    """The library in an image; raises NoImage."""
    read_header(image)
    code = image[HEADER:]
    if not code.startswith(ELF):
        raise NoImage("there is no library behind its header")
    return code


def _read(file: Path) -> BootRecord:
    """The record; as new where there is none, or one that cannot be read."""
    try:
        record = msgspec.json.decode(file.read_bytes(), type=BootRecord)
    except (OSError, msgspec.DecodeError):
        return BootRecord()
    return record if record.slot in (0, 1) else BootRecord()
