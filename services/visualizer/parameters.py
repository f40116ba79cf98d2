"""What a person may choose of the view."""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta


class VisualizerParameters(msgspec.Struct, frozen=True, kw_only=True):
    """Read at the start; the viewer itself is chosen by the deployment."""

    recording_path: Annotated[str, Meta(description="also write a Rerun recording (.rrd) there; empty: none")] = ""
    window: Annotated[float, Meta(description="[s] of the past that the plots show", gt=0)] = 20.0
    trail: Annotated[float, Meta(description="[s] of the tool's way that stays visible", gt=0)] = 20.0
