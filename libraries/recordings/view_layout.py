"""The viewer's layout, as a black box keeps it: what was chosen of it; the rest follows from the robot's own files."""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

from gemelo.libraries.recordings.channels import Entry
from gemelo.schemas.system import NodeRecord

LAYOUT = "layout"  # the name of the metadata record
SECONDS = 20.0  # [s] of the past that plots and the tool's way show where nobody has chosen


class ViewLayout(msgspec.Struct, frozen=True, kw_only=True):
    """The visualizer's parameters, and the cameras that have a view each."""

    window: float = SECONDS  # [s] of the past that the plots show
    trail: float = SECONDS  # [s] of the tool's way that stays visible
    cameras: tuple[str, ...] = ()


def layout_of(entries: Iterable[Entry], cameras: tuple[str, ...]) -> ViewLayout:
    """As the visualizer among `entries` has it; the usual one where there is none."""
    said: dict[str, object] = {}
    for entry in entries:
        if isinstance(entry.message, NodeRecord) and entry.message.node == "visualizer":
            said = {each.name: each.value for each in entry.message.parameters}
    chosen: dict[str, object] = {name: said[name] for name in ("window", "trail") if name in said}
    return msgspec.convert(chosen | {"cameras": cameras}, ViewLayout)


def layout_metadata(layout: ViewLayout) -> dict[str, dict[str, str]]:
    """The record of a recording's metadata."""
    return {LAYOUT: {"json": msgspec.json.encode(layout).decode()}}
