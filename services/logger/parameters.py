"""What a person may change of the logger while it runs."""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta


class LoggerParameters(msgspec.Struct, frozen=True, kw_only=True):
    """Where to record, how large and how old a file may become, and how many are kept."""

    enable_logging: Annotated[bool, Meta(description="record at all")] = True
    log_dir: Annotated[str, Meta(description="folder of the recordings; empty: <paths.out>/recordings")] = ""
    max_file_mb: Annotated[float, Meta(description="[MB] a larger file is followed by a new one", gt=0)] = 256.0
    max_age_minutes: Annotated[float, Meta(description="[min] an older file is followed by a new one", gt=0)] = 60.0
    keep_files: Annotated[int, Meta(description="how many recordings are kept; 0: all", ge=0)] = 48
