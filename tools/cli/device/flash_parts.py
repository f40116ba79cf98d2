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
from gemelo.schemas.reasons import because
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
            raise usage(because("flash.kind", path=str(path), firmware=FIRMWARE, manifest=MANIFEST))
        return (build_of(folder),)
    except OSError as error:
        said = str(error.strerror or error)
        raise usage(because("flash.unread", path=str(error.filename or path), error=said)) from error


def require_there(path: Path) -> None:
    """Raises `CommandError` where there is no such file."""
    if not path.exists():
        raise usage(because("flash.none", path=str(path)))


def build_of(folder: Path) -> FirmwareBuild:
    """What PlatformIO has built in `folder`; raises `CommandError`."""
    missing = [name for name in (BOOTLOADER, TABLE, FIRMWARE) if not (folder / name).is_file()]
    if missing:
        raise usage(because("flash.missing", path=str(folder), files=tuple(missing)))
    firmware, table = (folder / FIRMWARE).read_bytes(), (folder / TABLE).read_bytes()
    header = read_image_header(firmware, str(folder / FIRMWARE))
    if header.chip not in BOOTLOADER_AT:
        chips = tuple(BOOTLOADER_AT)
        raise usage(because("flash.unknown_chip", path=str(folder / FIRMWARE), chip=header.chip, chips=chips))
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
        raise usage(because("flash.lacks", path=source, chip=build.chip, files=tuple(missing)))
    bootloader, firmware = by_name[BOOTLOADER], by_name[FIRMWARE]
    for part in (bootloader, firmware):
        require_whole(part.content, f"{source}: {part.name}")
    if build.header.project != PROJECT:
        raise usage(because("flash.foreign", path=source, file=FIRMWARE, project=build.header.project))
    its_chip = _IMAGE.unpack_from(bootloader.content)[2]
    if its_chip != build.header.chip_id:
        raise usage(
            because("flash.mixed", path=source, file=BOOTLOADER, number=its_chip, firmware=FIRMWARE, chip=build.chip)
        )
    partitions = read_table(by_name[TABLE].content, f"{source}: {TABLE}")
    slot = partition(partitions, _APP, _OTA_0, source)
    places = {
        BOOTLOADER: BOOTLOADER_AT.get(build.chip), TABLE: TABLE_AT, FIRMWARE: slot.offset,
        OTA_DATA: partition(partitions, _DATA, _OTA_DATA, source).offset,
    }  # fmt: skip
    for name, place in places.items():
        if by_name[name].offset != place:
            at = f"{by_name[name].offset:#x}"
            raise usage(because("flash.place", path=source, file=name, at=at, place=f"{place or 0:#x}"))
    if len(firmware.content) > slot.size:
        size = len(firmware.content)
        raise usage(because("flash.too_large", path=source, file=FIRMWARE, size=size, slot=slot.size))
    return build


def require_whole(image: bytes, what: str) -> None:
    """Raises `CommandError` unless the SHA-256 behind an image is that of its bytes."""
    if len(image) < _IMAGE.size or image[0] != MAGIC:
        raise usage(because("flash.no_image", path=what))
    _, segments, _, has_digest = _IMAGE.unpack_from(image)
    end = _IMAGE.size
    for _ in range(segments):
        if end + _SEGMENT.size > len(image):
            raise usage(because("flash.cut", path=what, size=len(image)))
        end += _SEGMENT.size + _SEGMENT.unpack_from(image, end)[1]
    end += 16 - end % 16  # the checksum is the last byte of a block of 16
    if has_digest and image[end : end + 32] != hashlib.sha256(image[:end]).digest():
        raise usage(because("flash.damaged", path=what))
    if len(image) < end:
        raise usage(because("flash.cut", path=what, size=len(image)))


def read_table(table: bytes, what: str) -> tuple[Partition, ...]:
    """The entries of a partition table; raises `CommandError`."""
    found = []
    for at in range(0, len(table) - _ENTRY.size + 1, _ENTRY.size):
        magic, kind, subtype, offset, size, label, _ = _ENTRY.unpack_from(table, at)
        if magic != _ENTRY_MAGIC:
            break
        found.append(Partition(label.split(b"\0", 1)[0].decode("ascii", "replace"), kind, subtype, offset, size))
    if not found:
        raise usage(because("flash.no_table", path=what))
    return tuple(found)


def partition(partitions: Sequence[Partition], kind: int, subtype: int, source: object) -> Partition:
    """That one of the table; raises `CommandError` where it has none."""
    for each in partitions:
        if (each.kind, each.subtype) == (kind, subtype):
            return each
    name = "ota_0" if kind == _APP else "otadata"
    raise usage(because("flash.no_partition", path=str(source), file=TABLE, name=name))


def build_for(builds: Sequence[FirmwareBuild], chip: str) -> FirmwareBuild:
    """That for the chip; raises `CommandError` with the chips that there is one for."""
    for build in builds:
        if build.chip == chip:
            return build
    raise CommandError(because("flash.other_chip", chip=chip, chips=tuple(build.chip for build in builds)))


def read_image_header(image: bytes, what: str) -> ImageHeader:
    """What an application says of itself; raises `CommandError`."""
    try:
        return read_header(image)
    except NoImage as error:
        raise usage(because("flash.header", error.reason, path=what)) from error


def _of_zip(path: Path, manifest: str) -> tuple[FirmwareBuild, ...]:
    require_there(path)
    try:
        with zipfile.ZipFile(path) as opened:
            if sum(each.file_size for each in opened.infolist()) > LARGEST_RELEASE:
                raise usage(because("flash.huge", path=str(path), most=LARGEST_RELEASE))
            names = [name for name in opened.namelist() if PurePosixPath(name).name == manifest]
            if not names:
                raise usage(because("flash.no_manifest", path=str(path), manifest=manifest))
            within = PurePosixPath(names[0]).parent
            return _of_manifest(opened.read(names[0]), str(path), lambda name: opened.read(str(within / name)))
    except (zipfile.BadZipFile, KeyError) as error:
        raise usage(because("flash.bad_zip", path=str(path), error=str(error).strip("'\""))) from error


def _of_manifest(text: bytes, source: str, read: Read) -> tuple[FirmwareBuild, ...]:
    try:
        manifest = msgspec.json.decode(text, type=Manifest)
    except msgspec.DecodeError as error:
        raise usage(because("flash.bad_manifest", path=source, error=str(error))) from error
    return tuple(_of_build(each, source, read) for each in manifest.builds)


def _of_build(build: ManifestBuild, source: str, read: Read) -> FirmwareBuild:
    parts = tuple(FlashPart(PurePosixPath(each.path).name, each.offset, read(each.path)) for each in build.parts)
    firmware = next((part.content for part in parts if part.name == FIRMWARE), None)
    if firmware is None:
        raise usage(because("flash.lacks", path=source, chip=build.chip_family, files=(FIRMWARE,)))
    header = read_image_header(firmware, f"{source}: {FIRMWARE}")
    if header.chip != build.chip_family:
        expected = build.chip_family
        raise usage(because("flash.wrong_chip", path=source, file=FIRMWARE, expected=expected, chip=header.chip))
    return require_sound(FirmwareBuild(header, parts), source)
