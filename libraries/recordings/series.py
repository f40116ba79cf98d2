"""The messages of one topic as columns: a number, word or truth each, by the path of its field."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import msgspec

from gemelo.libraries.recordings.reader import RecordingReader

LONGEST_LIST = 32  # elements that get columns of their own; a longer one is one cell of JSON
MAX_COLUMNS = 2000
STAMPS = ("log_time", "publish_time")  # [ns] UNIX: when it was recorded, and when it was said

Cell = str | int | float | bool | None


@dataclass
class Series:
    """Rows of one topic; a row has the cells that its message has."""

    topic: str
    message: str
    rows: list[dict[str, Cell]] = field(default_factory=list)
    columns: dict[str, None] = field(default_factory=lambda: dict.fromkeys(STAMPS))  # in the order of their first cell

    def add(self, log_time: int, publish_time: int, value: object) -> None:
        """One message, decoded."""
        row: dict[str, Cell] = {"log_time": log_time, "publish_time": publish_time}
        for path, cell in cells(value):
            if path in self.columns or len(self.columns) < MAX_COLUMNS:
                self.columns[path] = None
                row[path] = cell
        self.rows.append(row)


def series_of(reader: RecordingReader, topics: set[str]) -> dict[str, Series]:
    """The chosen topics that have a message, by their keys; what is derived for Foxglove is left out."""
    found: dict[str, Series] = {}
    for row in reader.rows(lambda topic: topic in topics):
        if not row.is_derived:
            series = found.setdefault(row.channel.topic, Series(row.channel.topic, row.schema.name))
            series.add(row.message.log_time, row.message.publish_time, msgspec.json.decode(row.message.data))
    return found


def cells(value: object, path: str = "") -> Iterator[tuple[str, Cell]]:
    """Every number, word and truth with the path of its field, as `position[0]`."""
    if isinstance(value, Mapping) and value:
        for name, item in value.items():
            yield from cells(item, f"{path}.{name}" if path else str(name))
    elif isinstance(value, list) and len(value) <= LONGEST_LIST:
        for index, item in enumerate(value):
            yield from cells(item, f"{path}[{index}]")
    elif isinstance(value, list | Mapping):
        yield path or "value", msgspec.json.encode(value).decode()
    elif value is None or isinstance(value, str | int | float | bool):
        yield path or "value", value
