"""The parts of one build of the firmware, read and checked, as they are written into a board's flash over its cable.

A build comes as the folder that PlatformIO made (`.pio/build/esp32`), or as a release: a zip or a folder with a
manifest, as ESP Web Tools reads it too. Formats: Espressif's image (header, segments, checksum, SHA-256) and partition
table (entries of 32 bytes from 0x8000 on).
"""

from __future__ import annotations

import hashlib
import struct
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path, PurePosixPath
from typing import NamedTuple

import msgspec

from gemelo.libraries.runtime.firmware_update import MAGIC, ImageHeader, NoImage, read_header
from gemelo.tools.cli.common.errors import CommandError, usage

BOOTLOADER, TABLE, OTA_DATA, FIRMWARE = "bootloader.bin", "partitions.bin", "ota_data.bin", "firmware.bin"
BOOTLOADER_AT = {"ESP32": 0x1000, "ESP32-S3": 0x0, "ESP32-C3": 0x0}  # standard: where the chip's ROM looks for it
TABLE_AT = 0x8000  # standard: CONFIG_PARTITION_TABLE_OFFSET of ESP-IDF, unless it is changed
PROJECT = "gemelo"
MANIFEST, USB_MANIFEST = "manifest.json", "manifest-usb.json"
BLANK = b"\xff"  # of the flash, erased
LARGEST_RELEASE = 64_000_000  # [bytes] chosen: of all that a release's zip holds, twenty times what ours does

_IMAGE = struct.Struct("<BB10xH9x?")  # esp_image_header_t: magic, segments, chip_id, hash_appended
_SEGMENT = struct.Struct("<II")  # load address, length
_ENTRY = struct.Struct("<HBBII16sI")
_ENTRY_MAGIC = 0x50AA
_APP, _DATA, _OTA_0, _OTA_DATA = 0, 1, 0x10, 0x00


class FlashPart(NamedTuple):
    """Bytes and their place in the flash [bytes from its start]."""

    name: str
    offset: int
    content: bytes


class FirmwareBuild(NamedTuple):
    """The firmware for one chip."""

    header: ImageHeader
    parts: tuple[FlashPart, ...]

    @property
    def chip(self) -> str:
        return self.header.chip


class Partition(NamedTuple):
    """One entry of a partition table."""

    label: str
    kind: int
    subtype: int
    offset: int
    size: int


class ManifestPart(msgspec.Struct, frozen=True):
    """As ESP Web Tools has it."""

    path: str
    offset: int


class ManifestBuild(msgspec.Struct, frozen=True, rename="camel"):
    """The parts for one chip."""

    chip_family: str
    parts: tuple[ManifestPart, ...]


class Manifest(msgspec.Struct, frozen=True):
    """What a browser flasher reads of a release; keys that only it needs are passed over."""

    name: str
    version: str
    builds: tuple[ManifestBuild, ...]


Read = Callable[[str], bytes]  # of a file of the release, by its path from the manifest


def read_builds(path: Path, is_usb: bool = False) -> tuple[FirmwareBuild, ...]:
    """Every build that `path` holds, checked: the folder of one, an image within it, or a release.

    `is_usb`: of a release, those whose serial wire is the chip's own USB. Raises `CommandError`, naming the file.
    """
    manifest = USB_MANIFEST if is_usb else MANIFEST
    try:
        if path.suffix == ".zip":
            return _of_zip(path, manifest)
        folder = path if path.is_dir() else path.parent
        if path.name.startswith("manifest") or (path.is_dir() and (path / manifest).is_file()):
            text = (path if path.is_file() else path / manifest).read_bytes()
            return _of_manifest(text, str(path), lambda name: (folder / name).read_bytes())
        if not path.is_dir() and path.name != FIRMWARE:
            require_there(path)
            raise usage(f"{path}: give the folder of a build, with {FIRMWARE}, or a release's .zip or {MANIFEST}")
        return (build_of(folder),)
    except OSError as error:
        raise usage(f"cannot read {error.filename or path}: {error.strerror or error}") from error


def require_there(path: Path) -> None:
    """Raises `CommandError` where there is no such file."""
    if not path.exists():
        raise usage(f"there is no {path}: build it (firmware/README.md), or download a release")


def build_of(folder: Path) -> FirmwareBuild:
    """What PlatformIO has built in `folder`; raises `CommandError`."""
    missing = [name for name in (BOOTLOADER, TABLE, FIRMWARE) if not (folder / name).is_file()]
    if missing:
        raise usage(
            f"{folder} has no {', '.join(missing)}: give the folder of a build, as .pio/build/esp32, or a release"
        )
    firmware, table = (folder / FIRMWARE).read_bytes(), (folder / TABLE).read_bytes()
    header = read_image_header(firmware, str(folder / FIRMWARE))
    if header.chip not in BOOTLOADER_AT:
        raise usage(f"{folder / FIRMWARE} is for {header.chip}: gemelo's firmware is for {', '.join(BOOTLOADER_AT)}")
    partitions = read_table(table, str(folder / TABLE))
    ota_data, slot = partition(partitions, _DATA, _OTA_DATA, folder), partition(partitions, _APP, _OTA_0, folder)
    parts = (
        FlashPart(BOOTLOADER, BOOTLOADER_AT[header.chip], (folder / BOOTLOADER).read_bytes()),
        FlashPart(TABLE, TABLE_AT, table),
        # Blank, the boot loader starts the first slot: after an update over the air it may be the other one.
        FlashPart(OTA_DATA, ota_data.offset, BLANK * ota_data.size),
        FlashPart(FIRMWARE, slot.offset, firmware),
    )
    return require_sound(FirmwareBuild(header, parts), str(folder))


def require_sound(build: FirmwareBuild, source: str) -> FirmwareBuild:
    """Returns the build if it would start; raises `CommandError` where a part is damaged or belongs to another."""
    by_name = {part.name: part for part in build.parts}
    missing = [name for name in (BOOTLOADER, TABLE, OTA_DATA, FIRMWARE) if name not in by_name]
    if missing:
        raise usage(f"{source}: the build for {build.chip} lacks {', '.join(missing)}")
    bootloader, firmware = by_name[BOOTLOADER], by_name[FIRMWARE]
    for part in (bootloader, firmware):
        require_whole(part.content, f"{source}: {part.name}")
    if build.header.project != PROJECT:
        raise usage(f'{source}: {FIRMWARE} is the firmware "{build.header.project}", not {PROJECT}\'s')
    its_chip = _IMAGE.unpack_from(bootloader.content)[2]
    if its_chip != build.header.chip_id:
        raise usage(f"{source}: {BOOTLOADER} is for another chip (number {its_chip}) than {FIRMWARE} ({build.chip})")
    partitions = read_table(by_name[TABLE].content, f"{source}: {TABLE}")
    slot = partition(partitions, _APP, _OTA_0, source)
    places = {
        BOOTLOADER: BOOTLOADER_AT.get(build.chip), TABLE: TABLE_AT, FIRMWARE: slot.offset,
        OTA_DATA: partition(partitions, _DATA, _OTA_DATA, source).offset,
    }  # fmt: skip
    for name, place in places.items():
        if by_name[name].offset != place:
            raise usage(f"{source}: {name} is to go to {by_name[name].offset:#x}; it would start from {place or 0:#x}")
    if len(firmware.content) > slot.size:
        raise usage(f"{source}: {FIRMWARE} has {len(firmware.content)} bytes, its slot {slot.size}")
    return build


def require_whole(image: bytes, what: str) -> None:
    """Raises `CommandError` unless the SHA-256 behind an image is that of its bytes."""
    if len(image) < _IMAGE.size or image[0] != MAGIC:
        raise usage(f"{what} is no image of ESP-IDF")
    _, segments, _, has_digest = _IMAGE.unpack_from(image)
    end = _IMAGE.size
    for _ in range(segments):
        if end + _SEGMENT.size > len(image):
            raise usage(f"{what} is cut off after {len(image)} bytes: download or build it again")
        end += _SEGMENT.size + _SEGMENT.unpack_from(image, end)[1]
    end += 16 - end % 16  # the checksum is the last byte of a block of 16
    if has_digest and image[end : end + 32] != hashlib.sha256(image[:end]).digest():
        raise usage(f"{what} is damaged: its SHA-256 is not that of its bytes; download or build it again")
    if len(image) < end:
        raise usage(f"{what} is cut off after {len(image)} bytes: download or build it again")


def read_table(table: bytes, what: str) -> tuple[Partition, ...]:
    """The entries of a partition table; raises `CommandError`."""
    found = []
    for at in range(0, len(table) - _ENTRY.size + 1, _ENTRY.size):
        magic, kind, subtype, offset, size, label, _ = _ENTRY.unpack_from(table, at)
        if magic != _ENTRY_MAGIC:
            break
        found.append(Partition(label.split(b"\0", 1)[0].decode("ascii", "replace"), kind, subtype, offset, size))
    if not found:
        raise usage(f"{what} is no partition table")
    return tuple(found)


def partition(partitions: Sequence[Partition], kind: int, subtype: int, source: object) -> Partition:
    """That one of the table; raises `CommandError` where it has none."""
    for each in partitions:
        if (each.kind, each.subtype) == (kind, subtype):
            return each
    name = "ota_0" if kind == _APP else "otadata"
    raise usage(f"{source}: {TABLE} has no partition {name}, as firmware/platform/esp32/partitions.csv has one")


def build_for(builds: Sequence[FirmwareBuild], chip: str) -> FirmwareBuild:
    """That for the chip; raises `CommandError` with the chips that there is one for."""
    for build in builds:
        if build.chip == chip:
            return build
    chips = ", ".join(build.chip for build in builds)
    raise CommandError(f"the board is an {chip}, and the image is for {chips}: take that of its chip")


def read_image_header(image: bytes, what: str) -> ImageHeader:
    """What an application says of itself; raises `CommandError`."""
    try:
        return read_header(image)
    except NoImage as error:
        raise usage(f"{what}: {error}") from error


def _of_zip(path: Path, manifest: str) -> tuple[FirmwareBuild, ...]:
    require_there(path)
    try:
        with zipfile.ZipFile(path) as opened:
            if sum(each.file_size for each in opened.infolist()) > LARGEST_RELEASE:
                raise usage(f"{path} holds more than {LARGEST_RELEASE} bytes: it is no release of the firmware")
            names = [name for name in opened.namelist() if PurePosixPath(name).name == manifest]
            if not names:
                raise usage(f"{path} has no {manifest}: is it a release of gemelo's firmware?")
            within = PurePosixPath(names[0]).parent
            return _of_manifest(opened.read(names[0]), str(path), lambda name: opened.read(str(within / name)))
    except (zipfile.BadZipFile, KeyError) as error:
        raise usage(f"{path}: {str(error).strip(chr(34))}; download it again") from error


def _of_manifest(text: bytes, source: str, read: Read) -> tuple[FirmwareBuild, ...]:
    try:
        manifest = msgspec.json.decode(text, type=Manifest)
    except msgspec.DecodeError as error:
        raise usage(f"{source}: its manifest is none of ESP Web Tools: {error}") from error
    return tuple(_of_build(each, source, read) for each in manifest.builds)


def _of_build(build: ManifestBuild, source: str, read: Read) -> FirmwareBuild:
    parts = tuple(FlashPart(PurePosixPath(each.path).name, each.offset, read(each.path)) for each in build.parts)
    firmware = next((part.content for part in parts if part.name == FIRMWARE), None)
    if firmware is None:
        raise usage(f"{source}: the build for {build.chip_family} lacks {FIRMWARE}")
    header = read_image_header(firmware, f"{source}: {FIRMWARE}")
    if header.chip != build.chip_family:
        raise usage(f"{source}: {FIRMWARE} for {build.chip_family} is for {header.chip}")
    return require_sound(FirmwareBuild(header, parts), source)
