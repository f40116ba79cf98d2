"""`python -m gemelo.firmware.platform.host.image FILE [LIBRARY]`: an image for virtual devices, of a built core."""

from __future__ import annotations

import re
import sys
from pathlib import Path

from gemelo.firmware.bindings.library import LIBRARY
from gemelo.libraries.runtime.firmware_update import VIRTUAL_CHIP, ImageHeader, build_header

VERSION = re.compile(r'kFirmwareVersion = "([^"]+)"')
REPORT = Path(__file__).parents[2] / "core" / "report.h"


def virtual_image(library: bytes, version: str) -> bytes:
    """The image of a core's shared library."""
    return build_header(ImageHeader(VIRTUAL_CHIP, version, "gemelo")) + library


def source_version() -> str:
    """The version that the core's source says."""
    found = VERSION.search(REPORT.read_text())
    assert found is not None, REPORT
    return found[1]


def main() -> int:
    """Writes the image; 2 without a file's name."""
    if len(sys.argv) not in (2, 3):
        print(__doc__, file=sys.stderr)
        return 2
    library = Path(sys.argv[2]) if len(sys.argv) > 2 else LIBRARY
    Path(sys.argv[1]).write_bytes(virtual_image(library.read_bytes(), source_version()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
