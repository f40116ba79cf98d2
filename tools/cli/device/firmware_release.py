"""`python -m gemelo.tools.cli.device.firmware_release BUILDS RELEASE`: a release of what PlatformIO has built.

Of each folder of BUILDS, as firmware/.pio/build, its parts and its linker's map; the manifests of a browser flasher
(ESP Web Tools), one for boards with a serial chip and one for boards with the chip's own USB only; the sizes; and all
of it as one zip, which `gemelo device flash --image` takes.
"""

from __future__ import annotations

import shutil
import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path

import msgspec

from gemelo.schemas.reasons import because
from gemelo.tools.cli.common.errors import CommandError
from gemelo.tools.cli.device.flash_parts import (
    FIRMWARE,
    MANIFEST,
    PROJECT,
    USB_MANIFEST,
    FirmwareBuild,
    Manifest,
    ManifestBuild,
    ManifestPart,
    build_of,
)

USB = "-usb"  # how the environments of platformio.ini end whose serial wire is the chip's own USB
DEBUG = "-debug"  # these have a console in the place of the wire, and are for one's own table
SIZES = "sizes.txt"


def main(arguments: Sequence[str] | None = None) -> int:
    """Makes the folder RELEASE and prints its sizes; 1 where a build would not start, 2 without both folders."""
    words = sys.argv[1:] if arguments is None else list(arguments)
    if len(words) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    try:
        print(make_release(Path(words[0]), Path(words[1])))
    except CommandError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def make_release(builds: Path, release: Path) -> str:
    """Writes every build into `release`, with manifests and zip; returns the sizes. Raises `CommandError`."""
    folders = sorted(each.parent for each in builds.glob(f"*/{FIRMWARE}") if not each.parent.name.endswith(DEBUG))
    found = {folder.name: build_of(folder) for folder in folders}
    if not found:
        raise CommandError(because("flash.no_builds", path=str(builds), firmware=FIRMWARE))
    versions = {build.header.version for build in found.values()}
    if len(versions) > 1:
        raise CommandError(because("flash.versions", versions=tuple(sorted(versions))))
    version = versions.pop()
    release.mkdir(parents=True)
    for name, build in found.items():
        write_build(release / name, build)
        for linker_map in (builds / name).glob("*.map"):
            shutil.copy(linker_map, release / name / linker_map.name)
    for file, is_usb in ((MANIFEST, False), (USB_MANIFEST, True)):
        of_kind = {name: build for name, build in found.items() if name.endswith(USB) is is_usb}
        if of_kind:
            (release / file).write_bytes(msgspec.json.format(msgspec.json.encode(manifest_of(version, of_kind))))
    sizes = sizes_of(found)
    (release / SIZES).write_text(sizes)
    files = sorted(each for each in release.rglob("*") if each.is_file())
    with zipfile.ZipFile(release / f"gemelo-firmware-{version}.zip", "w", zipfile.ZIP_DEFLATED) as packed:
        for each in files:
            packed.write(each, each.relative_to(release))
    return sizes


def write_build(folder: Path, build: FirmwareBuild) -> None:
    """Its parts as files."""
    folder.mkdir()
    for part in build.parts:
        (folder / part.name).write_bytes(part.content)


def manifest_of(version: str, builds: dict[str, FirmwareBuild]) -> Manifest:
    """What a browser flasher reads: for each chip the parts, by their paths from the manifest."""
    return Manifest(
        name=PROJECT,
        version=version,
        builds=tuple(
            ManifestBuild(
                chip_family=build.chip,
                parts=tuple(ManifestPart(path=f"{name}/{part.name}", offset=part.offset) for part in build.parts),
            )
            for name, build in builds.items()
        ),
    )


def sizes_of(builds: dict[str, FirmwareBuild]) -> str:
    """A table of the parts' sizes [bytes]."""
    names = [part.name for part in next(iter(builds.values())).parts]
    rows = [["build", *names]]
    rows += [[name, *(str(len(part.content)) for part in build.parts)] for name, build in builds.items()]
    return "".join("  ".join(cell.rjust(15) for cell in row) + "\n" for row in rows)


if __name__ == "__main__":
    sys.exit(main())
